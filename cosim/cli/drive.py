"""`cosim hardware virtual-drive`: a drive in a process of its own, to try a loop on."""

import json
import sys
from contextlib import ExitStack
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.support.errors import HardwareError
from cosim.support.terminal import say

if TYPE_CHECKING:
    from cosim.hardware.machine import Machine
    from cosim.hardware.simulated import Plant
    from cosim.hardware.virtual import Event

MachineOption = Annotated[
    str, typer.Option("--machine", help="A machine (.toml) or a shipped one: simulated, virtual.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


KeyOption = Annotated[
    str, typer.Option("--key", help="File with the key that loop and drive share; else who sees them meet could forge.")
]


def machine_of(name: str, drive: str = "", key: str = "") -> "Machine":
    """Return the machine of --machine, with the adapter of --drive and the key of --key if they are given."""
    from cosim.hardware.machine import changed, read_machine

    changes = {name: value for name, value in (("adapter", drive), ("key_file", key)) if value}
    given = read_machine(name)
    return changed(given, "--drive", **changes) if changes else given


def virtual_drive(
    source: Annotated[str, typer.Argument(help="A scenario whose plant it moves, or a card; or a shipped one's name.")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="UDP port; 0: any that is free.")] = 4020,
    machine: MachineOption = "simulated",
    key: KeyOption = "",
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

    if 0 < counts_per_turn < 1:
        message = f"--counts-per-turn {counts_per_turn:g}: a turn has one count at least."
        raise HardwareError(message, culprit="--counts-per-turn", value=counts_per_turn)
    given = machine_of(machine, key=key)
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


def _plant(source: str, step: float, stack: ExitStack) -> tuple["Plant", float, float]:
    """Return the plant of a scenario or card, its cycle in s, and rad a count."""
    from cosim.hardware.simulated import Plant
    from cosim.hardware.virtual import plant_of
    from cosim.hardware.wired import wire_up
    from cosim.master.exchange import open_fmu
    from cosim.models.cache import fmu_of_card, with_fmus
    from cosim.system.scenario import read_scenario, shipped_scenarios
    from pyfmi_models.card import read_card, shipped_cards

    if source in shipped_scenarios() or (
        Path(source).is_file() and "[components" in Path(source).read_text("utf-8", "replace")
    ):
        scenario = with_fmus(read_scenario(source), say)
        wired = wire_up(scenario, stack)
        return Plant(wired.plant, wired.torque, wired.position), scenario.step, wired.quantum
    if not Path(source).is_file() and source not in shipped_cards():
        choices = (*shipped_scenarios(), *shipped_cards())
        message = f"{source}: no such scenario or card; it is a .toml file or one of: {', '.join(choices)}."
        raise HardwareError(message, culprit=source, choices=choices)
    encoder = read_card(source).encoder
    quantum = 2 * pi / (encoder.counts_per_rev * encoder.ratio or 2.0**32)
    component = stack.enter_context(open_fmu(fmu_of_card(source, "plant", say), "plant"))
    return plant_of(component), step, quantum
