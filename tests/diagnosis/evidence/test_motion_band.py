"""The motion that goes into the models is read in the band in which friction is neither smeared nor made to creep."""

from dataclasses import replace

import numpy as np
import pytest
from wandering import recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem, diagnose
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.effects.encoder_eccentricity import Eccentricity
from cosim.diagnosis.effects.periodogram import peaks
from cosim.diagnosis.evidence.band import NOISE_LIMIT, in_band, predicted
from cosim.estimation.prepare import Band, choose_cutoff, prepare
from pyfmi_models.card import Card, parse_card
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity

RATE, FINE = 1000, 20
INERTIA, STIFFNESS, DAMPING, VISCOUS, LEVEL, REST, SPEED = 30.0, 9e4, 500.0, 25.0, 2.0, 3.5, 0.05


def card(friction: str) -> Card:
    return parse_card(f'[mount]\nname = "m"\ninertia = {INERTIA}\n[friction]\n{friction}', "a.toml")


LUGRE = card(
    f'model = "lugre"\nsigma0 = {STIFFNESS}\nsigma1 = {DAMPING}\nsigma2 = {VISCOUS}\n'
    f"Fc = {LEVEL}\nFs = {REST}\nVs = {SPEED}\n"
)


def bristled(seed: int, noise: float = 3e-7) -> Recording:
    """Quick turns of an axis with stiff bristles, whose equations are integrated here anew, read with some noise."""
    draw, h = np.random.default_rng(seed), 1 / (RATE * FINE)
    t = np.arange(20 * RATE * FINE) * h
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
    t = np.arange(20 * RATE) / RATE
    tone = recorded(np.sin(2 * np.pi * hertz * t), t, 0.1 * np.sin(t))
    (piece,) = prepare([tone], Band(10.0, 20.0)).pieces
    assert piece.motion == 20.0
    assert np.sqrt(2) * piece.tau[piece.inside].std() == pytest.approx(piece.gain(hertz), rel=0.01)


def test_the_band_of_the_torque_is_that_of_two_passes_wherever_the_motion_is_read() -> None:
    narrow, wide = (prepare(RUNS, Band(10.0, motion)).pieces[0] for motion in (0.0, 28.0))
    assert narrow.gain(10.0) == pytest.approx(0.25, rel=0.01)
    assert wide.gain(10.0) == pytest.approx(0.25, rel=0.01)
    assert 0.88 * len(narrow.kept) < len(wide.kept) < len(narrow.kept), (
        "a tenth more lies beside the ends of a filter more"
    )


# The band of a diagnosis rises where a ripple over position lies above it, and for nothing else.

CARD = parse_card(
    '[mount]\nname = "m"\ninertia = 5e-6\n[friction]\nmodel = "coulomb"\nFc = 2e-3\nsigma2 = 1e-5\n', "a.toml"
)
ORDER, FAST = 72, 1000.0


def turning(
    seed: int, ripple: float = 4e-3, noise: float = 0.0, seconds: float = 6.0, order: float = ORDER
) -> Recording:
    """About a turn a second with a ripple of so many a turn, the loop stiff, an encoder of 0.3 mrad noise."""
    draw, t = np.random.default_rng(seed), np.arange(int(seconds * FAST)) / FAST
    speed = 5 + 0.5 * np.sin(2 * np.pi * (0.2 + 0.05 * seed) * t)
    q = seed + np.cumsum(speed) / FAST
    tau = 2e-3 + 1e-5 * speed + 5e-6 * np.gradient(speed, 1 / FAST) + ripple * np.cos(order * q + 1)
    tau += noise * draw.standard_normal(len(t)) + 1e-4 * draw.standard_normal(len(t))
    return recorded(tau, t, q + 3e-4 * draw.standard_normal(len(t)), f"run{seed}")


def test_the_band_rises_to_a_ripple_above_it_and_the_ripple_is_found() -> None:
    train, mount = [turning(1), turning(2)], CARD.plant()
    narrow = choose_cutoff(train, 5e-6)
    assert narrow < ORDER * 5 / (2 * np.pi)
    assert in_band(train, mount).cutoff > ORDER * 5.5 / (2 * np.pi)
    outcome = diagnose(train, [turning(3)], CARD)
    assert outcome.diagnosis.verdict == ("cogging",)
    found = [one for one in outcome.card.effects if one.id == "cogging"]
    assert found[0].cycles_per_rev == pytest.approx(ORDER, abs=0.01)  # type: ignore[attr-defined]
    assert found[0].amplitude == pytest.approx(4e-3, rel=0.05)  # type: ignore[attr-defined]
    held = outcome.diagnosis.heldout
    assert held.cutoff_hz > 57
    assert held.after_rms < 0.3 * held.before_rms


def test_noise_above_the_band_does_not_raise_it() -> None:
    train, mount = [turning(k, ripple=0.0, noise=4e-3) for k in (1, 2)], CARD.plant()
    narrow, wide = choose_cutoff(train, 5e-6), choose_cutoff(train, 5e-6, NOISE_LIMIT)
    assert wide > narrow
    assert predicted(prepare(train, wide), mount, narrow) < POLICY.considerable / 10
    assert in_band(train, mount).cutoff == narrow


def test_of_one_recording_a_half_must_predict_the_other() -> None:
    one = [turning(1)]
    assert in_band(one, CARD.plant()).cutoff > choose_cutoff(one, 5e-6)


@pytest.mark.parametrize(("order", "seconds"), [(ORDER, 60.0), (72.37, 2.0)])
def test_high_cycles_of_many_turns_are_tried_and_of_few_turns_parts_of_a_cycle(order: float, seconds: float) -> None:
    """In 2 s a turn and a half: cycles are tried in steps of a fifth, and the best of them is made sharp."""
    prepared, mount = prepare([turning(1, seconds=seconds, order=order)], 100.0), CARD.plant()
    torque = prepared.stacked("tau")
    assert peaks(span_of(mount, prepared, torque, np.ones_like(torque)), torque)[0] == pytest.approx(order, abs=0.02)


def test_a_reading_that_would_err_by_half_the_way_is_no_eccentric_disc() -> None:
    disc = EncoderEccentricity(cycles_per_rev=1.0, amplitude_rad=5e-3)
    ripple = EncoderEccentricity(cycles_per_rev=18.0, amplitude_rad=0.0287, second=0.57)
    assert [Eccentricity().is_plausible(one, CARD.plant()) for one in (disc, ripple)] == [True, False]
