"""Constants of the policy where they act, in numbers that do not move with them: half or twice the value fails here."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from problems import compared, problem_of
from scipy.signal import lfilter
from wandering import axis, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.candidates import columns_of
from cosim.diagnosis.evidence.bands import Bands
from cosim.diagnosis.evidence.comparison import NONE
from cosim.diagnosis.evidence.discrepancy import discrepancy
from cosim.diagnosis.search.admissibility import standard_errors, tells
from cosim.diagnosis.search.stages import is_full, with_harmonics
from cosim.estimation.blocks import Blocks
from cosim.estimation.prepare import Prepared, prepare
from cosim.estimation.problem import Problem
from cosim.estimation.row_weights import weights
from cosim.support.statistics import Z95
from pyfmi_models.card import parse_card
from pyfmi_models.effects import Cogging, GravityUnbalance, TorqueOffset
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.quadratic_drag import QuadraticDrag

MOUNT = axis()
RIPPLE = Cogging(amplitude=0.3, cycles_per_rev=20.0)


def rippled(seconds: float, second_wave: float = 0.0, noise: float = 0.002, seed: int = 1) -> Recording:
    """An axis with a ripple that has a second wave of some size."""
    t = np.arange(int(500 * seconds)) / 500
    q, v, a = swing(t, [(0.5, 0.7, 1.0 + seed), (0.1, 2.3, 2.0), (0.02, 5.7, 0.5)], per=1)
    extra = 0.3 * np.cos(20 * q) + second_wave * np.cos(40 * q)
    tau = 5 * a + 2 * np.sign(v) + v + extra + noise * np.random.default_rng(seed).standard_normal(len(t))
    return recorded(tau, t, q, f"run_{seed}")


def bands(prepared: Prepared) -> Bands:
    rows = np.ones(len(prepared.recording_of))
    return Bands.of(prepared, rows, rows, POLICY)


def test_of_the_rows_of_a_band_four_hundred_count_at_most_and_of_as_many_half() -> None:
    short, long = (bands(prepare([rippled(seconds)], 20.0)) for seconds in (10.0, 200.0))
    for one in (short, long):
        assert one.effective == pytest.approx(one.count * 400 / (400 + one.count), rel=1e-9)
    assert short.effective[0] > 0.9 * short.count[0], "few rows are all new"
    assert 350 < long.effective[-1] < 400 < long.count[-1] / 5


def test_no_model_of_a_torque_is_better_than_a_thousandth_of_it() -> None:
    prepared = prepare([rippled(20.0, noise=0.0)], 20.0)
    own = bands(prepared)
    torque = own.grams(own.transform(prepared.stacked("tau")[:, None]))[:, 0, 0] / own.count
    assert np.sqrt(own.least_noise(prepared, 0.0, POLICY) / torque) == pytest.approx(1e-3, rel=0.01)


def test_a_level_wanders_as_a_process_does_that_forgets_itself_in_ten_seconds() -> None:
    """Cosine k of T seconds turns by w = pi k / T a second; of such a process it has a share 1 / (1 + (10 w)^2)."""
    prepared = prepare([rippled(10 * np.pi)], 20.0)
    found = discrepancy(MOUNT, prepared, POLICY)
    (group,) = (one for one in found.groups if one.name == "wander")
    constant, *waves = found.columns[0, list(group.columns)]
    w = np.pi * np.arange(1, 5) / np.ptp(prepared.stacked("t"))
    assert (np.array(waves) / constant) ** 2 == pytest.approx(1 / (1 + (10 * w) ** 2), rel=1e-6)


@pytest.mark.parametrize(("second_wave", "told"), [(0.2, True), (0.0, False)])
def test_a_size_is_told_that_stands_out_of_its_error(second_wave: float, told: bool) -> None:
    runs = (rippled(20.0, second_wave, noise=0.05, seed=seed) for seed in (1, 2))
    problem = problem_of(MOUNT, *runs, sample=0.002)
    waves = RIPPLE, replace(RIPPLE, amplitude=0.01, cycles_per_rev=40.0)
    found = problem.fit(replace(MOUNT, effects=waves), 30)
    assert tells(problem, found, found.mount.effects[0])
    assert tells(problem, found, found.mount.effects[1]) is told


@pytest.mark.parametrize(("second_wave", "between", "waves"), [(1.05e-3, (5.0, 10.0), 1), (1.18e-3, (10.0, 20.0), 2)])
def test_a_further_wave_of_a_ripple_is_taken_from_ten_nats_on(
    second_wave: float, between: tuple[float, float], waves: int
) -> None:
    comparison, _ = compared(problem_of(MOUNT, rippled(20.0, second_wave), sample=0.002), 15)
    problem = comparison.problem
    found = problem.fit(replace(MOUNT, effects=(RIPPLE,)), 15)
    second: Any = [hypothesis_of(RIPPLE).multiple(RIPPLE, 2)]
    columns = columns_of(found.mount, second, problem.prepared, found.values)
    assert between[0] < comparison.score(found, second, columns)[0].evidence < between[1]
    assert len(with_harmonics(comparison, found, found.mount.effects[-1]).mount.effects) == waves


def test_each_phase_that_a_recording_has_of_its_own_costs_half_the_logarithm_of_ten() -> None:
    problem = problem_of(MOUNT, *(rippled(10.0, seed=seed) for seed in (1, 2, 3)), sample=0.002)
    comparison, base = compared(problem, 15)
    found = problem.fit(replace(MOUNT, effects=(PeriodicDisturbance(frequency_hz=3.0, amplitude=0.1),)), 10)
    assert found.phases == 3
    paid = comparison._marginal(found, NONE).log_likelihood - comparison.evidence(found)
    assert paid == pytest.approx(3 * np.log(10) / 2, rel=0.01)
    assert comparison._marginal(base, NONE).log_likelihood == comparison.evidence(base)


@pytest.mark.parametrize(("kinds", "full"), [(6, False), (7, True)])
def test_six_different_effects_may_be_named_and_no_seventh(kinds: int, full: bool) -> None:
    effects = tuple(SimpleNamespace(id=f"effect_{number}") for number in range(kinds))
    one: Any = SimpleNamespace(fit=SimpleNamespace(mount=SimpleNamespace(effects=("the card's", *effects))))
    card: Any = SimpleNamespace(problem=SimpleNamespace(mount=SimpleNamespace(effects=("the card's",))), policy=POLICY)
    assert is_full(one, card) is full


# The 95 % ranges of a diagnosis hold: over many seeded machines with coloured noise they cover what is true.

HERTZ, SECONDS, MACHINES = 100, 60.0, 20
CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0\n', "c.toml")
TRUE = {
    "axis.inertia": 2.1,
    "friction.Fc": 1.1,
    "friction.sigma2": 2.8,
    "gravity_unbalance.mgl": 0.6,
    "gravity_unbalance.phase": 0.7,
    "torque_offset.torque": -0.2,
    "quadratic_drag.coefficient": 0.4,
}


def coloured(rng: np.random.Generator, name: str, seconds: float = SECONDS) -> Recording:
    """A motion of two tones and the torque of the true machine, with noise that forgets itself in 0.3 s."""
    t = np.arange(int(seconds * HERTZ)) / HERTZ
    tones = ((0.8, 0.15, 0.25), (0.15, 0.4, 0.6))
    q, v, a = swing(t, [(size, rng.uniform(low, high), rng.uniform(0, 2 * np.pi)) for size, low, high in tones])
    keep = np.exp(-1 / HERTZ / 0.3)
    noise = 0.05 * lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(t.size))
    friction = 1.1 * np.sign(v) + 2.8 * v + 0.4 * v * np.abs(v)
    return Recording(name, {"t": t, "tau": 2.1 * a + friction + 0.6 * np.sin(q + 0.7) - 0.2 + noise, "q": q})


def test_ranges_of_95_per_cent_hold_what_is_true_in_95_per_cent() -> None:
    """Of 140 ranges 133 should; errors half as large would hold 95, errors twice as large all."""
    effects = (GravityUnbalance(mgl=0.5, phase=0.5), TorqueOffset(torque=0.1), QuadraticDrag(coefficient=0.1))
    inside = []
    for seed in range(MACHINES):
        rng = np.random.default_rng([seed, 15])
        train = [coloured(rng, name) for name in ("one", "two")]
        prepared = prepare(train, 20.0)
        problem = Problem(CARD.plant(), prepared, weights(CARD.friction, prepared), 1 / HERTZ)
        found = problem.fit(replace(CARD.plant(), effects=effects), 25)
        errors = standard_errors(found, Blocks.of(prepared), problem.weight)
        assert set(errors) == set(TRUE) == set(found.free)
        inside += [abs(value - TRUE[name]) < Z95 * errors[name] for name, value in found.parameters().items()]
    assert len(inside) == 7 * MACHINES
    assert 0.91 < np.mean(inside) < 0.99
