"""Can these recordings be held against this card? What cannot be right is refused before anything is fitted."""

from collections.abc import Sequence

import numpy as np

from cosim.diagnosis.prepare import LEAST_SECONDS as SHORTEST
from cosim.diagnosis.prepare import lowpass, prepare
from cosim.diagnosis.structure import projected
from cosim.errors import InputError, RecordingError
from cosim.recording import Recording
from pyfmi_models.effects import Effect
from pyfmi_models.effects.friction_wander import FrictionWander
from pyfmi_models.mount import Mount

LEAST_SECONDS = 8.0
"""Seconds that the recordings to be fitted must have together."""
RATIOS = {"deg": 57.2958, "arcmin": 3437.75, "arcsec": 206264.8, "mrad": 1000.0, "rev": 1 / 6.28319}
LINEAR_RATIOS = {"mm": 1e3, "um": 1e6}
SPREAD = 2.2
"""An inertia within this factor of the card's, once a unit is undone, gives the unit away."""


def check_effects(mount: Mount) -> None:
    """Refuse a card with an effect that the torque needed for a recorded motion does not hold yet (InputError)."""
    for effect in mount.effects:
        if not is_held(effect):
            text = (
                f"The card holds {effect.id}, which a diagnosis cannot take into account yet; take it out of the card."
            )
            raise InputError(text, culprit=effect.id)


def is_held(effect: Effect) -> bool:
    """Whether `Inverse` holds an effect: not what was drawn by chance."""
    return not isinstance(effect, FrictionWander)


def check_recordings(train: Sequence[Recording], heldout: Sequence[Recording], mount: Mount) -> None:
    """Refuse recordings that are too short, or whose position is in a unit that the torque contradicts.

    The inertia that torque and acceleration imply is compared with the card's: a position in degrees makes it 57.3
    times too small. Raises RecordingError with the unit to state.
    """
    seconds = sum(recording.duration for recording in train)
    if seconds < LEAST_SECONDS:
        names = ", ".join(recording.name for recording in train)
        text = f"{names}: only {seconds:.3g} s of recording; fitting needs {LEAST_SECONDS:g} s."
        raise RecordingError(text, culprit=names, value=seconds)
    for recording in (*train, *heldout):
        if recording.duration < SHORTEST:
            text = f"{recording.name}: only {recording.duration:.3g} s long; a recording needs {SHORTEST:g} s."
            raise RecordingError(text, culprit=recording.name, value=recording.duration)
        _check_motion(recording)
        _check_ratio(recording, mount)


def _check_motion(recording: Recording) -> None:
    name = "q" if "q" in recording else "v"
    dt = recording.sample_time
    slow = lowpass(recording[name], dt, min(10.0, 0.2 / dt))
    moves = np.abs(np.diff(slow)).sum() if name == "q" else np.abs(slow).max()
    if moves <= 0:
        raise RecordingError(f"{recording.name}: {name} never moves, so there is nothing to diagnose.", culprit=name)


def _check_ratio(recording: Recording, mount: Mount) -> None:
    expected = float(mount.axis.inertia)
    implied, needed = _implied_inertia(recording, expected)
    if needed <= 1:
        return
    ratios = LINEAR_RATIOS if mount.motion == "linear" else RATIOS
    off = expected / implied if implied > 0 else np.inf
    if 1 / 5 < off < 5:
        return
    for unit, ratio in ratios.items():
        if ratio / SPREAD < off < ratio * SPREAD:
            name = "q" if "q" in recording else "v"
            stated = unit if name == "q" else f"{unit}/s"
            text = (
                f'{recording.name}: "{name}" looks like {unit} (the torque implies an inertia {off:.3g} times smaller '
                f"than the card's {expected:g}). Use --units {name}={stated}."
            )
            raise RecordingError(text, culprit=name, value=off)


def _implied_inertia(recording: Recording, expected: float) -> tuple[float, float]:
    """Inertia from least squares of torque on acceleration, direction and speed; and what the expected one would need.

    The latter is the RMS of the torque that the expected inertia takes for this motion, over that of the recorded
    torque: only where it is above one does the torque contradict the motion.
    """
    prepared = prepare([recording], min(10.0, 0.2 / recording.sample_time))
    top = max(abs(edge) for edge in prepared.ranges["v"]) + 1e-300
    a, v, tau = (prepared.stacked(name) for name in ("a", "v", "tau"))
    friction = np.column_stack([np.tanh(v / (0.02 * top)), v, np.ones_like(v)])
    own = projected(a, friction)
    energy = max(float(own @ own), 1e-300)
    return float(own @ tau) / energy, expected * np.sqrt(energy / max(float(tau @ tau), 1e-300))
