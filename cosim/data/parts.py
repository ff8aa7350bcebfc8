"""Several files of one run: position, velocity and effort in a file each, with times of their own.

    position.csv+effort.csv     files by name; those behind the first may be in its folder
    run1/                       a folder that holds nothing but such files

Their columns become channels with the times of their file, and are joined as those of an MDF file are
(`cosim.data.joining`). A column that several files have, or whose name says no quantity, is named after its file:
`effort.joint1`. A file without a time has that of another with as many rows, if there is one only.
"""

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.data.assign import assign, units_stated
from cosim.data.columns import Array, Columns, Request
from cosim.data.formats import is_recording, read_columns
from cosim.data.limits import check_cells, listed, short
from cosim.data.roles import is_named, tell_an_axis
from cosim.data.runs import JOINT, exists, split
from cosim.data.times import YEARS, read_clock
from cosim.support.errors import RecordingError
from cosim.support.files import sha256

BAGS = (".mcap", ".db3", ".bag")
"""Suffixes of bags: a folder of them is one that was split, and no run of a file for each quantity."""


@dataclass(frozen=True)
class Part:
    """One file of a run: its columns without the time, its times [s] since `origin` [ns since 1970]; None without."""

    path: Path
    found: Columns
    t: Array | None = None
    origin: int = 0


def read_run(request: Request) -> tuple[Request, Columns, str]:
    """Read the file that a path names, or the files of one run.

    Returns:
        The request for what was read (of several files the time is named and in seconds already), its columns, and
        the SHA-256 of the files.

    Raises:
        RecordingError: as `read_columns`; or a file has no time, or its time cannot be put beside the others'.
    """
    path = request.path
    files = _files_of(path)
    if len(files) == 1:
        return request, read_columns(files[0], request.layout), sha256(files[0])
    parts = [_part(file, request) for file in files]
    stated = ({name: units_stated(part.found, name) for name in part.found.values} for part in parts)
    whole = [part for part, units_of in zip(parts, stated, strict=True) if tell_an_axis(part.found.values, units_of)]
    if whole and exists(path):
        rule = f"{whole[0].path.name} holds torque and motion alone; give one file, or those of one run with + between"
        text = f"{path} is not a file but a folder of {len(parts)} recordings: {rule}."
        raise RecordingError(text, culprit=str(path), value=len(parts))
    digest = hashlib.sha256("".join(sha256(file) for file in files).encode()).hexdigest()
    said = (request.columns, request.units)
    columns, scales = ({key: text for key, text in one.items() if key != "t"} for one in said)
    return replace(request, columns=columns, units=scales), _joined(path, _with_times(path, parts)), digest


def _files_of(path: Path) -> list[Path]:
    """Return the files that a path names: one, or those of one run."""
    file, which = split(path)
    if exists(file) and file.is_dir():
        files = sorted(one for one in file.iterdir() if is_recording(one))
        bag = any(one.suffix in BAGS for one in files)
        return files if len(files) > 1 and not bag else [file]
    if which or exists(file) or JOINT not in str(file):
        return [file]
    first, *others = str(file).split(JOINT)
    beside = [Path(first), *(Path(one) if exists(Path(one)) else Path(first).parent / one for one in others)]
    return beside if all(map(exists, beside)) else [file]


def _part(path: Path, request: Request) -> Part:
    """Read one file and part its time from its columns."""
    found = read_columns(path, request.layout)
    if found.clocks:
        text = f"{path} holds channels with times of their own already; it is no part of a run of several files."
        raise RecordingError(text, culprit=str(path))
    name = _time_of(path, found, request.columns)
    if not name:
        single = found.numbered and len(found.values) == 1
        return Part(path, replace(found, values={path.stem: found.values["#1"]}) if single else found)
    stated = request.units.get("t", "") or units_stated(found, name, "t")
    clock = read_clock(path, found.values[name], name, stated, servo=True)
    if clock.values.dtype.kind not in "iuf":
        raise RecordingError(f'{path}: column "{short(name)}" holds no times.', culprit=str(path), value=name)
    t = clock.seconds
    rest = {key: column for key, column in found.values.items() if key != name}
    since = int(t[0]) if not clock.origin and len(t) and YEARS[0] <= t[0] <= YEARS[1] else 0
    notes = (*found.notes, *clock.notes)
    return Part(path, replace(found, values=rest, notes=notes), t - since, clock.origin + since * 10**9)


def _time_of(path: Path, found: Columns, columns: Mapping[str, str]) -> str:
    """Return the column that is the time of a file: as the user says, by its name, or the only one of a file `time`."""
    if columns.get("t") in found.values:
        return columns["t"]
    if not found.numbered:
        return assign(Request(path), found).sources.get("t", "")
    return "#1" if len(found.values) == 1 and is_named(path.stem, "time") else ""


def _with_times(path: Path, parts: Sequence[Part]) -> list[Part]:
    """Give a file without a time that of the only one with as many rows."""
    timed = {len(part.t): part for part in parts if part.t is not None}
    several = Counter(len(part.t) for part in parts if part.t is not None)
    whole = []
    for part in parts:
        rows = len(next(iter(part.found.values.values()), ()))
        if part.t is None and several[rows] != 1:
            rule = "name it with --columns t=..., or give a file with the times of as many rows"
            text = f"{path}: {part.path.name} has no time ({rows:,} rows); {rule}."
            raise RecordingError(text, culprit=str(part.path), value="t")
        own = part if part.t is not None else replace(part, t=timed[rows].t, origin=timed[rows].origin)
        whole += [own] if own.found.values else []
    return whole


def _joined(path: Path, parts: Sequence[Part]) -> Columns:
    """Put the columns of several files beside each other, each with the times of its file."""
    often = Counter(name for part in parts for name in part.found.values)
    origin = min(part.origin for part in parts)
    values: dict[str, np.ndarray] = {}
    clocks: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for part in parts:
        t = (np.empty(0) if part.t is None else part.t) + 1e-9 * (part.origin - origin)
        for name, column in part.found.values.items():
            telling = often[name] == 1 and (is_named(name) or not is_named(part.path.stem))
            whole = name if telling or name == part.path.stem else f"{part.path.stem}.{name.lstrip('#')}"
            values[whole], clocks[whole] = column, t
            units |= {whole: part.found.units[name]} if name in part.found.units else {}
    check_cells(path, max(map(len, values.values())), len(values))
    names = listed(tuple(part.path.name for part in parts))
    notes = (f"{path.stem}: {len(parts)} files were read as one run: {names}.",)
    start = str(np.datetime64(origin // 10**6, "ms")) if origin else ""
    return Columns(
        values,
        units,
        clocks=clocks,
        notes=(*notes, *(note for part in parts for note in part.found.notes)),
        missing=tuple(note for part in parts for note in part.found.missing),
        start=start,
    )
