"""A drive that saturates is found where it acts: in few rows of one recording, at a knee far below the command."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.stages import CandidateFit, admission, refitted, starts
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

Array = np.ndarray
SLOPE = 0.4


def motion(size: float, phase: float) -> tuple[Array, Array, Array, Array]:
    """Time, position, speed and acceleration of 20 s at 500 Hz."""
    t = np.arange(10_000) / 500
    tones = [(0.5, 0.11, phase), (0.1, 0.37, 1.0 + phase), (0.02, 0.9, 2.0)]
    waves = [(size * a, 2 * np.pi * f, 2 * np.pi * f * t + p) for a, f, p in tones]
    q = sum(a * np.sin(x) for a, _, x in waves)
    v = sum(a * w * np.cos(x) for a, w, x in waves)
    return t, q, v, sum(-a * w**2 * np.sin(x) for a, w, x in waves)


def saturated(knee: float, sizes: tuple[float, float]) -> tuple[Comparison, Fit]:
    """Two motions of different size by a drive that gives `SLOPE` of what is asked for past a knee (N m)."""
    recordings, rng = [], np.random.default_rng(1)
    for phase, size in enumerate(sizes):
        t, q, v, a = motion(size, 2.0 * phase)
        need = 5 * a + 2 * np.sign(v) + v
        past = np.maximum(np.abs(need) - knee, 0)
        command = np.sign(need) * (np.abs(need) + past * (1 / SLOPE - 1))
        noise = 0.005 * rng.standard_normal(len(t))
        recordings.append(Recording(f"run_{phase}", {"t": t, "tau": command + noise, "q": q}))
    mount = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))
    prepared = prepare(recordings, 20.0)
    weight = (np.abs(prepared.stacked("v")) > 0.02).astype(float)
    problem = Problem(mount, prepared, weight, 0.002)
    base = problem.fit(mount, 25)
    return Comparison.of(problem, base, POLICY), base


def found(comparison: Comparison, base: Fit) -> CandidateFit:
    """The refitted structure with the saturation that screening proposes."""
    worth = starts(comparison.screen(base), POLICY)
    fits = [refitted(comparison, base, one, many) for one, many in worth if isinstance(one, TorqueSaturation)]
    return max(fits, key=lambda one: one.evidence)


@pytest.mark.parametrize("knee", [5.6, 7.0])
def test_a_knee_that_one_recording_alone_reaches_is_tried_and_is_real(knee: float) -> None:
    comparison, base = saturated(knee, (0.5, 1.2))
    one = found(comparison, base)
    assert all_pass(admission(comparison, one))
    assert one.evidence > POLICY.clear
    assert isinstance(one.effect, TorqueSaturation)
    assert one.effect.knee_torque == pytest.approx(knee, rel=0.03)
    assert one.effect.slope == pytest.approx(SLOPE, rel=0.03)


def test_a_knee_is_found_far_below_the_command_that_it_swells() -> None:
    comparison, base = saturated(3.5, (1.0, 1.0))
    one = found(comparison, base)
    assert 0.4 * np.quantile(np.abs(comparison.problem.prepared.stacked("tau")), 0.98) > 3.5
    assert isinstance(one.effect, TorqueSaturation)
    assert one.effect.knee_torque == pytest.approx(3.5, rel=0.03)
