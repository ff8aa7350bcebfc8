"""The axis of a session, made from a scenario and a machine file, and what a replay must know of both."""

import numpy as np

from cosim.hardware.library import library, part_of, shared
from cosim.hardware.machine import Machine
from cosim.hardware.structures import CAxis, CHeads
from cosim.hardware.wired import REFERENCE, Wired
from cosim.hardware.words import LIMITS
from cosim.support.errors import HardwareError
from cosim.support.plain import JsonObject
from cosim.support.version import __version__
from cosim.system.scenario import Scenario


def cycles_of(milliseconds: float, step: float) -> int:
    """Return a time as cycles, at least one."""
    return max(1, round(milliseconds / 1000 / step))


def make_axis(wired: Wired, machine: Machine, step: float) -> tuple[CAxis, tuple[np.ndarray, ...]]:
    """Return an axis that has just been switched on, and the arrays that must live as long as it."""
    part, arrays = part_of(wired.controller, list(wired.inputs), [wired.command])
    reactions = machine.reactions
    axis = CAxis(
        controller=part,
        encoder_input=wired.inputs.index(wired.encoder),
        reference_input=wired.inputs.index(REFERENCE),
        step=step,
        quantum=wired.quantum,
        limit=tuple(getattr(machine.limits, name) for name in LIMITS),
        stop_slew=reactions.stop_slew,
        ramp=cycles_of(reactions.ramp_ms, step),
        patience=cycles_of(reactions.patience_ms, step),
        lost_limit=reactions.lost_cycles,
        stale_limit=reactions.stale_cycles,
        mismatch_limit=reactions.mismatch_cycles,
        late_row_limit=reactions.late_in_a_row,
        late_limit=reactions.late_in_window,
        late_window=cycles_of(reactions.window_ms, step),
        heads=CHeads(
            used=machine.encoder.heads,
            apart=round(machine.encoder.apart / wired.quantum),
            jump=round(machine.limits.jump / wired.quantum),
        ),
    )
    if not library().hardware_ready(axis):
        raise HardwareError("The controller cannot save its state, which each entry into operation starts from.")
    return shared(axis), arrays


def story_of(scenario: Scenario, machine: Machine, wired: Wired) -> JsonObject:
    """Say all that a replay needs beside the records."""
    name = wired.controller.name
    return {
        "version": f"mount-cosim {__version__}",
        "step": scenario.step,
        "quantum": wired.quantum,
        "inputs": list(wired.inputs),
        "encoder": wired.encoder,
        "output": wired.command,
        "units": wired.units,
        "machine": machine.model_dump(),
        "controller": wired.controller.origin
        | {"path": str(wired.controller.path), "parameters": dict(scenario.components[name].parameters)},
        "scenario": scenario.text,
    }
