"""The controller of a scenario against the simulated drive in the process, without a clock."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from cosim.cli import application
from cosim.data.recording import Recording
from cosim.hardware.blackbox import read_black_box, recording_of
from cosim.hardware.machine import Inject, Machine, changed, read_machine
from cosim.hardware.session import Session
from cosim.hardware.words import FAULTS
from cosim.master.simulate import run
from cosim.models.cache import with_fmus
from cosim.system.scenario import Scenario, parse_scenario
from cosim.system.wire import Record

MOVING = """  { from = "reference.velocity", to = "controller.v_d" },
  { from = "reference.acceleration", to = "controller.a_d" },
"""
SCENARIO = f"""
name = "hardware"
step = 1e-4
stop = 0.4
connections = [
  {{ from = "controller.tau", to = "mount.tau" }},
  {{ from = "mount.q", to = "controller.q", quantum = 1.4629180792671596e-9 }},
  {{ from = "reference.position", to = "controller.q_d" }},
{MOVING}]
[components.mount]
card = "paper_mount"
part = "plant"
[components.controller]
card = "paper_mount"
part = "controller"
[signals.reference]
kind = "sine"
frequency = 1.0
max_velocity = 2e-3
smooth_start = 0.1
[record]
signals = {{ tau = "mount.tau", q = "controller.q" }}
"""
SIMULATED = read_machine("simulated")
AT = 0.2
"""Seconds after switching on at which a fault is injected; the axis moves then."""


def scenario(*changes: tuple[str, str]) -> Scenario:
    text = SCENARIO
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return with_fmus(parse_scenario(text, "hardware.toml", Path()))


def machine(**inject: Any) -> Machine:
    faults = (Inject(**({"at": AT} | inject)),) if inject else ()
    return SIMULATED.model_copy(update={"inject": faults})


def altered(given: Machine = SIMULATED, **changes: Any) -> Machine:
    """A machine with other numbers, read anew: a section keeps those that are not given."""
    kept = {name: getattr(given, name).model_dump() for name in ("limits", "reactions", "clock", "encoder")}
    return changed(given, "test", **{name: kept[name] | one if name in kept else one for name, one in changes.items()})


def session(folder: Path, given: Machine = SIMULATED, what: Scenario | None = None, **options: Any) -> Session:
    return Session(what or scenario(), given, folder / "box", fast=True, **options)


def recorded(folder: Path) -> Recording:
    kept = read_black_box(folder / "box")
    assert kept.torn == 0
    return recording_of(kept, "box")


def simulated(what: Scenario) -> Recording:
    records = {"command": Record("controller.tau"), "acting": Record("mount.tau"), "q": Record("controller.q")}
    return run(replace(what, records=records)).recording


INJECTED = {
    "frame_lost": ({"kind": "lost"}, 3),
    "encoder_stale": ({"kind": "stale"}, 3),
    "encoder_jump": ({"kind": "jump", "size": 1e-5, "lasts": 1e-4}, 1),
    "overspeed": ({"kind": "jump", "size": 1e-4, "lasts": 1e-4}, 1),
    "torque_mismatch": ({"kind": "saturated", "size": 0.1}, 11),
    "drive_fault": ({"kind": "tripped", "lasts": 1e-4}, 1),
}
"""Fault of the simulated drive, and the cycles from its first one to the fault, that one counted."""


def assert_safe(found: Recording, fault: str, begun: int, within: int) -> None:
    bit = 1 << list(FAULTS).index(fault)
    tick, state = found["machine.tick"].astype(int), found["machine.state"].astype(int)
    seen = (found["machine.faults"].astype(int) & bit > 0) & (tick >= begun)
    assert seen.any(), f"{fault} was not found"
    first = int(np.flatnonzero(seen)[0])
    assert tick[first] - begun < within
    assert list(state[first : first + 3]) == [6, 7, 7], "fault reaction, then fault, and there it stays"
    assert not found["machine.order"][first:].any(), "torque is zero from the cycle of the fault on"
    assert found["machine.order"][:first].any(), "there was a torque to take away"


def invoke(*arguments: str) -> Any:
    return CliRunner().invoke(application(["hardware", *arguments]), ["hardware", *arguments])
