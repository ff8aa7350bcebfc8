"""A scenario drawn as text: what feeds what, and how old it is when it acts.

A delay counts from where the source takes its inputs to where the target takes the result; signals have none.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from cosim.support.files import cache_home
from cosim.system.algorithm import GaussSeidel
from cosim.system.scenario import Scenario
from cosim.system.schedule import Delay, delays, order_of
from cosim.system.wire import Wire

Ring = tuple[str, ...]


def draw(scenario: Scenario) -> list[str]:
    """Return the lines of the drawing.

    Raises:
        WiringError: the algorithm names what is not there.
    """
    stated = wire_delays(scenario)
    owners = dict.fromkeys(wire.source.owner for wire in scenario.wires)
    width = max((len(wire.source.port) for wire in scenario.wires), default=0)
    reach = max((len(wire.target) for wire in scenario.wires), default=0)
    lines: list[str] = []
    for owner in owners:
        wires = [wire for wire in scenario.wires if wire.source.owner == owner]
        lines.append(f"┌ {owner}: {_what(scenario, owner)}")
        for wire in wires:
            corner = "└" if wire is wires[-1] else "├"
            output = wire.source.port
            told = in_words(stated[wire.target], scenario.step) + on_the_way(wire)
            lines.append(f"{corner}─ {output} {'─' * (width - len(output))}──▶ {wire.target:<{reach}}  {told}")
        lines.append("")
    return lines + [_round(ring, scenario, stated) for ring in rings(scenario.wires, tuple(scenario.components))]


def wire_delays(scenario: Scenario) -> dict[str, Delay]:
    """Return by its target what each wire of a scenario delays."""
    return delays(scenario.algorithm, scenario.wires, tuple(scenario.components), scenario.every)


def in_words(delay: Delay, step: float) -> str:
    """Say a delay in ticks and milliseconds."""
    if delay.coupled or not delay.most:
        return delay.coupled or "at once"
    plural = "s" if delay.most > 1 else ""
    return f"{delay} tick{plural}, {_milliseconds(delay.least, delay.most, step)}"


def on_the_way(wire: Wire) -> str:
    """Say what a wire does to what it carries."""
    parts = {"x": wire.gain if wire.gain != 1 else 0, "+": wire.offset, "quantum": wire.quantum}
    told = [f"{name} {value:.6g}" for name, value in parts.items() if value]
    told += [f"+ {wire.noise}"] if wire.noise else []
    told += ["nearest value"] if wire.cast else []
    told += [", ".join(f"{source} as {target}" for source, target in wire.table.items())] if wire.table else []
    return "".join(f"; {one}" for one in told)


def rings(wires: Sequence[Wire], components: Sequence[str]) -> list[Ring]:
    """List the feedback loops of components, each once, starting with the component named first."""
    after: dict[str, list[str]] = {name: [] for name in components}
    for wire in wires:
        source, target = wire.source.owner, wire.target.owner
        if source in after and target in after and target not in after[source]:
            after[source].append(target)
    return [ring for number, first in enumerate(components) for ring in _rings(first, after, set(components[:number]))]


def _rings(first: str, after: dict[str, list[str]], done: set[str]) -> Iterator[Ring]:
    paths: list[Ring] = [(first,)]
    while paths:
        path = paths.pop()
        for name in after[path[-1]]:
            if name == first:
                yield path
            elif name not in done and name not in path:
                paths.append((*path, name))


def _round(ring: Ring, scenario: Scenario, stated: dict[str, Delay]) -> str:
    steps = [
        next(stated[w.target] for w in scenario.wires if _ends(w) == pair)
        for pair in zip(ring, (*ring[1:], ring[0]), strict=True)
    ]
    way = " → ".join((*ring, ring[0]))
    if all(one.coupled for one in steps):
        return f"round {way}: {steps[0].coupled}"
    least, most = sum(one.least for one in steps), sum(one.most for one in steps)
    total = f"{least}" if least == most else f"{least} to {most}"
    return f"round {way}: {total} ticks, {_milliseconds(least, most, scenario.step)}"


def _ends(wire: Wire) -> tuple[str, str]:
    return wire.source.owner, wire.target.owner


def _milliseconds(least: int, most: int, step: float) -> str:
    low, high = (f"{1000 * ticks * step:.6g}" for ticks in (least, most))
    return f"{low} ms" if low == high else f"{low} to {high} ms"


def _what(scenario: Scenario, owner: str) -> str:
    if owner in scenario.components:
        every = scenario.every.get(owner, 1)
        return f"{origin(scenario.components[owner])}, steps every {_milliseconds(every, every, scenario.step)}"
    return str(getattr(scenario.signals.get(owner), "kind", "signal"))


def origin(component: Any) -> str:
    """Say where a component comes from; what was built from a card or model is told by that, not by its place here."""
    built = component.model or (f"the {component.part} of {component.card}" if component.card else "")
    return str(built or _fmu_label(component.fmu) or component.python)


def _fmu_label(fmu: Any) -> str:
    """Name an FMU; one that was unpacked into the cache by its place in the archive that it came from."""
    if fmu is None or not Path(fmu).is_relative_to(cache_home()):
        return str(fmu or "")
    parts = Path(fmu).relative_to(cache_home()).parts
    return "/".join(parts[parts.index("resources") :] if "resources" in parts else parts[-1:])


def in_short(scenario: Scenario) -> str:
    """Name the algorithm, for Gauss-Seidel with its order."""
    names = tuple(scenario.components)
    order = order_of(scenario.algorithm.stages(names)) if isinstance(scenario.algorithm, GaussSeidel) else ()
    return scenario.algorithm.kind + (f": {', '.join(order)}" if order else "")
