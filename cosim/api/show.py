"""`cosim.show`: any file of this project, told as facts and tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.api.show_results import result
from cosim.support.errors import FmuError, InputError
from cosim.support.html import facts as html_facts
from cosim.support.html import table as html_table
from cosim.support.html import text as html_text
from cosim.support.near import did_you_mean
from cosim.support.plain import Json
from cosim.support.plugins import TOML, loaded, names
from cosim.system.variant import ssp_of

if TYPE_CHECKING:
    from cosim.data.recording import Recording

Facts = Mapping[str, Json]
Row = Mapping[str, Json]
Tables = Mapping[str, Sequence[Row]]
NO_RECORDINGS = (".fmu", ".ssp", ".ssd", ".toml", "")
"""Suffixes of what is no recording; a name without one is that of what is shipped."""
START = 200
"""Characters of a start value; that of an array of a million numbers has some millions."""
WIRES = "wires"
"""The table that is drawn on a screen."""


@dataclass(frozen=True)
class Shown:
    """What a file holds: facts by name, tables by name as rows, and the drawing of a scenario's wires as lines."""

    facts: Facts
    tables: Tables
    drawing: tuple[str, ...] = field(default=())

    def __str__(self) -> str:
        lines = [f"{name}: {value}" for name, value in self.facts.items()]
        for name, rows in self.tables.items():
            lines += ["", *self.drawing] if name == WIRES else ["", name, *_lines(rows)]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        first = next(iter(self.facts.values()), "")
        tables = (html_table(name, rows) for name, rows in self.tables.items() if name != WIRES)
        drawn = html_text("\n".join(self.drawing)) if self.drawing else ""
        return html_facts(str(first), self.facts) + drawn + "".join(tables)


def show(
    source: "str | Path | Recording",
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    layout: Mapping[str, str] | None = None,
    picture: str | Path | None = None,
    schedule: bool = False,
    force: bool = False,
) -> Shown:
    """Tell what a recording, FMU, SSP, scenario or card holds; one that is shipped is given by its name.

    The id of an effect ("cogging") tells what it is, three checks at the machine and the repair by kind of machine.

    Args:
        source: a path, the name of a shipped scenario or card, the id of an effect, or a `Recording`.
        columns: of a recording's file, our name to its name.
        units: of a recording's file, our name to the unit in it.
        layout: CSV format; see `Recording.read`.
        picture: an SVG or PNG file into which a recording is drawn.
        schedule: of a scenario or SSP, what happens in a step: order, age of inputs, what FMUs offer besides.
        force: overwrite the picture.

    Returns:
        `Shown`: facts and tables; values are texts with their units. Of a recording's file the facts hold the options
        that it needs.

    Raises:
        InputError: the file is unsupported, or breaks its own rules.
    """
    path = Path(source) if isinstance(source, str | Path) else None
    own = result(path) if path and not schedule else None
    if not schedule and own is None and (path is None or _may_be_recording(path)):
        from cosim.api.show_recordings import of_file, of_recording

        options = {"columns": columns or {}, "units": units or {}, "layout": layout or {}}
        if not isinstance(source, str | Path):
            return Shown(*of_recording(source, picture, force))
        return Shown(*of_file(Path(source), options, picture, force))
    for name, value in {"--columns": columns, "--units": units, "--layout": layout, "--out": picture}.items():
        if value:
            raise InputError(f"{name} is for recordings alone; {source} is shown without it.", culprit=name)
    if own is not None:
        return Shown(*own)
    if path is None:
        raise InputError("A recording has no schedule: give a scenario (.toml) or an SSP.")
    if schedule:
        from cosim.api.schedule import schedule as schedule_of

        return Shown(*schedule_of(str(source)))
    facts, tables = describe(str(source))
    return Shown(facts, tables, drawing(str(source)) if WIRES in tables else ())


def _may_be_recording(path: Path) -> bool:
    return path.suffix not in NO_RECORDINGS and ssp_of(path)[0] is None


def _lines(rows: Sequence[Row]) -> list[str]:
    """Rows as lines, their columns under each other."""
    cells = [[str(value) for value in row.values()] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    padded = ([text.ljust(width) for text, width in zip(row, widths, strict=True)] for row in cells)
    return ["  " + "  ".join(row).rstrip() for row in padded]


def drawing(file: str) -> tuple[str, ...]:
    """Return the wiring of a scenario as lines of text, with the delay of each wire."""
    from cosim.system.diagram import draw
    from cosim.system.scenario import read_scenario

    return tuple(draw(read_scenario(file)))


def describe(file: str) -> tuple[Facts, Tables]:
    """Return facts by name, and tables by name as lists of rows.

    Raises:
        InputError: the file is unsupported, or breaks its own rules.
    """
    path = Path(file)
    if path.suffix == ".fmu":
        return _fmu(path)
    if ssp_of(file)[0] is not None:
        return _scenario(file)
    return _toml(file)


def _fmu(path: Path) -> tuple[Facts, Tables]:
    from cosim.fmi.description import describe as read
    from cosim.fmi.sound import doubts_of
    from cosim.fmi.variables import variables_of
    from cosim.support.memory import many_objects

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
    facts |= _carried(path)
    facts |= {f"note {number}": f"{doubt}." for number, doubt in enumerate(doubts_of(description), 1)}
    order = ("input", "output", "parameter", "structuralParameter", "calculatedParameter", "local", "independent")
    with many_objects():
        ports = sorted(variables_of(description), key=lambda port: order.index(port.causality))
        variables = [
            {
                "variable": port.name,
                "causality": port.causality,
                "type": _type(port),
                "unit": port.unit,
                "start": _first_values(port.start),
                "description": port.description,
            }
            for port in ports
        ]
    drawn = _maps_in(path)
    return facts, {"variables": variables} | ({"learned maps": drawn} if drawn else {})


def _maps_in(path: Path) -> list[dict[str, Json]]:
    """Return the learned terms that an FMU of ours carries as curves of text; nothing of what is no such file."""
    from cosim.fmi.manifest import manifest_of

    try:
        manifest = manifest_of(path)
    except FmuError:  # `brings along` says so
        return []
    named = [one.member for one in manifest.related if one.member.endswith("/maps.json")] if manifest else []
    if not named:  # most FMUs: what draws maps knows the physics, which takes a second to load
        return []
    from cosim.models.maps import curves_in

    return [row for member in named for row in curves_in(path, member)]


def _carried(path: Path) -> dict[str, str]:
    """What an FMU brings along (FMI-LS-REF): where it is proven, and experiments that `cosim check` runs."""
    from cosim.fmi.domain import domains_in
    from cosim.fmi.manifest import manifest_of

    try:
        manifest = manifest_of(path)
    except FmuError as error:
        return {"brings along": str(error)}
    if manifest is None:
        return {}
    found = {"brings along": ", ".join(dict.fromkeys(one.role for one in manifest.related))}
    domains = domains_in(path, manifest)
    return found | ({"proven for": "; ".join(map(str, domains))} if domains else {})


def _first_values(start: Any) -> str:
    """Write a start value; of an array of many the first ones and their number."""
    if start is None or isinstance(start, float):
        return "" if start is None else f"{start:g}"
    first = str(start)[:START].split()
    if len(start) <= START or len(first) < 2:
        return str(start)
    return f"{' '.join(first[:-1])} ... ({len(start.split()):,} values)"


def _type(port: Any) -> str:
    """Write a type with the size of an array and the items of an enumeration."""
    items = ", ".join(f"{value} {name}" for value, name in port.items.items())
    size = f" {' x '.join(map(str, port.shape))}" if port.shape else ""
    return f"{port.type}{size}" + (f" ({items})" if items else "")


def _toml(file: str) -> tuple[Facts, Tables]:
    import tomllib

    from cosim.support.toml import parsed

    path = Path(file)
    if path.suffix == ".toml" and path.is_file():
        try:
            keys = parsed(path.read_text("utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise InputError(f"{file} is not valid TOML: {error}.", culprit=file) from error
        if key := next((one for one in names(TOML) if one in keys), ""):
            plugged: tuple[Facts, Tables] = loaded(TOML, key)(path)
            return plugged
        return _card(file) if "mount" in keys else _scenario(file)
    from cosim.system.scenario import shipped_scenarios

    if file in shipped_scenarios():
        return _scenario(file)
    from pyfmi_models.card import shipped_cards

    if file in shipped_cards():
        return _card(file)
    from cosim.api.show_effect import effects, of_effect

    if file in effects() and not path.exists():
        return of_effect(file)
    if path.exists():
        folders = "run, diagnosis, sweep, comparison, calibration, check or benchmark"
        kinds = f"a recording, FMU, SSP, scenario, card, sweep, or a folder of a {folders}"
        raise InputError(f"{file} is unsupported: cosim show takes {kinds}.", culprit=file)
    choices = (*shipped_scenarios(), *shipped_cards(), *effects())
    meant = did_you_mean(file, choices)
    text = (
        f"{file} does not exist; shipped are: {', '.join((*shipped_scenarios(), *shipped_cards()))}; and effects by "
        f"their ids, as cogging.{meant}"
    )
    raise InputError(text, culprit=file, choices=choices)


def _scenario(file: str) -> tuple[Facts, Tables]:
    from cosim.api.proven import proven_rows
    from cosim.system.diagram import in_short, on_the_way, origin, wire_delays
    from cosim.system.scenario import read_scenario

    scenario = read_scenario(file)
    stated = wire_delays(scenario)
    facts = {
        "scenario": scenario.name,
        "description": scenario.description,
        "step": f"{scenario.step:g} s",
        "stop": f"{scenario.stop:g} s ({scenario.ticks:,} steps)",
        "algorithm": in_short(scenario),
        "rows": "every step" if scenario.decimation == 1 else f"one in {scenario.decimation:,} steps",
    } | {f"note {number}": note for number, note in enumerate(scenario.notes, 1)}
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
    proven = proven_rows(scenario)
    more = {"proven for": proven} if proven else {}
    return facts, {"components": components, WIRES: wires, "recorded": records, **more}


def _card(file: str) -> tuple[Facts, Tables]:
    from cosim.fmi.domain import KEY, domains_of
    from cosim.models.maps import curves, maps_of
    from pyfmi_models.card import read_card

    card = read_card(file)
    model = card.plant().model()
    facts = {
        "card": file,
        "name": card.mount.name,
        "motion": card.mount.motion,
        "friction": card.friction.key,
        "effects": ", ".join(effect.name for effect in card.effects) or "none",
        "controller": card.controller.compensation if card.controller else "none",
    }
    domains = domains_of(card.origin.get(KEY))
    facts |= {"proven for": "; ".join(map(str, domains))} if domains else {}
    facts |= {f"note {number}": note for number, note in enumerate(card.remarks(), 1)}
    parameters = [
        {"parameter": v.name, "value": f"{v.start:.6g}", "unit": v.unit, "description": v.description}
        for v in model.parameters
    ]
    drawn = curves(maps_of(card)) if card.effects else []
    return facts, {"parameters": parameters} | ({"learned maps": drawn} if drawn else {})
