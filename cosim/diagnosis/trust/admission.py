"""Can these recordings be held against this card? What cannot be right is refused before anything is fitted."""

from collections.abc import Sequence
from math import pi

import numpy as np

from cosim.data.neighbours import neighbours
from cosim.data.recording import Recording
from cosim.estimation.filters import derivative, lowpass
from cosim.estimation.prepare import LEAST_SECONDS as SHORTEST
from cosim.estimation.prepare import STEADY, Array
from cosim.support.errors import InputError, RecordingError
from cosim.support.statistics import rms
from pyfmi_models.mount import Mount

LEAST_SECONDS = 8.0
"""Seconds of recordings to be fitted, together, that are enough whatever the motion is ..."""
QUICK_SECONDS, LEAST_CYCLES, LEAST_ROWS = 4.0, 2.0, 500
"""... and those that are, if the speed goes up and down so many times in them, in so many rows."""


def check_effects(mount: Mount, recordings: Sequence[Recording] = ()) -> None:
    """Refuse a card with an effect that the torque needed for a recorded motion does not hold yet (InputError).

    So is one that reads a neighbour of which recordings have no column (RecordingError).
    """
    for effect in mount.effects:
        if not effect.is_determined:  # what was drawn by chance
            text = (
                f"The card holds {effect.id}, which a diagnosis cannot take into account yet; take it out of the card."
            )
            raise InputError(text, culprit=effect.id)
    check_neighbours(mount, recordings)


def check_neighbours(mount: Mount, recordings: Sequence[Recording]) -> None:
    """Refuse a card that names a neighbour of which a recording has no column (RecordingError)."""
    for name in (name for effect in mount.effects for name in getattr(effect, "neighbours", ())):
        for one in recordings:
            there = [each.name for each in neighbours(one.columns, one.units)]
            if name not in there:
                listed = f"neighbours are: {', '.join(there)}" if there else "it has no column of a neighbour"
                text = f'{one.name}: the card\'s axis_coupling reads "{name}", which this recording lacks; {listed}.'
                raise RecordingError(text, culprit=name, choices=tuple(there))


def admit(mount: Mount, train: Sequence[Recording], heldout: Sequence[Recording]) -> None:
    """Refuse a card or recordings of which nothing can be said; errors as of the two checks."""
    check_effects(mount, (*train, *heldout))
    check_recordings(train, heldout)


def check_recordings(train: Sequence[Recording], heldout: Sequence[Recording]) -> None:
    """Refuse recordings that are too short or do not move (RecordingError)."""
    for recording in (*train, *heldout):
        if recording.duration < SHORTEST:
            text = (
                f"{recording.name}: only {recording.duration:.3g} s long; a recording needs {SHORTEST:g} s, "
                f"whether it is fitted or held out. Record longer, or split what there is in another place."
            )
            raise RecordingError(text, culprit=recording.name, value=recording.duration)
        name, slow = "q" if "q" in recording else "v", _slow(recording)
        moves = np.abs(np.diff(slow)).sum() if name == "q" else np.abs(slow).max()
        if moves <= 0:
            said = f"{recording.name}: {name} never moves, so there is nothing to diagnose."
            raise RecordingError(said, culprit=name)
    # What is enough follows from how often the motion repeats what is to be told.
    seconds, rows = sum(one.duration for one in train), sum(len(one) for one in train)
    cycles = sum(map(_cycles, train))
    is_quick = seconds >= QUICK_SECONDS and cycles >= LEAST_CYCLES and rows >= LEAST_ROWS
    if seconds < LEAST_SECONDS and not is_quick:
        names = ", ".join(recording.name for recording in train)
        text = (
            f"{names}: only {seconds:.3g} s of recording to fit, with {cycles:.2g} cycles of motion in {rows} rows; "
            f"fitting needs {LEAST_SECONDS:g} s, or {QUICK_SECONDS:g} s with {LEAST_CYCLES:g} cycles in {LEAST_ROWS} "
            f"rows. Record longer, speed up and slow down more often, or give more recordings."
        )
        raise RecordingError(text, culprit=names, value=seconds)


def _cycles(recording: Recording) -> float:
    """How often the speed goes up and down, were it a wave of its RMS frequency; a constant speed has no cycles."""
    slow, dt = _slow(recording), recording.sample_time
    speed = derivative(slow, dt) if "q" in recording else slow
    if np.std(speed) <= STEADY * rms(speed):
        return 0.0
    return recording.duration * rms(derivative(speed, dt)) / (2 * pi * float(np.std(speed)))


def _slow(recording: Recording) -> Array:
    """Position, or the speed where that alone was read, without what is faster than 10 Hz."""
    dt = recording.sample_time
    return lowpass(recording["q" if "q" in recording else "v"], dt, min(10.0, 0.2 / dt))
