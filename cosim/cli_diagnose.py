"""`cosim diagnose`: recordings and a card to what the card lacks, and a better card and FMU."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from cosim.errors import InputError
from cosim.reading import read_recordings
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
    recordings = read_recordings((*train, heldout), believed.columns, columns, units, believed.mount.motion)
    _check_split(recordings[:-1], recordings[-1])
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


def _check_split(train: Sequence[object], heldout: object) -> None:
    hashes = [getattr(recording, "sha256", "") for recording in train]
    if getattr(heldout, "sha256", None) in hashes:
        name = getattr(heldout, "name", "the held-out recording")
        raise InputError(f"{name} is held out and among the training recordings; a proof needs a recording of its own.")
