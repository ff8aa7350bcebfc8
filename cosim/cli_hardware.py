"""`cosim hardware`: the controller on a machine: check, run, replay, firmware; and a virtual drive to try it on."""

import json
from pathlib import Path
from typing import Annotated

import typer

from cosim.cli_drive import JsonOption, MachineOption, machine_of, virtual_drive
from cosim.cli_firmware import firmware
from cosim.cli_supervisor import alpaca, indi
from cosim.terminal import put, put_json, say

app = typer.Typer(no_args_is_help=True, help="The same controller on a machine.")
app.command()(firmware)
app.command("alpaca")(alpaca)
app.command("indi")(indi)
app.command("virtual-drive")(virtual_drive)

ScenarioArgument = Annotated[str, typer.Argument(help="A scenario (.toml) or the name of a shipped one: sidereal.")]
DriveOption = Annotated[str, typer.Option("--drive", help="udp://HOST:PORT, instead of the machine's adapter.")]


@app.command()
def run(
    scenario: ScenarioArgument,
    out: Annotated[Path, typer.Option("--out", "-o", help="Directory for black box and recording.")],
    machine: MachineOption = "simulated",
    drive: DriveOption = "",
    fast: Annotated[bool, typer.Option("--fast", help="Without a clock, as fast as possible.")] = False,
    as_json: JsonOption = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite what is there.")] = False,
) -> None:
    """Run a scenario with its plant replaced by a machine; write DIR/black_box.bin, recording.parquet and run.json."""
    from cosim.cli_cache import with_fmus
    from cosim.files import check_free, replacing
    from cosim.hardware.blackbox import read_black_box, recording_of
    from cosim.hardware.session import Session, run_session
    from cosim.scenario import read_scenario

    wanted, given = read_scenario(scenario), machine_of(machine, drive)
    box, recording, report = out / "black_box.bin", out / "recording.parquet", out / "run.json"
    for one in (box, recording, report):
        check_free(one, force)
    ready = with_fmus(wanted, say)
    command = f"cosim hardware run {scenario} --machine {machine}{f' --drive {drive}' if drive else ''} --out {out}"
    try:
        with Session(ready, given, box, fast=fast, force=force, origin={"command": command}) as session:
            result = run_session(session)
    finally:
        if box.exists():
            kept = read_black_box(box)
            recording_of(kept, wanted.name).write(recording, force)
    result |= {"records": len(kept.records), "torn": kept.torn, "recording": str(recording), "black_box": str(box)}
    with replacing(report, force) as partial:
        partial.write_text(json.dumps(result, indent=2) + "\n", "utf-8")
    reason = f", because of: {', '.join(result['faults'])}" if result["faults"] else ""
    ended = "followed to its end" if result["completed"] else f"left before its end{reason}"
    say(f"{wanted.name} was {ended}; the axis is now in: {result['state']}, torque {result['torque']:g} N.m")
    say("{cycles:,} cycles, {late_cycles:,} late; {records:,} records, {torn} torn".format(**result))
    if as_json:
        put_json(result)
    else:
        put(str(recording))


@app.command()
def replay(
    recording: Annotated[Path, typer.Argument(help="A recording of `cosim hardware run`.")],
    as_json: JsonOption = False,
) -> None:
    """Take recorded samples through the controller again; exit 1 unless every order is the same, bit for bit."""
    from dataclasses import asdict

    from cosim.hardware.replay import replay as take
    from cosim.recording import Recording

    done = take(Recording.read(recording, required=()))
    if as_json:
        put_json(asdict(done) | {"identical": done.identical})
    elif done.identical:
        put(f"identical: {done.cycles:,} cycles, {done.stepped:,} steps of the controller, bit for bit")
    else:
        worst = ", ".join(f"{count:,} in {name}" for name, count in done.different.items() if count)
        put(f"different: {worst}, of {done.cycles:,} cycles; the first at cycle {done.first:,}")
    if not done.identical:
        raise typer.Exit(1)


@app.command()
def check(
    scenario: ScenarioArgument,
    machine: MachineOption = "simulated",
    drive: DriveOption = "",
    seconds: Annotated[float, typer.Option(help="How long to watch the clock of this computer.")] = 1.0,
    move: Annotated[
        bool, typer.Option("--move", help="Then move the axis a little: is the encoder scaled right?")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Look at scenario, limits, drive, encoder and clock, without enabling torque (unless with --move)."""
    from cosim.cli_cache import with_fmus
    from cosim.hardware.look import look
    from cosim.hardware.move import try_move
    from cosim.scenario import read_scenario

    wanted, given = with_fmus(read_scenario(scenario), say), machine_of(machine, drive)
    found = look(wanted, given, seconds)
    if move:
        found["moved"] = try_move(wanted, given).shown
    if as_json:
        put_json(found)
        return
    for key, value in found.items():
        put(f"{key.replace('_', ' '):18} {value}")
