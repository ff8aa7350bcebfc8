"""`cosim hardware`: the controller on a machine: check, run, replay, firmware; and a virtual drive to try it on."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from cosim.cli.drive import JsonOption, KeyOption, MachineOption, machine_of, virtual_drive
from cosim.cli.firmware import firmware
from cosim.cli.options import Force, Out, command_of, default_out
from cosim.cli.verbs import attach
from cosim.support.terminal import begun, put, put_json, say

app = typer.Typer(no_args_is_help=True, help="The same controller on a machine.")
app.command()(firmware)
app.command("virtual-drive")(virtual_drive)
attach(app, "hardware")

ScenarioArgument = Annotated[str, typer.Argument(help="A scenario (.toml) or the name of a shipped one: sidereal.")]
DriveOption = Annotated[str, typer.Option("--drive", help="udp://HOST:PORT, instead of the machine's adapter.")]


@app.command()
def run(
    scenario: ScenarioArgument,
    out: Out = None,
    machine: MachineOption = "simulated",
    drive: DriveOption = "",
    key: KeyOption = "",
    fast: Annotated[bool, typer.Option("--fast", help="Without a clock, as fast as possible.")] = False,
    as_json: JsonOption = False,
    force: Force = False,
) -> None:
    """Run a scenario with its plant replaced by a machine; write DIR/black_box.bin, recording.parquet and run.json."""
    out = out or default_out(Path(scenario).stem)
    from cosim.hardware.blackbox import read_black_box, recording_of
    from cosim.hardware.session import Session, run_session
    from cosim.models.cache import cards_of, with_fmus
    from cosim.support.files import check_free, replacing
    from cosim.system.scenario import read_scenario

    wanted, given = read_scenario(scenario), machine_of(machine, drive, key)
    box, recording, report = out / "black_box.bin", out / "recording.parquet", out / "run.json"
    for one in (box, recording, report):
        check_free(one, force)
    ready = with_fmus(wanted, say)
    words = {"--out": out, "--machine": machine, "--drive": drive, "--key": key, "--fast": fast}
    command = command_of("hardware run", [scenario], words)
    try:
        with Session(
            ready, given, box, fast=fast, force=force, origin={"command": command, "cards": cards_of(wanted)}
        ) as session:
            begun()
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
    controller: Annotated[
        Path | None, typer.Option("--controller", help="Its FMU, where the cache does not have it any more.")
    ] = None,
    card: Annotated[
        str, typer.Option("--card", help="The card it was built from: its hash is compared, and it is built again.")
    ] = "",
    as_json: JsonOption = False,
) -> None:
    """Take recorded samples through the controller again; exit 1 unless every column is the same, bit for bit."""
    from dataclasses import asdict

    from cosim.data.recording import Recording
    from cosim.hardware.replay import replay as take

    given = Recording.read(recording, required=())
    done = take(given, _built_again(given, card) if card else controller)
    if as_json:
        put_json(asdict(done) | {"identical": done.identical})
    elif done.identical:
        put(f"identical: {done.cycles:,} cycles, {done.stepped:,} steps of the controller, bit for bit")
    else:
        worst = ", ".join(f"{count:,} in {name}" for name, count in done.different.items() if count)
        if worst:
            put(f"different: {worst}, of {done.cycles:,} cycles; the first at cycle {done.first:,}")
        if done.noticed:
            put(f"{recording} is not the file that was written: {done.noticed}")
    if not done.identical:
        raise typer.Exit(1)


def _built_again(recording: Any, card: str) -> Path:
    """Return the controller of a card that is, by its hash, one that the session was built from."""
    from cosim.hardware.story import story_in
    from cosim.models.cache import fmu_of_card, hash_of_card
    from cosim.support.errors import HardwareError

    said = {one.sha256 for one in story_in(recording).cards.values()}
    if hash_of_card(card) not in said:
        raise HardwareError(f"{card} is another card than that of the session.", culprit=card)
    return fmu_of_card(card, "controller", say)


@app.command()
def check(
    scenario: ScenarioArgument,
    machine: MachineOption = "simulated",
    drive: DriveOption = "",
    key: KeyOption = "",
    seconds: Annotated[float, typer.Option(help="How long to watch the clock.", min=0, max=86_400)] = 1.0,
    move: Annotated[
        bool, typer.Option("--move", help="Then move the axis a little: is the encoder scaled right?")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Look at scenario, limits, drive, encoder and clock, without enabling torque (unless with --move)."""
    from cosim.hardware.look import look
    from cosim.hardware.move import try_move
    from cosim.models.cache import with_fmus
    from cosim.system.scenario import read_scenario

    wanted, given = with_fmus(read_scenario(scenario), say), machine_of(machine, drive, key)
    found = look(wanted, given, seconds)
    if move:
        found["moved"] = try_move(wanted, given).shown
    if as_json:
        put_json(found)
        return
    for key, value in found.items():
        put(f"{key.replace('_', ' '):18} {value}")
