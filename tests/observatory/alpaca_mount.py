"""A simulated mount behind its server, and ASCOM's own client of it."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from math import radians

from cosim.models.cache import with_fmus
from cosim.system.scenario import read_scenario
from cosim_observatory.mount import Limits, SimulatedMount
from cosim_observatory.pointing import Pointing
from cosim_observatory.telescope import Telescope

ARCSEC = 1 / 3600
QUICK = Limits(velocity=radians(10), acceleration=radians(10))
BEGUN = datetime(2026, 11, 21, 20, tzinfo=UTC)


@contextmanager
def simulated() -> Iterator[Telescope]:
    """A telescope of the shipped mount that moves quickly, twenty times as fast as the clock."""
    with SimulatedMount(with_fmus(read_scenario("two_axis")), limits=QUICK, speed=20.0) as mount:
        yield Telescope(Pointing(mount, radians(9.0), BEGUN))
