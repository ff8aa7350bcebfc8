"""A machine file: which adapter, which limits, how the loop reacts. Every limit must be stated; times become cycles."""

import re
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, get_args
from urllib.parse import urlsplit

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializeAsAny,
    ValidationError,
    create_model,
    model_validator,
)

from cosim.support.complaint import complaint
from cosim.support.errors import HardwareError
from cosim.support.plain import Parsed
from cosim.support.plugins import TRANSPORTS, loaded, names
from cosim.support.toml import parsed

MILLISECONDS, CYCLES, LARGEST = 1e9, 10**9, 1e12
"""Most of what a machine may be given: eleven days, as many cycles as 32 bits count, limits in SI units."""
Positive = Annotated[float, Field(gt=0, le=LARGEST)]
Milliseconds = Annotated[float, Field(gt=0, le=MILLISECONDS)]
Cycles = Annotated[int, Field(ge=0, le=CYCLES)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Limits(_Section):
    """`[limits]`: what the axis may never exceed; all of them are required. N m, N m/s, rad/s, rad, rad, N m."""

    torque: Positive
    slew: Positive
    speed: Positive
    following_error: Positive
    jump: Positive
    torque_mismatch: Positive


class Reactions(_Section):
    """`[reactions]`: how long is too long. `ramp_ms`: of the torque limit from zero; `stop_slew`: N m/s, quick stop."""

    ramp_ms: Milliseconds = 20.0
    stop_slew: Positive = 5000.0
    patience_ms: Milliseconds = 100.0
    lost_cycles: Cycles = 2
    stale_cycles: Cycles = 2
    mismatch_cycles: Cycles = 10
    late_in_a_row: int = Field(default=3, ge=1, le=CYCLES)
    late_in_window: int = Field(default=10, ge=1, le=64)
    window_ms: Milliseconds = 1000.0
    heartbeat_ms: Milliseconds = 500.0


class Clock(_Section):
    """`[clock]`: how many of the last microseconds before an edge are spent awake.

    `answer_us`: for how long a read waits for the answer of a drive behind a network; `answer_spin_us`: of that, awake.
    """

    spin_us: float = Field(default=20.0, ge=0, le=1000)
    answer_us: float = Field(default=60.0, gt=0, le=1e6)
    answer_spin_us: float = Field(default=50.0, ge=0, le=1000)


class Encoder(_Section):
    """`[encoder]`: `heads` = 4 read heads around one disc, whose mean is the position; 0: the encoder is one.

    A head that is farther than `apart` [rad] from the middle of all is left out; an eccentric disc must stay below.
    `eccentricity` [rad] is what the simulated encoder has of it.
    """

    heads: Literal[0, 4] = 0
    apart: Positive = 1e-4
    eccentricity: float = Field(default=0.0, ge=0)


class Inject(_Section):
    """`[[inject]]`: a fault of the simulated or virtual drive, in seconds of a session.

    `size` in rad (jump), N m (saturated) or cycles (late).
    """

    kind: Literal[
        "lost", "stale", "jump", "saturated", "dead", "tripped", "late", "duplicated", "reordered", "corrupted",
        "silent_head", "frozen_head", "stray_head",
    ]  # fmt: skip
    at: float = Field(ge=0, le=LARGEST)
    lasts: Positive = 1e9
    size: float = 0.0
    head: int = Field(default=0, ge=0, le=3)


def _adapter(value: str) -> str:
    """Refuse what is no adapter."""
    parts = urlsplit(value)
    with suppress(ValueError):  # a port that is no number
        if parts.scheme == "udp" and parts.hostname and parts.port and not parts.path:
            return value
    if value == "simulated" or re.fullmatch(r".+\.py:\w+", value) or plugged(value):
        return value
    more = "".join(f' or "{name}:..."' for name in names(TRANSPORTS))
    raise ValueError(f'an adapter is "simulated" or "udp://HOST:PORT" or "FILE.py:CLASS"{more}')


def plugged(adapter: str) -> str:
    """Return the name of the plugged-in way to a drive that an adapter asks for, or "": ethercat of ethercat:eth0."""
    name, _, rest = adapter.partition(":")
    return name if rest.strip() and not rest.startswith("//") and name in names(TRANSPORTS) else ""


class Machine(_Section):
    """A whole machine file; `key_file` has the key that the loop and a drive behind a network share."""

    name: str
    adapter: Annotated[str, AfterValidator(_adapter)]
    key_file: str = ""
    watchdog_ms: Milliseconds = 2.0
    black_box_seconds: float = Field(default=120.0, gt=0, le=86_400)
    limits: Limits
    reactions: Reactions = Reactions()
    clock: Clock = Clock()
    encoder: Encoder = Encoder()
    inject: tuple[Inject, ...] = ()

    @model_validator(mode="after")
    def _heads_are_read(self) -> "Machine":
        if self.encoder.heads and self.adapter != "simulated":
            raise ValueError('[encoder] heads = 4, and only adapter = "simulated" brings the readings of heads yet')
        return self


def read_machine(source: str | Path) -> Machine:
    """Read a machine from a file or by the name of a shipped one.

    Raises:
        HardwareError: one sentence that names file, key, value and rule.
    """
    path, shipped = Path(source), files("cosim.hardware") / "machines" / f"{source}.toml"
    if path.is_file():
        return _located(parse_machine(_text(path), str(source)), path.parent)
    if shipped.is_file():
        return parse_machine(shipped.read_text("utf-8"), str(source))
    names = (one.name.removesuffix(".toml") for one in (files("cosim.hardware") / "machines").iterdir())
    choices = tuple(sorted(names))
    rule = f"a machine is a .toml file or one of: {', '.join(choices)}."
    raise HardwareError(f"{source}: no such machine; {rule}", culprit=str(source), choices=choices)


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise HardwareError(f"{path} is not text in UTF-8 (at byte {error.start}).", culprit=str(path)) from error


def _located(machine: Machine, folder: Path) -> Machine:
    """Take the file of an adapter in Python, and that of a key, from where the machine file is."""
    files = {"adapter": machine.adapter if ".py:" in machine.adapter else "", "key_file": machine.key_file}
    return machine.model_copy(update={key: str(folder.resolve() / file) for key, file in files.items() if file})


def parse_machine(text: str, path: str) -> Machine:
    """Check the text of a machine file; `path` is its name in errors."""
    try:
        return _checked(parsed(text), path)
    except tomllib.TOMLDecodeError as error:
        raise HardwareError(f"{path} is not valid TOML: {error}.", culprit=path) from error


def changed(machine: Machine, where: str, **changes: Any) -> Machine:
    """Return a machine with other values for some keys, checked as those of a file; `where` is their name in errors."""
    return _checked(machine.model_dump() | changes, where)


def _checked(values: Parsed, where: str) -> Machine:
    kind = _kind(values)
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        raise HardwareError(**complaint(error, where, "a machine", partial(_keys, kind))) from error


def _kind(values: Parsed) -> type[Machine]:
    """What checks a machine file: with the sections of ways to a drive that are plugged in, where it has more keys."""
    return _with_sections() if set(values) - set(Machine.model_fields) else Machine


@cache
def _with_sections() -> type[Machine]:
    sections: Any = {name: (loaded(TRANSPORTS, name).section | None, None) for name in names(TRANSPORTS)}
    return create_model("Machine", __base__=Machine, **sections)


def _of_kind(values: Any) -> Any:
    return _kind(values).model_validate(values) if isinstance(values, dict) else values


Kept = Annotated[SerializeAsAny[Machine], BeforeValidator(_of_kind)]
"""A machine as a part of something else, with the sections of its kind."""


def _keys(kind: type[BaseModel], location: tuple[int | str, ...]) -> tuple[str, ...]:
    """Keys that are legal beside a location: those of the section around it."""
    for part in location[:-1]:
        if isinstance(part, str):
            kind = next(_sections(kind.model_fields[part].annotation))
    return tuple(kind.model_fields)


def _sections(annotation: Any) -> Iterator[type[BaseModel]]:
    """Sections that a type of a key speaks of: of `tuple[Inject, ...]` it is Inject."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for one in get_args(annotation):
        yield from _sections(one)
