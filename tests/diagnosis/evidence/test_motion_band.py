"""The motion that goes into the models is read in the band in which friction is neither smeared nor made to creep."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from problems import compared, problem_of
from wandering import axis, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.decision import Gain, held_out_rules
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem, diagnose
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.effects.encoder_eccentricity import Eccentricity
from cosim.diagnosis.effects.periodogram import peaks
from cosim.diagnosis.evidence import predictive
from cosim.diagnosis.evidence.band import NOISE_LIMIT, in_band, predicted
from cosim.diagnosis.evidence.predictive import Predictive, reading_noise
from cosim.estimation.prepare import Band, choose_cutoff, prepare
from cosim.estimation.residuals import residuals
from pyfmi_models.card import Card, parse_card
from pyfmi_models.effects import Cogging, Effect, TorqueOffset
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.friction import Frictionless

KHZ, FINE = 1000, 20
INERTIA, STIFFNESS, DAMPING, VISCOUS, LEVEL, REST, SPEED = 30.0, 9e4, 500.0, 25.0, 2.0, 3.5, 0.05


def card(friction: str) -> Card:
    return parse_card(f'[mount]\nname = "m"\ninertia = {INERTIA}\n[friction]\n{friction}', "a.toml")


LUGRE = card(
    f'model = "lugre"\nsigma0 = {STIFFNESS}\nsigma1 = {DAMPING}\nsigma2 = {VISCOUS}\n'
    f"Fc = {LEVEL}\nFs = {REST}\nVs = {SPEED}\n"
)


def bristled(seed: int, noise: float = 3e-7) -> Recording:
    """Quick turns of an axis with stiff bristles, whose equations are integrated here anew, read with some noise."""
    draw, h = np.random.default_rng(seed), 1 / (KHZ * FINE)
    t = np.arange(20 * KHZ * FINE) * h
    q, v, a = swing(t, [(a, f, seed) for a, f in ((0.02, 0.3), (0.005, 1.1), (0.0008, 4.0))])
    held, z = (LEVEL + (REST - LEVEL) * np.exp(-((v / SPEED) ** 2))) / STIFFNESS, np.zeros(len(t))
    for k in range(1, len(t)):  # implicit in the bristle, so no step is too long
        z[k] = (z[k - 1] + h * v[k]) / (1 + h * abs(v[k]) / held[k])
    torque = INERTIA * a + STIFFNESS * z + DAMPING * (v - np.abs(v) * z / held) + VISCOUS * v
    rows = slice(None, None, FINE)
    return recorded(torque[rows], t[rows], q[rows] + noise * draw.standard_normal(len(t[rows])), f"run{seed}")


RUNS = [bristled(1), bristled(2)]


def test_a_base_whose_motion_is_not_smeared_has_the_numbers_of_the_machine() -> None:
    problem, cutoff = _problem(RUNS, LUGRE), choose_cutoff(RUNS, INERTIA)
    assert problem.prepared.band.motion >= 1.4 * cutoff == pytest.approx(1.4 * problem.prepared.cutoff)
    base = problem.fit(LUGRE.plant(), 50)
    prepared = prepare(RUNS, cutoff)
    narrow = replace(problem, prepared=prepared, weight=np.ones(len(prepared.recording_of)))
    smeared = narrow.fit(LUGRE.plant(), 50)
    assert problem.error(base) < 0.5 * narrow.error(smeared)
    assert base.parameters()["friction.Fc"] == pytest.approx(LEVEL, rel=0.05)
    assert base.parameters()["friction.sigma1"] == pytest.approx(DAMPING, rel=0.1)


def test_what_is_linear_in_the_motion_needs_no_wider_band() -> None:
    free = card('model = "none"').plant()
    noisy = [bristled(seed, noise=3e-6) for seed in (1, 2)]
    for run in noisy:
        smooth = np.gradient(run["q"], run.t)
        run.table["tau"] = INERTIA * np.gradient(smooth, run.t) + VISCOUS * smooth  # type: ignore[index]
    assert in_band(noisy, free).band.motion == 0.0


@pytest.mark.parametrize("hertz", [3.0, 8.0, 12.0])
def test_a_tone_passes_all_filters_as_its_gain_says(hertz: float) -> None:
    t = np.arange(20 * KHZ) / KHZ
    tone = recorded(np.sin(2 * np.pi * hertz * t), t, 0.1 * np.sin(t))
    (piece,) = prepare([tone], Band(10.0, 20.0)).pieces
    assert piece.motion == 20.0
    assert np.sqrt(2) * piece.tau[piece.inside].std() == pytest.approx(piece.gain(hertz), rel=0.01)


def test_the_band_of_the_torque_is_that_of_two_passes_wherever_the_motion_is_read() -> None:
    narrow, wide = (prepare(RUNS, Band(10.0, motion)).pieces[0] for motion in (0.0, 28.0))
    assert [one.gain(10.0) for one in (narrow, wide)] == pytest.approx([0.25, 0.25], rel=0.01)
    assert 0.88 * len(narrow.kept) < len(wide.kept) < len(narrow.kept), "a tenth more lies beside the ends of a filter"


# The band of a diagnosis rises where a ripple over position lies above it, and for nothing else.

CARD = parse_card(
    '[mount]\nname = "m"\ninertia = 5e-6\n[friction]\nmodel = "coulomb"\nFc = 2e-3\nsigma2 = 1e-5\n', "a.toml"
)
ORDER, ROWS = 72, 1000.0


def spun(seed: int, ripple: float = 4e-3, noise: float = 0.0, seconds: float = 6.0, order: float = ORDER) -> Recording:
    """About a turn a second with a ripple of so many a turn, the loop stiff, an encoder of 0.3 mrad noise."""
    draw, t = np.random.default_rng(seed), np.arange(int(seconds * ROWS)) / ROWS
    speed = 5 + 0.5 * np.sin(2 * np.pi * (0.2 + 0.05 * seed) * t)
    q = seed + np.cumsum(speed) / ROWS
    tau = 2e-3 + 1e-5 * speed + 5e-6 * np.gradient(speed, 1 / ROWS) + ripple * np.cos(order * q + 1)
    tau += noise * draw.standard_normal(len(t)) + 1e-4 * draw.standard_normal(len(t))
    return recorded(tau, t, q + 3e-4 * draw.standard_normal(len(t)), f"run{seed}")


def test_the_band_rises_to_a_ripple_above_it_and_the_ripple_is_found() -> None:
    train, mount = [spun(1), spun(2)], CARD.plant()
    narrow = choose_cutoff(train, 5e-6)
    assert narrow < ORDER * 5 / (2 * np.pi)
    assert in_band(train, mount).cutoff > ORDER * 5.5 / (2 * np.pi)
    outcome = diagnose(train, [spun(3)], CARD)
    assert outcome.diagnosis.verdict == ("cogging",)
    found = [one for one in outcome.card.effects if one.id == "cogging"]
    assert found[0].cycles_per_rev == pytest.approx(ORDER, abs=0.01)  # type: ignore[attr-defined]
    assert found[0].amplitude == pytest.approx(4e-3, rel=0.05)  # type: ignore[attr-defined]
    held = outcome.diagnosis.heldout
    assert held.cutoff_hz > 57
    assert held.after_rms < 0.3 * held.before_rms


def test_noise_above_the_band_does_not_raise_it() -> None:
    train, mount = [spun(k, ripple=0.0, noise=4e-3) for k in (1, 2)], CARD.plant()
    narrow, wide = choose_cutoff(train, 5e-6), choose_cutoff(train, 5e-6, NOISE_LIMIT)
    assert wide > narrow
    assert predicted(prepare(train, wide), mount, narrow) < POLICY.considerable / 10
    assert in_band(train, mount).cutoff == narrow


def test_of_one_recording_a_half_must_predict_the_other() -> None:
    one = [spun(1)]
    assert in_band(one, CARD.plant()).cutoff > choose_cutoff(one, 5e-6)


@pytest.mark.parametrize(("order", "seconds"), [(ORDER, 60.0), (72.37, 2.0)])
def test_high_cycles_of_many_turns_are_tried_and_of_few_turns_parts_of_a_cycle(order: float, seconds: float) -> None:
    """In 2 s a turn and a half: cycles are tried in steps of a fifth, and the best of them is made sharp."""
    prepared, mount = prepare([spun(1, seconds=seconds, order=order)], 100.0), CARD.plant()
    torque = prepared.stacked("tau")
    assert peaks(span_of(mount, prepared, torque, np.ones_like(torque)), torque)[0] == pytest.approx(order, abs=0.02)


def test_a_reading_that_would_err_by_half_the_way_is_no_eccentric_disc() -> None:
    disc = EncoderEccentricity(cycles_per_rev=1.0, amplitude_rad=5e-3)
    ripple = EncoderEccentricity(cycles_per_rev=18.0, amplitude_rad=0.0287, second=0.57)
    assert [Eccentricity().is_plausible(one, CARD.plant()) for one in (disc, ripple)] == [True, False]


# The plain held-out error of a real model in both bands: what errs in one of them alone does not stand.

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
    ("noise", "weighed", "narrow", "wide", "both"),
    [
        pytest.param(0, 1, (1, 0.6), (100, 199), (0.4, 0.4), id="noise: the narrow band counts twice"),
        pytest.param(0, 1, (1, 0.6), (100, 201), (0.4, -1.01), id="amplified"),
        pytest.param(0, 1, (1, 0.49), (100, 201), (0.51, 0.51), id="amplified, and half of the rest is removed"),
        pytest.param(0, 1, (1, 0.51), (100, 201), (0.49, -1.01), id="amplified, and less is removed"),
        pytest.param(0, 1, (1, 0.6), (8.9, 5), (0.4, 1 - 5 / 8.9), id="no noise"),
        pytest.param(0.8, 0.5, (1, 0.96), (1.5, 1.4), (0.2, 1 - 0.6 / 0.7), id="rows without weight have no noise"),
        pytest.param(0.95, 1, (2, 0.5), (2, 0.5), (1 - 0.05 / 1.05,) * 2, id="noise is nine tenths at most"),
    ],
)
def test_a_model_may_amplify_noise_twofold_or_must_halve_the_error(
    noise: float,
    weighed: float,
    narrow: tuple[float, float],
    wide: tuple[float, float],
    both: tuple[float, float],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the energies that two mounts leave in both bands, of which noise of the reading is so much."""
    monkeypatch.setattr(predictive, "reading_noise", lambda *_: noise)
    mounts = axis(), axis(effects=(offset(1.0),))
    size, energy = dict(zip(mounts, narrow, strict=True)), dict(zip(mounts, wide, strict=True))
    this: Any = SimpleNamespace(weight=np.repeat([1.0, 0.0], [round(4 * weighed), 4 - round(4 * weighed)]), halved=0.5)
    this.prepared, this.protocol = SimpleNamespace(cutoff=NARROW), SimpleNamespace(cutoff=WIDE)
    this.residual, this._protocol_energy = (lambda one: np.full(4, size[one] ** 0.5)), energy.__getitem__
    assert Predictive.plain_gains(this, *mounts) == pytest.approx(both)


def test_what_a_model_removes_in_clear_motion_is_not_hidden_by_what_it_raises_at_rest() -> None:
    t = np.arange(SECONDS * RATE) / RATE
    v = np.where(t % 4 < 2, np.sin(np.pi * t) ** 2, 0.0)  # moves and rests in turn
    clear = v > 0.02 * v.max()
    left = {"base": np.ones(len(t)), "other": np.where(clear, 0.5, 3.0)}
    prepared = SimpleNamespace(stacked=lambda _: v)
    this: Any = SimpleNamespace(prepared=prepared, residual=lambda mount: left[mount])
    assert Predictive.in_motion(this, "base", "other") == pytest.approx(0.75)  # type: ignore[arg-type]
    assert np.mean(left["other"] ** 2) > 1
