"""`cosim hardware`: the controller on a machine: check, run, replay, firmware; and a virtual drive to try it on."""

import json
import sys
from contextlib import ExitStack
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.cli_firmware import firmware
from cosim.cli_supervisor import alpaca
from cosim.terminal import put, put_json, say

if TYPE_CHECKING:
    from cosim.hardware.machine import Machine
    from cosim.hardware.simulated import Plant
    from cosim.hardware.virtual import Event

app = typer.Typer(no_args_is_help=True, help="The same controller on a machine.")
app.command()(firmware)
app.command()(alpaca)

ScenarioArgument = Annotated[str, typer.Argument(help="A scenario (.toml) or the name of a shipped one: sidereal.")]
MachineOption = Annotated[str, typer.Option("--machine", help="A machine (.toml) or a shipped one: simulated.")]
DriveOption = Annotated[str, typer.Option("--drive", help="udp://HOST:PORT, instead of the machine's adapter.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


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

    wanted, given = read_scenario(scenario), _machine(machine, drive)
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

    wanted, given = with_fmus(read_scenario(scenario), say), _machine(machine, drive)
    found = look(wanted, given, seconds)
    if move:
        found["moved"] = try_move(wanted, given).shown
    if as_json:
        put_json(found)
        return
    for key, value in found.items():
        put(f"{key.replace('_', ' '):18} {value}")


@app.command("virtual-drive")
def virtual_drive(
    source: Annotated[str, typer.Argument(help="A scenario whose plant it moves, or a card; or a shipped one's name.")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="UDP port; 0: any that is free.")] = 4020,
    machine: MachineOption = "simulated",
    inject: Annotated[
        list[str] | None, typer.Option(help="KIND[:AT[:LASTS[:SIZE]]], s of a session; repeatable.")
    ] = None,
    counts_per_turn: Annotated[float, typer.Option(min=0, help="Of its encoder; 0: those of scenario or card.")] = 0.0,
    host: Annotated[str, typer.Option(help="Address to listen at.")] = "127.0.0.1",
    lockstep: Annotated[bool, typer.Option("--lockstep", help="No clock: for loops with --fast.")] = False,
    step: Annotated[float, typer.Option(min=1e-6, help="Cycle in s, where the source is a card.")] = 1e-4,
    as_json: JsonOption = False,
) -> None:
    """Be a drive: a plant in real time behind CiA 402 over UDP, with a watchdog and faults on demand, until Ctrl-C."""
    from cosim.hardware.machine import changed
    from cosim.hardware.virtual import VirtualDrive, parse_injection

    given = _machine(machine)
    faults = [one.model_dump() for one in given.inject] + [parse_injection(one) for one in inject or []]
    given = changed(given, "--inject", inject=faults)
    with ExitStack() as stack:
        plant, cycle, quantum = _plant(source, step, stack)
        quantum = 2 * pi / counts_per_turn if counts_per_turn else quantum
        drive = VirtualDrive(plant, given, cycle, quantum, host=host, port=port, lockstep=lockstep)
        with drive:
            say(f"{source}: a drive listens at {drive.url}, watchdog {given.watchdog_ms:g} ms")
            try:
                for event in drive.events():
                    _tell(event, as_json)
            except KeyboardInterrupt:
                say(json.dumps(drive.statistics))


def _tell(event: "Event", as_json: bool) -> None:
    numbers = ", ".join(f"{name} {value:g}" for name, value in event.numbers.items())
    line = json.dumps({"what": event.what, "state": event.state} | event.numbers)
    sys.stdout.write((line if as_json else f"{event.what}: {event.state} ({numbers})") + "\n")
    sys.stdout.flush()


def _machine(name: str, drive: str = "") -> "Machine":
    from cosim.hardware.machine import changed, read_machine

    given = read_machine(name)
    return changed(given, "--drive", adapter=drive) if drive else given


def _plant(source: str, step: float, stack: ExitStack) -> tuple["Plant", float, float]:
    """Return the plant of a scenario or card, its cycle in s, and rad a count."""
    from cosim.cli_cache import fmu_of_card, with_fmus
    from cosim.exchange import open_fmu
    from cosim.hardware.simulated import Plant
    from cosim.hardware.virtual import plant_of
    from cosim.hardware.wired import wire_up
    from cosim.scenario import read_scenario, shipped_scenarios
    from pyfmi_models.card import read_card

    if source in shipped_scenarios() or (Path(source).is_file() and "[components" in Path(source).read_text("utf-8")):
        scenario = with_fmus(read_scenario(source), say)
        wired = wire_up(scenario, stack)
        return Plant(wired.plant, wired.torque, wired.position), scenario.step, wired.quantum
    encoder = read_card(source).encoder
    quantum = 2 * pi / (encoder.counts_per_rev * encoder.ratio or 2.0**32)
    component = stack.enter_context(open_fmu(fmu_of_card(source, "plant", say), "plant"))
    return plant_of(component), step, quantum
