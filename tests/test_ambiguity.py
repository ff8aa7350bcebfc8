"""An effect that another becomes in a limit wins by its gain; what cannot be excluded stays in the set."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from cosim.diagnosis.challenge import CREDIBLE, Place
from cosim.diagnosis.evidence import Score
from cosim.diagnosis.findings import not_found
from cosim.diagnosis.fit import Fit
from cosim.diagnosis.meaning import is_another
from cosim.diagnosis.prepare import prepare
from cosim.diagnosis.problem import Problem
from cosim.diagnosis.result import is_special
from cosim.diagnosis.trial import Trial, clearly_worse, is_real, winner
from cosim.diagnosis.tuning import tuned
from cosim.recording import Recording
from pyfmi_models.effects import (
    ActuatorLag,
    Delay,
    Effect,
    FrictionAsymmetry,
    GravityUnbalance,
    StribeckEffect,
    TorqueOffset,
)
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.clock_skew import ClockSkew
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

Array = npt.NDArray[np.float64]
OFFSET, UNBALANCE = TorqueOffset(torque=1.0), GravityUnbalance(mgl=1.0, phase=1.5)
CABLE = CableWrap(stiffness=0.1, home=-0.5)
ASYMMETRY = FrictionAsymmetry(level_asymmetry=0.3)
MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=1.0))
NONE: Array = np.zeros(0)


def trial(effect: Effect, gain: float, parameters: int = 1) -> Trial:
    """A trial that removes the same share in each of twenty blocks: any difference of two is a clear one."""
    rows = np.full(20, 50.0)
    after = (1 - gain) * (1 + 1e-4 * np.sin(np.arange(20) * (1 + 10 * gain)))
    free = tuple(f"effect.{number}" for number in range(parameters))
    return Trial(effect, Fit(MOUNT, free, NONE, NONE, NONE, NONE), Score(np.ones(20), after, rows), gain, size=1.0)


@pytest.mark.parametrize("larger", [CABLE, UNBALANCE])
def test_an_offset_wins_over_what_becomes_one_in_a_limit_if_it_explains_nearly_as_much(larger: Effect) -> None:
    offset, other = trial(OFFSET, 0.88), trial(larger, 0.90, 2)
    assert clearly_worse(offset, other)
    best = winner([offset, other])
    assert best is offset
    assert winner([trial(OFFSET, 0.85), other]) is other


def test_an_offset_that_is_clearly_worse_loses_to_an_asymmetry_which_is_none_at_rest() -> None:
    other = trial(ASYMMETRY, 0.90, 2)
    assert winner([trial(OFFSET, 0.88), other]) is other


@pytest.mark.parametrize(("gain", "alike"), [(0.89, True), (0.70, False)])
def test_an_asymmetry_that_explains_no_more_than_the_offset_is_not_said_to_be_ruled_out(
    gain: float, alike: bool
) -> None:
    place = Place(OFFSET, trial(OFFSET, 0.89), (trial(ASYMMETRY, gain, 2),))
    assert place.ambiguous_with == ()
    assert bool(place.more_general) is alike


def test_an_asymmetry_that_foretells_more_than_an_offset_which_explains_as_much_is_in_the_set() -> None:
    better = replace(trial(ASYMMETRY, 0.89, 2), foretold=0.9)
    place = Place(OFFSET, replace(trial(OFFSET, 0.89), foretold=0.8), (better,))
    assert place.ambiguous_with == ("friction_asymmetry",)


def test_the_set_holds_an_unbalance_over_a_short_stroke_whichever_of_the_two_stands() -> None:
    offset, other = trial(OFFSET, 0.895), trial(UNBALANCE, 0.8951, 2)
    assert Place(OFFSET, offset, (other,)).ambiguous_with == ("gravity_unbalance",)
    assert Place(UNBALANCE, other, (trial(OFFSET, 0.84),)).ambiguous_with == ("torque_offset",)
    assert Place(UNBALANCE, other, (trial(OFFSET, 0.7),)).ambiguous_with == ()


def test_shares_of_an_effect_and_its_rivals_leave_the_rest_to_nothing_and_a_parameter_has_its_price() -> None:
    shares = Place(OFFSET, trial(OFFSET, 0.9), (trial(UNBALANCE, 0.9, 2),)).shares
    assert 0.99 < sum(shares.values()) < 1
    assert shares["torque_offset"] > 2 * shares["gravity_unbalance"]


def test_where_the_set_point_speaks_its_chi_squared_is_the_evidence() -> None:
    delay, lag = Delay(delay_ms=5.0), ActuatorLag(time_constant_ms=5.0)
    heard = {"delay": 10.0, "actuator_lag": 30.0, "none": 500.0}
    place = Place(delay, trial(delay, 0.6), (trial(lag, 0.8),), heard)
    assert place.better.effect is delay
    assert place.ambiguous_with == ()
    assert place.shares["actuator_lag"] == pytest.approx(np.exp(-10) * place.probability)


def test_a_credible_rival_is_in_the_set_even_if_it_is_a_little_worse_in_every_block() -> None:
    place = Place(UNBALANCE, trial(UNBALANCE, 0.9, 2), (trial(OFFSET, 0.87, 2), trial(CABLE, 0.5, 2)))
    assert clearly_worse(place.rivals[0], place.trial)
    assert place.shares["torque_offset"] > CREDIBLE > place.shares["cable_wrap"]
    assert place.ambiguous_with == ("torque_offset",)
    short = replace(trial(OFFSET, 0.7, 2), score=Score(np.ones(3), np.array([0.29, 0.3, 0.31]), np.full(3, 9.0)))
    other = replace(trial(UNBALANCE, 0.8, 2), score=Score(np.ones(3), np.array([0.19, 0.2, 0.21]), np.full(3, 9.0)))
    place = Place(UNBALANCE, other, (short,))
    assert place.shares["torque_offset"] > CREDIBLE
    assert place.ambiguous_with == ()


def test_the_most_probable_member_of_a_set_is_named_first() -> None:
    unbalance, offset = trial(UNBALANCE, 0.9, 3), trial(OFFSET, 0.9)
    assert Place(UNBALANCE, unbalance, (offset,)).favourite is offset
    assert Place(OFFSET, offset, (unbalance,)).favourite is offset


def test_calibrated_probabilities_of_a_set_add_up_to_one_at_most() -> None:
    place = Place(OFFSET, trial(OFFSET, 0.9), (trial(UNBALANCE, 0.9, 2),))
    assert set(place.probabilities) == {"torque_offset", "gravity_unbalance"}
    assert 0.9 < sum(place.probabilities.values()) <= 1


def test_what_foretells_every_recording_left_out_counts_where_whitened_evidence_is_too_little() -> None:
    slow = replace(trial(OFFSET, 0.01), foretold=0.4)
    assert slow.is_slow
    assert slow.gain == 0.4
    assert slow.log_odds > 3
    assert not replace(trial(OFFSET, 0.01), foretold=0.1).is_slow
    assert replace(trial(OFFSET, 0.5), foretold=0.4).gain == pytest.approx(0.5, abs=1e-3)


def problem(speed: Array, **columns: Array) -> Problem:
    t = np.arange(len(speed)) / 1000
    given = {"t": t, "tau": speed, "q": np.cumsum(speed) / 1000, **columns}
    prepared = prepare([Recording("r", given)], 10.0)
    return Problem(MOUNT, prepared, np.ones(len(prepared.recording_of)), 1e-3)


def test_a_clock_that_the_set_point_does_not_see_late_is_a_drive_whether_it_drifts_or_not() -> None:
    t = np.arange(40_000) / 1000
    q_d = np.sin(0.7 * t)
    in_time, late = (
        problem(0.7 * np.cos(0.7 * t), q_d=q_d),
        problem(0.7 * np.cos(0.7 * t), q_d=np.sin(0.7 * t + 3.5e-3)),
    )
    for clock in (ClockSkew(offset_ms=-5.0), ClockSkew(offset_ms=-4.0, drift_ppm=-50.0)):
        assert is_another(in_time, clock)
        assert not is_another(late, clock)
    assert is_another(late, Delay(delay_ms=5.0))
    assert not is_another(in_time, Delay(delay_ms=5.0))
    assert not is_another(in_time, ClockSkew(offset_ms=-0.5, drift_ppm=100.0))


def test_a_spring_that_no_card_may_hold_is_no_answer() -> None:
    swing = problem(np.sin(np.arange(20_000) / 1000))
    assert is_another(swing, Compliance(antiresonance_hz=30.0, resonance_hz=20.0))
    assert not is_another(swing, Compliance(antiresonance_hz=20.0, resonance_hz=30.0))


def test_a_cable_whose_home_is_many_strokes_away_is_an_offset() -> None:
    swing = problem(np.sin(np.arange(20_000) / 1000))  # from 0 to 2 rad
    assert not is_another(swing, CableWrap(stiffness=0.1, home=-1.5))
    assert is_another(swing, CableWrap(stiffness=0.1, home=-3.0))
    assert is_another(swing, CableWrap(stiffness=0.1, home=5.0))


def test_noise_at_constant_speed_tells_no_delay_unless_a_set_point_asks_for_it() -> None:
    late = trial(Delay(delay_ms=5.0), 0.5)
    steady = 1 + 0.02 * np.random.default_rng(1).standard_normal(20_000)
    for found, told in ((problem(steady), False), (problem(steady, q_d=np.arange(20_000) / 1000), True)):
        rest = np.zeros(len(found.prepared.recording_of))
        explained = Trial(late.effect, Fit(MOUNT, (), NONE, NONE, NONE, rest), late.score, 0.5, size=1.0)
        assert is_real(found, explained) is told


def test_how_a_cable_hardens_is_fitted_as_its_grid_knows_it_only_roughly() -> None:
    t = np.arange(40_000) / 1000
    q, v = 1.5 * np.sin(0.9 * t), 1.35 * np.cos(0.9 * t)
    tau = -0.81 * 5 * q + np.sign(v) + 2 * (q - 0.2) * (1 + 0.3 * (q - 0.2) ** 2)
    this = problem(v, tau=tau, q=q)
    rough = replace(MOUNT, effects=(CableWrap(stiffness=1.0, home=0.0, hardening=4 / 9),))
    found = tuned(this, this.fit(rough, 12), rough.effects[0]).mount.effects[-1]
    assert isinstance(found, CableWrap)
    assert float(found.hardening) == pytest.approx(0.3, rel=0.05)
    assert float(found.home) == pytest.approx(0.2, rel=0.05)


def steady(speeds: list[float], torque: Callable[[float], float]) -> Problem:
    """One recording a speed."""
    t = np.arange(300) / 100
    signals = [{"t": t, "q": v * t, "tau": np.full(300, torque(v))} for v in speeds]
    prepared = prepare([Recording(f"r{number}", one) for number, one in enumerate(signals)], 10.0)
    return Problem(MOUNT, prepared, np.ones(len(prepared.recording_of)), 1e-2)


def test_a_stribeck_curve_is_found_from_a_start_narrower_than_the_gap_between_the_speeds() -> None:
    speeds = [side * v for v in (0.1, 3.0, 6.0, 9.0, 12.0, 15.0, 18.0, 21.0) for side in (1, -1)]
    this = steady(speeds, lambda v: float(np.sign(v) * (1 + 0.2 * np.exp(-abs(v) / 5)) + 0.02 * v))
    narrow = StribeckEffect(Fs=1.2, Vs=0.1)
    found = tuned(this, this.fit(replace(MOUNT, effects=(narrow,)), 12), narrow).mount.effects[-1]
    assert isinstance(found, StribeckEffect)
    assert float(found.Vs) == pytest.approx(5, rel=0.01)
    assert float(found.Fs) == pytest.approx(1.2, rel=0.01)


def test_of_an_asymmetry_that_looks_like_the_offset_found_it_is_said_that_it_does() -> None:
    t = np.arange(0, 20, 0.01)
    v = np.cos(2 * t) + 0.5 * np.cos(0.7 * t)
    q = np.sin(2 * t) / 2 + np.sin(0.7 * t) / 1.4
    one = {"t": t, "q": q, "tau": np.sign(v) + 0.2 + 5 * np.gradient(v, t)}
    prepared = prepare([Recording("r", one)], 10.0)
    weight = np.ones(len(prepared.recording_of))
    found = Problem(MOUNT, prepared, weight, 1e-2).fit(replace(MOUNT, effects=(OFFSET,)), 5)
    absent = {finding.effect: finding for finding in not_found(found, prepared, weight, {}, ["torque_offset"])}
    assert absent["friction_asymmetry"].answer == "not_testable"
    assert "torque offset" in absent["friction_asymmetry"].evidence


def test_only_a_special_case_of_all_its_rivals_goes_into_a_model_beside_them() -> None:
    assert is_special("torque_offset", ("friction_asymmetry",))
    assert not is_special("torque_offset", ("friction_asymmetry", "gravity_unbalance"))
    assert not is_special("friction_asymmetry", ("torque_offset",))
