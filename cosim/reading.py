"""Recordings as a command line names them: with columns and units mapped, and checked against the card's axis."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from cosim.errors import InputError
from cosim.recording import Recording


def read_recordings(
    paths: Sequence[Path],
    columns: Mapping[str, str],
    given: Sequence[str] | None,
    units: Sequence[str] | None,
    motion: str,
) -> list[Recording]:
    """Read recordings of an axis that is "rotary" or "linear".

    Args:
        paths: the files.
        columns: names of a card, {"tau": "force"}.
        given: what `--columns` was given, ["tau=force", ...]; it comes before the card's.
        units: what `--units` was given, ["q=deg", ...].
        motion: kind of the axis.

    Raises:
        InputError: a pair is malformed, a unit does not fit the axis, or a recording is bad (`Recording.read`).
    """
    names = dict(columns) | pairs_of("--columns", given)
    recordings = [Recording.read(path, names, pairs_of("--units", units)) for path in paths]
    _check_kind(recordings, motion)
    return recordings


def pairs_of(option: str, given: Sequence[str] | None) -> dict[str, str]:
    """Read what an option was given as name=value pairs; raises InputError for one that is none."""
    pairs = [item.partition("=") for item in given or []]
    for name, equals, value in pairs:
        if not (name and equals and value):
            raise InputError(f'{option} {name}{equals}{value}: write it as name=value, for example "tau=force".')
    return {name: value for name, _, value in pairs}


def _check_kind(recordings: Sequence[Recording], motion: str) -> None:
    """Units stated for q or v must be those of the card's kind of axis."""
    fitting = {"q": "m", "v": "m/s"} if motion == "linear" else {"q": "rad", "v": "rad/s"}
    for recording in recordings:
        for name, unit in fitting.items():
            stated = recording.units.get(name, unit) if name in recording else unit
            if stated not in (unit, "1"):
                rule = f"{name} of a {motion} axis is in {unit} or a unit that becomes it"
                raise InputError(f'{recording.name}: the unit of "{name}" becomes {stated}; {rule}.', culprit=name)
