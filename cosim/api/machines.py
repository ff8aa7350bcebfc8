"""Which recordings of a folder belong to one machine, and what came of each machine.

A machine is a folder inside with recordings, or what several files have in their names before the last separator:
north_monday.csv and north_tuesday.csv are two recordings of "north". Names that say so (heldout, validation, check,
test) are kept out of the fit; NAME.toml or a card.toml in the folder of the recordings is the card.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.data.formats import is_recording
from cosim.support.errors import InputError
from cosim.support.plain import JsonObject, Parsed

HELD = re.compile(r"(held[ _-]?out|validation|valid|check|test|proof)", re.IGNORECASE)
SEPARATED = re.compile(r"[_\-. ]+[^_\-. ]*$")
DOCUMENT, JOURNAL = "diagnosis.json", "machines.jsonl"
OURS = (".toml", ".json", ".jsonl")
"""Suffixes of what is no recording among recordings: cards, settings, and what we write ourselves."""
LEAST = 2
"""Machines, and recordings of each, from which a folder of files is one of several machines: else it is one run."""


@dataclass(frozen=True)
class Machine:
    """The recordings of one machine."""

    name: str
    train: tuple[Path, ...]
    heldout: tuple[Path, ...] = ()
    card: Path | None = None


@dataclass(frozen=True)
class MachineResult:
    """What came of a machine: its answer, or why there is none; `earlier` where it was there before."""

    name: str
    out: Path
    document: Parsed
    error: str = ""
    earlier: bool = False

    @property
    def missing(self) -> tuple[str, ...]:
        """Ids of the effects that the card lacks; () if nothing is missing, or if there is no answer."""
        return tuple(name for name in self.document.get("verdict", ()) if name != "none")

    def as_json(self) -> JsonObject:
        """One line of it: the verdict, the probabilities of what is detected or possible, and the errors."""
        if self.error:
            return {"machine": self.name, "error": self.error}
        held = self.document["heldout"]
        from cosim.diagnosis.answer.names import with_names

        entries = with_names(self.document["effects"])
        return {
            "machine": self.name,
            "verdict": self.document["verdict"],
            "probabilities": {
                name: one["probability"] for name, one in entries if one["answer"] in ("found", "ambiguous")
            },
            "before_rms": held["before_rms"],
            "after_rms": held["after_rms"],
            "floor_rms": held["floor_rms"],
            "out": str(self.out),
        }

    def __str__(self) -> str:
        if self.error:
            return f"{self.name}: {self.error}"
        held, verdict = self.document["heldout"], ", ".join(self.document["verdict"]) or "nothing missing"
        errors = f"{held['before_rms']:.3g} -> {held['after_rms']:.3g} (noise {held['floor_rms']:.2g})"
        return f"{self.name}: {verdict}; validation RMS {errors}; {self.out}"


def machines_in(folder: Path) -> list[Machine]:
    """List the machines of a folder; [] where it holds the files of one run, or none.

    Raises:
        InputError: it is no folder, or cannot be listed.
    """
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise InputError(f"{folder} cannot be listed: {error.strerror}.", culprit=str(folder)) from None
    inside = [one for one in entries if one.is_dir() and not (one / JOURNAL).exists() and recordings_in(one)]
    if inside:
        return [_machine(one.name, recordings_in(one), (one, folder)) for one in inside]
    groups: dict[str, list[Path]] = {}
    for path in recordings_in(folder):
        groups.setdefault(SEPARATED.sub("", path.name.partition(".")[0]), []).append(path)
    if len(groups) < LEAST or min(map(len, groups.values())) < LEAST:
        return []
    return [_machine(name, paths, (folder,)) for name, paths in groups.items()]


def recordings_in(folder: Path) -> list[Path]:
    """List the recordings that lie in a folder."""
    known = (path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith("."))
    return [path for path in known if path.suffix not in OURS and is_recording(path)]


def _machine(name: str, paths: Sequence[Path], places: Sequence[Path]) -> Machine:
    held = [path for path in paths if HELD.search(path.stem)]
    train = [path for path in paths if path not in held]
    if not train:
        train, held = list(paths), []
    cards = [place / file for place in places for file in (f"{name}.toml", "card.toml")]
    return Machine(name, tuple(train), tuple(held), next((one for one in cards if one.is_file()), None))


def read_result(name: str, out: Path, earlier: bool = False) -> MachineResult:
    """Read what a diagnosis wrote into its folder."""
    try:
        return MachineResult(name, out, json.loads((out / DOCUMENT).read_text("utf-8")), earlier=earlier)
    except (OSError, ValueError) as error:
        return MachineResult(name, out, {}, f"{out / DOCUMENT} cannot be read: {error}")
