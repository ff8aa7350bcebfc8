"""The simulated mount that both servers point."""

from collections.abc import Iterator
from datetime import UTC, datetime
from math import radians

import pytest

from cosim.models.cache import with_fmus
from cosim.system.scenario import read_scenario
from cosim_observatory.mount import Limits, SimulatedMount
from cosim_observatory.pointing import Pointing
from cosim_observatory.telescope import Telescope

QUICK = Limits(velocity=radians(10), acceleration=radians(10))
BEGUN = datetime(2026, 11, 21, 20, tzinfo=UTC)


@pytest.fixture(scope="module")
def mount() -> Iterator[Telescope]:
    """A telescope of the shipped mount that moves quickly, twenty times as fast as the clock."""
    with SimulatedMount(with_fmus(read_scenario("two_axis")), limits=QUICK, speed=20.0) as one:
        yield Telescope(Pointing(one, radians(9.0), BEGUN))
