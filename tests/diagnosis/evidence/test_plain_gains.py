"""The plain held-out error of a real model in both bands: what errs in one of them alone does not stand."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from problems import compared, problem_of
from wandering import axis, recorded

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.decision import Gain, held_out_rules
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence import predictive
from cosim.diagnosis.evidence.predictive import Predictive, _beyond, reading_noise
from cosim.estimation.prepare import prepare
from cosim.estimation.residuals import residuals
from pyfmi_models.effects import Cogging, Effect, TorqueOffset
from pyfmi_models.friction import Frictionless

SECONDS, RATE, NOISE = 40, 200, 0.1
NARROW, WIDE = 10.0, 30.0
CYCLES = 16.0 / 2 * 2 * np.pi
"""Of a ripple at 12 to 20 Hz where the axis turns at 2 rad/s: above the one band and below the other."""
FAST, SLOW = 0.08, 0.03


def ripple(amplitude: float) -> Cogging:
    return Cogging(cycles_per_rev=CYCLES, amplitude=abs(amplitude), phase=0.0 if amplitude > 0 else np.pi)


def offset(torque: float) -> TorqueOffset:
    return TorqueOffset(torque=torque)


def turning(seed: int, fast: float, slow: float, hum: float = 0.0) -> Recording:
    """Steady turning with a ripple and an offset of these sizes; a hum at 20 Hz is in no model."""
    t = np.arange(SECONDS * RATE) / RATE
    q, v, a = 2 * t - np.cos(0.5 * t), 2 + 0.5 * np.sin(0.5 * t), 0.25 * np.cos(0.5 * t)
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(t))
    extra = fast * np.cos(CYCLES * q) + slow + hum * np.sin(2 * np.pi * 20 * t)
    return recorded(5 * a + 2 + v + extra + noise, t, q)


@cache
def held(fast: float, slow: float, hum: float = 0.0, band: float = NARROW) -> Predictive:
    """A recording with these in it, held out from a base that knows of none."""
    comparison, base = compared(problem_of(axis(), turning(1, 0.0, 0.0), cutoff=band, slow=0.0), 10)
    runs = [turning(2, fast, slow, hum)]
    return Predictive.of(comparison, prepare(runs, band), base, prepare(runs, WIDE))


def gains(this: Predictive, *effects: Effect) -> tuple[float, float]:
    return this.plain_gains(axis(), axis(effects=effects))


def is_vetoed(narrow: float, wide: float) -> bool:
    """Whether an effect that surely matters and predicts falls by these."""
    return not all_pass(held_out_rules(Gain(2 * POLICY.clear, narrow, wide), POLICY))


def test_what_is_there_removes_error_in_its_own_band_and_raises_none() -> None:
    narrow, wide = gains(held(FAST, 0.0), ripple(FAST))
    assert abs(narrow) < 0.02 < 0.3 < wide
    assert not is_vetoed(narrow, wide)


@pytest.mark.parametrize("times", [1.0, 5.0])
def test_what_errs_above_the_band_of_the_analysis_alone_is_seen_in_the_wider_one(times: float) -> None:
    """Five times as large, most of the error lies above the narrow band: there it is no noise but an amplified one."""
    narrow, wide = gains(held(0.0, 0.0), ripple(times * FAST))
    assert abs(narrow) < 0.1 * abs(wide)
    assert wide < -0.5 * times**2
    assert is_vetoed(narrow, wide)


def test_what_errs_below_is_seen_in_the_narrow_band_though_the_wider_one_is_better() -> None:
    narrow, wide = gains(held(FAST, 0.0), ripple(FAST), offset(SLOW))
    assert narrow < -0.3
    assert wide > 0.1
    assert is_vetoed(narrow, wide)
    assert not is_vetoed(*gains(held(FAST, SLOW), ripple(FAST), offset(SLOW)))


def test_where_the_wider_band_is_mostly_noise_that_a_model_does_not_amplify_the_narrow_one_counts_twice() -> None:
    this = held(0.0, SLOW, hum=0.3)
    narrow, wide = gains(this, offset(SLOW))
    assert narrow == wide > 0.3
    assert not is_vetoed(narrow, wide)
    assert is_vetoed(*gains(this, offset(-SLOW)))


def test_the_wider_band_comes_last_though_it_be_that_of_the_analysis() -> None:
    cycles = 2 * np.pi * 45 / 2
    false = Cogging(cycles_per_rev=cycles, amplitude=2 * FAST, phase=0.0)
    narrow, wide = gains(held(0.0, 0.0, band=60.0), false)
    assert wide < -0.5 < narrow
    assert is_vetoed(narrow, wide)


@pytest.mark.parametrize(("name", "size"), [("q", 1e-4), ("v", 2e-3)])
@pytest.mark.parametrize("band", [NARROW, WIDE])
def test_the_noise_of_a_reading_makes_the_torque_that_is_predicted(name: str, size: float, band: float) -> None:
    """The residual with noise in the reading less that without; the noise itself is estimated from differences.

    That estimate is 6 % low here, its energy 12 %; a spectrum of one side, half of it, would be seen.
    """
    t = np.arange(200 * RATE) / RATE
    v, true = 0.5 * np.cos(t), {"q": 0.5 * np.sin(t), "v": 0.5 * np.cos(t)}[name]
    table = {"t": t, "tau": -2.5 * np.sin(t) + 2 * np.sign(v) + v}
    noise = size * np.random.default_rng(4).standard_normal(len(t))
    clean, noisy = (prepare([Recording("run", table | {name: true + one})], band) for one in (0 * noise, noise))
    frictionless = replace(axis(), friction=Frictionless())
    made = [residuals(one, frictionless)[0][one.pieces[0].kept] for one in (clean, noisy)]
    assert reading_noise(noisy, frictionless) == pytest.approx(float(np.mean((made[1] - made[0]) ** 2)), rel=0.15)


@pytest.mark.parametrize(
    ("energy", "noise", "left"), [(1.0, 0.0, 1.0), (1.0, 0.3, 0.7), (1.0, 0.95, 0.1), (2.0, 5.0, 0.2)]
)
def test_noise_takes_at_most_nine_tenths_of_an_error(energy: float, noise: float, left: float) -> None:
    assert _beyond(energy, noise) == pytest.approx(left)


def stand_in(weight: np.ndarray, narrow: tuple[float, float], wide: tuple[float, float]) -> tuple[Any, Any, Any]:
    """A recording in which two mounts, which come second and third, leave these energies in both bands."""
    mounts = axis(), axis(effects=(offset(1.0),))
    size, energy = dict(zip(mounts, narrow, strict=True)), dict(zip(mounts, wide, strict=True))
    this: Any = SimpleNamespace(weight=weight, halved=0.5)
    this.prepared, this.protocol = SimpleNamespace(cutoff=NARROW), SimpleNamespace(cutoff=WIDE)
    this.residual, this._protocol_energy = (lambda one: np.full(4, size[one] ** 0.5)), energy.__getitem__
    return this, *mounts


@pytest.mark.parametrize(
    ("narrow", "wide", "both"),
    [
        ((1.0, 0.6), (100.0, 199.0), (0.4, 0.4)),  # noise: the narrow band counts twice
        ((1.0, 0.6), (100.0, 201.0), (0.4, -1.01)),  # amplified
        ((1.0, 0.49), (100.0, 201.0), (0.51, 0.51)),  # amplified, and half of what is no noise is removed
        ((1.0, 0.51), (100.0, 201.0), (0.49, -1.01)),
        ((1.0, 0.6), (8.9, 5.0), (0.4, 1 - 5.0 / 8.9)),  # no noise
    ],
)
def test_a_model_may_amplify_noise_twofold_or_must_halve_the_error(
    narrow: tuple[float, float], wide: tuple[float, float], both: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(predictive, "reading_noise", lambda *_: 0.0)
    this, before, after = stand_in(np.ones(4), narrow, wide)
    assert Predictive.plain_gains(this, before, after) == pytest.approx(both)


def test_noise_counts_by_the_share_of_the_rows_that_are_weighed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows without weight have no error in the narrow band, and so no noise either."""
    monkeypatch.setattr(predictive, "reading_noise", lambda *_: 0.8)
    this, before, after = stand_in(np.array([1.0, 1.0, 0.0, 0.0]), (1.0, 0.98**2), (1.5, 1.4))
    narrow, wide = Predictive.plain_gains(this, before, after)
    assert narrow == pytest.approx(1 - (0.5 * 0.98**2 - 0.5 * 0.8) / (0.5 - 0.5 * 0.8))
    assert wide == pytest.approx(1 - (1.4 - 0.8) / (1.5 - 0.8))


def test_what_a_model_removes_in_clear_motion_is_not_hidden_by_what_it_raises_at_rest() -> None:
    t = np.arange(SECONDS * RATE) / RATE
    v = np.where(t % 4 < 2, np.sin(np.pi * t) ** 2, 0.0)  # moves and rests in turn
    clear = v > 0.02 * v.max()
    left = {"base": np.ones(len(t)), "other": np.where(clear, 0.5, 3.0)}
    prepared = SimpleNamespace(stacked=lambda _: v)
    this: Any = SimpleNamespace(prepared=prepared, residual=lambda mount: left[mount])
    assert Predictive.in_motion(this, "base", "other") == pytest.approx(0.75)  # type: ignore[arg-type]
    assert np.mean(left["other"] ** 2) > 1
