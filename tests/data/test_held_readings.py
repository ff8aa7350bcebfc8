"""Readings that are repeated, false or rounded: noticed, and analysed as what they are."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wandering import swing

from cosim.data.held import held_columns, notes, rows_held
from cosim.data.own_rate import _mean, as_analysed, at_own_rate
from cosim.data.recording import Recording
from cosim.data.resolution import resolution
from cosim.data.single_readings import cleaned
from cosim.data.start_up import settled
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.trust.doubts import single_readings
from cosim.estimation.prepare import prepare
from cosim_studies.proof.generator import make_case
from pyfmi_models.card import parse_card

Array = npt.NDArray[np.float64]
LINES = ((0.11, 0.3), (0.27, 0.12), (0.63, 0.036))
CARD = '[mount]\ninertia = 30.0\n[friction]\nmodel = "coulomb"\nFc = 2.5\nsigma2 = 30.0\n'


def axis(seed: int, seconds: float = 30.0, rate: float = 1000.0) -> Recording:
    """An axis with Coulomb and viscous friction on a multisine, as the card says; torque 0.02 N m of noise."""
    random = np.random.default_rng(seed)
    t, phases = np.arange(int(seconds * rate)) / rate, random.uniform(0, 6, len(LINES))
    q, v, a = swing(t, [(size, f, p) for (f, size), p in zip(LINES, phases, strict=True)])
    tau = 30 * a + 2.5 * np.tanh(v / 1e-3) + 30 * v + random.normal(0, 0.02, len(t))
    return Recording(f"run{seed}", {"t": t, "tau": tau, "q": q + random.normal(0, 1e-7, len(t)), "q_d": q})


def held(values: Array, rows: float, first: int = 0) -> Array:
    """The same values, new every so many rows from the first of them on."""
    k = np.arange(len(values)) - first
    return np.asarray(values[np.maximum(np.ceil(np.floor(k / rows + 1e-9) * rows - 1e-9) + first, 0).astype(int)])


def with_held(recording: Recording, **rows: tuple[float, int]) -> Recording:
    return replace(recording, table=recording.table | {n: held(recording[n], *one) for n, one in rows.items()})


@settings(max_examples=40, deadline=None)
@given(
    rows=st.sampled_from([2, 2.5, 3, 5, 7.5, 10, 20, 33.3, 100]),
    first=st.integers(0, 19),
    count=st.sampled_from([0, 1e-4]),
)
def test_a_held_column_is_noticed_with_its_interval(rows: float, first: int, count: float) -> None:
    q = axis(1)["q"]
    q = count * np.round(q / count) if count else q
    assert rows_held(held(q, rows, first)) == pytest.approx(rows, rel=0.01)


@pytest.mark.parametrize("step", [1e-5, 1e-4, 1e-3, 1e-2])
def test_a_coarse_encoder_a_set_point_with_corners_and_a_torque_in_steps_are_not_held(step: float) -> None:
    q, t, random = axis(1)["q"], np.arange(30_000) / 1000, np.random.default_rng(5)
    table = {name: step * np.round(x / step) for name, x in (("q", q), ("steady", 0.0729 * t))}
    table["noisy"] = step * np.round((q + random.normal(0, step, len(q))) / step)
    table |= {"tau": np.repeat(random.normal(size=40), 750), "q_d": np.sign(np.sin(2 * np.pi * 0.25 * t))}
    assert held_columns({"t": t} | table) == {}


def test_reading_says_what_is_held_however_late_it_comes_now_and_then_and_what_holds_nothing_stays() -> None:
    whole = with_held(axis(1), tau=(20, 0), q=(10, 3))
    said = Recording.of(whole.table, "run").notes
    assert said == notes("run", whole.table)
    assert said[0].startswith("run: tau is new every 20 ms, while rows come every 1 ms")
    assert said[1].startswith("run: q is new every 10 ms")
    whole = Recording.of(axis(1).table, "run")
    assert whole.notes == ()
    assert at_own_rate(whole) is whole
    random, q = np.random.default_rng(4), axis(1)["q"]
    new = np.maximum.accumulate(np.arange(0, len(q), 20) + random.integers(-2, 4, len(q) // 20))
    rows = np.searchsorted(new, np.arange(len(q)), "right") - 1
    assert rows_held(q[np.maximum(new[np.maximum(rows, 0)], 0)]) == pytest.approx(20, rel=0.02)


def test_its_own_rate_has_new_readings_themselves_the_mean_torque_between_or_a_slow_one_when_new() -> None:
    whole = axis(1)
    slow = at_own_rate(with_held(whole, q=(10, 3)))
    assert slow.sample_time == pytest.approx(0.01)
    rows = np.rint(slow.t * 1000).astype(int)
    assert np.all(rows % 10 == 3)
    np.testing.assert_array_equal(slow["q"], whole["q"][rows])
    middle = rows[5] + np.arange(-4, 5)
    expected = (whole["tau"][middle].sum() + (whole["tau"][rows[5] - 5] + whole["tau"][rows[5] + 5]) / 2) / 10
    assert slow["tau"][5] == pytest.approx(expected, rel=1e-9)
    slower = at_own_rate(with_held(whole, tau=(20, 7), q=(10, 0)))
    rows = np.rint(slower.t * 1000).astype(int)
    np.testing.assert_array_equal(slower["tau"], whole["tau"][rows])  # and not half an interval late
    np.testing.assert_allclose(slower["q"], whole["q"][rows], atol=3e-6)


def test_the_mean_at_the_ends_is_that_of_the_part_of_its_interval_that_was_recorded() -> None:
    """A reading holds around its time, the first from half a row before it on: of 10 ms there are 5.5 at the ends."""
    t = np.arange(1001) / 1000
    for spike, place in ((0, 0), (1000, -1)):
        torque = np.where(np.arange(1001) == spike, 11.0, 0.0)
        found = _mean(t, torque, np.arange(0, 1.001, 0.01), 0.01)
        assert found[place] == pytest.approx(11.0 / 5.5)
        assert np.count_nonzero(np.abs(found) > 1e-9) == 1


def test_gaps_stay_gaps_and_rests_are_readings_at_their_own_rate() -> None:
    one = axis(1)
    kept, rest = (one.t < 10) | (one.t > 12.5), (one.t > 20) & (one.t < 25)
    table = one.table | {"q": held(np.where(rest, 0.1, one["q"]), 10)}
    slow = at_own_rate(replace(one, table={name: column[kept] for name, column in table.items()}))
    (gap,) = slow.gaps
    assert (gap.start, gap.end) == (pytest.approx(10, abs=0.03), pytest.approx(12.5, abs=0.03))
    assert len(slow) == pytest.approx(2750, abs=2)


def test_nothing_is_named_because_readings_are_held() -> None:
    runs = [with_held(axis(seed, 12.0), tau=(20.0, 0), q=(10.0, 0)) for seed in (1, 2)]
    found = diagnose(runs[:1], runs[1:], parse_card(CARD, "card.toml")).diagnosis
    assert found.verdict == ()
    assert "encoder_step" not in [one.finding for one in found.sanity]


# The step of an encoder is found where readings are rounded, and nowhere else.

T = np.arange(20_000) / 1000


def wave(period: float, t: Array = T) -> Array:
    """Ramps up and down between 0 and 1."""
    return np.abs((t / period) % 2 - 1)


def multisine(t: Array = T, phase: float = 0.0) -> Array:
    return swing(t, [(size, f, phase * f) for f, size in LINES])[0]


def strokes() -> Array:
    """Constant accelerations and constant speeds, integrated exactly."""
    one = np.concatenate([np.full(200, 1.0), np.zeros(600), np.full(200, -1.0), np.zeros(500)])
    speed = np.cumsum(np.tile(np.concatenate([one, -one]), 6)) / 1000
    return np.cumsum(speed) / 1000


def steady_speeds() -> Array:
    """A friction test: speeds that are multiples of each other, up and down, read to 1e-7 rad."""
    speeds = np.repeat([0.05, -0.05, 0.1, -0.1, 0.2, -0.2, 0.4, -0.4], 2500)
    return np.cumsum(speeds) / 1000 + np.random.default_rng(1).normal(0, 1e-7, len(speeds))


MOTIONS: dict[str, Callable[[], Array]] = {
    "ramp": lambda: 0.1 * T,
    "sidereal rate": lambda: 0.0729 * T,
    "another steady rate": lambda: 0.313 * T,
    "ramp of a whole turn a second": lambda: 2 * np.pi * T,
    "ramps that turn": lambda: wave(1.0),
    "fast ramps that turn": lambda: wave(0.013),
    "sum of a ramp and ramps that turn": lambda: 0.1 * T + 0.3 * wave(3.0),
    "sum of ramps that turn": lambda: 0.1 * wave(1.0) + 0.21 * wave(0.7),
    "steady speeds": steady_speeds,
    "strokes": strokes,
    "parabolas": lambda: np.sign(T % 2 - 1) * (T % 2 - 1) ** 2,
    "sine of 1 Hz": lambda: np.sin(2 * np.pi * T),
    "sine of 5 Hz": lambda: np.sin(2 * np.pi * 5 * T),
    "several sines": multisine,
    "several sines and noise": lambda: multisine() + np.random.default_rng(2).normal(0, 1e-5, len(T)),
    "steady speed, held for 20 ms": lambda: 57 * np.floor(T / 0.02) * 0.02,
    "ramps that turn, held for 10 ms": lambda: wave(2.0, np.floor(T / 0.01 + 1e-9) * 0.01),
    "several sines, held for 20 ms": lambda: multisine(np.floor(T / 0.02 + 1e-9) * 0.02),
    "nearly steady speed, held for 20 ms": lambda: (
        57 * (1 + 0.01 * np.sin(T[::20] / 3)).cumsum().repeat(20) * 0.02 + 1e-3 * wave(0.31, T[::20]).repeat(20)
    ),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_that_is_not_rounded_has_no_step(name: str) -> None:
    assert resolution(MOTIONS[name]()) == 0


@settings(max_examples=30, deadline=None)
@given(
    share=st.floats(1e-4, 3e-2),
    phase=st.floats(0, 6),
    noise=st.sampled_from([0.0, 1e-5, 1e-3]),
    unit=st.sampled_from([1.0, 1e-3, 57.2957795]),
)
def test_a_rounded_motion_has_its_step_whatever_its_size(share: float, phase: float, noise: float, unit: float) -> None:
    motion = multisine(phase=phase) + np.random.default_rng(3).normal(0, noise, len(T))
    step = share * float(np.ptp(motion))
    assert resolution(unit * step * np.round(motion / step)) == pytest.approx(unit * step, rel=1e-6)


@pytest.mark.parametrize("name", ["ramp", "sidereal rate", "ramps that turn", "strokes", "steady speeds"])
@pytest.mark.parametrize("share", [1e-3, 4e-3, 2e-2])
def test_a_rounded_ramp_has_its_step(name: str, share: float) -> None:
    """A telescope at sidereal rate counts almost as regularly as a held reading is refreshed."""
    motion = MOTIONS[name]()
    step = 1.234 * share * float(np.ptp(motion))
    assert resolution(step * np.round(motion / step)) == pytest.approx(step, rel=1e-6)


@pytest.mark.parametrize("count", [2e-6, 1e-3])
def test_a_single_count_at_rest_is_no_false_reading_and_one_far_away_is(count: float) -> None:
    """An axis that rests on a count, shows its neighbour now and then, and at last moves by many counts a row."""
    q = count * np.round(np.where(T < 16, 0.0, 1e5 * (T - 16) ** 2))
    for row, rows in ((700, 1), (4000, 2), (9000, 3), (15_000, 1)):
        q[row : row + rows] -= count
    table = {"t": T, "tau": multisine(phase=1.0), "q": q}
    assert cleaned(Recording("run", table)).notes == ()
    q[5000] = 0.5
    (note,) = cleaned(Recording("run", table)).notes
    assert "row 5,001" in note


# False readings are bridged, and a start in which a loop is switched on is left out; what a machine can do stays.

RATE = 500.0


def motion(step: float = 0.0, noise: float = 1e-6, rate: float = RATE) -> Recording:
    """A multisine of 20 s that friction and inertia answer; `step` [rad] of the encoder, `noise` [rad] rms."""
    t = np.arange(int(20 * rate)) / rate
    q, v, a = swing(t, [(0.2, 0.11, 0.0), (0.1, 0.37, 1.0), (0.03, 0.9, 2.0)])
    q = q + noise * np.random.default_rng(1).standard_normal(len(t))
    return Recording(
        "run", {"t": t, "tau": 5 * a + 2 * np.tanh(v / 1e-3) + v, "q": np.round(q / step) * step if step else q}
    )


def spoiled(recording: Recording, column: str, rows: slice, values: object) -> Recording:
    table = dict(recording.table)
    table[column] = table[column].copy()
    table[column][rows] = values
    return replace(recording, table=table)


@pytest.mark.parametrize("rate", [50.0, 1000.0])
@pytest.mark.parametrize("step", [0.0, 1e-5, 3e-3])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_clean_recording_is_returned_as_it_is(rate: float, step: float, noise: float) -> None:
    recording = motion(step, noise, rate)
    assert cleaned(recording) is recording


@pytest.mark.parametrize("effect", [[], ["backlash"], ["torque_saturation"]])
def test_a_generated_recording_with_stops_and_impacts_is_returned_as_it_is(effect: list[str]) -> None:
    case = make_case(11, effect, duration=20.0)
    for frame in (*case.train, case.heldout):
        recording = Recording("run", {name: frame[name].to_numpy(float) for name in frame.columns})
        assert cleaned(recording) is recording


@pytest.mark.parametrize("row", [0, 424, 9999])
@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("step", [0.0, 3e-3])
def test_a_false_position_is_bridged_to_within_the_encoder(row: int, rows: int, step: float) -> None:
    good = motion(step)
    if row + rows > len(good):
        rows = len(good) - row
    bad = spoiled(good, "q", slice(row, row + rows), -3.14)
    found = cleaned(bad)
    assert np.abs(found["q"] - good["q"]).max() < max(5e-5, 3 * step)
    assert found.masked == ((good.t[row], good.t[row + rows - 1]),)
    (said,) = single_readings([bad], [found])
    assert said.finding == "single_readings"
    assert f"q = -3.14 in row {row + 1:,}" in said.statement
    assert cleaned(found) is found


def test_nothing_is_judged_beside_a_false_reading_and_a_stale_one_in_fast_motion_is_false() -> None:
    found = cleaned(spoiled(motion(), "q", slice(5000, 5001), -3.14))
    (piece,) = prepare([found], 20.0).pieces
    out = piece.t[~piece.inside & (piece.t > 4) & (piece.t < 19)]
    assert out.min() == pytest.approx(10.0, abs=0.03)
    assert out.max() == pytest.approx(10.0, abs=0.03)
    good = motion(noise=1e-7)
    row = int(np.argmax(np.abs(np.diff(good["q"]))))
    stale = spoiled(good, "q", slice(row, row + 1), good["q"][row - 1])
    assert cleaned(stale).masked == ((good.t[row], good.t[row]),)


@pytest.mark.parametrize(("times", "is_false"), [(10, True), (2, False)])
def test_a_torque_that_no_drive_gives_is_bridged_and_a_kick_that_one_may_give_is_not(
    times: float, is_false: bool
) -> None:
    good = motion()
    reach = float(np.abs(good["tau"]).max())
    kicked = spoiled(good, "tau", slice(300, 301), times * reach)
    assert (cleaned(kicked) is not kicked) == is_false
    assert (np.abs(cleaned(kicked)["tau"] - good["tau"]).max() < 1e-3 * reach) == is_false


MACHINE = {
    "impact": lambda t, row: 0.5 * np.maximum(t - t[row], 0),
    "new zero": lambda t, row: 1.0 * (t > t[row]),
    "bump": lambda t, row: 0.01 * np.exp(-(((t - t[row]) / (4 / RATE)) ** 2)),
    "chatter": lambda t, row: 0.003 * np.sign(np.sin(2 * np.pi * 120 * t)) * (np.abs(t - t[row]) < 0.2),
    "flicker": lambda t, row: 1e-4 * (np.arange(len(t)) == row),
    "many false readings, none of them single": lambda t, row: -3.14 * (np.random.default_rng(2).random(len(t)) < 0.05),
}
"""What is added to a position."""


@pytest.mark.parametrize("what", MACHINE)
def test_what_a_machine_can_do_is_left(what: str) -> None:
    good = motion(1e-4, noise=1e-5)
    run = replace(good, table=good.table | {"q": good["q"] + MACHINE[what](good.t, 4000)})
    assert cleaned(run) is run


def test_a_diagnosis_leaves_them_out_before_anything_is_fitted() -> None:
    from cosim.diagnosis.diagnose import diagnose

    bad = spoiled(motion(rate=200.0), "q", slice(2000, 2001), -3.14)
    card = parse_card('[mount]\ninertia = 4.5\n[friction]\nmodel = "coulomb"\nFc = 1.8\nsigma2 = 1.1\n', "card.toml")
    found = diagnose([bad], [replace(bad, name="heldout")], card).diagnosis
    assert found.verdict == ()
    assert found.heldout.before_rms < 0.1, "a twentieth of the friction level; the false reading alone makes 1 N m"
    assert [one.finding for one in found.sanity][:2] == ["single_readings", "single_readings"]
    assert any("row 2,001" in note for note in found.data_quality)


# A start in which the torque alternates and moves nothing is left out; one that moves the axis, or a rough one, stays.

EACH = np.arange(100)
ALTERNATING, WAVE = (-1.0) ** EACH, np.sin(2 * np.pi * EACH / 100)


@pytest.mark.parametrize(
    ("start", "rows", "rate", "left_out"),
    [
        pytest.param(3.0 * ALTERNATING, 1000, 1000, 0, id="three times the largest torque after it"),
        pytest.param(3.1 * ALTERNATING, 1000, 1000, 100, id="more than three times"),
        pytest.param(9 * ALTERNATING + 0.42 * 9, 1000, 1000, 0, id="a push, by 71 % of its squares"),
        pytest.param(9 * ALTERNATING + 0.40 * 9, 1000, 1000, 100, id="a push by 69 %"),
        pytest.param(9 * (ALTERNATING + 1.84 * WAVE), 1000, 1000, 0, id="a move whose mean has 55 %"),
        pytest.param(9 * (ALTERNATING + 1.46 * WAVE), 1000, 1000, 100, id="one whose mean has 45 %"),
        pytest.param(9 * ALTERNATING[:8], 17, 80, 8, id="eight rows, less than half of all"),
        pytest.param(9 * ALTERNATING[:8], 16, 80, 0, id="half of all rows"),
        pytest.param(9 * ALTERNATING[:7], 100, 70, 0, id="too few rows"),
    ],
)
def test_a_start_that_alternates_and_moves_nothing_is_left_out(
    start: np.ndarray, rows: int, rate: float, left_out: int
) -> None:
    t = np.arange(rows) / rate
    tau = 2 * np.concatenate([start, (-1.0) ** np.arange(rows - len(start))])
    assert len(settled(Recording("run", {"t": t, "tau": tau, "q": t}))) == rows - left_out


def switched_on(kick: float) -> Recording:
    """An axis that speeds up, with a ripple; the command alternates while it settles, and no motion follows that."""
    t = np.arange(3000) / 1000
    v = 1 - np.exp(-7.5 * t) + 0.02 * np.sin(2 * np.pi * 1.7 * t)
    tau = 0.1 * np.gradient(v, 1e-3) + 1.3 + 0.7 * v + kick * np.exp(-t / 0.004) * (-1.0) ** np.arange(len(t))
    noise = np.random.default_rng(10).normal(0, 1, (2, len(t)))
    return Recording.of({"t": t, "tau": tau + 0.02 * noise[0], "q": np.cumsum(v) / 1000 + 1e-5 * noise[1]}, "run")


def test_what_is_left_out_is_said_and_spreads_over_no_row_that_counts() -> None:
    clean, spoilt, taken = (switched_on(0.0), switched_on(300.0), as_analysed(switched_on(300.0)))
    assert as_analysed(clean) is clean
    assert taken.t[0] == pytest.approx(0.1)
    assert "in the first 0.1 s the torque alternates" in taken.notes[-1]
    pieces = [prepare([one], 8.0).pieces[0] for one in (clean, spoilt, taken)]
    (t, true), (_, spread), (late, kept) = ((one.t[one.inside], one.tau[one.inside]) for one in pieces)
    assert np.abs(spread - true)[t > 0.3].max() > 0.1, "the filter spreads the kick over half a second"
    assert np.abs(kept - np.interp(late, t, true)).max() < 0.01
