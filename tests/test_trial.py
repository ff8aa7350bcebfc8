"""One effect beside a fitted base: what is tried of it, in which shape it is fitted, and from which size it is real."""

import numpy as np
import pytest

from cosim.diagnosis.evidence import Blocks
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.prepare import prepare
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.select import others, starts
from cosim.diagnosis.structure import Screening, nuisances, screen
from cosim.diagnosis.trial import is_real, tried
from cosim.recording import Recording
from pyfmi_models.effects import Cogging, LocalFriction, PeriodicFriction, StribeckEffect, TorqueOffset
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

LEVEL = 2.0


def screened(extra: object) -> tuple[Problem, Fit, Screening]:
    """An axis with dry friction that nobody doubts and `extra(q, v)`, recorded twice; its base, and its candidates."""
    t = np.arange(10_000) / 500
    recordings, rng = [], np.random.default_rng(1)
    for run in (0.0, 2.0):
        tones = [(0.5, 0.11, run), (0.1, 0.37, 1.0 + run), (0.02, 0.9, 2.0)]
        q = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
        v = sum(a * 2 * np.pi * f * np.cos(2 * np.pi * f * t + p) for a, f, p in tones)
        acceleration = sum(-a * (2 * np.pi * f) ** 2 * np.sin(2 * np.pi * f * t + p) for a, f, p in tones)
        noise = 0.002 * rng.standard_normal(len(t))
        tau = 5 * acceleration + LEVEL * np.sign(v) + v + extra(q, v) + noise  # type: ignore[operator]
        recordings.append(Recording(f"run_{run}", {"t": t, "tau": tau, "q": q}))
    mount = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=LEVEL, sigma2=1.0))
    prepared = prepare(recordings, 20.0)
    weight = (np.abs(prepared.stacked("v")) > 0.02).astype(float)
    problem = Problem(mount, prepared, weight, t[1])
    base = problem.fit(mount, 25)
    return problem, base, screen(base, prepared, Blocks.of(prepared), nuisances(base, prepared), weight)


@pytest.mark.parametrize("delta", [1.0, 2.0])
def test_a_stribeck_curve_has_the_exponent_of_the_recorded_friction(delta: float) -> None:
    problem, base, screening = screened(lambda _, v: 1.6 * np.exp(-((np.abs(v) / 0.08) ** delta)) * np.sign(v))
    found = tried(problem, base, StribeckEffect(Fs=3.0, Vs=0.05), screening.bench).effect
    assert isinstance(found, StribeckEffect)
    assert found.delta == pytest.approx(delta, abs=0.15)
    assert found.Vs == pytest.approx(0.08, rel=0.15)


def test_one_rough_spot_is_tried_where_a_wave_imitates_it_better_than_a_first_guess_of_the_spot() -> None:
    _, _, screening = screened(lambda q, v: 1.5 * np.exp(-(((q - 0.1) / 0.04) ** 2) / 2) * np.sign(v))
    assert {LocalFriction, PeriodicFriction} <= {type(candidate.instances[0]) for candidate, _, _ in screening.best}
    assert LocalFriction in {type(effect) for effect in starts(screening)}


def test_what_no_recording_foretells_of_the_other_is_looked_at_before_the_rest_is_unknown() -> None:
    levels = iter((0.2, 1.0))
    problem, base, screening = screened(lambda q, _: next(levels) + 0 * q)
    offset = next(score.gain for candidate, score, _ in screening.best if candidate.effect == "torque_offset")
    assert offset < 0
    assert TorqueOffset not in {type(effect) for effect in starts(screening)}
    assert TorqueOffset in {type(effect) for effect in others(screening, base, [])}
    known = tried(problem, base, TorqueOffset(torque=0.6), screening.bench)
    assert TorqueOffset not in {type(effect) for effect in others(screening, base, [known])}


@pytest.mark.parametrize(("share", "real"), [(0.01, False), (0.1, True)])
def test_an_effect_that_is_smaller_than_friction_wanders_is_none(share: float, real: bool) -> None:
    amplitude = share * LEVEL * np.sqrt(2)
    problem, base, screening = screened(lambda q, _: amplitude * np.sin(40 * q))
    trial = tried(problem, base, Cogging(cycles_per_rev=40.0, amplitude=amplitude), screening.bench)
    assert trial.gain > 0.2
    assert trial.size == pytest.approx(share, rel=0.2)
    assert is_real(problem, trial) == real
