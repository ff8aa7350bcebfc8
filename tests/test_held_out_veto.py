"""An effect is proven on the held-out recording if it helps there by a share that counts, or by more than chance."""

from pathlib import Path

import numpy as np
import pytest

from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.protocol import is_misleading, is_proven
from cosim.proof.generator import make_case, write_case
from cosim.proof.tool import given
from cosim.recording import Recording
from pyfmi_models.effects import TorqueOffset
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


def wander(seed: int) -> Array:
    """A level that is another each second, of mean zero."""
    level = np.random.default_rng(seed).standard_normal(SECONDS)
    return np.repeat(NOISE * (level - level.mean()) / level.std(), RATE)


@pytest.mark.parametrize("seed", range(3))
def test_a_small_gain_is_proven_if_every_second_shows_it(seed: int) -> None:
    steady = np.ones(SECONDS * RATE)
    offset = 0.05 * NOISE
    assert is_proven([held_out(white(seed) + offset, steady)], axis(), axis(TorqueOffset(torque=offset)), 30.0)


@pytest.mark.parametrize(("share", "proven"), [(0.01, False), (0.1, True)])
def test_the_same_gain_in_a_wandering_torque_is_chance_unless_its_share_counts(share: float, proven: bool) -> None:
    offset = NOISE * np.sqrt(share)
    recording = held_out(wander(1) + offset, np.ones(SECONDS * RATE))
    assert is_proven([recording], axis(), axis(TorqueOffset(torque=offset)), 30.0) == proven


def test_what_acts_in_one_second_of_a_minute_is_proven_by_its_share() -> None:
    t = np.arange(SECONDS * RATE) / RATE
    v = 1 + 2 * np.exp(-(((t - 30.5) / 0.15) ** 2))
    recording = held_out(white(2) + 0.1 * v**2, v)
    assert is_proven([recording], axis(), axis(QuadraticDrag(coefficient=0.1)), 30.0)


def test_what_raises_the_held_out_error_is_not_proven() -> None:
    recording = held_out(white(3), np.ones(SECONDS * RATE))
    assert not is_proven([recording], axis(), axis(TorqueOffset(torque=0.02)), 30.0)


@pytest.mark.parametrize(("held", "misleading"), [(0.3, False), (0.05, True), (-0.3, True)])
def test_what_is_worse_than_the_base_as_a_whole_misleads(held: float, misleading: bool) -> None:
    recording = held_out(white(4) + held, np.ones(SECONDS * RATE))
    assert is_misleading([recording], axis(), axis(TorqueOffset(torque=0.3)), 10.0) == misleading


def test_the_base_does_not_mislead() -> None:
    assert not is_misleading([held_out(white(5), np.ones(SECONDS * RATE))], axis(), axis(), 30.0)


def test_a_diagnosis_never_ends_with_a_model_that_is_worse_than_the_base(tmp_path: Path) -> None:
    """A dwell that had a warm-up beside it was left alone when that was taken out, and misled."""
    write_case(make_case(1755486916, ("thermal_viscosity",)), tmp_path)
    card, train, held = given(str(tmp_path))
    found = diagnose(train, [held], card).diagnosis
    assert found.heldout.after_rms <= found.heldout.before_rms
    assert "dwell_breakaway" not in found.verdict
    assert {one.answer for one in found.findings if one.effect == "dwell_breakaway"} == {"not_proven"}
