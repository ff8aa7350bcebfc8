"""Simulations of a calibration kept in its folder until it is done: one that was ended goes on where it was.

The fit is a function of what was simulated alone, so that it comes to the same bits however often it was ended.

progress/calibration.json    what the simulations depend on, as hashes
progress/runs.jsonl          a line for each point that is done
progress/points/             the outputs at each point
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from cosim.support.errors import CosimError, OutputError
from cosim.support.files import directory, replacing
from cosim.support.journal import RUNS, Journal, clear
from cosim_calibration.simulation import Answer, Outputs, Point

FOLDER, POINTS = "progress", "points"
MADE = ("calibration.json", RUNS, POINTS)


class Store:
    """Outputs at points, on disk."""

    def __init__(self, journal: Journal) -> None:
        self._journal = journal
        self._points = directory(journal.folder / POINTS)
        self._known = {row["key"]: row for row in journal.rows.values()}
        self.found = len(self._known)
        """Points that were done before."""

    def get(self, point: Point, part: slice) -> Answer | None:
        """What is known of a point; None where nothing is."""
        row = self._known.get(_key(point, part))
        if row is None:
            return None
        if row["reason"]:
            return Answer(None, row["reason"])
        try:
            with np.load(self._path(row["run"])) as arrays:
                counts = arrays["arr_0"].tolist()
                columns = iter([arrays[f"arr_{k + 1}"] for k in range(sum(counts))])
        except (OSError, ValueError, KeyError, BadZipFile):
            return None  # damaged by another hand: it is simulated again
        outputs: Outputs = [[next(columns) for _ in range(count)] for count in counts]
        return Answer(outputs)

    def put(self, point: Point, part: slice, answer: Answer) -> None:
        """Keep what was simulated; it is there even if this process is killed at once."""
        key = _key(point, part)
        number = self._known[key]["run"] if key in self._known else len(self._journal.rows)
        if answer.outputs is not None:
            columns = [values for one in answer.outputs for values in one]
            counts = np.array([len(one) for one in answer.outputs])
            with replacing(self._path(number), force=True) as partial, partial.open("wb") as file:
                np.savez(file, counts, *columns)
        row = {"run": number, "key": key, "reason": "" if answer.outputs is not None else answer.reason or "lost"}
        self._journal.append(row)
        self._known[key] = row

    def _path(self, number: int) -> Path:
        return self._points / f"{number:06d}.npz"


@contextmanager
def stored(out: Path, identity: Mapping[str, str], force: bool) -> Iterator[Store]:
    """Yield the store of a calibration whose results go to `out`; it is removed unless the calibration is broken off.

    Args:
        out: folder of the results.
        identity: what the simulations depend on.
        force: start over where the folder holds the store of another calibration.

    Raises:
        OutputError: the folder holds the store of another calibration, or another one is writing to it.
    """
    folder = out / FOLDER
    try:
        journal = _journal(folder, identity, False)
    except OutputError:
        if not force:
            raise
        journal = _journal(folder, identity, True)
    with journal:
        try:
            yield Store(journal)
        except CosimError:
            _remove(folder)  # the next one would come to the same
            raise
        _remove(folder)


def _journal(folder: Path, identity: Mapping[str, str], force: bool) -> Journal:
    def fits(row: Mapping[str, object]) -> bool:
        return isinstance(row.get("key"), str) and isinstance(row.get("reason"), str)

    return Journal(folder, identity, force, "calibration", MADE, fits)


def _remove(folder: Path) -> None:
    clear(folder, MADE)
    for one in (folder, folder.parent):
        with suppress(OSError):  # it holds more than ours
            one.rmdir()


def _key(point: Point, part: slice) -> str:
    text = json.dumps([sorted((name, float(value).hex()) for name, value in point.items()), part.start, part.stop])
    return hashlib.sha256(text.encode()).hexdigest()
