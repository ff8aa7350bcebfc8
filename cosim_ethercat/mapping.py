"""Process data of an EtherCAT drive: which objects of CiA 402, in which order; their bytes follow from that.

[ethercat]
rated_torque = 100.0                        # N m; the drive counts torque in per mille of it
outputs = [
    { name = "controlword", object = 0x6040, bits = 16 },
    { name = "torque", object = 0x6071, bits = 16 },
    { name = "mode", object = 0x6060, bits = 8 },
    { object = 0x60FE, subindex = 1, bits = 32 }, # not ours: sent as zero
]
"""

import struct
from collections.abc import Mapping, Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

SIGNED = {"torque", "mode", "position", "mode_shown"}
_CODES = {8: "b", 16: "h", 32: "i"}


class Entry(BaseModel):
    """One object of a PDO; without a name it is carried and not used."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Literal["", "controlword", "torque", "mode", "statusword", "position", "mode_shown"] = ""
    object: int = Field(gt=0, le=0xFFFF)
    subindex: int = Field(default=0, ge=0, le=255)
    bits: Literal[8, 16, 32]

    @property
    def mapped(self) -> int:
        """The entry as it stands in a mapping object: index, subindex, length."""
        return self.object << 16 | self.subindex << 8 | self.bits


OUTPUTS = (
    Entry(name="controlword", object=0x6040, bits=16),
    Entry(name="torque", object=0x6071, bits=16),
    Entry(name="mode", object=0x6060, bits=8),
)
INPUTS = (
    Entry(name="statusword", object=0x6041, bits=16),
    Entry(name="position", object=0x6064, bits=32),
    Entry(name="torque", object=0x6077, bits=16),
    Entry(name="mode_shown", object=0x6061, bits=8),
)


class Ethercat(BaseModel):
    """`[ethercat]`: the drive's place on the bus, from 0; its rated torque [N m]; its PDOs and what is in them."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    position: int = Field(default=0, ge=0)
    rated_torque: Annotated[float, Field(gt=0)]
    receive_pdo: int = 0x1600
    transmit_pdo: int = 0x1A00
    outputs: tuple[Entry, ...] = OUTPUTS
    inputs: tuple[Entry, ...] = INPUTS
    distributed_clock: bool = False

    @model_validator(mode="after")
    def _complete(self) -> "Ethercat":
        needed = {"outputs": ("controlword", "torque"), "inputs": ("statusword", "position", "torque")}
        for side, names in needed.items():
            have = [one.name for one in getattr(self, side) if one.name]
            if missing := [name for name in names if name not in have]:
                raise ValueError(f"{side} must have {missing[0]}; they have: {', '.join(have)}")
            if len(set(have)) < len(have):
                raise ValueError(f"{side} have a name twice: {', '.join(have)}")
        return self


class Layout:
    """The bytes of a PDO: little-endian, one entry after the other, without gaps."""

    def __init__(self, entries: Sequence[Entry]) -> None:
        self.entries = tuple(entries)
        codes = (_CODES[one.bits] if one.name in SIGNED else _CODES[one.bits].upper() for one in self.entries)
        self._struct = struct.Struct("<" + "".join(codes))
        self.size = self._struct.size

    def pack(self, values: Mapping[str, int]) -> bytes:
        """Return the bytes of values by name; what has no name is zero."""
        return self._struct.pack(*(values.get(one.name, 0) if one.name else 0 for one in self.entries))

    def unpack(self, raw: bytes) -> dict[str, int]:
        """Return values by name."""
        values = self._struct.unpack(raw[: self.size])
        return {one.name: value for one, value in zip(self.entries, values, strict=True) if one.name}
