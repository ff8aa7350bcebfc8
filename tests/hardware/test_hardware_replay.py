"""A black box says what happened; a replay compares each column bit for bit and believes nothing that is said."""

import os
import shutil
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from on_hardware import SCENARIO, SIMULATED, invoke, recorded, scenario, session

from cosim.data.recording import Recording
from cosim.hardware.replay import replay
from cosim.hardware.session import Session, run_session
from cosim.hardware.story import broken_seal, seal_of
from cosim.master.simulate import run
from cosim.support.errors import CosimError, HardwareError
from cosim.support.files import cache_home
from cosim.system.wire import Record

SHORT = ("stop = 0.4", "stop = 0.12")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A session as it was recorded."""
    folder = tmp_path_factory.mktemp("session")
    with session(folder, what=scenario(SHORT)) as one:
        run_session(one)
    return recorded(folder)


def with_column(recording: Recording, name: str, column: np.ndarray) -> Recording:
    return replace(recording, table=recording.table | {name: column})


def without(recording: Recording, name: str) -> Recording:
    return replace(recording, table={key: column for key, column in recording.table.items() if key != name})


def with_story(recording: Recording, change: Callable[[dict[str, Any]], Any]) -> Recording:
    story = deepcopy(recording.origin["hardware"])
    changed = change(story)
    return replace(recording, origin=recording.origin | {"hardware": story if changed is None else changed})


def sealed(recording: Recording) -> Recording:
    """Seal it again, as who means to deceive would."""
    return replace(
        recording, origin=recording.origin | {"seal": seal_of(recording.table, recording.origin["hardware"])}
    )


def test_a_changed_bit_in_any_column_is_seen(whole: Recording) -> None:
    """What only enters the loop (set points, a torque below what the loop tells apart) needs the seal; all else not."""
    row = len(whole) // 2
    unseen = []
    for name in whole:
        column = whole[name].copy()
        column[row] = np.nextafter(column[row], np.inf)
        changed = with_column(whole, name, column)
        if name == "machine.tick":
            with pytest.raises(HardwareError, match="was altered"):
                replay(changed)
            continue
        done = replay(changed)
        assert done.noticed == "its numbers are not those that were recorded"
        assert done.first == (whole["machine.tick"][row] if done.different[name] else -1)
        if not done.different[name] and replay(sealed(changed)).identical:
            unseen.append(name)
    assert set(unseen) <= {"q_d", "v_d", "a_d", "machine.value", "machine.torque"}


@pytest.mark.parametrize("value", [0.25, np.nan, np.inf, -1.0, 2.0**32, 1e300])
@pytest.mark.parametrize("name", ["machine.state", "machine.statusword", "machine.notes", "machine.encoder"])
def test_a_number_that_its_field_cannot_hold_is_no_match(whole: Recording, name: str, value: float) -> None:
    column = whole[name].copy()
    column[700] = column[700] + value if value == 0.25 else value
    done = replay(sealed(with_column(whole, name, column)))
    assert done.different[name] >= 1
    assert not done.identical


def test_what_is_cut_off_is_seen(whole: Recording) -> None:
    cut = replace(whole, table={name: column[:500] for name, column in whole.table.items()})
    done = replay(cut)
    assert not any(done.different.values())
    assert done.noticed == f"it has 500 of the {len(whole):,} cycles that were recorded"
    assert not done.identical
    more = replay(sealed(with_column(whole, "machine.more", np.zeros(len(whole)))))
    assert (more.identical, more.different["machine.more"]) == (False, len(whole))
    assert replay(sealed(without(whole, "tau"))).different["tau"] == len(whole)
    for name in ("machine.late", "machine.order", "machine.link", "v_d"):
        with pytest.raises(HardwareError, match=f"it has no column {name}"):
            replay(without(whole, name))


def test_what_was_recorded_is_identical_and_its_seal_is_checked(whole: Recording) -> None:
    done = replay(whole)
    assert (done.identical, done.noticed, done.first, broken_seal(whole)) == (True, "", -1, "")
    assert set(done.different) == set(whole)
    assert done.stepped > 1000
    other = seal_of(whole.table | {"extra": np.zeros(len(whole))}, whole.origin["hardware"])
    for seal, reason in [
        (None, "it has no seal, or one that is damaged"),
        ({"records": "many", "sha256": "0" * 64}, "it has no seal, or one that is damaged"),
        ({"records": len(whole), "sha256": "0" * 63}, "it has no seal, or one that is damaged"),
        (other, "its numbers are not those that were recorded"),
        (other | {"records": 1}, f"it has {len(whole):,} of the 1 cycles that were recorded"),
    ]:
        done = replay(replace(whole, origin=whole.origin | {"seal": seal}))
        assert (done.noticed, done.identical) == (reason, False)


def test_the_seal_depends_on_every_name_and_number() -> None:
    one = seal_of({"a": np.arange(3.0), "b": np.zeros(3)}, {})
    assert one == seal_of({"b": np.zeros(3), "a": np.arange(3.0)}, {})
    for other in (
        {"a": np.arange(3.0), "c": np.zeros(3)},
        {"a": np.arange(3.0), "b": -np.zeros(3)},
        {"a": np.array([0.0, 2.0, 1.0]), "b": np.zeros(3)},
        {"a": np.arange(3.0)},
    ):
        assert seal_of(other, {})["sha256"] != one["sha256"]


def test_the_card_and_all_else_that_a_session_says_is_part_of_what_is_checked(tmp_path, monkeypatch) -> None:
    path, out = tmp_path / "s.toml", tmp_path / "out"
    path.write_text(SCENARIO.replace(*SHORT), "utf-8")
    done = invoke("run", str(path), "--fast", "--out", str(out))
    assert done.exit_code == 0, done.output
    session = Recording.read(out / "recording.parquet", required=())
    assert replay(session).identical
    cards = session.origin["hardware"]["cards"]
    assert {name: one["card"] for name, one in cards.items()} == {"mount": "paper_mount", "controller": "paper_mount"}
    for altered in (
        with_story(session, lambda story: story["cards"]["mount"].update(sha256="0" * 64)),
        with_story(session, lambda story: story["cards"]["mount"].update(card="another")),
        with_story(session, lambda story: story.pop("cards") and None),
        with_story(session, lambda story: story["machine"]["limits"].update(following_error=9.0)),
        with_story(session, lambda story: story.update(scenario="")),
    ):
        said = "what it says of its machine, controller and cards was altered"
        assert (replay(altered).noticed, replay(altered).identical) == (said, False)
    command = "replay", str(out / "recording.parquet")
    assert [invoke(*command, "--card", card).exit_code for card in ("paper_mount", "emps")] == [0, 2]
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "empty"))
    assert invoke(*command).exit_code == 2, "the controller is in no cache"


JUNK: list[Any] = [None, 0, -1, 1e300, "", "x" * 300, [], {}, [1], {"a": 1}, True, "../../etc/passwd"]


def test_no_story_that_was_altered_is_a_traceback(whole: Recording) -> None:
    """Every key, also those inside, becomes every kind of junk, and is left out; what still runs may be identical."""
    story = whole.origin["hardware"]
    paths = [(key,) for key in story]
    paths += [("machine", key) for key in story["machine"]] + [("controller", key) for key in story["controller"]]
    paths += [("machine", "limits", key) for key in story["machine"]["limits"]]
    for path in paths:
        for junk in (*JUNK, "left out"):
            altered = deepcopy(story)
            place = reduce(getitem, path[:-1], altered)
            if junk == "left out":
                del place[path[-1]]
            else:
                place[path[-1]] = junk
            with suppress(CosimError):  # a sentence
                replay(replace(whole, origin=whole.origin | {"hardware": altered}))
    for junk in JUNK:
        with pytest.raises(HardwareError):
            replay(replace(whole, origin={"hardware": junk}))


def test_a_controller_that_a_recording_names_is_never_opened(whole, tmp_path, monkeypatch) -> None:
    own = next(
        one
        for one in (cache_home() / "fmus").glob("*.fmu")
        if one.name == whole.origin["hardware"]["controller"]["file"]
    )
    copy = shutil.copy(own, tmp_path / "controller.fmu")
    named = sealed(with_story(whole, lambda story: story["controller"].update(path=str(copy), file=str(copy))))
    assert replay(named).identical  # found in the cache, by its hash
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path / "empty"))
    with pytest.raises(HardwareError, match=r"is not in the cache; it was built from|is not in the cache\."):
        replay(named)
    assert replay(named, Path(copy)).identical
    with pytest.raises(HardwareError, match="there is no such controller"):
        replay(named, tmp_path / "none.fmu")


def test_another_controller_is_refused(whole: Recording, tmp_path: Path) -> None:
    wrong = next(one for one in (cache_home() / "fmus").glob("paper_mount-plant-*.fmu"))
    with pytest.raises(HardwareError, match="is another controller than that of the session"):
        replay(whole, wrong)
    renamed = with_story(whole, lambda story: story["controller"].update(sha256="0" * 64))
    with pytest.raises(HardwareError, match=r"SHA-256 0000000000000000\.\.\.\) is not in the cache"):
        replay(renamed)


def test_the_recording_is_one_that_a_diagnosis_reads(tmp_path: Path) -> None:
    with session(tmp_path) as one:
        run_session(one)
    path = recorded(tmp_path).write(tmp_path / "r.parquet")
    read = Recording.read(path)
    assert {"tau", "q", "q_d"} <= set(read)
    assert [read.units[one] for one in ("t", "tau", "q", "q_d", "v_d")] == ["s", "N.m", "rad", "rad", "rad/s"]
    what = scenario()
    twin = run(replace(what, records={"tau": Record("mount.tau", "mean")})).recording
    first = int(np.flatnonzero(read["machine.notes"].astype(int) & 1)[0])
    assert np.allclose(read["tau"][first:][1:3999], twin["tau"][1:3999], rtol=1e-15, atol=1e-15)
    assert replay(read).identical


def test_a_black_box_keeps_the_end_and_is_let_go_of_when_its_session_ends(tmp_path: Path) -> None:
    def mapped() -> bool:
        return str(tmp_path / "box") in Path("/proc/self/maps").read_text()

    with session(tmp_path, SIMULATED.model_copy(update={"black_box_seconds": 0.05})) as one:
        one.advance(1234)
        assert mapped()
    assert not mapped(), "though the session is still there"
    assert one is not None
    found = recorded(tmp_path)
    assert np.array_equal(found["machine.tick"], np.arange(734, 1234))
    with pytest.raises(HardwareError, match="begins at cycle 734"):
        replay(found)


def test_a_late_loop_is_told_and_the_simulated_machine_waits_for_it(tmp_path: Path) -> None:
    with Session(scenario(), SIMULATED, tmp_path / "box") as one:
        one.enable()
        os.kill(one.loop.process, signal.SIGSTOP)
        time.sleep(0.1)  # a thousand cycles
        os.kill(one.loop.process, signal.SIGCONT)
        ended = one.track(500)
        assert ended.running
        assert ended.faults == ()
        assert one.statistics["late_cycles"] > 500
    found = recorded(tmp_path)
    assert not found["machine.late"].any()
    assert replay(found).identical
