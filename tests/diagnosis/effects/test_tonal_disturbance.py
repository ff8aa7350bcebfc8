"""What shakes the axis in time: one frequency and one amplitude, and in each recording a phase of its own."""

from dataclasses import replace

import numpy as np
import pytest
from closed_loop import recorded
from problems import diagnosed, problem_of
from wandering import axis, swing

from cosim.data.recording import Recording
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.effects.periodogram import tones
from cosim.estimation.fit import fit
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import prepare
from pyfmi_models.card import read_card
from pyfmi_models.effects import ActuatorLag
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance

HERTZ, SECOND, AMPLITUDE = 4.3, 9.1, 0.4
BASE = axis()
CARD = '[mount]\ninertia = 5.0\n[friction]\nmodel = "coulomb"\nFc = 2.0\nsigma2 = 1.0\n'


def disturbed(number: int) -> Recording:
    """12 s of a wandering motion of the base, disturbed by two tones of other phases in each, with a little noise."""
    t, rng = np.arange(3000) / 250, np.random.default_rng(number)
    q, v, a = swing(t, list(zip((0.2, 0.1, 0.03), rng.uniform(0.1, 1, 3), (0, 1, 2), strict=True)))
    waves = np.sin(2 * np.pi * HERTZ * t + 0.5 + number), 0.6 * np.sin(2 * np.pi * SECOND * t + 2 * (0.5 + number))
    noise = 0.05 * rng.standard_normal(len(t))
    tau = 5.0 * a + 2.0 * np.sign(v) + 1.0 * v + AMPLITUDE * sum(waves) + noise
    return Recording(f"run_{number}", {"t": t, "tau": tau, "q": q})


def test_a_fit_finds_one_frequency_and_one_amplitude_over_recordings_of_other_phases() -> None:
    problem = problem_of(BASE, disturbed(0), disturbed(1))
    start = replace(BASE, effects=(PeriodicDisturbance(frequency_hz=HERTZ + 0.005, amplitude=0.1),))
    found = fit(start, problem.prepared.pieces, problem.weight)
    assert "periodic_disturbance.phase" not in found.free
    tone = found.mount.effects[0]
    assert isinstance(tone, PeriodicDisturbance)
    assert tone.frequency_hz == pytest.approx(HERTZ, abs=1e-3)
    assert tone.amplitude == pytest.approx(AMPLITUDE, rel=0.05)
    inverse = Inverse(found.mount, found.free)
    phases = [inverse.phases(piece, found.values)["periodic_disturbance.phase"] for piece in problem.prepared.pieces]
    assert phases == pytest.approx([0.5, 1.5], abs=0.1)
    assert tone.phase == pytest.approx(phases[0])


def test_behind_a_lag_amplitude_and_phase_are_those_of_the_disturbance_not_of_the_command() -> None:
    lag, tone = ActuatorLag(time_constant_ms=15.0), PeriodicDisturbance(frequency_hz=9.0, amplitude=0.6, phase=0.2)
    mount = replace(read_card("paper_mount").plant(), effects=(lag, tone))
    piece = recorded(mount).pieces[0]
    inverse = Inverse(mount, ())
    rest = (piece.tau - inverse.torque(piece, np.zeros(0))[0])[piece.inside]
    assert float(np.sqrt(np.mean(rest**2))) < 0.15
    assert inverse.phases(piece, np.zeros(0))["periodic_disturbance.phase"] == pytest.approx(0.2, abs=0.1)


def test_a_machine_with_two_tones_is_one_disturbance_and_its_card_holds_both() -> None:
    outcome = diagnosed([disturbed(number) for number in range(3)], CARD)
    assert outcome.diagnosis.verdict == ("periodic_disturbance",)
    (found,) = (one for one in outcome.diagnosis.findings if one.answer == "found")
    assert found.statement.endswith("Further tones: 9.1 Hz.")
    main, second = sorted(outcome.card.effects, key=lambda tone: tone.frequency_hz)
    assert (main.frequency_hz, main.amplitude, main.phase) == pytest.approx((HERTZ, AMPLITUDE, 0.5), abs=0.03)
    assert (second.frequency_hz, second.amplitude) == pytest.approx((SECOND, 0.6 * AMPLITUDE), abs=0.03)
    assert np.cos(second.phase - 1.0) > 0.99


def found_in(q: np.ndarray, t: np.ndarray, residual: np.ndarray) -> list[float]:
    """The tones that stand out from a residual beside a motion."""
    prepared = prepare([Recording("r", {"t": t, "tau": residual, "q": q})], 20.0)
    rest = prepared.stacked("tau")
    return tones(span_of(BASE, prepared, rest, np.zeros(len(rest))), rest)


def test_what_follows_a_motion_that_repeats_itself_or_turns_steadily_is_no_tone() -> None:
    t, pitch = np.arange(6000) / 125, 0.35
    residual = np.sin(2 * np.pi * 3 * pitch * t) + 0.1 * np.random.default_rng(1).standard_normal(len(t))
    for wild in (0, 9):
        found = found_in(np.sin(2 * np.pi * pitch * t + 0.5 * wild * np.sin(0.4 * t)), t, residual)
        assert any(abs(hertz - 3 * pitch) < 0.02 for hertz in found) == bool(wild)
    turning = found_in(0.6 * t + 1e-3 * np.sin(t), t, residual)
    assert not any(abs(hertz - 3 * pitch) < 0.02 for hertz in turning)


def test_recordings_too_short_for_a_tone_have_none() -> None:
    t = np.arange(40) / 10
    assert found_in(np.sin(t), t, np.cos(9 * t)) == []
