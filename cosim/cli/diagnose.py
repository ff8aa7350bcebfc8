"""`cosim diagnose`: recordings and a card to what the card lacks, and a better card and FMU."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from cosim.cli.complete import cards
from cosim.cli.options import Columns, Force, Layout, Out, Units, command_of, default_out
from cosim.reading import pairs_of, read_recordings
from cosim.support.memory import keep_freed_memory
from cosim.support.terminal import put, put_json, say, stage


def diagnose(
    train: Annotated[list[Path], typer.Argument(help="Recordings that may be fitted.", metavar="TRAIN...")],
    heldout: Annotated[
        list[Path], typer.Option("--heldout", help="Recordings that prove the result, and may veto an effect.")
    ],
    card: Annotated[
        str, typer.Option("--card", help="Model card (.toml), or the name of a shipped one.", autocompletion=cards)
    ],
    out: Out = None,
    columns: Columns = None,
    units: Units = None,
    layout: Layout = None,
    fmu: Annotated[
        Path | None,
        typer.Option("--fmu", help="Anyone's plant FMU as the base; the card says roughly what it is."),
    ] = None,
    variables: Annotated[
        list[str] | None, typer.Option("--variables", help="Our name = the FMU's: tau=Motor.torque q=Encoder.angle ...")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print diagnosis.json instead of the summary.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Exit with 1 if something is missing.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="The answer and the card alone: no FMU, no report.")] = False,
    propose: Annotated[
        Path | None,
        typer.Option("--propose", help="Folder for the formula of what has no name, as an effect to review."),
    ] = None,
    force: Force = False,
) -> None:
    """Say which physics a card lacks, and prove it on a recording that was never fitted."""
    out = out or default_out(Path(train[0]).stem)
    from cosim.api.diagnose import diagnose as find
    from cosim.report.terminal import proposed, summary
    from pyfmi_models.card import read_card

    keep_freed_memory()
    _check_folders(out, propose, quick, force)
    believed = read_card(card)
    recordings = read_recordings((*train, *heldout), believed.columns, columns, units, believed.mount.motion, layout)
    seconds = sum(recording.duration for recording in recordings)
    say(f"Read {len(recordings)} recordings, {seconds:.0f} s; card {believed.mount.name}")
    given: dict[str, object] = {"--heldout": heldout, "--card": card, "--out": out}
    given |= {"--columns": columns, "--units": units, "--layout": layout}
    given |= {"--fmu": fmu, "--variables": variables, "--propose": propose, "--quick": quick}
    with stage("looking for what the model lacks") as progress:
        found = find(
            recordings[: len(train)],
            recordings[len(train) :],
            believed,
            out,
            fmu=fmu,
            variables=pairs_of("--variables", variables),
            quick=quick,
            force=force,
            command=command_of("diagnose", train, given),
            on_progress=progress.tell,
        )
    put_json(found.as_json()) if as_json else put(summary(found.diagnosis, out=out))
    if propose:
        say(proposed(found.diagnosis, found.propose(propose, force)))
    if check and found.missing:
        sys.exit(1)


def _check_folders(out: Path, propose: Path | None, quick: bool, force: bool) -> None:
    """Refuse at once what could not be written at the end (raises OutputError)."""
    from cosim.delivery.deliver import FILES, QUICK, check_out
    from cosim.delivery.proposal import check_folder

    check_out(out, force, QUICK if quick else FILES)
    if propose:
        check_folder(propose, force)
