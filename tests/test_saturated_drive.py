"""A drive that saturates is found where it acts: in few rows of one recording, at a knee far below the command."""

import numpy as np
import pytest

from cosim.diagnosis.evidence import Blocks
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.prepare import prepare
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.select import starts
from cosim.diagnosis.structure import Screening, nuisances, screen
from cosim.diagnosis.trial import Trial, is_real, tried
from cosim.recording import Recording
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


def saturated(knee: float, sizes: tuple[float, float]) -> tuple[Problem, Fit, Screening]:
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
    return problem, base, screen(base, prepared, Blocks.of(prepared), nuisances(base, prepared), weight)


def found(problem: Problem, base: Fit, screening: Screening) -> Trial:
    """The trial of the saturation that screening proposes."""
    (start,) = (effect for effect in starts(screening) if isinstance(effect, TorqueSaturation))
    return tried(problem, base, start, screening.bench)


@pytest.mark.parametrize("knee", [5.6, 7.0])
def test_a_knee_that_one_recording_alone_reaches_is_tried_and_is_real(knee: float) -> None:
    problem, base, screening = saturated(knee, (0.5, 1.2))
    trial = found(problem, base, screening)
    assert is_real(problem, trial)
    assert isinstance(trial.effect, TorqueSaturation)
    assert trial.effect.knee_torque == pytest.approx(knee, rel=0.03)
    assert trial.effect.slope == pytest.approx(SLOPE, rel=0.03)


def test_a_knee_is_found_far_below_the_command_that_it_swells() -> None:
    problem, base, screening = saturated(3.5, (1.0, 1.0))
    trial = found(problem, base, screening)
    assert 0.4 * np.quantile(np.abs(problem.prepared.stacked("tau")), 0.98) > 3.5
    assert isinstance(trial.effect, TorqueSaturation)
    assert trial.effect.knee_torque == pytest.approx(3.5, rel=0.03)


def test_a_column_is_untold_where_it_acts_in_one_fold_nearly_alone() -> None:
    t, q, _, _ = motion(1.0, 0.0)
    prepared = prepare([Recording(name, {"t": t, "tau": q, "q": q}) for name in "abc"], 20.0)
    blocks, first = Blocks.of(prepared), prepared.recording_of == 0
    everywhere, dust, nowhere = np.ones(len(first)), np.where(first, 1.0, 1e-3), np.zeros(len(first))
    told = blocks.untold(np.column_stack([everywhere, dust, nowhere]))
    np.testing.assert_array_equal(told, [[False, True, False], [False] * 3, [False] * 3])
    one = prepare([Recording("a", {"t": t[:2000], "tau": q[:2000], "q": q[:2000]})], 20.0)
    assert not Blocks.of(one).untold(np.ones((len(one.recording_of), 1))).any()
