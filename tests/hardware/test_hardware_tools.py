"""The commands, the test move and the supervisor over UDP."""

import json
import sys
from contextlib import ExitStack
from mmap import mmap
from pathlib import Path

import numpy as np
import pytest
from on_hardware import SCENARIO, SIMULATED, invoke, recorded, scenario
from over_udp import drive, over, session

from cosim.cli.drive import _plant
from cosim.hardware.loops import bare_clock
from cosim.hardware.machine import read_machine
from cosim.hardware.move import try_move
from cosim.hardware.virtual import plant_of
from cosim.master.exchange import open_fmu
from cosim.models.cache import fmu_of_card
from cosim.support.errors import HardwareError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the loop needs absolute sleeps")


def test_the_commands_check_and_run_over_udp(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(SCENARIO, "utf-8")
    with drive() as there:
        arguments = [str(tmp_path / "s.toml"), "--drive", there.url, "--out", str(tmp_path / "out")]
        done = invoke("run", *arguments, "--fast", "--json")
        assert done.exit_code == 0, done.output
        assert json.loads((tmp_path / "out" / "run.json").read_text("utf-8"))["link"]["lost"] == 0
    with drive(lockstep=False) as there:
        done = invoke("check", str(tmp_path / "s.toml"), "--drive", there.url, "--seconds", "0.05")
        assert done.exit_code == 0, done.output
        assert there.url in done.output
        assert "duplicated" in done.output
    done = invoke("check", str(tmp_path / "s.toml"), "--drive", there.url)
    assert done.exit_code == 2
    assert "No drive at" in done.output


def test_a_drive_of_a_card_has_the_cards_encoder() -> None:
    with ExitStack() as stack:
        plant, step, quantum = _plant("paper_mount", 1e-4, stack)
        assert (plant.torque, plant.position, step) == ("tau", "q", 1e-4)
        assert quantum == pytest.approx(2 * np.pi / 2**32)
    with (
        ExitStack() as stack,
        pytest.raises(HardwareError, match=r"no such scenario or card; .*sidereal, .*paper_mount"),
    ):
        _plant("nonsense", 1e-4, stack)
    with ExitStack() as stack, pytest.raises(HardwareError, match='no plant of a drive: it has no input "tau"'):
        plant_of(stack.enter_context(open_fmu(fmu_of_card("paper_mount", "controller", print), "controller")))


@pytest.mark.parametrize(("scale", "times"), [(0.5, "2.1"), (3.0, "0.45")])
def test_the_test_move_finds_an_encoder_that_counts_wrongly(scale: float, times: str) -> None:
    with drive(scale=scale) as there, pytest.raises(HardwareError, match=f"about {times} times the counts per turn"):
        try_move(scenario(), over(there.url), fast=True)
    assert there.drive.held == 0


def test_the_test_move_ends_in_a_sentence_where_the_loop_cannot_even_follow() -> None:
    with drive(scale=1 / 60) as there, pytest.raises(HardwareError, match=r"ended in: .*scaling of the encoder"):
        try_move(scenario(), over(there.url), fast=True)
    assert there.drive.held == 0


def test_the_test_move_of_an_encoder_that_counts_right_is_small_and_shows_the_inertia() -> None:
    with drive() as there:
        move = try_move(scenario(), over(there.url), fast=True)
    assert move.scale == pytest.approx(1, rel=1e-3), "the drive has rested elsewhere than its twin"
    assert move.seen == pytest.approx(24.5, rel=0.03), "30 kg m2 of the card, less 5.5 of its elastic friction at 10 Hz"
    assert move.way <= 0.2 * SIMULATED.limits.following_error
    assert move.torque <= 0.5 * SIMULATED.limits.torque


def test_a_supervisor_drains_each_record_once_while_the_loop_goes_on(tmp_path: Path) -> None:
    with drive() as there, session(tmp_path, there.url) as one:
        drained = []
        for cycles in (1, 700, 0, 299):
            one.advance(cycles)
            drained.append(one.drain())
    assert [len(records) for records in drained] == [1, 700, 0, 299]
    sequence = np.concatenate([records["sequence"] for records in drained])
    assert np.array_equal(sequence, np.arange(1, 1001))
    assert np.array_equal(np.concatenate(drained)["sample"]["tick"], recorded(tmp_path)["machine.tick"])


def test_a_loop_in_this_process_locks_what_is_in_use_and_lets_go_of_it() -> None:
    """Python reserves far more than it uses: made resident, it would stay so until the process ends."""

    def held(what: str) -> int:
        """Memory of this process [kB]."""
        told = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text("utf-8").splitlines())
        return int(told[what].split()[0])

    with mmap(-1, 2**30):
        before = held("VmRSS")
        bare_clock(1e-3, 20.0, 0.05)
        assert held("VmRSS") - before < 200_000
    assert held("VmLck") == 0


def test_a_machine_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_bytes(b'name = "\x98"')
    with pytest.raises(HardwareError, match=r"m\.toml is not text in UTF-8 \(at byte 8\)"):
        read_machine(tmp_path / "m.toml")
