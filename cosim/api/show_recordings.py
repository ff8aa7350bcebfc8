"""Recordings on one screen: what a file or a `Recording` holds, and the options with which it is read."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from cosim.api.show_results import Shown
from cosim.data.preview import preview
from cosim.data.recording import Recording
from cosim.data.runs import Run, taken
from cosim.plots import recording as told
from cosim.support.errors import ManyRecordingsError
from cosim.support.plain import Json

Row = Mapping[str, Json]


def of_file(path: Path, options: Mapping[str, Mapping[str, str]], picture: str | Path | None, force: bool) -> Shown:
    """Tell what a recording's file holds, and draw it where a picture is asked for."""
    try:
        seen = preview(path, options)
    except ManyRecordingsError as error:
        return _of_many(path, error.runs)
    drawn = {"picture": str(told.draw(seen.recording, seen.sources, Path(picture), force))} if picture else {}
    return ({"recording": str(path)} | told.facts(seen) | drawn, {"columns": told.rows(seen.recording, seen.sources)})


def _of_many(path: Path, runs: Sequence[Run]) -> Shown:
    """Tell of the recordings that a file holds, and how one is taken."""
    rows: list[Row] = [
        {"number": f"#{number}", "recording": one.which, "rows": one.rows, "duration": f"{one.seconds:.6g} s"}
        for number, one in enumerate(runs, 1)
    ]
    holds = f"{len(runs):,} recordings"
    return {"recording": str(path), "holds": holds, "take one": taken(path, runs)}, {"recordings": rows}


def of_recording(recording: Recording, picture: str | Path | None, force: bool) -> Shown:
    """Tell what a recording holds."""
    drawn = {"picture": str(told.draw(recording, {}, Path(picture), force))} if picture else {}
    tables: dict[str, Sequence[Row]] = {"columns": told.rows(recording)}
    if recording.others:
        tables["text"] = [_of_text(recording, name) for name in recording.others]
    return ({"recording": recording.name} | told.facts_of(recording) | drawn, tables)


def _of_text(recording: Recording, name: str) -> Row:
    """Tell of a column that is no number how often it changes, and its first and last value."""
    changes = recording.changes(name)
    shown = [f"{len(one)} bytes" if isinstance(one, bytes) else f"{one}" for one in (changes[0][1], changes[-1][1])]
    return {"column": name, "changes": len(changes) - 1, "first": shown[0], "last": shown[1]}
