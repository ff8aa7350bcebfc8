"""`cosim diagnose`: recordings and a card to what the card lacks, and a better card and FMU."""

import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cosim.cli.complete import cards
from cosim.cli.options import Cluster, Columns, Force, Layout, Out, Units, command_of, default_out, results
from cosim.support.memory import keep_freed_memory
from cosim.support.terminal import put, put_json, say, say_once_begun, stage

if TYPE_CHECKING:
    from cosim.api.diagnose import DiagnosisResult
    from cosim.api.folder import FolderResult
    from cosim.api.machines import Machine
    from cosim.data.recording import Recording
    from pyfmi_models.card import Card
Propose = Annotated[
    Path | None, typer.Option("--propose", help="Folder for formulas outside the catalogue, as effects to review.")
]
SHARED = ("motion", "columns", "units", "layout", "fmu", "variables", "quick", "with_possible")
"""Options of one machine and of several, in the order in which the report repeats the command."""
TOGETHER = ("motion", "fmu", "quick", "with_possible", "card", "workers", "cluster", "force")


def diagnose(
    train: Annotated[
        list[Path],
        typer.Argument(help="Recordings that may be fitted; or a folder of several machines.", metavar="TRAIN..."),
    ],
    heldout: Annotated[
        list[Path] | None,
        typer.Option("--heldout", help="Recordings that prove the result; the last of TRAIN where not given."),
    ] = None,
    card: Annotated[
        str,
        typer.Option(
            "--card", help="Model card (.toml) or a shipped one's name; else estimated.", autocompletion=cards
        ),
    ] = "",
    motion: Annotated[str, typer.Option("--motion", help="Without a card: rotary or linear.")] = "",
    out: Out = None,
    columns: Columns = None,
    units: Units = None,
    layout: Layout = None,
    fmu: Annotated[
        Path | None,
        typer.Option("--fmu", help="A third-party plant FMU as the baseline, with an approximate card."),
    ] = None,
    variables: Annotated[
        list[str] | None, typer.Option("--variables", help="Our name = the FMU's: tau=Motor.torque q=Encoder.angle ...")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print diagnosis.json instead of the summary.")] = False,
    check: Annotated[bool, typer.Option("--check", help="Exit with 1 if something is missing.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="The answer and the card alone: no FMU, no report.")] = False,
    with_possible: Annotated[
        bool, typer.Option("--with-possible", help="The card holds effects that are only possible, too.")
    ] = False,
    propose: Propose = None,
    workers: Annotated[
        int | None, typer.Option("--workers", help="A folder of several machines: so many at a time.", min=1)
    ] = None,
    cluster: Cluster = "",
    force: Force = False,
) -> None:
    """Say which physics a card lacks, and prove it on a recording that was never fitted."""
    given = dict(locals())  # all options by name, and nothing else: no variable may come before
    if len(train) == 1 and train[0].is_dir() and (machines := _machines(train[0], heldout, propose)):
        return _all(machines, out or _begun(train[0].resolve().stem), given)
    _check_single(workers, cluster)
    out = out or default_out(Path(train[0]).resolve().stem)
    found = _diagnosed(out, given)
    for note in found.notes:
        say(note)
    from cosim.report.terminal import proposed, summary

    put_json(found.as_json()) if as_json else put(summary(found.diagnosis, out=out))
    if propose:
        say(proposed(found.diagnosis, found.propose(propose, force)))
    if check and found.missing:
        sys.exit(1)


def _diagnosed(out: Path, given: Mapping[str, Any]) -> "DiagnosisResult":
    """Read, diagnose and write, and show how it goes; `given` are the options by name."""
    from cosim.api.diagnose import diagnose as find
    from cosim.reading import pairs_of

    keep_freed_memory()
    train, heldout, force = given["train"], given["heldout"] or [], given["force"]
    _check_folders(out, given["propose"], given["quick"], force)
    believed, recordings = _read(train, heldout, given)
    options = {"--heldout": heldout, "--card": given["card"], "--out": out, "--propose": given["propose"]}
    options |= {f"--{name.replace('_', '-')}": given[name] for name in SHARED}
    with stage("looking for what the model lacks") as progress:
        return find(
            *(recordings[: len(train)], recordings[len(train) :], believed, out),
            **{name: given[name] for name in ("motion", "fmu", "quick", "with_possible", "force")},
            variables=pairs_of("--variables", given["variables"]),
            command=command_of("diagnose", train, options),
            on_progress=progress.tell,
        )


def _machines(folder: Path, heldout: list[Path] | None, propose: Path | None) -> "list[Machine]":
    """List the machines of a folder; options that are of one machine alone are refused (InputError)."""
    from cosim.api.machines import machines_in
    from cosim.support.errors import InputError

    found = machines_in(folder)
    for option, given in (("--heldout", heldout), ("--propose", propose)):
        if found and given:
            names = ", ".join(one.name for one in found)
            raise InputError(f"{option} is of one machine, and {folder} holds several: {names}.", culprit=option)
    return found


def _begun(name: str) -> Path:
    """Return the folder of results in which machines of this name were begun last; where there is none a new one."""
    from cosim.api.machines import JOURNAL

    made = results().glob(f"{name}-*/{JOURNAL}")
    last = max(made, key=lambda path: path.stat().st_mtime_ns, default=None)
    if last is None:
        return default_out(name)
    say_once_begun(f"results go to {last.parent}, where they were begun")
    return last.parent


def _check_single(workers: int | None, cluster: str) -> None:
    """Refuse what is for a folder of several machines (InputError)."""
    from cosim.support.errors import InputError

    for option, given in (("--workers", workers), ("--cluster", cluster)):
        if given:
            text = f"{option} is for a folder of several machines; these are recordings of one: cosim diagnose FOLDER."
            raise InputError(text, culprit=option)


def _all(machines: "list[Machine]", out: Path, given: Mapping[str, Any]) -> None:
    """Diagnose machine by machine; print a line of each as it comes."""
    from cosim.api.folder import diagnose_folder
    from cosim.api.machines import MachineResult
    from cosim.reading import pairs_of

    say(f"{len(machines)} machines: {', '.join(one.name for one in machines)}")
    began, fresh = time.monotonic(), 0

    def on_machine(one: MachineResult, done: int, of: int) -> None:
        nonlocal fresh
        put(json.dumps(one.as_json())) if given["as_json"] else put(str(one))
        sys.stdout.flush()
        fresh += not one.earlier
        if done < of and fresh:
            say(f"{done} of {of} machines, about {(of - done) * (time.monotonic() - began) / fresh:.0f} s left")

    how: dict[str, Any] = {name: given[name] or () for name in ("columns", "units", "layout")}
    how |= {name: given[name] for name in TOGETHER}
    variables = pairs_of("--variables", given["variables"])
    try:
        done = diagnose_folder(machines, out, variables=variables, on_machine=on_machine, **how)
    except KeyboardInterrupt:
        say(f"what was done until then is in {out}; the same command goes on from there")
        raise
    _end(done, given["check"])


def _end(done: "FolderResult", check: bool) -> None:
    """Say what could not be diagnosed, and exit as was asked."""
    if lost := len(done.errors):
        say(f"{lost} of {len(done.machines)} machines could not be diagnosed; the same command goes on with them")
    if lost == len(done.machines):
        sys.exit(2)
    if check and any(done.missing.values()):
        sys.exit(1)


def _read(train: list[Path], heldout: list[Path], given: Mapping[str, Any]) -> "tuple[Card | None, list[Recording]]":
    """Read the card, if one is given, and all recordings."""
    from cosim.reading import read_recordings
    from pyfmi_models.card import read_card

    believed = read_card(given["card"]) if given["card"] else None
    names, kind = (believed.columns, believed.mount.motion) if believed else ({}, given["motion"])
    recordings = read_recordings((*train, *heldout), names, given["columns"], given["units"], kind, given["layout"])
    seconds, several = sum(recording.duration for recording in recordings), "s" * (len(recordings) > 1)
    named = f"card {believed.mount.name}" if believed else "no card"
    say(f"Read {len(recordings)} recording{several}, {seconds:.0f} s; {named}")
    return believed, recordings


def _check_folders(out: Path, propose: Path | None, quick: bool, force: bool) -> None:
    """Refuse at once what could not be written at the end (raises OutputError)."""
    from cosim.delivery.deliver import FILES, QUICK, check_out
    from cosim.delivery.proposal import check_folder, check_searched

    check_out(out, force, QUICK if quick else FILES)
    if propose:
        check_searched()
        check_folder(propose, force)
