"""What one piece of evidence about a recording may say, and no more."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.sanity.balance import Balance
from cosim.diagnosis.sanity.explanations import RIGHT
from cosim.diagnosis.sanity.judgement import Judgement
from cosim.diagnosis.sanity.likelihood import Reference


def waving(share: float, order: float = 0.5) -> Recording:
    """Twelve turns of 1 kg m2 and 4 N m with a wave over the position, `share` of the friction, and noise."""
    t = np.arange(0, 40, 0.01)
    q = 37 * np.sin(0.35 * t) + 0.8 * np.sin(1.9 * t)
    v, a = (np.gradient(np.gradient(q, t) if k else q, t) for k in (0, 1))
    noise = 0.02 * np.random.default_rng(0).standard_normal(len(t))
    tau = a + 4 * np.tanh(v / 0.01) + 0.1 * v + 4 * share * np.sin(order * q) + noise
    return Recording("run", {"t": t, "q": q, "tau": tau})


@pytest.mark.parametrize(("share", "least", "most"), [(0.0, -1.0, 0.1), (0.04, 0.1, 0.3), (0.5, 5.9, 6.0)])
def test_only_a_wave_beyond_what_physics_may_leave_is_gravity_of_another_order(
    share: float, least: float, most: float
) -> None:
    evidence = Judgement.of([waving(share)], Reference(1.0, 4.0)).evidence
    assert least <= evidence._gravity(evidence.balance(1.0), 0.5) <= most


def test_the_sign_of_the_torque_tells_of_the_sign_alone() -> None:
    """Both signs together are no less likely than either, and none is gained by a balance that is surer of it."""
    evidence = Judgement.of([waving(0.0)], Reference(1.0, 4.0)).evidence
    sure = evidence.of(RIGHT)
    for sign in (3.0, 12.0):
        with pytest.MonkeyPatch.context() as patch:
            solution = replace(evidence.balance(1.0).solution(1.0), sign=sign)
            patch.setattr(Balance, "solution", lambda _, order, one=solution: one)
            assert evidence.of(RIGHT) == pytest.approx(sure, abs=0.05)
            flipped = evidence.of(replace(RIGHT, torque=-1.0))
            assert flipped < evidence.of(RIGHT) - sign + 0.1
