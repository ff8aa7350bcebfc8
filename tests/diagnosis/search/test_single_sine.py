"""On one sine a weight is an inertia with the other sign: errors, bounds and sets of a diagnosis know it."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from wandering import swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Finding
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.measure.bounds import not_found
from cosim.diagnosis.search.admissibility import needs_turns
from cosim.diagnosis.search.sizes import standard_errors
from cosim.diagnosis.search.stages import margin, refitted
from cosim.estimation.blocks import Blocks
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Prepared, prepare
from cosim.estimation.problem import Problem
from pyfmi_models.card import parse_card
from pyfmi_models.effects import Cogging, Effect, GravityUnbalance, LocalFriction, PeriodicFriction, TorqueOffset
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.inertia_variation import InertiaVariation
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import Coulomb, LuGre
from pyfmi_models.mount import Axis, Mount

CARD = parse_card('[mount]\ninertia = 2.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 3.0\n', "card.toml")
INERTIA, SLOW, FAST = 2.0, 1.5, 4.0


class Stroke(NamedTuple):
    """Amplitude [rad] of a sine, and what of it another, faster one has."""

    size: float
    more: float = 0.0


def recorded(stroke: Stroke, mgl: float, seed: int) -> Recording:
    t = np.arange(3000) / 100
    q, v, a = swing(t, [(stroke.size, SLOW, seed), (stroke.more * stroke.size, FAST, seed)], per=1)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(len(t))
    tau = INERTIA * a + np.sign(v) + 3 * v + mgl * np.sin(q) + noise
    return Recording(f"run_{seed}", {"t": t, "q": q, "tau": tau})


def problem(stroke: Stroke, mgl: float = 1.0) -> Problem:
    return _problem([recorded(stroke, mgl, seed) for seed in (1, 2)], CARD)


def compared(stroke: Stroke, mgl: float = 1.0) -> tuple[Comparison, Fit]:
    this = problem(stroke, mgl)
    base = this.fit(this.mount, 25)
    return Comparison.of(this, base, POLICY), base


def errors_of(stroke: Stroke) -> tuple[dict[str, float], dict[str, float]]:
    """Numbers and standard errors of inertia and weight, fitted together."""
    this = problem(stroke)
    found = this.fit(replace(this.mount, effects=(GravityUnbalance(mgl=0.3, phase=0.3),)), 40)
    return found.parameters(), standard_errors(found, Blocks.of(this.prepared), this.weight)


@pytest.mark.parametrize("size", [0.1, 0.3])
def test_errors_of_inertia_and_weight_are_large_on_one_sine_and_small_on_two(size: float) -> None:
    (values, errors), (_, fewer) = errors_of(Stroke(size)), errors_of(Stroke(size, 0.15))
    for name, true in (("axis.inertia", INERTIA), ("gravity_unbalance.mgl", 1.0)):
        assert errors[name] > 50 * fewer[name]
        assert abs(values[name] - true) < 1.96 * errors[name]
    assert errors["friction.Fc"] < 2 * fewer["friction.Fc"], "what is not collinear is told as well"


def gravity(stroke: Stroke, mgl: float) -> tuple[Finding, Fit]:
    """What is said of a weight that the base could take for less inertia."""
    comparison, base = compared(stroke, mgl)
    return next(one for one in not_found(comparison, base, [], 0.0) if one.effect == "gravity_unbalance"), base


def test_a_weight_that_the_inertia_took_is_not_testable_on_a_short_sine() -> None:
    one, base = gravity(Stroke(0.1), 1.0)
    assert base.mount.axis.inertia == pytest.approx(INERTIA - 1.0 / SLOW**2, rel=0.02)
    assert (one.answer, one.evidence) == ("not_testable", "these recordings do not excite it")
    assert one.action == "record at least half a turn, slowly, with stops"


def test_the_bound_on_a_longer_sine_is_larger_than_the_weight_that_the_inertia_took() -> None:
    one, base = gravity(Stroke(0.3), 3.0)
    assert base.mount.axis.inertia < 0.5 * INERTIA
    assert one.answer == "not_seen"
    assert one.visible_from is not None
    assert one.visible_from > 3.0


@pytest.mark.parametrize(("stroke", "together"), [(Stroke(0.8), True), (Stroke(0.8, 0.15), False)])
def test_a_weight_and_an_inertia_over_position_stand_in_one_set_on_one_sine_only(
    stroke: Stroke, together: bool
) -> None:
    comparison, base = compared(stroke)
    weight = refitted(comparison, base, GravityUnbalance(mgl=0.5, phase=0.1), 1)
    varying = refitted(comparison, base, InertiaVariation(relative_amplitude=0.1, cycles_per_rev=1.0, phase=3.0), 1)
    assert weight.evidence > POLICY.clear
    assert weight.plain_gain > POLICY.considerable
    behind = float(margin(comparison, weight, varying))
    assert behind < POLICY.fair if together else behind > POLICY.fair


# What recordings cannot tell: friction, where motion goes one way; a tone, where each recording is a few rows.

Array = npt.NDArray[np.float64]
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=1.0))
T = np.arange(20_000) / 1000


def moved(q: Array) -> Prepared:
    return prepare([Recording("r", {"t": T, "q": q, "tau": np.sign(np.gradient(q))})], 10.0)


ONE_WAY = moved(0.6 * T + 0.03 * np.sin(30 * T))
BACKWARDS = moved(-0.6 * T)
SWING = moved(1.5 * np.sin(0.9 * T))


@pytest.mark.parametrize(
    "effect",
    [
        Presliding(sigma0=20.0),
        PeriodicFriction(cycles_per_rev=14.0, relative_amplitude=0.3),
        Backlash(gap_rad=0.2),
        Backlash(gap_rad=1e-4, load_deflection=0.09),
    ],
)
def test_what_needs_a_turn_is_not_believed_where_motion_goes_one_way(effect: Effect) -> None:
    assert needs_turns(effect, MOUNT, ONE_WAY)
    assert needs_turns(effect, MOUNT, BACKWARDS)
    assert not needs_turns(effect, MOUNT, SWING)


def test_a_contact_stiff_enough_to_slide_on_the_way_back_may_be_believed() -> None:
    assert not needs_turns(Presliding(sigma0=100.0), MOUNT, ONE_WAY)
    assert needs_turns(Presliding(sigma0=100.0), replace(MOUNT, friction=Coulomb(Fc=10.0)), ONE_WAY)


@pytest.mark.parametrize("effect", [Cogging(cycles_per_rev=14.0, amplitude=0.1), TorqueOffset(torque=0.1)])
def test_a_torque_over_position_needs_no_turn(effect: Effect) -> None:
    assert not needs_turns(effect, MOUNT, ONE_WAY)


@pytest.mark.parametrize(("width", "is_one"), [(1e-5, False), (5e-3, True)])
def test_a_spot_across_which_the_contact_bends_is_a_place_where_the_axis_rested(width: float, is_one: bool) -> None:
    spot = LocalFriction(q_center=0.3, width=width, relative_amplitude=0.4)
    bristle = replace(MOUNT, friction=LuGre(sigma0=1e4, sigma1=50.0, sigma2=0.0, Fc=1.0, Fs=1.0, Vs=0.01))
    assert hypothesis_of(spot).shows(spot, bristle, SWING) is is_one
