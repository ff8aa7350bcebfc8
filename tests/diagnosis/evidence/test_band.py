"""The band of a diagnosis rises where a ripple over position lies above it, and for nothing else."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.effects.encoder_eccentricity import Eccentricity
from cosim.diagnosis.effects.periodogram import peaks
from cosim.diagnosis.evidence.band import NOISE_LIMIT, in_band, predicted
from cosim.estimation.prepare import choose_cutoff, prepare
from pyfmi_models.card import parse_card
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity

CARD = parse_card(
    '[mount]\nname = "m"\ninertia = 5e-6\n[friction]\nmodel = "coulomb"\nFc = 2e-3\nsigma2 = 1e-5\n', "a.toml"
)
ORDER, RATE = 72, 1000.0


def turning(seed: int, ripple: float = 4e-3, noise: float = 0.0, seconds: float = 6.0) -> Recording:
    """About a turn a second with a ripple of 72 a turn, the loop stiff, an encoder of 0.3 mrad noise."""
    draw, t = np.random.default_rng(seed), np.arange(int(seconds * RATE)) / RATE
    speed = 5 + 0.5 * np.sin(2 * np.pi * (0.2 + 0.05 * seed) * t)
    q = seed + np.cumsum(speed) / RATE
    tau = 2e-3 + 1e-5 * speed + 5e-6 * np.gradient(speed, 1 / RATE) + ripple * np.cos(ORDER * q + 1)
    tau += noise * draw.standard_normal(len(t)) + 1e-4 * draw.standard_normal(len(t))
    return Recording(f"run{seed}", {"t": t, "tau": tau, "q": q + 3e-4 * draw.standard_normal(len(t))})


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


def test_high_cycles_of_many_turns_are_tried() -> None:
    prepared, mount = prepare([turning(1, seconds=60.0)], 100.0), CARD.plant()
    torque = prepared.stacked("tau")
    assert peaks(span_of(mount, prepared, torque, np.ones_like(torque)), torque)[0] == pytest.approx(ORDER, abs=0.02)


def test_a_reading_that_would_err_by_half_the_way_is_no_eccentric_disc() -> None:
    disc = EncoderEccentricity(cycles_per_rev=1.0, amplitude_rad=5e-3)
    ripple = EncoderEccentricity(cycles_per_rev=18.0, amplitude_rad=0.0287, second=0.57)
    assert Eccentricity().is_plausible(disc, CARD.plant())
    assert not Eccentricity().is_plausible(ripple, CARD.plant())
