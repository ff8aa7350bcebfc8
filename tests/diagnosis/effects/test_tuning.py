"""What a start knows only roughly of an effect is found by further fits."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from problems import compared, problem_of
from wandering import axis, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.encoder_eccentricity import halved
from cosim.diagnosis.effects.tuning import in_cycles, in_whole_cycles
from cosim.diagnosis.search.stages import admission, refitted, starts
from cosim.estimation.fit import fit, with_values
from pyfmi_models.effects import Cogging
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.inertia_variation import InertiaVariation
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
def test_waves_of_a_ripple_have_whole_cycles_together_which_one_alone_had_not(
    true: float, motion: Any, found_at: float
) -> None:
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
def test_the_error_twice_a_turn_of_half_the_turns_is_the_error_that_was_found(
    motion: str, phase: float, cycles: float
) -> None:
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
