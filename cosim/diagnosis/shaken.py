"""What shakes the axis in time: tones whose phase only the recording itself can tell.

A machine next door runs at its own frequency and strength through all recordings, but each recording begins at another
moment of its turn. So frequency and amplitude are parameters like any other, and the phase of a tone is the one in
which it explains most of what is left of the torque recorded in that piece: least squares on sine and cosine.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.prepare import Array, Piece, gain
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.mount import Mount

Rows = npt.NDArray[np.bool_]


def phases_of(mount: Mount) -> tuple[str, ...]:
    """Names of the phases that are each recording's own."""
    return tuple(f"{name}.phase" for name, _ in mount.of_kind(PeriodicDisturbance))


class Tone(NamedTuple):
    """A tone as the recorded torque shows it: frequency [Hz] and amplitude [N m] at the drive."""

    hertz: float
    amplitude: float


def in_phase(piece: Piece, rest: Array, tones: Sequence[Tone], rows: Rows) -> Iterator[tuple[float, Array]]:
    """Phase [rad] at time zero and torque (rows,), filtered as `tau` is, of each tone in a rest of the torque.

    Each tone is found in what those before it leave; `rows` are those that count.
    """
    for tone in tones:
        angle = 2 * np.pi * tone.hertz * piece.t
        waves = np.column_stack([np.sin(angle), np.cos(angle)])
        a, b = np.linalg.lstsq(waves[rows], rest[rows], rcond=None)[0]
        phase = float(np.arctan2(b, a))
        torque = tone.amplitude * gain(tone.hertz, piece.dt, piece.cutoff) ** 2 * np.sin(angle + phase)
        rest = rest - torque
        yield phase, torque
