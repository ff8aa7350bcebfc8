"""What a start knows only roughly of an effect is found by further fits."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from wandering import swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.encoder_eccentricity import halved
from cosim.diagnosis.effects.tuning import in_cycles, in_whole_cycles
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.stages import CandidateFit, admission, refitted, starts
from cosim.estimation.fit import Fit, fit, with_values
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from pyfmi_models.card import parse_card
from pyfmi_models.effects import Cogging
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.effects.thermal_viscosity import ThermalViscosity
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount


def warmed(name: str, coldest: float, phase: float) -> Recording:
    """20 s in air and grease that thins as it warms up."""
    t = np.arange(4000) / 200
    q, v, acceleration = swing(t, [(0.5, 0.11, phase), (0.1, 0.37, 1.0 + phase), (0.02, 0.9, 2.0)])
    temperature = coldest + 8 * t / t[-1]
    thinner = np.exp(-0.04 * (temperature - 20))
    tau = 5 * acceleration + 2 * np.sign(v) + 3 * v * thinner + 1.5 * v * np.abs(v)
    noise = 0.002 * np.random.default_rng(int(coldest)).standard_normal(len(t))
    return Recording(name, {"t": t, "tau": tau + noise, "q": q, "temperature": temperature})


def test_a_metre_knows_no_whole_numbers_of_waves() -> None:
    t = np.arange(4000) / 200
    q, v, a = (0.1 * f for f in (np.sin(2 * t), 2 * np.cos(2 * t), -4 * np.sin(2 * t)))
    wave = 2 * np.pi * 0.6
    needed = 5 * (1 + 0.1 * np.cos(wave * q)) * a - 2.5 * 0.1 * wave * np.sin(wave * q) * v**2
    noise = 0.05 * np.random.default_rng(1).standard_normal(len(t))  # in which a whole number fits as well
    prepared = prepare([Recording("r", {"t": t, "tau": needed + 2 * np.sign(v) + 3 * v + noise, "q": q})], 20.0)
    card = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0), motion="linear")
    problem = Problem(card, prepared, (np.abs(prepared.stacked("v")) > 0.01).astype(float), 0.005)
    start = InertiaVariation(relative_amplitude=0.05, cycles_per_rev=0.7)
    grown = problem.fit(replace(card, effects=(start,)), 12)
    found = in_cycles(problem, grown).mount.effects[-1]
    assert isinstance(found, InertiaVariation)
    assert found.cycles_per_rev != 1.0


@pytest.mark.parametrize(
    ("true", "motion", "found_at"), [(6.0, "rotary", 6.0), (6.4, "rotary", 6.4), (6.08, "linear", 6.08 / (2 * np.pi))]
)
def test_waves_of_a_ripple_have_whole_cycles_together_which_one_alone_had_not(
    true: float, motion: Any, found_at: float
) -> None:
    """On part of a turn a wave that stands in for its double has other cycles."""
    t = np.arange(4000) / 200
    tones = [(0.35, 0.9, 1.0), (0.05, 3.1, 2.0)]
    q = 0.1 + sum((a * np.sin(w * t + p) for a, w, p in tones), np.zeros_like(t))
    v = sum(a * w * np.cos(w * t + p) for a, w, p in tones)
    acceleration = sum(-a * w**2 * np.sin(w * t + p) for a, w, p in tones)
    ripple = 1.0 * np.cos(true * q - 2.8) + 0.4 * np.cos(2 * true * q + 2.4)
    noise = 0.05 * np.random.default_rng(3).standard_normal(len(t))
    tau = 5 * acceleration + 2 * np.sign(v) + 3 * v + ripple + noise
    prepared = prepare([Recording("r", {"t": t, "tau": tau, "q": q})], 20.0)
    turn = 2 * np.pi if motion == "linear" else 1.0
    card = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0), motion=motion)
    problem = Problem(card, prepared, (np.abs(prepared.stacked("v")) > 0.02).astype(float), 0.005)
    drawn = max(true, 6.08) / turn
    waves = [Cogging(cycles_per_rev=k * drawn, amplitude=0.4, phase=p) for k, p in ((1, -2.5), (2, 2.0))]
    found = in_whole_cycles(problem, problem.fit(replace(card, effects=tuple(waves)), 24), 2)
    cycles = [wave.cycles_per_rev for wave in found.mount.effects if isinstance(wave, Cogging)]
    assert cycles == [found_at, 2 * found_at]


def test_grease_is_found_to_thin_where_a_drag_had_taken_its_place() -> None:
    card = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0))
    prepared = prepare([warmed("cold", 8.0, 0.0), warmed("warm", 16.0, 2.0)], 20.0)
    weight = (np.abs(prepared.stacked("v")) > 0.02).astype(float)
    problem, start = Problem(card, prepared, weight, 0.005), ThermalViscosity(viscous_per_degC=-0.3)
    drag = Mount(name="axis", axis=card.axis, friction=card.friction, effects=(QuadraticDrag(coefficient=6.0), start))
    lost = with_values(drag, ("friction.sigma2",), np.array([1e-3]))
    stuck = fit(lost, prepared.pieces, weight, evaluations=12)  # held to where it starts, not to the card
    assert stuck.parameters()["friction.sigma2"] < 0.3
    found = hypothesis_of(start).tuned(problem, stuck, start, lambda one: -problem.error(one)).parameters()
    assert found["thermal_viscosity.viscous_per_degC"] == pytest.approx(-0.04, rel=0.05)
    assert found["friction.sigma2"] == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize(("second", "turns"), [(0.6, 6.0), (0.0, 12.0)])
def test_a_disc_is_found_at_its_own_turns_though_its_error_twice_a_turn_is_larger(second: float, turns: float) -> None:
    t = np.arange(8000) / 200
    q, v, a = (0.8 * f for f in (np.sin(t), np.cos(t), -np.sin(t)))
    once, twice = 6 * q + 0.4, 2 * (6 * q + 0.4)
    error = 2e-3 * (np.sin(once) + 0.6 * np.sin(twice)) if second else 1.2e-3 * np.sin(twice)
    noise = 0.01 * np.random.default_rng(2).standard_normal(len(t))
    read = {"t": t, "tau": 5 * a + 2 * np.sign(v) + 3 * v + noise, "q": q + error}
    prepared = prepare([Recording("r", read)], 20.0)
    card = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0))
    problem = Problem(card, prepared, (np.abs(prepared.stacked("v")) > 0.05).astype(float), 0.005)
    start = EncoderEccentricity(cycles_per_rev=12.0, amplitude_rad=1e-3, phase=0.8)
    began = problem.fit(replace(card, effects=(start,)), 12)
    tuned = hypothesis_of(start).tuned(problem, began, start, lambda fit: 1e3 * (1 - problem.error(fit)))
    found = tuned.mount.effects[-1]
    assert isinstance(found, EncoderEccentricity)
    assert found.cycles_per_rev == turns
    assert found.second == pytest.approx(second, abs=0.05)
    assert found.amplitude_rad == pytest.approx(2e-3 if second else 1.2e-3, rel=0.1)


# A disc of half the turns whose error twice a turn is that of the disc that was found.


def problem(middle: float, motion: str) -> Any:
    """What the search knows: where the axis was, and whether it turns."""
    prepared = SimpleNamespace(ranges={"q": (middle - 0.5, middle + 0.5)})
    return SimpleNamespace(mount=SimpleNamespace(motion=motion), prepared=prepared)


def twice_a_turn(disc: EncoderEccentricity, angle: np.ndarray) -> np.ndarray:
    """The second harmonic of a disc's error, as its docstring has it, at an angle in rad (a place in m times 2 pi)."""
    return np.asarray(disc.second * disc.amplitude_rad * np.sin(2 * (disc.cycles_per_rev * angle + disc.phase)))


@pytest.mark.parametrize("motion", ["rotary", "linear"])
@pytest.mark.parametrize("phase", [0.0, 0.8, -2.5])
@pytest.mark.parametrize("cycles", [12.0, 13.0])
def test_the_error_twice_a_turn_of_half_the_turns_is_the_error_that_was_found(
    motion: str, phase: float, cycles: float
) -> None:
    """In the middle of what was visited, and everywhere where the turns can be halved."""
    disc = EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=3e-4, phase=phase)
    middle = 0.7
    found = halved(problem(middle, motion), disc)
    angle = (2 * np.pi if motion == "linear" else 1.0) * np.linspace(middle - 0.3, middle + 0.3, 61)
    error = disc.amplitude_rad * np.sin(cycles * angle + phase)
    whole = motion == "linear" or cycles % 2 == 0
    assert len(found) == 2
    for one in found:
        got = twice_a_turn(one, angle)
        np.testing.assert_allclose(got if whole else got[30], error if whole else error[30], rtol=0, atol=1e-12)


def test_an_axis_that_turns_has_whole_turns_and_at_least_one() -> None:
    for cycles, turns in ((1.0, 1.0), (5.0, 2.0), (7.0, 4.0), (12.0, 6.0)):
        disc = EncoderEccentricity(cycles_per_rev=cycles, amplitude_rad=3e-4)
        assert {one.cycles_per_rev for one in halved(problem(0.0, "rotary"), disc)} == {turns}
        assert {one.cycles_per_rev for one in halved(problem(0.0, "linear"), disc)} == {cycles / 2}


# A play with a stiff contact is found from afar: the grid that looks for it gets finer as its averages get shorter.

CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 1.0\n', "card.toml")
WIDE = Backlash(gap_rad=5e-3, load_share=0.4, load_friction=0.4)
NARROW = Backlash(gap_rad=1e-3, load_share=0.4, load_friction=0.2)
PLAYS = pytest.mark.parametrize("play", [WIDE, NARROW])


def recorded(play: Backlash, seed: int) -> Recording:
    """Two slow tones, and what the axis needs for them with a play behind it, 100 Hz of band."""
    t, rng = np.arange(15000) / 1000, np.random.default_rng(seed)
    q = 0.3 * np.sin(1.5 * (t + seed)) + 0.03 * np.sin(5 * (t + seed))
    (piece,) = prepare([Recording("still", {"t": t, "tau": t, "q": q})], 450.0).pieces
    tau = Inverse(replace(CARD.plant(), effects=(play,)), ()).torque(piece, np.zeros(0))[0]
    return Recording(f"run_{seed}", {"t": piece.t, "q": piece.q, "tau": tau + 0.02 * rng.standard_normal(len(tau))})


@cache
def compared(play: Backlash) -> tuple[Comparison, Fit]:
    problem = _problem([recorded(play, seed) for seed in (1, 2)], CARD)
    base = problem.fit(problem.mount, 40)
    return Comparison.of(problem, base, POLICY), base


def likeliest(play: Backlash) -> Backlash:
    comparison, base = compared(play)
    looked = [one for one in comparison.screen(base) if one.candidate.effect == "backlash"]
    best = max(looked, key=lambda one: one.evidence)
    start = best.candidate.start(best.coefficients)
    assert isinstance(start, Backlash)
    return start


@PLAYS
def test_from_there_a_fit_ends_at_the_truth(play: Backlash) -> None:
    comparison, base = compared(play)
    found = refitted(comparison, base, likeliest(play), 1)
    assert isinstance(found.effect, Backlash)
    assert found.effect.gap_rad == pytest.approx(play.gap_rad, rel=0.01)
    assert found.effect.load_share == pytest.approx(play.load_share, rel=0.05)
    assert found.evidence > 1000
    assert all_pass(admission(comparison, found))


# A drive that saturates is found where it acts: in few rows of one recording, at a knee far below the command.

Array = np.ndarray
SLOPE = 0.4


def motion(size: float, phase: float) -> tuple[Array, Array, Array, Array]:
    """Time, position, speed and acceleration of 20 s at 500 Hz."""
    t = np.arange(10_000) / 500
    return t, *swing(t, [(0.5 * size, 0.11, phase), (0.1 * size, 0.37, 1.0 + phase), (0.02 * size, 0.9, 2.0)])


def saturated(knee: float, sizes: tuple[float, float]) -> tuple[Comparison, Fit]:
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
    return Comparison.of(problem, base, POLICY), base


def found(comparison: Comparison, base: Fit) -> CandidateFit:
    """The refitted structure with the saturation that screening proposes."""
    worth = starts(comparison.screen(base), POLICY)
    fits = [refitted(comparison, base, one, many) for one, many in worth if isinstance(one, TorqueSaturation)]
    return max(fits, key=lambda one: one.evidence)


@pytest.mark.parametrize("knee", [5.6, 7.0])
def test_a_knee_that_one_recording_alone_reaches_is_tried_and_is_real(knee: float) -> None:
    comparison, base = saturated(knee, (0.5, 1.2))
    one = found(comparison, base)
    assert all_pass(admission(comparison, one))
    assert one.evidence > POLICY.clear
    assert isinstance(one.effect, TorqueSaturation)
    assert one.effect.knee_torque == pytest.approx(knee, rel=0.03)
    assert one.effect.slope == pytest.approx(SLOPE, rel=0.03)


def test_a_knee_is_found_far_below_the_command_that_it_swells() -> None:
    comparison, base = saturated(3.5, (1.0, 1.0))
    one = found(comparison, base)
    assert 0.4 * np.quantile(np.abs(comparison.problem.prepared.stacked("tau")), 0.98) > 3.5
    assert isinstance(one.effect, TorqueSaturation)
    assert one.effect.knee_torque == pytest.approx(3.5, rel=0.03)
