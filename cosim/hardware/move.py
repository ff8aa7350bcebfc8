"""A small test move: does the encoder mean what the scenario says it means?

The axis follows a few periods of a small sine. The part of the torque that swings with the acceleration, over the
acceleration that the encoder shows, is an inertia: with w the frequency and < > the component in phase with cos(w t),

    J_seen = <tau> / (-w^2 <q>)

Friction hardly enters: Coulomb and viscous torque swing with the velocity, a constant load not at all; what is elastic
does. The scenario's own plant, moved in the same way, says what J_seen should be; an encoder that counts s times too
much shows about J / s.
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.recording import Recording
from cosim.hardware.blackbox import read_black_box, recording_of
from cosim.hardware.machine import Machine
from cosim.hardware.session import Session
from cosim.hardware.words import ENTERED
from cosim.support.elementary import sine_and_cosine
from cosim.support.errors import HardwareError
from cosim.support.scratch import Scratch
from cosim.system.scenario import Scenario

FREQUENCY, PERIODS, SETTLING = 10.0, 6, 2
"""Hz; periods in all; those before the ones that count."""
SHARE_OF_ERROR, SHARE_OF_TORQUE = 0.2, 0.25
"""Of the limits: the greatest way of the move, and the greatest torque it may need by the model."""
TOLERANCE = 1.5
"""Factor between model and machine that is still no question of scaling."""


@dataclass(frozen=True)
class Move:
    """What a test move showed: its way [rad], inertia seen [N m s2/rad] and that of the model, most torque [N m]."""

    way: float
    seen: float
    expected: float
    torque: float

    @property
    def scale(self) -> float:
        """How many times too much the encoder counts; 1 where scenario and machine agree."""
        return self.expected / self.seen

    @property
    def shown(self) -> dict[str, float]:
        """All of it by name."""
        return asdict(self) | {"scale": self.scale}


def try_move(scenario: Scenario, machine: Machine, *, fast: bool = False) -> Move:
    """Move the axis a little and compare it with the scenario's own plant.

    Args:
        scenario: with an FMU for each component.
        machine: its limits hold; torque is limited to twice what the model says is needed.
        fast: without a clock.

    Raises:
        HardwareError: the axis left operation on the way, or the encoder is off by more than a factor of 1.5.
    """
    scenario = replace(scenario, ticks=round((PERIODS + 1) / FREQUENCY / scenario.step))
    way, expected, needed = _model(scenario, machine)
    found = _moved(scenario, machine, way, needed, fast)
    seen, torque = _inertia(found, scenario.step), float(np.abs(found["machine.order"]).max())
    move = Move(way, seen, expected, torque)
    if not 1 / TOLERANCE < move.scale < TOLERANCE:
        message = (
            f"{machine.name} moves as if its encoder had about {move.scale:.2g} times the counts per turn of "
            f"{scenario.path} (or torque or inertia were off by that factor): inertia seen {seen:.4g}, "
            f"expected {expected:.4g} N.m.s2/rad."
        )
        raise HardwareError(message, culprit=machine.name, value=move.scale)
    return move


def _model(scenario: Scenario, machine: Machine) -> tuple[float, float, float]:
    """Return way, inertia seen and torque needed of the scenario's own plant, with a way that keeps to the limits."""
    twin = machine.model_copy(update={"adapter": "simulated", "inject": ()})
    way = SHARE_OF_ERROR * machine.limits.following_error
    for _ in range(2):
        found = _moved(scenario, twin, way, machine.limits.torque, True)
        needed = float(np.abs(found["machine.order"]).max())
        way *= min(1.0, SHARE_OF_TORQUE * machine.limits.torque / needed)
    return way, _inertia(found, scenario.step), needed


def _moved(scenario: Scenario, machine: Machine, way: float, needed: float, fast: bool) -> Recording:
    """Return the recording of a move, from the first cycle of the controller on."""
    with Scratch() as folder:
        path = Path(folder) / "box"
        with Session(scenario, machine, path, fast=fast) as session:
            session.advance(100)
        position = float(recording_of(read_black_box(path), "rest")["q"][-1])
        session = Session(scenario, machine, path, fast=fast, force=True)
        _set_points(session, position, way)
        with session:
            session.tighten("torque", min(machine.limits.torque, 2 * needed))
            _follow(session)
        found = recording_of(read_black_box(path), "move")
    entered = int(np.flatnonzero(found["machine.notes"].astype(int) & ENTERED)[0])
    return Recording("move", {name: found[name][entered:] for name in found}, {}, {})


def _follow(session: Session) -> None:
    cycles = round(PERIODS / FREQUENCY / session.scenario.step)
    session.enable()
    ended = session.track(cycles)
    if not ended.running:
        message = (
            f"The test move of {session.machine.name} ended in: {', '.join(ended.faults) or ended.state}; "
            "scaling of the encoder, sign and limits are the first to look at."
        )
        raise HardwareError(message, culprit=session.machine.name)
    session.disable()


def _set_points(session: Session, position: float, way: float) -> None:
    """Replace the set points of a session, before it begins, by those of the move."""
    w, inputs = 2 * np.pi * FREQUENCY, session.wired.inputs
    t = np.arange(session.wired.setpoints.shape[1]) * session.scenario.step
    sine, cosine = sine_and_cosine(w * t)
    rows: dict[str, Any] = {
        "q_d": position + way / 2 * (1 - cosine),
        "v_d": way / 2 * w * sine,
        "a_d": way / 2 * w * w * cosine,
    }
    for name in set(rows) & set(inputs):
        session.wired.setpoints[inputs.index(name)] = rows[name]


def _inertia(found: Recording, step: float) -> float:
    t = step * (found["machine.tick"] - found["machine.tick"][0])
    counts = (t >= SETTLING / FREQUENCY) & (t < PERIODS / FREQUENCY)
    w = 2 * np.pi * FREQUENCY
    cosine = np.cos(w * t[counts])
    in_phase = {name: 2 * float(np.mean(found[name][counts] * cosine)) for name in ("tau", "q")}
    return in_phase["tau"] / (-(w**2) * in_phase["q"])
