"""Can these recordings be held against this card? What cannot be right is refused before anything is fitted."""

from collections.abc import Sequence

import numpy as np

from cosim.data.recording import Recording
from cosim.estimation.filters import lowpass
from cosim.estimation.prepare import LEAST_SECONDS as SHORTEST
from cosim.support.errors import InputError, RecordingError
from pyfmi_models.effects import Effect
from pyfmi_models.mount import Mount

LEAST_SECONDS = 8.0
"""Seconds that the recordings to be fitted must have together."""


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
    return effect.is_determined


def check_recordings(train: Sequence[Recording], heldout: Sequence[Recording]) -> None:
    """Refuse recordings that are too short or do not move (RecordingError)."""
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


def _check_motion(recording: Recording) -> None:
    name = "q" if "q" in recording else "v"
    dt = recording.sample_time
    slow = lowpass(recording[name], dt, min(10.0, 0.2 / dt))
    moves = np.abs(np.diff(slow)).sum() if name == "q" else np.abs(slow).max()
    if moves <= 0:
        raise RecordingError(f"{recording.name}: {name} never moves, so there is nothing to diagnose.", culprit=name)
