"""From which lag on two clocks are said and withhold names, and from which factor on a unit is refused."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from learned_cases import FC, MOUNT, NOISE, Array, night
from wandering import axis, swing

from cosim.data.recording import Recording
from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.trust.changes import changes
from cosim.diagnosis.trust.clocks import ClockOffset
from cosim.diagnosis.trust.doubts import beyond_denial, without_denied
from cosim.diagnosis.trust.explanations import Explanation, explanations
from cosim.diagnosis.trust.judgement import Judgement, stated
from cosim.diagnosis.trust.likelihood import Evidence, Reference
from cosim.estimation.prepare import prepare
from cosim.support.errors import RecordingError
from cosim.support.units import conversion
from pyfmi_models.card import parse_card
from pyfmi_models.effects import Delay, Effect, TorqueOffset
from pyfmi_models.effects.clock_skew import ClockSkew

# Milliseconds: a lag, what is not excluded from and to; the share that it removes, and the least of a recording.
# Lags are tried in steps of 2 ms from -60 to 60; a recording that a lag makes worse denies it.
NOT_LATE = [(8, 8, 12), (10, 6, 14), (40, 30, 60), (12, -2, 26), (24, 20, 28, 0.19, 0.19), (24, 20, 28, 0.90, -0.26)]
LATE = [(10, 8, 12), (-10, -12, -8), (16, 16, 20), (18, 14, 22), (24, 20, 28, 0.20, 0.20), (24, 20, 28, 0.69, 0.69)]
TOO_LATE = [(18, 16, 20), (-18, -20, -16), (40, 30, 58), (24, 20, 28, 0.70, 0.70), (24, 20, 28, 0.90, -0.24)]


@pytest.mark.parametrize("offset", [*NOT_LATE, *LATE, *TOO_LATE])
def test_a_lag_is_late_from_ten_milliseconds_and_no_drives_from_eighteen(offset: tuple[float, ...]) -> None:
    found = ClockOffset(*(one * 1e-3 for one in offset[:3]), *offset[3:])
    assert (found.is_late, found.is_too_late) == (offset not in NOT_LATE, offset in TOO_LATE)


def judgement(
    factor: float, probability: float, kind: Any = "position_scale", option: str = "--units q=x"
) -> Judgement:
    """One explanation beside "right", of which the recording is a plain sine."""
    t = np.arange(4000) / 200
    v = np.sin(1.7 * t) + 0.5 * np.sin(4.1 * t)
    run = Recording("run", {"t": t, "q": np.cumsum(v) / 200, "tau": np.gradient(v, t) + 0.5 * np.sign(v)})
    right = Explanation(kind=None, what="recording and card are right", prior=1.0, is_slip=False)
    wrong = Explanation(kind=kind, what='"q" is in x', prior=0.1, factor=factor, option=option)
    evidence = Evidence([run], Reference(1.0, 0.5))
    return Judgement((run,), evidence, (right, wrong), (1 - probability, probability))


# Factor and probability of a slip of position, or of another kind that an option puts right, or none does.
STATED = [(9.9, 0.99), (1 / 9.9, 0.99), (57.3, 0.89), (1e3, 0.89)]
STATED += [(1e3, 0.99, "torque_scale", "--units tau=mN.m"), (1e3, 0.99, "position_scale", "")]
REFUSED = [(10.1, 0.91), (1 / 10.1, 0.91), (57.3, 0.91), (1e3, 0.99, "time_unit", "--units t=ms")]


@pytest.mark.parametrize("slip", [*STATED, *REFUSED])
def test_a_scale_of_position_or_time_is_refused_if_wrong_by_more_than_ten_surely_and_an_option_puts_it_right(slip):
    kind, option = slip[2:] or ("position_scale", "--units q=x")
    if slip in REFUSED:
        with pytest.raises(RecordingError, match=f"Use {option}"):
            stated(judgement(*slip))
    else:
        said = stated(judgement(*slip))
        assert (said.finding, option in said.statement) == (kind, True)


@pytest.mark.parametrize(
    ("probability", "blocks", "alone", "told"),
    [
        pytest.param(0.96, True, True, 2, id="sure: the cause is stated alone"),
        pytest.param(0.94, True, False, 2, id="not sure"),
        pytest.param(0.51, True, False, 2, id="a slip that is likelier than not withholds names"),
        pytest.param(0.49, False, False, 2, id="less likely than not"),
        pytest.param(0.031, False, True, 2, id="an alternative of three percent is listed"),
        pytest.param(0.029, False, True, 1, id="none below"),
    ],
)
def test_a_cause_is_said_by_how_sure_it_is(probability: float, blocks: bool, alone: bool, told: int) -> None:
    said = stated(judgement(2.0, probability))
    assert (said.blocks_naming, "Either" not in said.statement, len(said.alternatives)) == (blocks, alone, told)


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("reading", ["q", "v"])
def test_a_unit_that_is_tried_is_that_of_its_name_and_the_option_puts_it_right(linear: bool, reading: str) -> None:
    """What was read counts so many of the unit where SI counts one; `--units` takes it back."""
    si = {"t": "s", "tau": "N" if linear else "N.m"}
    si |= {"q": "m", "v": "m/s"} if linear else {"q": "rad", "v": "rad/s"}
    tried = [one for one in explanations(linear, reading) if one.option]
    assert {one.option.split()[1].split("=")[0] for one in tried} == {"t", "tau", reading}
    for one in tried:
        column, unit = one.option.removeprefix("--units ").split("=")
        factor = {"t": one.time, "tau": one.torque}.get(column, one.position)
        assert factor == one.factor
        assert conversion(unit, si[column])[0] * factor == pytest.approx(1.0, rel=1e-12)
        assert (one.time, one.torque, one.position).count(1.0) == 2


@pytest.mark.parametrize(("linear", "gears"), [(False, 3 * 27), (True, 0)])
def test_a_gear_from_3_to_300_is_tried_before_position_torque_or_both(linear: bool, gears: int) -> None:
    found = [one for one in explanations(linear, "q") if one.kind == "gear_ratio"]
    assert len(found) == gears
    ratios = sorted({one.factor for one in found})
    steps = np.diff(np.log(ratios))
    assert not gears or (ratios[0], ratios[-1], steps.max() < 0.3) == (3.0, 300.0, True)
    for one in found:
        assert (one.torque, one.position) in {(1.0, one.factor), (1 / one.factor, one.factor), (1 / one.factor, 1.0)}


# A lag between the clocks that the model with its effects denies is not said, and withholds no name.

CLOCKS = Sanity(finding="clocks", statement="late", blocks_naming=True)
SIGN = Sanity(finding="torque_sign", statement="turned", blocks_naming=True)


LATE_BY_20, OFFSET = Delay(delay_ms=20.0), TorqueOffset(torque=20.0)
LAGS = [((LATE_BY_20,), ()), ((ClockSkew(offset_ms=-20.0, drift_ppm=0.0),), ()), ((), (LATE_BY_20, 3.0))]
NONE = [((), ()), ((OFFSET,), ()), ((Delay(delay_ms=2.0),), ())]
NONE += [((), (LATE_BY_20, -1.0)), ((), (OFFSET, 50.0))]


@pytest.mark.parametrize(("chosen", "beside"), [*LAGS, *NONE])
def test_a_lag_stays_where_the_model_wants_one(chosen: tuple[Effect, ...], beside: Any) -> None:
    """In the model, or beside it with its evidence."""

    def fitted(*effects: Effect) -> Any:
        return SimpleNamespace(mount=axis(effects=effects))

    fit = fitted(*beside[:1], OFFSET)
    tried = [SimpleNamespace(effect=beside[0], fit=fit, evidence=beside[1])] if beside else []
    left = without_denied((CLOCKS, SIGN), fitted(*chosen), SimpleNamespace(tried=tuple(tried)))
    assert left == ((CLOCKS, SIGN) if (chosen, beside) in LAGS else (SIGN,))


def test_what_no_model_settles_is_never_left_out() -> None:
    assert beyond_denial((SIGN, CLOCKS, SIGN)) == (SIGN, SIGN)


CARD = parse_card(
    '[mount]\nname = "axis"\ninertia = 0.66\n[friction]\nmodel = "coulomb"\nFc = 1.0\nsigma2 = 0.25\n', "a"
)


def shaken(seed: int, late: float, shake: float) -> Recording:
    """An axis on a ground that shakes at 7.3 Hz, where its loop no longer holds it; the position `late` [s]."""
    t = np.arange(3_000) / 250
    w = 2 * np.pi * 7.3
    tones = [(0.5, 0.7 + 0.1 * seed, 0.0), (0.2, 1.9, seed), (0.08, 5.3, 2 * seed), (0.006 * shake, w, 0.9)]
    q, v, a = swing(t, tones, per=1)
    ground = 0.25 * shake * np.sin(w * t + 1.4)
    noise = 0.03 * np.random.default_rng(seed).standard_normal(len(t))
    tau = 0.6 * a + 1.1 * np.tanh(v / 2e-4) + 0.3 * v + ground + noise
    rows = round(250 * late)
    read = np.concatenate([np.repeat(q[:1], rows), q[: len(q) - rows]])
    return Recording(f"run{seed}", {"t": t, "tau": tau, "q": read, "q_d": swing(t, tones[:3], per=1)[0]})


@pytest.mark.parametrize(("late", "shake"), [(0.0, 1.0), (0.028, 0.0)])
def test_a_ground_that_shakes_is_no_clock_and_two_clocks_stay_two(late: float, shake: float) -> None:
    found = diagnose([shaken(1, late, shake), shaken(2, late, shake)], [shaken(3, late, shake)], CARD).diagnosis
    assert ("clocks" in [one.finding for one in found.sanity]) is (late > 0)
    assert ("unknown" in found.verdict) is (late > 0)


# A change in the middle of a recording is told with time and size; what changes slowly or with the motion is none.


AFTER = 25.0


def said(more: Array, now: dict[str, Array], seed: int = 1) -> list[str]:
    """What is said of an axis whose torque holds something more."""
    noise = np.random.default_rng(seed).normal(0, NOISE, len(now["t"]))
    tau = 5.0 * now["a"] + FC * np.tanh(now["v"] / 1e-3) + now["v"] + more + noise
    prepared = prepare([Recording("run", {"t": now["t"], "q": now["q"], "tau": tau})], 10.0)
    return [one.statement for one in changes((prepared,), MOUNT)]


@pytest.mark.parametrize(
    ("words", "load"),
    [
        ("a constant torque of 0.8 N·m more", lambda now: 0.8),
        ("a constant torque of 0.8 N·m less", lambda now: -0.8),
        ("a friction level of 0.6 N·m more", lambda now: 0.6 * np.tanh(now["v"] / 1e-3)),
        ("an inertia of 2 kg·m² more", lambda now: 2.0 * now["a"]),
        ("a weight of 4 N·m more", lambda now: 4.0 * np.sin(now["q"] + 0.3)),
    ],
)
def test_what_comes_at_a_time_is_told_with_time_and_size(words: str, load) -> None:
    now = night(1)
    (text,) = said((now["t"] >= AFTER) * load(now), now)
    assert words.split(" of ")[0] in text
    assert float(text.split(" of ")[1].split()[0]) == pytest.approx(float(words.split(" of ")[1].split()[0]), rel=0.1)
    assert float(text.split("t = ")[1].split()[0]) == pytest.approx(AFTER, abs=0.5)
    assert words.split()[-1] in text


def test_what_is_there_all_the_time_changes_slowly_or_is_small_beside_the_rest_is_no_change_at_a_time() -> None:
    now = night(2)
    t, level = now["t"], np.tanh(now["v"] / 1e-3)
    for more in (0 * t, 0.8 + 0 * t, 4.0 * np.sin(now["q"]), 0.8 * np.exp(-t / 15), 0.6 * level * t / 60, 0.5 * level):
        assert said(more, now) == []
    now = night(4)
    assert said(0.4 * (now["t"] >= AFTER) + 0.6 * np.sin(9.1 * now["t"] + 3 * np.sin(0.9 * now["t"])), now) == []


def test_a_law_that_is_off_over_speed_is_no_change_where_the_motion_gets_faster() -> None:
    t = night(3)["t"]
    faster = t >= AFTER
    time = np.where(faster, 6 * t - 5 * AFTER, t)
    now = {"t": t, "q": 0.4 * np.sin(0.7 * time) + 0.1 * np.sin(1.9 * time)}
    now["v"] = np.gradient(now["q"], now["t"])
    now["a"] = np.gradient(now["v"], now["t"])
    assert np.abs(now["v"][faster]).max() > 2 * np.abs(now["v"][~faster]).max()
    for more in (1.5 * now["v"] * np.abs(now["v"]), -3.0 * np.tanh(now["v"] / 0.3)):
        assert said(more, now) == []
