"""Recordings of several machines in one folder: each machine diagnosed in a process of its own, and gone on with.

A machine is a folder inside with recordings, or what several files have in their names before the last separator:
north_monday.csv and north_tuesday.csv are two recordings of "north". Names that say so (heldout, validation, check,
test) are kept out of the fit; NAME.toml or a card.toml beside the recordings is the card.
"""

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from os import cpu_count
from pathlib import Path

from cosim.data.formats import is_recording
from cosim.support.errors import InputError
from cosim.support.plain import JsonObject, Parsed

HELD = re.compile(r"(held[ _-]?out|validation|valid|check|test|proof)", re.IGNORECASE)
SEPARATED = re.compile(r"[_\-. ]+[^_\-. ]*$")
DOCUMENT = "diagnosis.json"
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
class Outcome:
    """What came of a machine: its answer, or why there is none; `earlier` where it was there before."""

    name: str
    out: Path
    document: Parsed
    error: str = ""
    earlier: bool = False

    def as_json(self) -> JsonObject:
        """One line of it: the verdict, the probabilities of what was detected or is possible, and the errors."""
        if self.error:
            return {"machine": self.name, "error": self.error}
        told, held = self.document, self.document["heldout"]
        named = [one for one in told["effects"] if one["answer"] in ("found", "ambiguous")]
        return {
            "machine": self.name,
            "verdict": told["verdict"],
            "probabilities": {one["effect"]: one["probability"] for one in named},
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
    """List the machines of a folder; [] where it holds the files of one run, or none."""
    inside = [one for one in sorted(folder.iterdir()) if one.is_dir() and _recordings(one)]
    if inside:
        return [_machine(one.name, _recordings(one), (one, folder)) for one in inside]
    groups: dict[str, list[Path]] = {}
    for path in _recordings(folder):
        groups.setdefault(SEPARATED.sub("", path.name.partition(".")[0]), []).append(path)
    if len(groups) < LEAST or min(map(len, groups.values())) < LEAST:
        return []
    return [_machine(name, paths, (folder,)) for name, paths in groups.items()]


def _recordings(folder: Path) -> list[Path]:
    known = (path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith("."))
    return [path for path in known if path.suffix not in (".toml", ".json") and is_recording(path)]


def _machine(name: str, paths: Sequence[Path], places: Sequence[Path]) -> Machine:
    held = [path for path in paths if HELD.search(path.stem)]
    train = [path for path in paths if path not in held]
    if not train:
        train, held = list(paths), []
    cards = [place / file for place in places for file in (f"{name}.toml", "card.toml")]
    return Machine(name, tuple(train), tuple(held), next((one for one in cards if one.is_file()), None))


def diagnose_all(
    machines: Sequence[Machine],
    out: Path,
    options: Sequence[str],
    *,
    card: str = "",
    workers: int | None = None,
    force: bool = False,
) -> Iterator[Outcome]:
    """Diagnose each machine into a folder of its name; yield outcomes as they come.

    Raises:
        InputError: results would come between recordings.

    Args:
        machines: from `machines_in`.
        out: folder of the folders; what is complete there is not done again without `force`.
        options: further options of `cosim diagnose`, for all.
        card: of machines without a card of their own; "" estimates one.
        workers: how many at a time; the cores of this machine where not given.
        force: diagnose again what is there.
    """
    for one in machines:
        if (out / one.name).resolve() in {path.parent.resolve() for path in one.train}:
            text = f"--out {out}: results of {one.name} would come between its recordings; name another folder."
            raise InputError(text, culprit=str(out))
    begun: list[subprocess.Popen[str]] = []

    def work(one: Machine) -> Outcome:
        return _one(one, out / one.name, [*options, *_card(one, card)], begun.append)

    done = [] if force else [one for one in machines if (out / one.name / DOCUMENT).is_file()]
    yield from (_read(one.name, out / one.name, earlier=True) for one in done)
    with ThreadPoolExecutor(workers or cpu_count() or 1, "machine") as pool:
        asked = [pool.submit(work, one) for one in machines if one not in done]
        try:
            yield from (future.result() for future in as_completed(asked))
        except BaseException:
            for future in asked:
                future.cancel()
            for process in begun:
                process.terminate()
            raise


def _card(one: Machine, card: str) -> list[str]:
    chosen = str(one.card) if one.card else card
    return ["--card", chosen] if chosen else []


def _one(
    one: Machine, out: Path, options: Sequence[str], on_begin: Callable[["subprocess.Popen[str]"], None]
) -> Outcome:
    held = [word for path in one.heldout for word in ("--heldout", str(path))]
    command = [sys.executable, "-m", "cosim", "diagnose", *map(str, one.train), *held, "--out", str(out), *options]
    process = subprocess.Popen(
        [*command, "--force"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, stdin=subprocess.DEVNULL
    )
    on_begin(process)
    said = process.communicate()[1]
    if process.returncode:
        lines = [line.removeprefix("cosim: ") for line in said.splitlines() if line.strip()]
        return Outcome(one.name, out, {}, lines[-1] if lines else f"ended with {process.returncode}")
    return _read(one.name, out)


def _read(name: str, out: Path, earlier: bool = False) -> Outcome:
    try:
        return Outcome(name, out, json.loads((out / DOCUMENT).read_text("utf-8")), earlier=earlier)
    except (OSError, ValueError) as error:
        return Outcome(name, out, {}, f"{out / DOCUMENT} cannot be read: {error}")
