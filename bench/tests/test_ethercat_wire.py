"""Over a pair of virtual wires the real pysoem brings up a slave in software, which needs the rights of root."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path[:0] = [str(Path(__file__).parents[2] / "tests" / one) for one in ("tools", "hardware")]

from mortal import mortal  # noqa: E402
from on_hardware import assert_safe, recorded  # noqa: E402
from test_adapters import RATED, machine, session  # noqa: E402

from cosim.hardware.replay import replay  # noqa: E402
from cosim.hardware.session import run_session  # noqa: E402

IP = shutil.which("ip")


@pytest.fixture
def veth(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The near end of a pair of virtual wires with a slave in software at the other one, in a process of its own."""
    pytest.importorskip("pysoem", reason="the extra ethercat is not installed")
    near, far = f"ec{os.getpid() % 10**8}a", f"ec{os.getpid() % 10**8}b"
    made = subprocess.run(["ip", "link", "add", near, "type", "veth", "peer", "name", far], check=False) if IP else None
    if made is None or made.returncode:
        pytest.skip("virtual wires need `ip` and the rights of root")
    monkeypatch.setattr("cosim_ethercat.drive.FRAME_US", 200_000)  # this computer may be slow
    try:
        for end in (near, far):
            subprocess.run(["ip", "link", "set", end, "up"], check=True)
        program = Path(__file__).parents[1] / "ethercat_slave.py"
        with subprocess.Popen(mortal(sys.executable, str(program), far), stdout=subprocess.PIPE) as slave:
            assert slave.stdout is not None
            assert slave.stdout.readline() == b"listening\n"
            yield near
            slave.kill()
    finally:
        subprocess.run(["ip", "link", "del", near], check=True)


def test_over_a_wire_and_the_real_pysoem_the_drive_goes_up_gives_torque_and_comes_down(
    tmp_path: Path, veth: str
) -> None:
    outputs = [{"name": "torque", "object": 0x6071, "bits": 16}, {"object": 0x60FE, "subindex": 1, "bits": 32}]
    outputs += [{"name": "controlword", "object": 0x6040, "bits": 16}]
    with session(tmp_path, machine(veth, outputs=outputs, receive_pdo=0x1602)) as one:
        done = run_session(one)
    assert done["completed"], (done["faults"], done.get("adapter_error"))
    found = recorded(tmp_path)
    order, given = found["machine.order"], found["machine.torque"]
    assert np.abs(order).max() > 1
    assert np.all(found["machine.read"] == 0)
    assert np.allclose(given[1:], RATED / 1000 * np.round(order[:-1] * 1000 / RATED), atol=1e-12)
    assert np.all(found["machine.counts"] == 2**32 - 5)
    assert replay(found).identical


def test_over_a_wire_a_slave_that_is_gone_is_a_lost_frame(tmp_path: Path, veth: str, monkeypatch: Any) -> None:
    with session(tmp_path, machine(veth)) as one:
        one.enable()
        one.track(1000)
        begun = one.status.tick
        monkeypatch.setattr("cosim_ethercat.drive.FRAME_US", 2000)
        subprocess.run(["ip", "link", "set", veth, "down"], check=True)
        one.advance(20)
        subprocess.run(["ip", "link", "set", veth, "up"], check=True)
    found = recorded(tmp_path)
    assert_safe(found, "frame_lost" if "frame_lost" in one.status.faults else "adapter_failed", begun, 20)
