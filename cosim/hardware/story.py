"""What a recording of a session says of itself, checked word by word before any of it is used.

A recording comes from anywhere: nothing in it is a path that is opened, and nothing in it is believed that a replay or
a hash can show.
"""

import hashlib
import json
from collections.abc import Mapping

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from cosim.data.recording import Recording
from cosim.hardware.machine import Kept
from cosim.hardware.structures import INPUTS
from cosim.hardware.wired import REFERENCE
from cosim.support.complaint import complaint
from cosim.support.errors import HardwareError
from cosim.support.numbers import Step
from cosim.support.plain import JsonObject

Hash = Field(pattern="^[0-9a-f]{64}$")


class _Said(BaseModel):
    """A part of a story; what a later version says more is kept."""

    model_config = ConfigDict(extra="allow", frozen=True, allow_inf_nan=False)


class Origin(_Said):
    """`controller`: the hash of its FMU, and what it was started with."""

    sha256: str = Hash
    file: str = ""
    parameters: dict[str, float | bool | str] = {}


class CardSaid(_Said):
    """`cards.NAME`: the card that a component was built from, by its name there and its hash."""

    card: str
    sha256: str = Hash


class Story(_Said):
    """All that a replay needs beside the records."""

    step: Step
    quantum: float = Field(ge=1e-30, le=1e30)
    inputs: list[str] = Field(min_length=1, max_length=INPUTS)
    encoder: str
    output: str
    units: dict[str, str]
    machine: Kept
    controller: Origin
    cards: dict[str, CardSaid] = {}

    @model_validator(mode="after")
    def _names_are_there(self) -> "Story":
        for name in (self.encoder, REFERENCE):
            if name not in self.inputs:
                raise ValueError(f'"{name}" is none of the inputs {", ".join(self.inputs)}')
        return self


class Seal(_Said):
    """`seal`: how many records the recording was written with, the hash of their columns, and that of the story."""

    records: int = Field(ge=0)
    sha256: str = Hash
    story: str = Hash


def story_in(recording: Recording) -> Story:
    """Return what a recording says of its session.

    Raises:
        HardwareError: it is no recording of a session, or what it says breaks a rule.
    """
    said = recording.origin.get("hardware")
    if not isinstance(said, dict):
        message = f"{recording.name} is no recording of `cosim hardware run`, which keeps what a replay needs."
        raise HardwareError(message, culprit=recording.name)
    try:
        return Story.model_validate(said)
    except ValidationError as error:
        raise HardwareError(**complaint(error, recording.name, "a session", lambda _: ())) from error


def seal_of(table: Mapping[str, np.ndarray], story: object) -> JsonObject:
    """Return the seal of a session: rows, and the SHA-256 of all columns with their names, in the order of names.

    The story has a hash of its own: machine, limits, controller and the cards with their hashes.
    """
    digest = hashlib.sha256()
    for name in sorted(table):
        digest.update(name.encode() + b"\0" + np.ascontiguousarray(table[name], dtype="<f8").tobytes())
    said = hashlib.sha256(json.dumps(story, sort_keys=True).encode()).hexdigest()
    return {"records": len(next(iter(table.values()))), "sha256": digest.hexdigest(), "story": said}


def broken_seal(recording: Recording) -> str:
    """Say what shows that a recording is not the file that its session wrote; empty where nothing does."""
    try:
        seal = Seal.model_validate(recording.origin.get("seal"))
    except ValidationError:
        return "it has no seal, or one that is damaged"
    if seal.records != len(recording):
        return f"it has {len(recording):,} of the {seal.records:,} cycles that were recorded"
    now = seal_of({name: recording[name] for name in recording}, recording.origin.get("hardware"))
    if now["sha256"] != seal.sha256:
        return "its numbers are not those that were recorded"
    return "" if now["story"] == seal.story else "what it says of its machine, controller and cards was altered"
