"""A file of many recordings: where each begins, and what tells it from the others."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.data.limits import NAME, short
from cosim.support.errors import ManyRecordingsError

JOINT = "+"
"""Sign between the files of one run."""
TOLD_BY = 4
"""Columns that may tell recordings apart together; where it takes more, their numbers are shorter."""
MIXED = 20
"""Recordings whose rows may be mixed in one table: axes of a machine."""
TYPED = re.compile(r"[^=,:#/\\\x00-\x1f]+=[^,/\\\x00-\x1f]+")
"""What can be typed behind a file's name, and is no part of a path."""
SAME = 1e-6
"""Relative difference below which numbers are one: a single-precision 0.1 is the 0.1 that somebody types."""


@dataclass(frozen=True)
class Run:
    """One recording of a file: what stands after the file's name to take it, its first row (from 0), rows, seconds."""

    which: str
    first: int
    rows: int
    seconds: float


def split(path: Path | str) -> tuple[Path, str]:
    """Return the file, and what stands after a colon behind its name: `run=3`, `#3`; empty where nothing does."""
    text = str(path)
    places = [len(text), *(place for place, sign in enumerate(text) if sign == ":")]
    place = next((one for one in places if exists(Path(text[:one]), Path.is_file)), len(text))
    return Path(text[:place]), text[place + 1 :]


def named(path: Path) -> str:
    """Return what a recording is called: its file, or files, without the suffix, and which recording of it."""
    file, which = split(path)
    several = JOINT in str(file) and not exists(file)
    name = JOINT.join(Path(one).stem for one in str(file).split(JOINT)) if several else file.stem
    return f"{name}:{which}" if which else name


def starts(t: np.ndarray) -> np.ndarray:
    """Return the rows, from 0, at which time starts anew, the first row among them."""
    return np.concatenate([[0], np.flatnonzero(np.diff(t) < 0) + 1])


def runs_of(values: Mapping[str, np.ndarray], t: np.ndarray) -> tuple[Run, ...]:
    """Return the recordings of a table by their times, called by the columns that tell them apart, else by number."""
    begins = starts(t)
    ends = np.append(begins[1:], len(t))
    numbered = [f"#{number}" for number in range(1, len(begins) + 1)]
    names = _names(values, begins) or numbered
    rows = zip(names, begins.tolist(), ends.tolist(), strict=True)
    return tuple(Run(name, first, end - first, float(t[end - 1] - t[first])) for name, first, end in rows)


def many(path: Path, values: Mapping[str, np.ndarray], t: np.ndarray, where: str) -> ManyRecordingsError:
    """Refuse a table of many recordings and name the way to take one; `where` says where its time runs backwards."""
    runs = runs_of(values, t)
    told = f"{where} These are {len(runs):,} recordings, if another begins there; take one, {taken(path, runs)}."
    return ManyRecordingsError(told, culprit=str(path), value=len(runs), runs=runs)


def taken(path: Path, runs: Sequence[Run]) -> str:
    """Say how the first of several is taken, by what tells it apart and by its number."""
    first = runs[0].which
    by_name = f"{_typed(path)}{first}, or by number, " if first != "#1" and len(first) <= NAME else ""
    return f"{by_name}{_typed(path)}#1 to #{len(runs)}"


def _typed(path: Path) -> str:
    """The name of a file as it is typed in front of what takes one of its recordings."""
    return f"{path.name}{',' if ':' in path.name else ':'}"


def mixed(path: Path, values: Mapping[str, np.ndarray], t: np.ndarray) -> str:
    """Say which column tells recordings apart whose rows are mixed, and how one is taken; empty if none does."""
    for name, column in values.items():
        parts = [np.flatnonzero(column == kind) for kind in _kinds(column)]
        which = [f"{name}={text_of(column[rows[0]])}" for rows in parts]
        grow = all(len(rows) > 1 and bool((np.diff(t[rows]) > 0).all()) for rows in parts)
        if len(parts) > 1 and grow and all(map(TYPED.fullmatch, which)):
            told = f'rows of {len(parts)} recordings are mixed, and "{short(name)}" tells them apart'
            return f"{told}; take one, {_typed(path)}{which[0]} to {which[-1]}."
    return ""


def _kinds(column: np.ndarray) -> list[object]:
    """Values of a column that may be the name of a recording; none where it has many."""
    if column.dtype.kind not in "iufbO" or len(set(column[: 10 * MIXED].tolist())) > MIXED:
        return []
    kinds = list(dict.fromkeys(column.tolist()))
    return kinds if len(kinds) <= MIXED else []


def text_of(value: object) -> str:
    """Return a value of a column as it is typed."""
    return f"{value:.7g}" if isinstance(value, float | np.floating) else str(value)


def equal(column: np.ndarray, text: str) -> np.ndarray:
    """Which rows of a column hold what was typed, (rows,) of bool."""
    if column.dtype.kind not in "iuf":
        return np.array([str(value) == text for value in column], bool)
    try:
        return np.isclose(column.astype(np.float64), float(text), rtol=SAME, atol=0.0)
    except ValueError:
        return np.zeros(len(column), bool)


def _names(values: Mapping[str, np.ndarray], begins: np.ndarray) -> list[str]:
    """Return `column=value` for each recording, of one column that suffices, else of several; empty where none do."""
    steady = {name: column[begins] for name, column in values.items() if _stays(column, begins)}
    said = {name: [f"{name}={text_of(value)}" for value in column] for name, column in steady.items()}
    differing = [texts for texts in said.values() if len(set(texts)) > 1 and all(map(TYPED.fullmatch, texts))]
    single = next(filter(_differ, differing), [])
    joined = [",".join(texts) for texts in zip(*differing, strict=True)] if len(differing) <= TOLD_BY else []
    return single or (joined if _differ(joined) else [])


def _stays(column: np.ndarray, begins: np.ndarray) -> bool:
    """Whether a column changes nowhere but where a recording begins."""
    changes = np.flatnonzero(column[1:] != column[:-1]) + 1
    return bool(np.isin(changes, begins).all())


def _differ(texts: list[str]) -> bool:
    return len(set(texts)) == len(texts)


def exists(path: Path, is_one: Callable[[Path], bool] = Path.exists) -> bool:
    """Whether there is a file or folder; a name that is too long, or holds a zero byte, has none."""
    try:
        return is_one(path)
    except (OSError, ValueError):
        return False
