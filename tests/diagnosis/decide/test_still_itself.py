"""What stands on held-out recordings is still what its name says when all that stands was fitted anew."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.decision import Gain
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects.tuning import ANY
from cosim.diagnosis.search.proof import _validation
from cosim.diagnosis.search.rivals import AcceptedEffect
from pyfmi_models.effects import Cogging, Effect
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

SURE = Gain(100.0, 0.9, 0.9)


def spring(damping: float) -> Compliance:
    return Compliance(antiresonance_hz=5.0, resonance_hz=6.0, damping_ratio=damping)


def left(size: float, *effects: Effect) -> Any:
    mount = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=1.0), effects=effects)
    return SimpleNamespace(mount=mount, residual=np.full(4, size))


def accepted(*effects: Effect) -> AcceptedEffect:
    own: Any = SimpleNamespace(fit=left(0.1, *effects), effect=effects[0], evidence=200.0, plain_gain=0.9)
    return AcceptedEffect(effects, own, left(1.0), (), {}, {})


@pytest.mark.parametrize(("damping", "stands"), [(0.1, True), (0.3, False)])
def test_a_spring_that_is_refitted_to_spring_no_more_falls(
    damping: float, stands: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosim.diagnosis.search.admissibility.recorded_by", lambda _: ANY)
    prepared = SimpleNamespace(pieces=())
    problem = SimpleNamespace(weight=np.ones(4), mount=left(1.0).mount, prepared=prepared)
    one = accepted(spring(0.1))
    comparison: Any = SimpleNamespace(problem=problem, policy=POLICY)
    examined: Any = SimpleNamespace(effects=(one,), base=left(1.0))
    assert all_pass(_validation(comparison, examined, left(0.1, spring(damping)), one, SURE)) is stands


def test_of_a_ripple_the_strongest_wave_is_looked_at_and_none_of_the_cards_own() -> None:
    waves = [Cogging(cycles_per_rev=10.0 * k, amplitude=a) for k, a in ((1, 9.0), (2, 0.1), (3, 0.4))]
    assert accepted(*waves[1:]).within(left(0.0, *waves).mount) is waves[2]
