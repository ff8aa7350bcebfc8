"""An effect stands if recordings that nothing was fitted to are predicted better with it, and it is no small change."""

from pathlib import Path

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.measure.protocol import of_the_best
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from cosim_studies.proof.generator import make_case, write_case
from cosim_studies.proof.tool import given
from pyfmi_models.effects import FrictionAsymmetry, TorqueOffset
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

Array = np.ndarray
SECONDS, RATE = 60, 200
NOISE = 0.1


def axis(*effects: object) -> Mount:
    return Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0), effects=effects)


def held_out(missing: Array, v: Array) -> Recording:
    """A recording at speed `v` whose torque has something that the base lacks."""
    t = np.arange(SECONDS * RATE) / RATE
    acceleration = np.gradient(v, t)
    tau = 5 * acceleration + 2 * np.sign(v) + v + missing
    return Recording("held-out", {"t": t, "tau": tau, "q": np.cumsum(v) / RATE})


def white(seed: int) -> Array:
    return NOISE * np.random.default_rng(seed).standard_normal(SECONDS * RATE)


def predicted(recording: Recording, effect: object) -> float:
    """Nats by which an effect predicts a held-out recording better than the base."""
    noise = held_out(white(99), np.sin(np.arange(SECONDS * RATE) / RATE))
    prepared = prepare([noise], 30.0)
    problem = Problem(axis(), prepared, np.ones(len(prepared.recording_of)), 1 / RATE)
    base = problem.fit(axis(), 10)
    held = Predictive.of(
        Comparison.of(problem, base, POLICY), prepare([recording], 30.0), base, prepare([recording], 30.0)
    )
    with_it, without = (held.likelihood_of(mount) for mount in (axis(effect), axis()))
    return with_it - without


@pytest.mark.parametrize("seed", range(3))
def test_a_small_offset_that_is_there_predicts_and_its_opposite_does_not(seed: int) -> None:
    offset, v = 0.2 * NOISE, np.sin(np.arange(SECONDS * RATE) / RATE)
    recording = held_out(white(seed) + offset, v)
    assert predicted(recording, TorqueOffset(torque=offset)) > POLICY.fair
    assert predicted(recording, TorqueOffset(torque=-offset)) < 0


def test_the_gain_of_a_constant_is_what_its_energy_is_worth_in_its_band() -> None:
    v = np.sin(np.arange(SECONDS * RATE) / RATE)
    one, double = (predicted(held_out(white(7) + k * NOISE, v), TorqueOffset(torque=k * NOISE)) for k in (0.3, 0.6))
    assert 1.5 < double / one < 4


def test_what_acts_in_one_second_of_a_minute_predicts() -> None:
    t = np.arange(SECONDS * RATE) / RATE
    v = 1 + 2 * np.exp(-(((t - 30.5) / 0.15) ** 2)) + 0.1 * np.sin(t)
    recording = held_out(white(2) + 0.3 * v**2, v)
    assert predicted(recording, QuadraticDrag(coefficient=0.3)) > POLICY.fair


def test_what_training_leaves_open_of_an_effect_is_not_held_against_it() -> None:
    """Near one speed each way an asymmetry of the level and one of the viscous friction are much the same."""
    t = np.arange(SECONDS * RATE) / RATE
    steady, swinging = np.tanh(20 * np.sin(t)) * (1 + 0.2 * np.sin(0.37 * t)), np.sin(t) * (1.5 + np.sin(0.3 * t))
    trained = held_out(white(1) + 0.1 * np.abs(steady), steady)
    prepared, there = (prepare([one], 30.0) for one in (trained, held_out(white(2) + 0.1 * np.abs(swinging), swinging)))
    problem = Problem(axis(), prepared, np.ones(len(prepared.recording_of)), 1 / RATE)
    base, found = (problem.fit(axis(*effects), 15) for effects in ((), (FrictionAsymmetry(level_asymmetry=0.03),)))
    held = Predictive.of(Comparison.of(problem, base, POLICY), there, base, there)
    assert held.predicted(found) > held.likelihood_of(found.mount) + POLICY.fair
    assert held.predicted(found) > held.predicted(base) + POLICY.fair
    assert held.predicted(base) == held.likelihood_of(base.mount)


@pytest.mark.parametrize("factor", [0.8, 1.2])
def test_an_offset_is_told_beside_friction_and_load_of_another_day(factor: float) -> None:
    """Every number of the base is off by a fifth, twenty times the offset: that alone decides nothing."""
    offset, v = 0.2 * NOISE, np.sin(np.arange(SECONDS * RATE) / RATE)
    base = 5 * np.gradient(v, 1 / RATE) + 2 * np.sign(v) + v
    recording = held_out(white(5) + offset + (factor - 1) * base, v)
    assert predicted(recording, TorqueOffset(torque=offset)) > 10 * POLICY.fair
    assert predicted(recording, TorqueOffset(torque=-offset)) < 0


def test_what_raises_the_held_out_error_does_not_predict() -> None:
    v = np.sin(np.arange(SECONDS * RATE) / RATE)
    assert predicted(held_out(white(3), v), TorqueOffset(torque=0.05)) < 0


def test_a_diagnosis_never_ends_with_a_model_that_is_worse_than_the_base(tmp_path: Path) -> None:
    """A dwell that had a warm-up beside it was left alone when that was taken out, and misled."""
    write_case(make_case(1755486916, ("thermal_viscosity",)), tmp_path)
    card, train, held = given(str(tmp_path))
    found = diagnose(train, [held], card).diagnosis
    assert found.heldout.after_rms <= found.heldout.before_rms
    assert "dwell_breakaway" not in found.verdict


def test_the_range_of_the_best_of_some_is_wider_and_of_one_the_same() -> None:
    assert of_the_best((1.0, 4.0), 2.0, 1) == pytest.approx((1.0, 4.0))
    low, high = of_the_best((1.0, 4.0), 2.0, 4)
    assert (low, high) == pytest.approx((2 - 1.2744, 2 + 2 * 1.2744), rel=1e-4)  # 2.4977 and 1.9600 of a normal
    assert of_the_best((0.0, 0.0), 0.0, 8) == (0.0, 0.0)
