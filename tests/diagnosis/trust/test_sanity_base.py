"""The base that leaves its card, the encoder's step and the missing set point are said, and only where they matter."""

from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from wandering import axis, recorded, swing

from cosim.data.recording import Recording
from cosim.diagnosis.trust.admission import check_recordings
from cosim.diagnosis.trust.balance import Balance
from cosim.diagnosis.trust.doubts import base_far_from_card, load_far_from_card
from cosim.diagnosis.trust.explanations import RIGHT
from cosim.diagnosis.trust.judgement import Judgement, judged
from cosim.diagnosis.trust.likelihood import Reference
from cosim.diagnosis.trust.limits import encoder_step, little_motion, no_set_point
from cosim.estimation.fit import edges_of
from cosim.estimation.prepare import prepare
from cosim.support.errors import RecordingError
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.friction import Coulomb
from pyfmi_models.model import Pair
from pyfmi_models.mount import Mount


def run(step: float = 0.0, name: str = "run") -> Recording:
    t = np.arange(10_000) / 500
    q = 0.2 * np.sin(0.7 * t) + 0.1 * np.sin(2.3 * t)
    q = np.round(q / step) * step if step else q
    return Recording(name, {"t": t, "tau": 2 * np.sign(np.cos(0.7 * t)), "q": q})


BOUNDS = edges_of(axis(), prepare([run()], 20.0).pieces)


def friction(Fc: Any = 2.0, sigma2: float = 1.0) -> Mount:
    return replace(axis(), friction=Coulomb(Fc=Fc, sigma2=sigma2))


@pytest.mark.parametrize(
    ("card", "refitted", "words"),
    [
        *((axis(), replace(friction(2 * f, f), axis=axis(5 * f).axis), "") for f in (0.5, 0.9, 2.5)),
        (axis(), axis(50.0), "Refitted, the inertia is 10 times the card's (5 → 50 kg·m²)"),
        (axis(), axis(0.5), "Refitted, the inertia is 10 times smaller than the card's (5 → 0.5 kg·m²)"),
        (axis(), friction(0.0, 6.0), "Coulomb friction ends at a bound of the fit (2 → 0 N·m)"),
        (friction(sigma2=0.01), friction(sigma2=0.0), ""),  # it is not felt
        (friction(Pair(2.0, 2.0)), friction(Pair(2.0, 9.0)), "the Coulomb friction backward is 4.5 times the card's"),
    ],
)
def test_a_base_that_leaves_its_card_is_said_with_both_numbers(card: Mount, refitted: Mount, words: str) -> None:
    found = [one.statement for one in base_far_from_card(card, refitted, BOUNDS, 0.5)]
    assert bool(found) is bool(words)
    assert words in "".join(found)


def test_a_coarse_encoder_is_said_with_what_it_limits_and_one_that_spoils_no_torque_is_not() -> None:
    assert encoder_step([run(0.0)], axis(0.1), 30.0) == encoder_step([run(1e-7)], axis(0.1), 30.0) == ()
    (one,) = encoder_step([run(), run(3e-3, "coarse")], axis(0.1), 8.0)
    assert one.finding == "encoder_step"
    assert "The encoder of coarse counts in steps of 3 mrad: the analysis ends at 8 Hz" in one.statement
    assert "a play below about 6 mrad cannot be seen" in one.statement
    assert not one.blocks_naming


def test_a_missing_set_point_is_said_with_what_it_costs() -> None:
    asked = replace(run(name="asked"), table=run().table | {"q_d": run()["q"]})
    assert no_set_point([asked]) == ()
    (one,) = no_set_point([asked, run(name="blind")])
    assert one.statement.startswith("blind: no set point (q_d) was recorded.")
    assert "delay from a lag" in one.statement
    assert "nothing is validated in closed loop" in one.statement


@pytest.mark.parametrize(("hertz", "still", "told"), [(0.1, 0.0, False), (4.0, 0.0, True), (0.1, 0.97, True)])
def test_hardly_any_motion_away_from_turns_is_said(hertz: float, still: float, told: bool) -> None:
    """A shake at the band's own edge turns all the time; an axis that rests turns with its noise."""
    t = np.arange(10_000) / 500
    q = np.where(t < (1 - still) * t[-1], np.sin(2 * np.pi * hertz * t) / hertz, 0.0)
    noise = np.random.default_rng(1).standard_normal(len(t))
    recording = Recording("run", {"t": t, "tau": noise, "q": q + 1e-6 * noise})
    found = little_motion(prepare([recording], 8.0))
    assert bool(found) is told
    assert all("run: only" in one.statement and not one.blocks_naming for one in found)


def loaded(mgl: float, phase: float) -> Mount:
    return axis(effects=(GravityUnbalance(mgl=mgl, phase=phase),) if mgl else ())


@pytest.mark.parametrize(
    ("mgl", "phase", "turn", "is_another"),
    [
        (0.0, 0.0, 1.0, False),
        (4.2, 0.1, 1.0, False),
        (5.5, 0.1, 1.0, False),  # a payload that was weighed badly
        (2.2, -1.5, 1.0, True),  # 5 N·m hang on the axis beside the card's 4
        (9.0, 0.0, 1.0, True),
        (4.0, 3.1, 1.0, True),
        (8.0, 1.047, 0.05, False),  # pulls differently only where the axis was not
    ],
)
def test_a_load_that_is_another_one_is_said(mgl: float, phase: float, turn: float, is_another: bool) -> None:
    positions = 1.5708 + np.linspace(-3, 3, 200) * turn if turn < 1 else np.linspace(-1.5, 0.2, 200)
    said = load_far_from_card(loaded(4.0 if mgl else 0.0, 0.0), loaded(mgl, phase), positions)
    assert [one.finding for one in said] == ["base_far_from_card"] * is_another
    assert all(f"4 N·m at 0° → {mgl:.3g} N·m" in one.statement for one in said)


def swung(seconds: float, hertz: float = 0.2, rate: float = 200.0, size: float = 1.0, name: str = "swung") -> Recording:
    """A motion to and fro; of size 0 it rests away from zero."""
    t = np.arange(round(seconds * rate) + 1) / rate
    return Recording(name, {"t": t, "tau": np.sin(t), "q": 0.3 + size * np.sin(2 * np.pi * hertz * t)})


def spun(seconds: float, speed: float) -> Recording:
    """An axis of which only the speed was read."""
    t = np.arange(round(seconds * 200) + 1) / 200
    return Recording("spun", {"t": t, "tau": np.sin(t), "v": np.full(len(t), speed)})


GOOD = swung(10.0)


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (swung(10.0, size=0.0, name="still"), "still: q never moves, so there is nothing to diagnose"),
        (spun(10.0, 0.0), "spun: v never moves"),
        (swung(1.9, name="short"), "short: only 1.9 s long; a recording needs 2 s"),
    ],
)
def test_what_rests_or_is_short_is_refused_by_its_name(bad: Recording, says: str) -> None:
    for train, heldout in (([GOOD], [bad]), ([GOOD, bad], [GOOD])):
        with pytest.raises(RecordingError, match=says):
            check_recordings(train, heldout)


SWUNG = swung(4.0, hertz=0.6)  # 2.4 cycles
ENOUGH = [[swung(8.0)], [swung(4.0), swung(4.0)], [spun(8.0, 1.0)], [SWUNG], [swung(4.0, hertz=0.6, rate=130.0)]]
# A constant speed has no cycles; 120 rows a second are 480.
TOO_LITTLE = [[swung(7.9)], [spun(7.9, 1.0)], [swung(4.0, hertz=0.4)], [swung(3.9, hertz=0.6)]]
TOO_LITTLE += [[swung(4.0, hertz=0.6, rate=120.0)]]


@pytest.mark.parametrize("train", [*ENOUGH, *TOO_LITTLE])
def test_what_is_fitted_is_eight_seconds_or_four_with_two_cycles_in_500_rows(train: list[Recording]) -> None:
    refused = pytest.raises(RecordingError, match="8 s, or 4 s with 2 cycles in 500 rows")
    with refused if any(train is one for one in TOO_LITTLE) else nullcontext():
        check_recordings(train, [swung(2.0, hertz=2.0)])


# What one piece of evidence about a recording may say, and no more.


def waving(share: float, order: float = 0.5) -> Recording:
    """Twelve turns of 1 kg m2 and 4 N m with a wave over the position, `share` of the friction, and noise."""
    t = np.arange(0, 40, 0.01)
    q = 37 * np.sin(0.35 * t) + 0.8 * np.sin(1.9 * t)
    v, a = (np.gradient(np.gradient(q, t) if k else q, t) for k in (0, 1))
    noise = 0.02 * np.random.default_rng(0).standard_normal(len(t))
    tau = a + 4 * np.tanh(v / 0.01) + 0.1 * v + 4 * share * np.sin(order * q) + noise
    return Recording("run", {"t": t, "q": q, "tau": tau})


@pytest.mark.parametrize(("share", "least", "most"), [(0.0, -1.0, 0.1), (0.04, 0.1, 0.3), (0.5, 5.9, 6.0)])
def test_only_a_wave_beyond_what_physics_may_leave_is_gravity_of_another_order(share, least, most):
    evidence = Judgement.of([waving(share)], Reference(1.0, 4.0)).evidence
    assert least <= evidence._gravity(evidence.balance(1.0), 0.5) <= most


def test_the_sign_of_the_torque_tells_of_the_sign_alone() -> None:
    """Both signs together are no less likely than either, and none is gained by a balance that is surer of it."""
    evidence = Judgement.of([waving(0.0)], Reference(1.0, 4.0)).evidence
    sure = evidence.of(RIGHT)
    for sign in (3.0, 12.0):
        with pytest.MonkeyPatch.context() as patch:
            solution = replace(evidence.balance(1.0).solution(1.0), sign=sign)
            patch.setattr(Balance, "solution", lambda _, order, one=solution: one)
            assert evidence.of(RIGHT) == pytest.approx(sure, abs=0.05)
            flipped = evidence.of(replace(RIGHT, torque=-1.0))
            assert flipped < evidence.of(RIGHT) - sign + 0.1


def stroke(seed: int) -> Recording:
    """One stroke of 1.5 s in 20 s of rest, 2 kg m2 with 1.2 N m and 3 N m s/rad."""
    t, rng = np.arange(2000) / 100, np.random.default_rng(seed)
    x = np.clip((t - 2) / 1.5, 0, 1)
    sine, cosine, rate = np.sin(np.pi * x), np.cos(np.pi * x), np.pi / 1.5
    v, a = 1.2 * rate * sine**3 * cosine, 1.2 * rate**2 * (3 * sine**2 * cosine**2 - sine**4)
    v, a = (np.where((x > 0) & (x < 1), one, 0.0) for one in (v, a))
    tau = 2 * a + 1.2 * np.sign(v) + 3 * v + 0.05 * rng.standard_normal(len(t))
    return Recording(f"stroke_{seed}", {"t": t, "q": 0.3 * sine**4, "tau": tau})


def test_of_numbers_that_are_not_told_no_residual_tells_the_sign() -> None:
    short = Balance([stroke(1), stroke(2)]).solution(1.0)
    assert abs(short.inertia.value) < 3 * short.inertia.error
    assert abs(short.sign) < 5
    t = np.arange(6000) / 100
    q, v, a = swing(t, [(0.5 / 0.9, 0.9, 0.0), (0.2 / 3.1, 3.1, 0.0)], per=1)
    long = Balance([recorded(2 * a + 1.2 * np.sign(v) + 3 * v, t, q)]).solution(1.0)
    assert long.sign > 15


def beside_speed(t: float = 1.0, q: float = 1.0, v: float = 1.0) -> Recording:
    """The recording above with its speed, and columns that are so many times too large."""
    true = waving(0.0)
    speed = np.gradient(true["q"], true.t)
    return Recording("run", {"t": t * true.t, "q": q * true["q"], "tau": true["tau"], "v": v * speed})


@pytest.mark.parametrize(
    ("wrong", "finding", "blocks", "option"),
    [
        ({"v": 2.0}, "speed_scale", False, ""),
        ({"v": 5 / 3}, "speed_scale", False, ""),
        ({"t": 2.0}, "time_unit", True, "t=0.5 s"),
        ({"q": 0.4}, "position_scale", True, "q=2.5 rad"),
    ],
)
def test_where_speed_position_and_time_contradict_the_card_says_which_is_wrong(wrong, finding, blocks, option):
    (said,) = judged([beside_speed(**wrong)], [], Reference(1.0, 4.0))
    assert said.finding == finding
    assert said.blocks_naming == blocks
    assert option in said.alternatives[0].what


def test_where_no_card_knows_all_three_are_named_first_a_period_that_somebody_stated() -> None:
    """A card that was estimated from the same recording has the same fault."""
    read, unknown = beside_speed(t=2.0), Reference(4.0, 4.0, is_of_recordings=True)
    counted = replace(read, origin={"period": "20ms"})
    (by_file,), (by_hand,) = (judged([one], [], unknown) for one in (read, counted))
    assert [one.what.split()[0] for one in by_file.alternatives] == ['"v"', "time", '"q"']
    assert [one.what.split()[0] for one in by_hand.alternatives][:2] == ["time", '"v"']
    assert not by_file.blocks_naming, "what acts is the same, whatever its size"
    assert not by_hand.blocks_naming
    assert judged([beside_speed()], [], Reference(9.0, 4.0, is_of_recordings=True)) == ()
