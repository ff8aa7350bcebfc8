"""What one piece of evidence about a recording may say, and no more."""

from dataclasses import replace

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.trust.balance import Balance
from cosim.diagnosis.trust.explanations import RIGHT
from cosim.diagnosis.trust.judgement import Judgement, judged
from cosim.diagnosis.trust.likelihood import Reference


def waving(share: float, order: float = 0.5) -> Recording:
    """Twelve turns of 1 kg m2 and 4 N m with a wave over the position, `share` of the friction, and noise."""
    t = np.arange(0, 40, 0.01)
    q = 37 * np.sin(0.35 * t) + 0.8 * np.sin(1.9 * t)
    v, a = (np.gradient(np.gradient(q, t) if k else q, t) for k in (0, 1))
    noise = 0.02 * np.random.default_rng(0).standard_normal(len(t))
    tau = a + 4 * np.tanh(v / 0.01) + 0.1 * v + 4 * share * np.sin(order * q) + noise
    return Recording("run", {"t": t, "q": q, "tau": tau})


@pytest.mark.parametrize(("share", "least", "most"), [(0.0, -1.0, 0.1), (0.04, 0.1, 0.3), (0.5, 5.9, 6.0)])
def test_only_a_wave_beyond_what_physics_may_leave_is_gravity_of_another_order(
    share: float, least: float, most: float
) -> None:
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
    v = 0.5 * np.sin(0.9 * t) + 0.2 * np.sin(3.1 * t)
    a, q = np.gradient(v, t), np.cumsum(v) / 100
    long = Balance([Recording("long", {"t": t, "q": q, "tau": 2 * a + 1.2 * np.sign(v) + 3 * v})]).solution(1.0)
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
def test_where_speed_position_and_time_contradict_the_card_says_which_is_wrong(
    wrong: dict[str, float], finding: str, blocks: bool, option: str
) -> None:
    (said,) = judged([beside_speed(**wrong)], [], Reference(1.0, 4.0))
    assert said.finding == finding
    assert said.blocks_naming == blocks
    assert option in said.alternatives[0].what


def test_a_period_that_somebody_stated_is_doubted_before_the_speed_of_the_machine() -> None:
    """Nothing else tells them: the card was estimated from the same recording."""
    read, unknown = beside_speed(t=2.0), Reference(4.0, 4.0, is_of_recordings=True)
    counted = replace(read, origin={"period": "20ms"})
    (by_file,), (by_hand,) = (judged([one], [], unknown) for one in (read, counted))
    assert [one.what.split()[0] for one in by_file.alternatives][:2] == ['"v"', "time"]
    assert [one.what.split()[0] for one in by_hand.alternatives][:2] == ["time", '"v"']
    assert not by_hand.blocks_naming, "what acts is the same, whatever its size"


def test_where_no_card_knows_all_three_are_named() -> None:
    """A card that was estimated from the same recording has the same fault."""
    (said,) = judged([beside_speed(t=2.0)], [], Reference(4.0, 4.0, is_of_recordings=True))
    assert [one.what.split()[0] for one in said.alternatives] == ['"v"', "time", '"q"']
    assert not said.blocks_naming
    assert judged([beside_speed()], [], Reference(9.0, 4.0, is_of_recordings=True)) == ()
