"""Tonal disturbances: torque at a frequency in time, whose phase only the recording itself can tell.

A machine next door runs at its own frequency and strength through all recordings, but each recording begins at another
moment of its turn. So frequency and amplitude are parameters like any other, and the phase of a tone is the one in
which it explains most of what is left of the torque recorded in that piece: least squares on sine and cosine.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.estimation.prepare import Array, Piece, Prepared
from pyfmi_models.effects.base import TonalEffect
from pyfmi_models.mount import Mount

LEAST_WAVES = 6
"""Waves that the longest piece must hold: what is slower is drift, or friction that wanders."""
Rows = npt.NDArray[np.bool_]


def without_tones(mount: Mount) -> Mount:
    """The mount without what shakes it in time."""
    rest = tuple(effect for effect in mount.effects if not isinstance(effect, TonalEffect))
    return mount if len(rest) == len(mount.effects) else replace(mount, effects=rest)


def phases_of(mount: Mount) -> tuple[str, ...]:
    """Names of the phases that are each recording's own."""
    return tuple(f"{name}.{effect.own_phase}" for name, effect in mount.of_kind(TonalEffect))


def detectable_band(prepared: Prepared) -> tuple[float, float]:
    """Lowest and highest frequency [Hz] that can be told from drift and lies in the band of the analysis."""
    seconds = max(len(piece.kept) * piece.stride * piece.dt for piece in prepared.pieces)
    return LEAST_WAVES / seconds, prepared.cutoff


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
        torque = tone.amplitude * piece.gain(tone.hertz) * np.sin(angle + phase)
        rest = rest - torque
        yield phase, torque
