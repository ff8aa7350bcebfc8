"""Torque ripple locked to position."""

from dataclasses import dataclass
from functools import lru_cache
from math import pi
from typing import ClassVar

import casadi as ca
import numpy as np

from pyfmi_models.effects.base import LoadEffect, Main, Motion, times, words
from pyfmi_models.model import Scalar, parameter, structure


@dataclass(frozen=True, kw_only=True)
class Cogging(LoadEffect):
    """Torque periodic in position, the same in both directions and at every speed.

        torque = amplitude w(a) / half,   w(a) = sin(a) + h2 sin(2 a) + h3 sin(3 a) + ...,
        a = cycles angle + phase + pi/2

    so without harmonics amplitude cos(cycles angle + phase). `half` is half the peak-to-peak value of w, which leaves
    that of the torque at `amplitude`. The angle repeats once per turn of a rotary axis and once per metre of a linear
    one. A ripple whose harmonics have phases of their own is several effects of this kind.
    """

    id: ClassVar[str] = "cogging"
    title: ClassVar[str] = "Cogging"
    equation: ClassVar[str] = "a cos(N q + φ)"
    main: ClassVar[Main] = Main("amplitude")
    to_record: ClassVar[str] = "record slow motion over the whole stroke"
    rivals: ClassVar[tuple[str, ...]] = ("position_friction", "gravity_unbalance", "encoder_eccentricity")
    told_apart_by: ClassVar[str] = "friction that depends on position changes sign with the direction; cogging does not"
    action: ClassVar[str] = "Nothing needs repair: motors with slots and magnets do this. Use the improved model."
    cycles_per_rev: Scalar = parameter("1", "Ripple cycles per turn (per metre of a linear axis)", low=0, fitted=False)
    amplitude: Scalar = parameter("N.m", "Half the peak-to-peak torque", low=0)
    phase: Scalar = parameter("rad", "Phase at position zero", default=0.0)
    harmonics: tuple[float, ...] = structure(
        "1", "Second, third, ... harmonic, relative to the first", low=-100, high=100
    )

    def load(self, motion: Motion) -> Scalar:
        """The equation above."""
        turn = self.cycles_per_rev * motion.angle + self.phase
        return self.amplitude / _half(self.harmonics) * _wave(turn, self.harmonics)

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        often = f"{times(self.cycles_per_rev)} per {words(unit)['turn']}"
        return f"The motor torque ripples {often}, by {self.amplitude:.3g} {unit} each way."


def _wave(turn: Scalar, harmonics: tuple[float, ...]) -> Scalar:
    overtones = (share * ca.sin(k * (turn + pi / 2)) for k, share in enumerate(harmonics, 2))
    return ca.cos(turn) + sum(overtones)


@lru_cache(maxsize=256)
def _half(harmonics: tuple[float, ...]) -> float:
    """Half the peak-to-peak value of the wave."""
    turns = np.linspace(0, 2 * pi, 1024 * (len(harmonics) + 1), endpoint=False)
    return float(np.ptp(ca.DM(_wave(turns, harmonics)).full())) / 2 if harmonics else 1.0
