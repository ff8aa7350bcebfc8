"""`cosim show`: any file of this project on one screen."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from cosim.errors import InputError
from cosim.terminal import put_json

WIRES = "wires"
"""The table that is drawn on the screen."""


def show(
    file: Annotated[str, typer.Argument(help="A recording, FMU, SSP, scenario or card, or the name of a shipped one.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
) -> None:
    """Show a recording, an FMU, a scenario or a card."""
    facts, rows = describe(file)
    if as_json:
        put_json(facts | {name: table for name, table in rows.items()})
        return
    console = Console(highlight=False, soft_wrap=not Console().is_terminal)
    for name, value in facts.items():
        console.print(f"{name}: {value}", markup=False)
    for name, table in rows.items():
        if name == WIRES:
            console.print("\n".join(["", *drawing(file), ""]), markup=False, soft_wrap=True)
        else:
            console.print(_table(name, table))


def drawing(file: str) -> list[str]:
    """Return the wiring of a scenario as lines of text, with the delay of each wire."""
    from cosim.diagram import draw
    from cosim.scenario import read_scenario

    return draw(read_scenario(file))


def describe(file: str) -> tuple[dict[str, Any], dict[str, list[dict[str, Any]]]]:
    """Return facts by name, and tables by name as lists of rows.

    Raises:
        InputError: the file is nothing that can be shown, or breaks its own rules.
    """
    path = Path(file)
    if path.suffix == ".fmu":
        return _fmu(path)
    if path.suffix == ".ssp":
        return _scenario(file)
    if path.suffix in {".toml", ""}:
        return _toml(file)
    return _recording(path)


def _recording(path: Path) -> tuple[dict[str, Any], dict[str, list[dict[str, Any]]]]:
    from cosim.recording import Recording

    recording = Recording.read(path, required=())
    facts = {
        "recording": str(path),
        "rows": len(recording),
        "rate": f"{1 / recording.sample_time:.6g} Hz",
        "duration": f"{recording.duration:.6g} s",
        "gaps": len(recording.gaps),
        "jitter": f"{recording.jitter:.2%} rms of the sample time",
        "sha256": recording.sha256,
    }
    facts |= {name: recording.origin[name] for name in ("version", "command", "complete") if recording.origin.get(name)}
    facts |= {f"note {number}": note for number, note in enumerate(recording.quality(), 1)}
    columns = [
        {
            "column": name,
            "unit": recording.units.get(name, "?"),
            "least": f"{recording[name].min():.6g}",
            "greatest": f"{recording[name].max():.6g}",
            "mean": f"{recording[name].mean():.6g}",
        }
        for name in recording
    ]
    return facts, {"columns": columns}


def _fmu(path: Path) -> tuple[dict[str, Any], dict[str, list[dict[str, Any]]]]:
    from cosim.description import describe as read
    from cosim.description import ports_of

    description = read(path)
    kinds = {"co-simulation": description.coSimulation, "model exchange": description.modelExchange}
    facts = {
        "FMU": str(path),
        "model": description.modelName,
        "description": description.description or "",
        "FMI": description.fmiVersion,
        "kinds": ", ".join(name for name, kind in kinds.items() if kind is not None),
        "made by": description.generationTool or "?",
    }
    order = ("input", "output", "parameter", "structuralParameter", "calculatedParameter", "local", "independent")
    ports = sorted(ports_of(description).values(), key=lambda port: order.index(port.causality))
    variables = [
        {
            "variable": port.name,
            "causality": port.causality,
            "unit": port.unit,
            "start": "" if port.start is None else f"{port.start:g}",
            "description": port.description,
        }
        for port in ports
    ]
    return facts, {"variables": variables}


def _toml(file: str) -> tuple[dict[str, Any], dict[str, list[dict[str, Any]]]]:
    import tomllib

    from cosim.scenario import shipped_scenarios

    path = Path(file)
    if file in shipped_scenarios():
        return _scenario(file)
    if path.suffix == ".toml" and path.is_file():
        try:
            keys = tomllib.loads(path.read_text("utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise InputError(f"{file} is not valid TOML: {error}.", culprit=file) from error
        return _card(file) if "mount" in keys else _scenario(file)
    from pyfmi_models.card import shipped_cards

    if file in shipped_cards():
        return _card(file)
    if path.exists():
        raise InputError(f"{file} is nothing that can be shown: a recording, FMU, scenario or card.", culprit=file)
    choices = (*shipped_scenarios(), *shipped_cards())
    raise InputError(f"{file} does not exist; shipped are: {', '.join(choices)}.", culprit=file, choices=choices)


def _scenario(file: str) -> tuple[dict[str, Any], dict[str, list[dict[str, Any]]]]:
    from cosim.diagram import in_short, on_the_way, origin, wire_delays
    from cosim.scenario import read_scenario

    scenario = read_scenario(file)
    stated = wire_delays(scenario)
    facts = {
        "scenario": scenario.name,
        "description": scenario.description,
        "step": f"{scenario.step:g} s",
        "stop": f"{scenario.stop:g} s ({scenario.ticks:,} steps)",
        "algorithm": in_short(scenario),
        "rows": f"one in {scenario.decimation} steps",
    }
    components = [
        {"component": name, "from": origin(one), "steps every": f"{scenario.every.get(name, 1) * scenario.step:g} s"}
        for name, one in scenario.components.items()
    ]
    wires = [
        {
            "from": wire.source,
            "to": wire.target,
            "delay in ticks": str(stated[wire.target]),
            "on the way": on_the_way(wire).removeprefix("; "),
        }
        for wire in scenario.wires
    ]
    records = [{"column": name, "signal": one.signal, "mode": one.mode} for name, one in scenario.records.items()]
    return facts, {"components": components, WIRES: wires, "recorded": records}


def _card(file: str) -> tuple[dict[str, Any], dict[str, list[dict[str, Any]]]]:
    from pyfmi_models.card import read_card

    card = read_card(file)
    model = card.plant().model()
    facts = {
        "card": file,
        "name": card.mount.name,
        "motion": card.mount.motion,
        "friction": card.friction.key,
        "effects": ", ".join(effect.id for effect in card.effects) or "none",
        "controller": card.controller.compensation if card.controller else "none",
    }
    parameters = [
        {"parameter": v.name, "value": f"{v.start:.6g}", "unit": v.unit, "description": v.description}
        for v in model.parameters
    ]
    return facts, {"parameters": parameters}


def _table(title: str, rows: Iterable[dict[str, Any]]) -> Table:
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    listed = list(rows)
    for name in listed[0] if listed else ():
        table.add_column(name, overflow="fold")
    for row in listed:
        table.add_row(*(str(value) for value in row.values()))
    return table
