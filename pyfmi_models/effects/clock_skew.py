"""Two clocks."""

from dataclasses import dataclass
from typing import ClassVar

from pyfmi_models.effects.base import ClockEffect, Main, Motion
from pyfmi_models.model import Scalar, parameter


@dataclass(frozen=True, kw_only=True)
class ClockSkew(ClockEffect):
    """Not physics: in a row of a recording the reading is older or newer than the torque.

        ahead = offset + drift t,   recorded(t) = reading at t + ahead

    It does not touch the loop, which sees the encoder when it is read; so `q` stays and the plant gets one more output,
    `q_recorded`. There the position at t + ahead is q + ahead v + ahead^2 a / 2: it may be ahead of time, which no
    dead time can be. Its relative error for motion of frequency omega is (omega ahead)^3 / 6: 1e-4 at 8 ms, 10 rad/s.
    """

    id: ClassVar[str] = "clock_skew"
    title: ClassVar[str] = "Clock skew"
    equation: ClassVar[str] = "t_q = t_τ (1 + drift) + offset"
    main: ClassVar[Main] = Main("offset_ms", unit="ms", is_size=False)
    to_record: ClassVar[str] = "record 10 min in one piece"
    rivals: ClassVar[tuple[str, ...]] = ("delay",)
    told_apart_by: ClassVar[str] = (
        "a clock may drift, or run ahead, or trail the set point; a delay is constant, and the loop makes up for it"
    )
    action: ClassVar[str] = "No repair: take time stamps of torque and encoder from one clock."
    drift_ppm: Scalar = parameter(
        "1", "Drift of the reading's clock, parts per million", default=0.0, low=-1e5, high=1e5
    )
    offset_ms: Scalar = parameter(
        "ms", "Time by which the reading is ahead of the torque", default=0.0, low=-1e3, high=1e3
    )

    def ahead(self, motion: Motion) -> Scalar:
        """`offset + drift t`."""
        return 1e-3 * self.offset_ms + 1e-6 * self.drift_ppm * motion.t

    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        way = "ahead of" if self.offset_ms > 0 else "behind"
        offset = f"is {abs(self.offset_ms):.2g} ms {way} the torque" if self.offset_ms else ""
        drift = f"drifts by {self.drift_ppm:.3g} ppm" if self.drift_ppm else ""
        return f"The clock of the encoder {' and '.join(filter(None, (offset, drift))) or 'is right'}; not mechanical."
