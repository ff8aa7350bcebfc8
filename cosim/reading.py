"""Recordings as a command line names them: with columns and units mapped, and checked against the card's axis."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from cosim.data.limits import LIMIT
from cosim.data.questions import OF_ROWS
from cosim.data.recording import REQUIRED, Recording
from cosim.data.runs import JOINT, split
from cosim.support.errors import InputError, RecordingError, UndecidedError, UnitError
from cosim.support.units import unit

LAYOUT = ("separator", "decimal", "header", "encoding", *OF_ROWS, LIMIT)
"""What `--layout` may say: how a text is written, what becomes of rows, and the factor that raises limits."""
TORQUE = {"linear": "N", "rotary": "N.m"}
SUITED = {"rotary": {"q": "rad", "v": "rad/s"}, "linear": {"q": "m", "v": "m/s"}}
"""Units in which position and speed of an axis are kept."""


def read_recordings(
    paths: Sequence[Path],
    columns: Mapping[str, str],
    given: Sequence[str] | None,
    units: Sequence[str] | None,
    motion: str,
    layout: Sequence[str] | None = None,
) -> list[Recording]:
    """Read recordings of an axis that is "rotary" or "linear".

    Args:
        paths: the files; several of one run with a `+` between them, or their folder.
        columns: names of a card, {"tau": "force"}.
        given: what `--columns` was given, ["tau=force", "run3.csv:tau=current", ...]; it comes before the card's, and
            what is said of one file before what is said of all.
        units: what `--units` was given, ["q=deg", "run3.csv:q=arcsec", ...].
        motion: kind of the axis; "" where it is not known yet.
        layout: what `--layout` was given, ["decimal=comma", "run3.txt:header=4", ...].

    Raises:
        InputError: a pair is malformed or of no file, a unit does not fit the axis, or a recording is bad
            (`Recording.read`).
    """
    names, scales, written = (
        _by_file(*one, paths) for one in (("--columns", given), ("--units", units), ("--layout", layout))
    )
    for one in written:
        _check_layout(one)
    read = zip(paths, names, scales, written, strict=True)
    recordings = [_read(path, paths, dict(columns) | name, scale, text) for path, name, scale, text in read]
    if motion:
        check_kind(recordings, motion)
    return recordings


def _read(
    path: Path, paths: Sequence[Path], columns: Mapping[str, str], units: Mapping[str, str], layout: Mapping[str, str]
) -> Recording:
    """Read a recording; where another of the files has what it lacks, the refusal says how both are one."""
    try:
        return Recording.read(path, columns, units, layout=layout)
    except RecordingError as error:
        others = [one for one in paths if one.parent == path.parent and one != path] if error.value in REQUIRED else []
        for other in others:
            run = path.with_name(f"{path.name}{JOINT}{other.name}")
            try:
                Recording.read(run, columns, units, layout=layout)
            except UndecidedError:
                pass
            except RecordingError:
                continue
            way = f"If {path.name} and {other.name} are files of one run, give them as one: {run}."
            raise RecordingError(f"{error} {way}", culprit=str(path), value=error.value) from error
        raise


def options_of(
    path: Path, columns: Sequence[str] | None, units: Sequence[str] | None, layout: Sequence[str] | None
) -> dict[str, dict[str, str]]:
    """Return what the options say of one file: {"columns": {...}, "units": {...}, "layout": {...}} (InputError)."""
    given = {"columns": columns, "units": units, "layout": layout}
    options = {name: _by_file(f"--{name}", texts, [path])[0] for name, texts in given.items()}
    _check_layout(options["layout"])
    return options


def pairs_of(option: str, given: Sequence[str] | None) -> dict[str, str]:
    """Read what an option was given as name=value pairs; raises InputError for one that is none."""
    pairs = [item.partition("=") for item in given or []]
    for name, equals, value in pairs:
        if not (name and equals and value):
            raise InputError(f'{option} {name}{equals}{value}: write it as name=value, for example "tau=force".')
    found: dict[str, str] = {}
    for name, _, value in pairs:
        if found.setdefault(name, value) != value:
            text = f"{option} {name}={found[name]} {name}={value}: it is given twice; once is enough."
            raise InputError(text, culprit=name, value=value)
    return found


def _by_file(option: str, given: Sequence[str] | None, paths: Sequence[Path]) -> list[dict[str, str]]:
    """Return the pairs for each file: those without a file's name, then those with its own."""
    pairs = pairs_of(option, given)
    for_all = {name: value for name, value in pairs.items() if ":" not in name}
    own: list[dict[str, str]] = [{} for _ in paths]
    for name, value in pairs.items():
        file, colon, ours = name.rpartition(":")
        if colon:
            for place in _places(option, file, paths):
                own[place][ours] = value
    return [for_all | one for one in own]


def _places(option: str, file: str, paths: Sequence[Path]) -> list[int]:
    """Return which of the files is meant: by its path, its name, or its name without suffixes."""
    files = [(path, split(path)[0]) for path in paths]
    names = [{*map(str, pair), *(one.name for one in pair), pair[1].name.partition(".")[0]} for pair in files]
    places = [place for place, one in enumerate(names) if file in one]
    if not places:
        have = tuple(dict.fromkeys(path.name for path in paths))
        text = f'{option} names the file "{file}", which is not among: {", ".join(have)}.'
        raise InputError(text, culprit=file, choices=have)
    return places


def _check_layout(layout: Mapping[str, str]) -> None:
    for key in layout:
        if key not in LAYOUT:
            text = f'--layout {key}={layout[key]}: "{key}" is no key; keys there are: {", ".join(LAYOUT)}.'
            raise InputError(text, culprit=key, choices=LAYOUT)


def check_kind(recordings: Sequence[Recording], motion: str) -> None:
    """Units stated for tau, q or v must be those of the kind of axis, "rotary" or "linear" (InputError)."""
    if motion not in SUITED:
        kinds = tuple(SUITED)
        text = f'motion "{motion}" is no kind of axis; there are: {", ".join(kinds)}.'
        raise InputError(text, culprit="motion", choices=kinds)
    for recording in recordings:
        for name, wanted in SUITED[motion].items():
            stated = recording.units.get(name, wanted) if name in recording else wanted
            if stated not in (wanted, "1"):
                rule = f"{name} of a {motion} axis is in {wanted} or a unit that becomes it"
                raise InputError(f'{recording.name}: the unit of "{name}" becomes {stated}; {rule}.', culprit=name)
        _check_torque(recording, TORQUE[motion])


def _check_torque(recording: Recording, wanted: str) -> None:
    """A unit stated for tau must be one of torque or force, whichever of the two; a current needs its constant."""
    stated = recording.units.get("tau", "")
    try:
        if stated in ("", "1") or unit(stated).dimension in [unit(one).dimension for one in TORQUE.values()]:
            return
    except UnitError:
        return
    if stated == "A":
        rule = f'a current becomes one with the constant of the motor, --units "tau=KT {wanted}", KT in {wanted}/A'
    else:
        rule = f"it is a torque or force, in {wanted} or a unit that becomes it"
    raise InputError(f'{recording.name}: the unit of "tau" becomes {stated}; {rule}.', culprit="tau")
