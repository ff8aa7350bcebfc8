"""A wire and a record: what is connected with what, and what becomes a column of the recording."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, ClassVar, Literal, get_type_hints

from pydantic import ConfigDict, Field, PlainValidator

from cosim.system.ports import PortField, PortRef

CHECKED = ConfigDict(extra="forbid", allow_inf_nan=False, populate_by_name=True)
"""How a section of a file is checked when it is read; what Python code makes is checked when it is wired."""


def _port(value: Any) -> PortRef:
    """Check a port that comes from a file."""
    if not isinstance(value, str):
        raise ValueError("input should be a valid string")
    return PortRef(value)


@dataclass(frozen=True)
class Wire:
    """y = quantise(gain * x + offset) + noise, from an output or signal to an input; in a file `[[connections]]`.

    `quantum` is the step of the quantiser (0: none), `noise` a signal that is added, `unit` that of gain * x + offset
    (the source's where not given). `breaks_loop` accepts that the wire's delay breaks an algebraic loop. `table` puts
    values in the place of others, numbers or names of items; what it does not name stays. `cast` takes the nearest
    value of the target's type where that does not hold what arrives.
    """

    source: Annotated[PortField, PlainValidator(_port), Field(alias="from")] = PortField()
    target: Annotated[PortField, PlainValidator(_port), Field(alias="to")] = PortField()
    gain: float = 1.0
    offset: float = 0.0
    quantum: Annotated[float, Field(ge=0)] = 0.0
    noise: str = ""
    unit: str = ""
    breaks_loop: bool = False
    cast: bool = False
    table: Annotated[Mapping[str, float | bool | str], Field(alias="map")] = field(default_factory=dict)
    __pydantic_config__: ClassVar[Any] = CHECKED

    @property
    def straight(self) -> bool:
        """Whether values arrive as they are."""
        return (self.gain, self.offset, self.quantum, self.noise, dict(self.table)) == (1.0, 0.0, 0.0, "", {})


@dataclass(frozen=True)
class Record:
    """A column of the recording: the sample at the row's time, or the mean over the sample interval around it."""

    signal: Annotated[PortField, PlainValidator(_port)] = PortField()
    mode: Literal["sample", "mean"] = "sample"
    __pydantic_config__: ClassVar[Any] = CHECKED


def keys_of(section: type[Wire] | type[Record]) -> tuple[str, ...]:
    """Return the keys that a section of a file may have: aliases where fields have one."""
    hints = get_type_hints(section, include_extras=True)
    notes = {one.name: getattr(hints[one.name], "__metadata__", ()) for one in fields(section)}
    return tuple(
        next((note.alias for note in found if getattr(note, "alias", None)), name) for name, found in notes.items()
    )
