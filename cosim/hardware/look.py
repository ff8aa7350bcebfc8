"""A look at a machine before any torque: does the drive answer, does its encoder live, does this computer keep time."""

from pathlib import Path

from cosim.hardware.blackbox import read_black_box, recording_of
from cosim.hardware.machine import Machine
from cosim.hardware.session import Session
from cosim.hardware.words import LIMITS
from cosim.support.errors import HardwareError
from cosim.support.plain import JsonObject
from cosim.support.scratch import Scratch
from cosim.system.scenario import Scenario

SHOWN = ("cycles", "late_cycles", "worst_wake_up_us", "fifo", "memory_locked", "link")
"""Of the statistics of a session."""


def look(scenario: Scenario, machine: Machine, seconds: float) -> JsonObject:
    """Watch a machine that is never enabled for some seconds of real time; returns what was seen, SI.

    Raises:
        HardwareError: scenario and machine do not fit, the drive does not answer, or its encoder gives nothing new.
    """
    with Scratch() as folder:
        box = Path(folder) / "box"
        with Session(scenario, machine, box) as session:
            session.advance(max(100, round(seconds / scenario.step)))
            statistics = session.statistics
        recording = recording_of(read_black_box(box), "check")
    read = recording["machine.read"] == 0
    if not read.any():
        raise HardwareError(f"{machine.name} does not answer.", culprit=machine.name)
    encoder = recording["machine.encoder"][read]
    if encoder[0] == encoder[-1]:
        raise HardwareError(f"The encoder of {machine.name} gives no new samples.", culprit=machine.name)
    setpoint = session.wired.setpoints[session.wired.inputs.index("q_d"), 0]
    position = recording["q"][read]
    return {
        "drive": f"{machine.name}, {machine.adapter}",
        "answered": f"{read.mean():.2%} of {len(read):,} cycles",
        "position": float(position[-1]),
        "moved_by": float(position.max() - position.min()),
        "first_set_point": float(setpoint),
        "within_reach": bool(abs(setpoint - position[-1]) <= machine.limits.following_error),
        "limits": {name: getattr(machine.limits, name) for name in LIMITS},
        **{key: statistics[key] for key in SHOWN if key in statistics},
    }
