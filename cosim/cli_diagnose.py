"""`cosim diagnose`: recordings and a card to what the card lacks, and a better card and FMU."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from cosim.errors import InputError
from cosim.recording import Recording
from cosim.terminal import put, put_json, say, stage


def diagnose(
    train: Annotated[list[Path], typer.Argument(help="Recordings that may be fitted.", metavar="TRAIN...")],
    heldout: Annotated[
        Path, typer.Option("--heldout", help="Recording that proves the result, and may veto an effect.")
    ],
    card: Annotated[str, typer.Option("--card", help="Model card (.toml), or the name of a shipped one.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")],
    columns: Annotated[list[str] | None, typer.Option("--columns", help="Our name = the file's: tau=force ...")] = None,
    units: Annotated[list[str] | None, typer.Option("--units", help="Units in the files: q=deg ...")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print diagnosis.json instead of the summary.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Exit with 1 if something is missing.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite what is there.")] = False,
) -> None:
    """Say which physics a card lacks, and prove it on a recording that was never fitted."""
    from cosim.diagnosis.deliver import as_json as to_json
    from cosim.diagnosis.deliver import check_out, deliver
    from cosim.diagnosis.diagnose import diagnose as find
    from cosim.diagnosis.terminal import summary
    from pyfmi_models.card import read_card

    check_out(out, force)
    believed = read_card(card)
    names = believed.columns | _pairs("--columns", columns)
    stated = _pairs("--units", units)
    recordings = [Recording.read(path, names, stated) for path in (*train, heldout)]
    _check_split(recordings[:-1], recordings[-1])
    _check_kind(recordings, believed.mount.motion)
    seconds = sum(recording.duration for recording in recordings)
    say(f"Read {len(recordings)} recordings, {seconds:.0f} s; card {believed.mount.name}")
    with stage("looking for what the model lacks") as progress:
        outcome = find(recordings[:-1], recordings[-1], believed, progress.tell)
        command = f"cosim diagnose {' '.join(map(str, train))} --heldout {heldout} --card {card} --out {out}"
        done = deliver(outcome, recordings[:-1], recordings[-1], believed, out, command, progress.tell)
    if as_json:
        put_json(to_json(done))
    else:
        put(summary(done))
    if check and done.verdict:
        sys.exit(1)


def _pairs(option: str, given: list[str] | None) -> dict[str, str]:
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


def _check_split(train: Sequence[object], heldout: object) -> None:
    hashes = [getattr(recording, "sha256", "") for recording in train]
    if getattr(heldout, "sha256", None) in hashes:
        name = getattr(heldout, "name", "the held-out recording")
        raise InputError(f"{name} is held out and among the training recordings; a proof needs a recording of its own.")
