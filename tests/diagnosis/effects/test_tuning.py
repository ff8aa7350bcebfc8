"""What a start knows only roughly of an effect is found by further fits."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from closed_loop import recorded as closed
from problems import compared, diagnosed, likeliest, problem_of
from wandering import axis, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.effects.encoder_eccentricity import halved
from cosim.diagnosis.effects.periodogram import tones
from cosim.diagnosis.effects.tuning import in_cycles, in_whole_cycles
from cosim.diagnosis.search.stages import admission, refitted, starts
from cosim.estimation.fit import fit, with_values
from cosim.estimation.inverse import Inverse
from cosim.estimation.play import SEARCHED, far_torques, stepped_torque
from cosim.estimation.prepare import prepare
from pyfmi_models.card import parse_card, read_card
from pyfmi_models.effects import ActuatorLag, Cogging
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.effects.thermal_viscosity import ThermalViscosity
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.friction import Coulomb

OILED = replace(axis(), friction=Coulomb(Fc=2.0, sigma2=3.0))
T = np.arange(4000) / 200


def noise(size: float, seed: int, rows: int = len(T)) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(rows)


def test_a_metre_knows_no_whole_numbers_of_waves() -> None:
    q, v, a = swing(T, [(0.1, 2.0, 0.0)], per=1)
    wave = 2 * np.pi * 0.6
    needed = 5 * (1 + 0.1 * np.cos(wave * q)) * a - 2.5 * 0.1 * wave * np.sin(wave * q) * v**2
    tau = needed + 2 * np.sign(v) + 3 * v + noise(0.05, 1)  # in which a whole number fits as well
    problem = problem_of(replace(OILED, motion="linear"), recorded(tau, T, q), slow=0.01)
    start = InertiaVariation(relative_amplitude=0.05, cycles_per_rev=0.7)
    found = in_cycles(problem, problem.fit(replace(problem.mount, effects=(start,)), 12)).mount.effects[-1]
    assert isinstance(found, InertiaVariation)
    assert found.cycles_per_rev != 1.0


@pytest.mark.parametrize(
    ("true", "motion", "found_at"), [(6.0, "rotary", 6.0), (6.4, "rotary", 6.4), (6.08, "linear", 6.08 / (2 * np.pi))]
)
def test_waves_of_a_ripple_have_whole_cycles_together(true: float, motion: Any, found_at: float) -> None:
    """On part of a turn a wave that stands in for its double has other cycles."""
    q, v, a = swing(T, [(0.35, 0.9, 1.0), (0.05, 3.1, 2.0), (0.1, 0.0, np.pi / 2)], per=1)
    ripple = 1.0 * np.cos(true * q - 2.8) + 0.4 * np.cos(2 * true * q + 2.4)
    tau = 5 * a + 2 * np.sign(v) + 3 * v + ripple + noise(0.05, 3)
    problem = problem_of(replace(OILED, motion=motion), recorded(tau, T, q))
    drawn = max(true, 6.08) / (2 * np.pi if motion == "linear" else 1.0)
    waves = [Cogging(cycles_per_rev=k * drawn, amplitude=0.4, phase=p) for k, p in ((1, -2.5), (2, 2.0))]
    found = in_whole_cycles(problem, problem.fit(replace(problem.mount, effects=tuple(waves)), 24), 2)
    cycles = [wave.cycles_per_rev for wave in found.mount.effects if isinstance(wave, Cogging)]
    assert cycles == [found_at, 2 * found_at]


def warmed(coldest: float, phase: float) -> Recording:
    """20 s in air and grease that thins as it warms up."""
    q, v, a = swing(T, [(0.5, 0.11, phase), (0.1, 0.37, 1.0 + phase), (0.02, 0.9, 2.0)])
    temperature = coldest + 8 * T / T[-1]
    tau = 5 * a + 2 * np.sign(v) + 3 * v * np.exp(-0.04 * (temperature - 20)) + 1.5 * v * np.abs(v)
    table = {"t": T, "tau": tau + noise(0.002, int(coldest)), "q": q, "temperature": temperature}
    return Recording(f"from {coldest}", table)


def test_grease_is_found_to_thin_where_a_drag_had_taken_its_place() -> None:
    problem, start = problem_of(OILED, warmed(8.0, 0.0), warmed(16.0, 2.0)), ThermalViscosity(viscous_per_degC=-0.3)
    drag = replace(OILED, effects=(QuadraticDrag(coefficient=6.0), start))
    lost = with_values(drag, ("friction.sigma2",), np.array([1e-3]))
    stuck = fit(lost, problem.prepared.pieces, problem.weight, evaluations=12)  # held to its start, not to the card
    assert stuck.parameters()["friction.sigma2"] < 0.3
    found = hypothesis_of(start).tuned(problem, stuck, start, lambda one: -problem.error(one)).parameters()
    assert found["thermal_viscosity.viscous_per_degC"] == pytest.approx(-0.04, rel=0.05)
    assert found["friction.sigma2"] == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize(("second", "turns"), [(0.6, 6.0), (0.0, 12.0)])
def test_a_disc_is_found_at_its_own_turns_though_its_error_twice_a_turn_is_larger(second: float, turns: float) -> None:
    t = np.arange(8000) / 200
    q, v, a = swing(t, [(0.8, 1.0, 0.0)], per=1)
    once, twice = 6 * q + 0.4, 2 * (6 * q + 0.4)
    error = 2e-3 * (np.sin(once) + 0.6 * np.sin(twice)) if second else 1.2e-3 * np.sin(twice)
    tau = 5 * a + 2 * np.sign(v) + 3 * v + noise(0.01, 2, len(t))
    problem = problem_of(OILED, recorded(tau, t, q + error), slow=0.05)
    start = EncoderEccentricity(cycles_per_rev=12.0, amplitude_rad=1e-3, phase=0.8)
    began = problem.fit(replace(OILED, effects=(start,)), 12)
    tuned = hypothesis_of(start).tuned(problem, began, start, lambda fit: 1e3 * (1 - problem.error(fit)))
    found = tuned.mount.effects[-1]
    assert isinstance(found, EncoderEccentricity)
    assert found.cycles_per_rev == turns
    assert found.second == pytest.approx(second, abs=0.05)
    assert found.amplitude_rad == pytest.approx(2e-3 if second else 1.2e-3, rel=0.1)


def halves(disc: EncoderEccentricity, middle: float, motion: str) -> list[EncoderEccentricity]:
    """Discs of half the turns; the search knows where the axis was, and whether it turns."""
    prepared = SimpleNamespace(ranges={"q": (middle - 0.5, middle + 0.5)})
    problem: Any = SimpleNamespace(mount=SimpleNamespace(motion=motion), prepared=prepared)
    return halved(problem, disc)


@pytest.mark.parametrize("motion", ["rotary", "linear"])
@pytest.mark.parametrize("phase", [0.0, 0.8, -2.5])
@pytest.mark.parametrize("cycles", [12.0, 13.0])
def test_half_the_turns_err_twice_a_turn_as_was_found(motion: str, phase: float, cycles: float) -> None:
    """In the middle of what was visited, and everywhere where the turns can be halved; at a place in m times 2 pi."""
    disc = EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=3e-4, phase=phase)
    middle, found = 0.7, halves(disc, 0.7, motion)
    angle = (2 * np.pi if motion == "linear" else 1.0) * np.linspace(middle - 0.3, middle + 0.3, 61)
    there = slice(None) if motion == "linear" or cycles % 2 == 0 else 30
    error = disc.amplitude_rad * np.sin(cycles * angle + phase)
    assert len(found) == 2
    for one in found:
        twice = one.second * one.amplitude_rad * np.sin(2 * (one.cycles_per_rev * angle + one.phase))
        np.testing.assert_allclose(twice[there], error[there], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("cycles", "turns"), [(1.0, 1.0), (5.0, 2.0), (7.0, 4.0), (12.0, 6.0)])
def test_an_axis_that_turns_has_whole_turns_and_at_least_one(cycles: float, turns: float) -> None:
    disc = EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=3e-4)
    assert {one.cycles_per_rev for one in halves(disc, 0.0, "rotary")} == {turns}
    assert {one.cycles_per_rev for one in halves(disc, 0.0, "linear")} == {cycles / 2}


@pytest.mark.parametrize(
    ("knee", "sizes"),
    [
        pytest.param(5.6, (0.5, 1.2), id="one recording alone reaches it"),
        pytest.param(7.0, (0.5, 1.2), id="in few rows"),
        pytest.param(3.5, (1.0, 1.0), id="far below the command that it swells"),
    ],
)
def test_a_drive_that_saturates_is_found_where_it_acts(knee: float, sizes: tuple[float, float]) -> None:
    """Two motions of different size by a drive that gives 0.4 of what is asked for past a knee (N m)."""
    recordings, rng, t = [], np.random.default_rng(1), np.arange(10_000) / 500
    for number, size in enumerate(sizes):
        tones = [(0.5 * size, 0.11, 2.0 * number), (0.1 * size, 0.37, 1.0 + 2 * number), (0.02 * size, 0.9, 2.0)]
        q, v, a = swing(t, tones)
        need = 5 * a + 2 * np.sign(v) + v
        past = np.maximum(np.abs(need) - knee, 0)
        command = np.sign(need) * (np.abs(need) + past * (1 / 0.4 - 1))
        recordings.append(recorded(command + 0.005 * rng.standard_normal(len(t)), t, q, f"run_{number}"))
    comparison, base = compared(problem_of(axis(), *recordings, sample=0.002))
    worth = starts(comparison.screen(base), POLICY)
    fits = [refitted(comparison, base, one, many) for one, many in worth if isinstance(one, TorqueSaturation)]
    best = max(fits, key=lambda one: one.evidence)
    assert all_pass(admission(comparison, best))
    assert best.evidence > POLICY.clear
    assert isinstance(best.effect, TorqueSaturation)
    assert best.effect.knee_torque == pytest.approx(knee, rel=0.03)
    assert best.effect.slope == pytest.approx(0.4, rel=0.03)


# What is behind a play coasts, rubs and is caught; a search finds it from afar, with the width of the gap.

FAR, DT = 2.0, 1e-3


def torque(play: Backlash, v: np.ndarray) -> np.ndarray:
    """Torque passed on to the far side, the near one moving at v."""
    a = np.gradient(v, DT)
    return stepped_torque([play], [FAR], v, a, DT)[0] + FAR * a


@pytest.mark.parametrize("side", [-1, 1])
def test_pushed_on_for_long_the_far_side_follows_and_needs_its_inertia_and_its_friction(side: int) -> None:
    t = DT * np.arange(4000)
    play = Backlash(gap_rad=1e-3, load_friction=0.3, load_viscous=0.5)
    passed = torque(play, side * 0.4 * t)
    np.testing.assert_allclose(passed[-500:], side * (FAR * 0.4 + 0.3 + 0.5 * 0.4 * t[-500:]), rtol=0.01)


def test_a_near_side_that_stops_is_left_for_as_long_as_the_gap_is_wide() -> None:
    """At rest from 1 s on, it is left with 0.1 rad/s; friction takes 0.05 rad/s2, so 20 mrad are crossed in 212 ms."""
    t = DT * np.arange(3000)
    v = np.where(t < 1, 0.1, 0.0)
    passed = torque(Backlash(gap_rad=0.02, load_friction=0.05 * FAR), v)
    met = t[np.flatnonzero((t > 1.01) & (np.abs(passed) > 1e-3))[0]] - 1
    assert met == pytest.approx((0.1 - np.sqrt(0.1**2 - 2 * 0.05 * 0.02)) / 0.05, abs=5e-3)
    caught = t > 1.01
    # What it still had of speed goes; the contact is well damped, so that at most a fifth of it comes back.
    assert 1.0 < DT * passed[caught].sum() / (-FAR * (0.1 - 0.05 * met)) < 1.2


@pytest.mark.parametrize("rows", [1, 2, 5])
def test_the_momentum_that_is_told_hardly_depends_on_how_dense_the_rows_are(rows: int) -> None:
    t = 1e-3 * np.arange(20000)
    v, a = 0.2 * np.sin(3 * t), 0.6 * np.cos(3 * t)
    play = Backlash(gap_rad=5e-3, load_friction=0.2, load_viscous=0.3)
    fine = np.cumsum(stepped_torque([play], [FAR], v, a, 1e-3)) * 1e-3
    coarse = np.cumsum(stepped_torque([play], [FAR], v[::rows], a[::rows], rows * 1e-3)) * rows * 1e-3
    assert np.std(coarse - fine[::rows]) < 0.05 * np.std(fine)


def test_a_search_slows_the_far_side_by_dry_and_by_viscous_friction() -> None:
    """What the search offers for a gap is the play's own torque, its oil included, in the band of the diagnosis."""
    t = DT * np.arange(20000)
    prepared = prepare([recorded(0 * t, t, 0.1 * np.sin(3 * t))], 20.0)
    piece, dry, ratio = prepared.pieces[0], 0.02, 10.0
    step = max(1, int(1 / (SEARCHED * piece.dt)))
    play = Backlash(gap_rad=5e-3, load_friction=dry, load_viscous=ratio * dry)
    exact = stepped_torque([play], [1.0], piece.v[::step], piece.a[::step], step * piece.dt)[0]
    told = far_torques(prepared, ((5e-3, dry),), ratio)[:, 0]
    expected = piece.lowpass(np.interp(piece.t, piece.t[::step], exact))[piece.kept]
    np.testing.assert_allclose(told, expected, atol=1e-12)
    assert np.std(told - far_torques(prepared, ((5e-3, dry),), 0.0)[:, 0]) > 0.05 * np.std(told)


@pytest.mark.parametrize(("share", "degenerate"), [(0.08, True), (0.1, False)])
def test_behind_a_play_is_more_than_a_bristle(share: float, degenerate: bool) -> None:
    """Four nulls of two generators had up to .077 of the inertia there, a true play was found at .11."""
    play = Backlash(gap_rad=1e-3, load_share=share, load_friction=0.3)
    assert hypothesis_of(play).is_degenerate(None, play) is degenerate  # type: ignore[arg-type]


# A play with a stiff contact is found from afar: the grid that looks for it gets finer as its averages get shorter.

CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 1.0\n', "card.toml")


def played(play: Backlash, seed: int) -> Recording:
    """Two slow tones, and what the axis needs for them with a play behind it, 100 Hz of band."""
    t, rng = np.arange(15000) / 1000, np.random.default_rng(seed)
    q, _, _ = swing(t, [(0.3, 1.5, 1.5 * seed), (0.03, 5.0, 5.0 * seed)], per=1)
    (piece,) = prepare([recorded(t, t, q)], 450.0).pieces
    tau = Inverse(replace(CARD.plant(), effects=(play,)), ()).torque(piece, np.zeros(0))[0]
    return recorded(tau + 0.02 * rng.standard_normal(len(tau)), piece.t, piece.q, f"run_{seed}")


@pytest.mark.parametrize(("gap", "friction"), [(5e-3, 0.4), (1e-3, 0.2)])
def test_from_the_likeliest_place_of_the_grid_a_fit_ends_at_the_truth(gap: float, friction: float) -> None:
    play = Backlash(gap_rad=gap, load_share=0.4, load_friction=friction)
    comparison, base = compared(_problem([played(play, seed) for seed in (1, 2)], CARD), 40)
    found = refitted(comparison, base, likeliest(comparison, base, "backlash"), 1)
    assert isinstance(found.effect, Backlash)
    assert found.effect.gap_rad == pytest.approx(gap, rel=0.01)
    assert found.effect.load_share == pytest.approx(play.load_share, rel=0.05)
    assert found.evidence > 1000
    assert all_pass(admission(comparison, found))


# What shakes the axis in time: one frequency and one amplitude, and in each recording a phase of its own.

HERTZ, SECOND, AMPLITUDE = 4.3, 9.1, 0.4
BASE = axis()
TEXT = '[mount]\ninertia = 5.0\n[friction]\nmodel = "coulomb"\nFc = 2.0\nsigma2 = 1.0\n'


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
    piece = closed(mount).pieces[0]
    inverse = Inverse(mount, ())
    rest = (piece.tau - inverse.torque(piece, np.zeros(0))[0])[piece.inside]
    assert float(np.sqrt(np.mean(rest**2))) < 0.15
    assert inverse.phases(piece, np.zeros(0))["periodic_disturbance.phase"] == pytest.approx(0.2, abs=0.1)


def test_a_machine_with_two_tones_is_one_disturbance_and_its_card_holds_both() -> None:
    outcome = diagnosed([disturbed(number) for number in range(3)], TEXT)
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
