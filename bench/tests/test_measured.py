"""Measured machines: the official protocol of EMPS on a machine that is known, and copies with one mistake each."""

import time
from pathlib import Path

import corrupted
import judges
import measured
import numpy as np
import official
import pandas as pd
import pytest

from cosim.data.recording import Recording
from cosim.support.errors import RecordingError
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

MASS, DRAG, TICK = 95.0, 200.0, 1e-3


def slide(drag: float = DRAG) -> Mount:
    """A mass in oil: M v' = F - drag v."""
    return Mount(name="m", axis=Axis(inertia=MASS), friction=Coulomb(Fc=0.0, sigma2=drag), motion="linear")


def pushed(force: np.ndarray, q0: float = 0.3, v0: float = 0.05) -> Recording:
    """Its closed form under forces that are held for a tick each, as a recording."""
    keep = np.exp(-TICK * DRAG / MASS)
    q, v = np.full(force.size, q0), np.full(force.size, v0)
    for k, push in enumerate(force[:-1]):
        end = push / DRAG
        v[k + 1] = end + (v[k] - end) * keep
        q[k + 1] = q[k] + end * TICK + (v[k] - end) * (1 - keep) * MASS / DRAG
    t = TICK * np.arange(force.size)
    return Recording("run", {"t": t, "tau": force, "q": q})


def test_in_open_loop_the_true_machine_is_where_it_was_measured() -> None:
    force = 40 * np.sign(np.sin(2 * np.pi * 0.5 * TICK * np.arange(6000)))
    assert official.position_error(slide(), [pushed(force)]) < 1e-3  # mm


def test_in_open_loop_an_error_of_the_model_adds_up_as_the_closed_form_says() -> None:
    """Without drag the mass drifts: its speed grows by v drag / M, its position by the double integral."""
    run = pushed(np.zeros(4000))
    measured_q, t = np.asarray(run["q"]), np.asarray(run["t"])
    drifted = 0.3 + 0.05 * t
    expected = 1e3 * np.sqrt(np.mean((measured_q - drifted)[official.GIVEN :] ** 2))
    assert official.position_error(slide(0.0), [run]) == pytest.approx(expected, rel=0.05)
    assert expected > 50


def machine() -> measured.Machine:
    t = np.arange(1000) * 0.01
    table = pd.DataFrame({"t": t, "tau": np.sin(t), "q": np.cos(t)})
    return measured.Machine(
        name="pendulum, quasi-direct drive",
        concealed="",
        card='[mount]\ninertia = 1.0\n[friction]\nmodel = "coulomb"\nFc = 0.1\n',
        train={"one": table},
        heldout={"two": table},
        score=lambda mount, recordings: 0.0,
        unit="N.m",
        bar=1.0,
        first_look="",
    )


def test_each_copy_has_one_mistake_in_all_of_its_recordings(tmp_path: Path) -> None:
    made = {copy.name: broken for copy, broken in corrupted.copies(machine(), tmp_path)}
    one, plain = {name: broken.heldout["two"] for name, broken in made.items()}, machine().heldout["two"]
    assert len(made) == len(corrupted.COPIES) == 8
    for name, column, factor in (
        ("sign of the torque", "tau", -1),
        ("time in ms", "t", 1e3),
        ("gear of 6 forgotten", "q", 6),
    ):
        np.testing.assert_array_equal(one[name][column], factor * plain[column])
        others = [other for other in plain if other != column]
        pd.testing.assert_frame_equal(one[name][others], plain[others])
    late = one["position 20 ms late"].q
    np.testing.assert_allclose(late[2:], plain.q[:-2], atol=1e-12)
    assert (one["one false reading"].q != plain.q).sum() == 1


def test_what_a_copy_was_answered_is_judged_by_the_words_that_it_needed() -> None:
    copy = corrupted.COPIES[1]
    right = corrupted.judged(copy, {"verdict": [], "sanity": [{"finding": "torque_sign"}]})
    wrong = corrupted.judged(copy, {"verdict": ["delay"], "sanity": [{"finding": "encoder_step"}]})
    refused = corrupted.judged(copy, {"refused": "The torque sign is turned."})
    assert [row["right"] for row in (right, wrong, refused)] == ["yes", "**no**", "yes"]
    assert (right["answered"], wrong["answered"], wrong["warned"]) == ("none", "delay", "encoder_step")
    assert corrupted.judged(corrupted.COPIES[0], {"verdict": [], "sanity": []})["right"] == ""
    assert "1 of 2 are warned about" in corrupted.page([{"machine": "m"} | right, {"machine": "m"} | wrong], "command")


def test_a_copy_that_is_refused_crashes_or_never_ends_is_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise RecordingError("no")

    def crash(*_: object) -> None:
        raise ZeroDivisionError("0")

    for stub, longest, expected in (
        (refuse, 60.0, {"refused": "no"}),
        (crash, 60.0, {"ended": "traceback: ZeroDivisionError: 0"}),
        (lambda *_: time.sleep(60), 0.5, {"ended": "no answer within 0 s"}),
    ):
        monkeypatch.setattr(corrupted, "diagnose", stub)
        assert corrupted.asked(machine(), longest) == expected


def test_an_interval_holds_the_error_and_narrows_with_what_is_drawn() -> None:
    draw, told = np.random.default_rng(3), {}
    for count in (20, 500):
        blocks = np.column_stack([draw.chisquare(50, count), np.full(count, 50.0)])
        judge = judges.Judge(lambda *_, blocks=blocks: blocks, 2.0)
        assert judge(slide(), []) == pytest.approx(2.0, rel=0.1)
        low, high = (float(word) for word in judge.interval(slide(), []).split(" to "))
        assert low < judge(slide(), []) < high
        told[count] = high - low
    # sqrt(500 / 20) = 5; of 20 blocks the width is known to 16 %, and of 500 its two digits round by as much.
    assert told[20] / told[500] == pytest.approx(5, rel=0.4)
    assert not judges.Judge(lambda *_: np.ones((4, 2))).interval(slide(), [])
