"""`cosim diagnose`: recordings and a card to what the card lacks, and a better card and FMU."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import join
from typing import Annotated, Any

import typer

from cosim.errors import InputError
from cosim.memory import keep_freed_memory
from cosim.reading import pairs_of, read_recordings
from cosim.recording import Recording
from cosim.renamed import Alias
from cosim.terminal import put, put_json, say, stage


def diagnose(
    train: Annotated[list[Path], typer.Argument(help="Recordings that may be fitted.", metavar="TRAIN...")],
    heldout: Annotated[
        list[Path], typer.Option("--heldout", help="Recordings that prove the result, and may veto an effect.")
    ],
    card: Annotated[str, typer.Option("--card", help="Model card (.toml), or the name of a shipped one.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")],
    columns: Annotated[list[str] | None, typer.Option("--columns", help="Our name = the file's: tau=force ...")] = None,
    units: Annotated[list[str] | None, typer.Option("--units", help="Units in the files: q=deg ...")] = None,
    fmu: Annotated[
        Path | None,
        typer.Option("--fmu", help="Anyone's plant FMU as the base; the card says roughly what it is."),
    ] = None,
    variables: Annotated[
        list[str] | None, typer.Option("--variables", help="Our name = the FMU's: tau=Motor.torque q=Encoder.angle ...")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print diagnosis.json instead of the summary.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Exit with 1 if something is missing.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite what is there.")] = False,
) -> None:
    """Say which physics a card lacks, and prove it on a recording that was never fitted."""
    from cosim.diagnosis.black_box import BlackBox, as_base
    from cosim.diagnosis.closed_loop import Loops
    from cosim.diagnosis.corrected import Correction, motion_of
    from cosim.diagnosis.deliver import as_json as to_json
    from cosim.diagnosis.deliver import check_out, deliver
    from cosim.diagnosis.diagnose import diagnose as find
    from cosim.diagnosis.terminal import summary
    from pyfmi_models.card import read_card

    keep_freed_memory()
    check_out(out, force)
    believed = read_card(card)
    recordings = read_recordings((*train, *heldout), believed.columns, columns, units, believed.mount.motion)
    fitted, held = recordings[: len(train)], recordings[len(train) :]
    _check_split(fitted, held)
    seconds = sum(recording.duration for recording in recordings)
    say(f"Read {len(recordings)} recordings, {seconds:.0f} s; card {believed.mount.name}")
    given: dict[str, Sequence[object]] = {"--heldout": heldout, "--card": [card], "--out": [out]}
    given |= {"--columns": columns or (), "--units": units or (), "--fmu": [fmu] if fmu else ()}
    command = _command(train, given | {"--variables": variables or ()})
    more: Any = {}
    with stage("looking for what the model lacks") as progress:
        if fmu:
            box = BlackBox(fmu, {name: Alias(theirs) for name, theirs in pairs_of("--variables", variables).items()})
            base = as_base(box, fitted, held, believed, progress.tell)
            more = {"more": Correction(box, base.card, *motion_of(recordings[0])).deliver, "base": box.told}
            fitted, held, believed = [*base.train], [*base.heldout], base.card
        with Loops(believed, held) as loops:
            loops.close("nominal", believed.plant())
            outcome = find(fitted, held, believed, progress.tell, loops.close)
            done = deliver(outcome, fitted, held, believed, out, command, progress.tell, **more, loops=loops)
    if as_json:
        put_json(to_json(done))
    else:
        put(summary(done))
    if check and done.verdict:
        sys.exit(1)


def _command(train: Sequence[Path], options: Mapping[str, Sequence[object]]) -> str:
    """The command line that does the same again."""
    told = [word for name, values in options.items() for value in values for word in (name, str(value))]
    return join(["cosim", "diagnose", *map(str, train), *told])


def _check_split(train: Sequence[Recording], heldout: Sequence[Recording]) -> None:
    hashes = [recording.sha256 for recording in train]
    for one in heldout:
        if one.sha256 in hashes:
            text = f"{one.name} is held out and among the training recordings; a proof needs a recording of its own."
            raise InputError(text, culprit=one.name)
