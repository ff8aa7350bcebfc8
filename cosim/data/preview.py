"""What a file holds before it is used: its columns, what they serve as, and the options with which it can be read."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from shlex import quote

from cosim.data.assign import assign
from cosim.data.columns import Columns, Request
from cosim.data.one_run import rows_of_one
from cosim.data.parts import read_run
from cosim.data.recording import REQUIRED, Recording
from cosim.data.runs import named
from cosim.data.speeds import with_speed
from cosim.data.times import check_slow
from cosim.support.errors import ManyRecordingsError, RecordingError, UndecidedError

TRIES = 8
"""Questions that a file may leave open: one for each column of ours, and its time."""
Options = dict[str, dict[str, str]]


@dataclass(frozen=True)
class Preview:
    """A file as it can be read.

    Args:
        recording: the file with `options`, as an axis if it can be one, else as a table with a time.
        found: its columns as they are.
        sources: our names to the file's.
        options: what has to be said to read it, by option; an example where `undecided` says so.
        refused: why it is no recording of an axis, whatever is said; empty if it can be one.
        undecided: why something has to be said, one sentence each.
    """

    recording: Recording
    found: Columns
    sources: dict[str, str]
    options: Options
    refused: str
    undecided: tuple[str, ...] = ()

    @property
    def said(self) -> str:
        """The options as they are typed."""
        pairs = {name: [quote(f"{ours}={value}") for ours, value in one.items()] for name, one in self.options.items()}
        return " ".join(f"--{name} {' '.join(texts)}" for name, texts in pairs.items() if texts)


def preview(path: Path, options: Mapping[str, Mapping[str, str]] | None = None) -> Preview:
    """Read a file with the options that it needs, asked of the reader one after the other.

    Args:
        path: the file.
        options: what the user says already: {"columns": ..., "units": ..., "layout": ...}.

    Raises:
        RecordingError: it is not even a table with a time.
    """
    said: Options = {name: dict((options or {}).get(name, {})) for name in ("columns", "units", "layout")}
    request, found, own = read_run(Request(path, said["columns"], said["units"], said["layout"]))
    said |= {"columns": dict(request.columns), "units": dict(request.units)}
    undecided: list[str] = []
    for _ in range(TRIES):
        try:
            return replace(_judged(path, own, found, said), undecided=tuple(undecided))
        except UndecidedError as error:
            undecided.append(str(error))
            said = {name: error.decided_by.get(name, {}) | pairs for name, pairs in said.items()}
    raise RecordingError(undecided[-1], culprit=str(path))


def _judged(path: Path, own: str, found: Columns, said: Options) -> Preview:
    """The file as an axis; else as what it holds of one: a torque or a position without the other, or a table."""
    try:
        return _read(path, own, found, said, REQUIRED)
    except (UndecidedError, ManyRecordingsError):
        raise
    except RecordingError as error:
        refused, lacking = str(error), error.value
    there = {"t", *found.values, *said["columns"]}  # a table has our names only where they are given
    said = said | {"units": {ours: text for ours, text in said["units"].items() if ours in there}}
    if lacking in REQUIRED and lacking not in found.lacks:
        try:
            rest = tuple(rule for rule in REQUIRED if rule != lacking)
            return _read(path, own, found, said, rest, refused)
        except RecordingError:
            pass  # then nothing of it is served
    return _read(path, own, found, said, (), refused)


def _read(path: Path, own: str, found: Columns, said: Options, required: tuple[str, ...], refused: str = "") -> Preview:
    request = Request(path, **said, required=required)
    timed = rows_of_one(request, found)
    if refused:
        table = assign(request, timed)
        if "t" in table.values:
            check_slow(path, table.values["t"], table.sources["t"], table.units.get("t", ""))
    recording = Recording.judged(request, named(path), timed, own)
    served = assign(request, timed)
    served = with_speed(path, timed, served, said["units"]) if required == REQUIRED else served
    return Preview(recording, timed, served.sources, said, refused)
