"""False readings are bridged, and a start in which a loop is switched on is left out; what a machine can do stays."""

from dataclasses import replace

import numpy as np
import pytest
from wandering import swing

from cosim.data.own_rate import as_analysed
from cosim.data.recording import Recording
from cosim.data.single_readings import cleaned
from cosim.data.start_up import settled
from cosim.diagnosis.trust.doubts import single_readings
from cosim.estimation.prepare import prepare
from cosim_studies.proof.generator import make_case
from pyfmi_models.card import parse_card

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


def test_nothing_is_judged_beside_a_false_reading() -> None:
    found = cleaned(spoiled(motion(), "q", slice(5000, 5001), -3.14))
    (piece,) = prepare([found], 20.0).pieces
    out = piece.t[~piece.inside & (piece.t > 4) & (piece.t < 19)]
    assert out.min() == pytest.approx(10.0, abs=0.03)
    assert out.max() == pytest.approx(10.0, abs=0.03)


@pytest.mark.parametrize(("times", "is_false"), [(10, True), (2, False)])
def test_a_torque_that_no_drive_gives_is_bridged_and_a_kick_that_one_may_give_is_not(
    times: float, is_false: bool
) -> None:
    good = motion()
    reach = float(np.abs(good["tau"]).max())
    kicked = spoiled(good, "tau", slice(300, 301), times * reach)
    assert (cleaned(kicked) is not kicked) == is_false
    assert (np.abs(cleaned(kicked)["tau"] - good["tau"]).max() < 1e-3 * reach) == is_false


def test_a_stale_reading_in_fast_motion_is_false() -> None:
    good = motion(noise=1e-7)
    row = int(np.argmax(np.abs(np.diff(good["q"]))))
    stale = spoiled(good, "q", slice(row, row + 1), good["q"][row - 1])
    assert cleaned(stale).masked == ((good.t[row], good.t[row]),)


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
