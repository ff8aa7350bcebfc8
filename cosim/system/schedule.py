"""What an algorithm makes of a wiring: the stages of a tick, what each wire delays, and loops that it cannot solve."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from math import lcm

from cosim.fmi.component import Component
from cosim.support.errors import UnitError, WiringError
from cosim.support.units import unit
from cosim.system.algorithm import Algorithm, Energy, Iterated, Stage
from cosim.system.conversions import check_smooth
from cosim.system.plan import Balance, Gather, Inner, Iterate, PlannedStage, Step
from cosim.system.ports import PortRef
from cosim.system.wire import Wire

POWER = unit("W").dimension


@dataclass(frozen=True)
class Delay:
    """Ticks from where a source takes its inputs to where the target takes the result, at least and at most.

    A signal has none. `coupled` says that source and target are taken over the tick together: the target acts on what
    the source does in the same tick (iterated), or in the piece of a tick before (energy).
    """

    least: int
    most: int
    coupled: str = ""

    def __str__(self) -> str:
        if self.coupled:
            return self.coupled
        return str(self.least) if self.least == self.most else f"{self.least} to {self.most}"


def order_of(stages: Sequence[Stage]) -> tuple[str, ...]:
    """Return the components in the order in which they step."""
    return tuple(name for stage in stages if stage.what != "gather" for name in stage.names)


def coupled_of(stages: Sequence[Stage]) -> tuple[str, ...]:
    """Return the components that are taken over the tick together."""
    return next((stage.names for stage in stages if stage.what == "couple"), ())


def delays(
    algorithm: Algorithm, wires: Sequence[Wire], components: Sequence[str], every: Mapping[str, int]
) -> dict[str, Delay]:
    """Return by its target what each wire delays.

    Raises:
        WiringError: the algorithm names what is not there.
    """
    stages = algorithm.stages(components)
    return {wire.target: _delay(wire, algorithm, stages, every) for wire in wires}


def _delay(wire: Wire, algorithm: Algorithm, stages: Sequence[Stage], every: Mapping[str, int]) -> Delay:
    source, target = wire.source.owner, wire.target.owner
    members = coupled_of(stages)
    if source not in order_of(stages):
        return Delay(0, 0)
    if source in members and target in members:
        return Delay(0, 1, "solved together" if isinstance(algorithm, Iterated) else "a piece of a step")
    gathered = next((k for k, stage in enumerate(stages) if stage.what == "gather" and target in stage.names), 0)
    stepped = next(k for k, stage in enumerate(stages) if stage.what != "gather" and source in stage.names)
    return _between(every.get(source, 1), every.get(target, 1), forward=stepped < gathered)


def _between(source: int, target: int, forward: bool) -> Delay:
    """Follow what a source that steps every `source` ticks shows, to a target that looks every `target` ticks."""
    ready = source - forward
    ages = [(look - ready) % source + ready for look in range(0, lcm(source, target), target)]
    return Delay(min(ages), max(ages))


def planned_stages(
    algorithm: Algorithm, wires: Sequence[Wire], components: Mapping[str, Component], every: Mapping[str, int]
) -> tuple[PlannedStage, ...]:
    """Return the stages of a tick, for parts in the order of `order_of`.

    Raises:
        WiringError: the algorithm does not fit these components and wires.
    """
    stages = algorithm.stages(tuple(components))
    place = {name: index for index, name in enumerate(order_of(stages))}
    made: list[PlannedStage] = []
    for stage in stages:
        part, parts = place[stage.names[0]], len(stage.names)
        if stage.what == "gather":
            made.append(Gather(part, parts))
        elif stage.what == "step":
            made.append(Step(part, parts))
        else:
            made.append(_couple(algorithm, stage, wires, components, every, place))
    return tuple(made)


def _couple(
    algorithm: Algorithm,
    stage: Stage,
    wires: Sequence[Wire],
    components: Mapping[str, Component],
    every: Mapping[str, int],
    place: Mapping[str, int],
) -> PlannedStage:
    inside = [wire for wire in wires if wire.source.owner in stage.names and wire.target.owner in stage.names]
    _check_members(algorithm, stage.names, components, every)
    check_smooth(inside, {name: components[name].ports for name in stage.names})
    inner = tuple(_inner(wire, wires, place) for wire in inside)
    part, parts = place[stage.names[0]], len(stage.names)
    if isinstance(algorithm, Iterated):
        for wire in inside:
            if wire.quantum:
                message = f'The wire to "{wire.target}" is quantised; values that are iterated must be smooth.'
                raise WiringError(message, culprit=wire.target, value=wire.quantum)
        return Iterate(part, parts, inner, algorithm.tolerance, algorithm.max_iterations, algorithm.theta)
    assert isinstance(algorithm, Energy)  # the two algorithms that couple
    bonds = tuple(_bond(bond, inside, components) for bond in algorithm.bonds)
    return Balance(part, parts, inner, bonds, algorithm.tolerance, algorithm.max_pieces)


def _check_members(
    algorithm: Algorithm, names: Sequence[str], components: Mapping[str, Component], every: Mapping[str, int]
) -> None:
    for name in names:
        if every.get(name, 1) != 1:
            message = f'"{name}" steps every {every[name]} ticks; components that are coupled must step at every tick.'
            raise WiringError(message, culprit=name, value=every[name])
        if isinstance(algorithm, Iterated) and not components[name].can_get_and_set_state:
            message = (
                f'"{name}" cannot save and restore its state, which the iterated algorithm needs; '
                f"leave it out of algorithm.components, or choose jacobi, gauss-seidel or energy."
            )
            raise WiringError(message, culprit=name, choices=("jacobi", "gauss-seidel", "energy"))
        if isinstance(algorithm, Energy) and not components[name].can_vary_step:
            message = f'"{name}" takes steps of one length only, and the energy algorithm cuts them into pieces.'
            raise WiringError(message, culprit=name, choices=("jacobi", "gauss-seidel", "iterated"))


def _inner(wire: Wire, wires: Sequence[Wire], place: Mapping[str, int]) -> Inner:
    target = wire.target.owner
    link = [one for one in wires if one.target.owner == target].index(wire)
    return Inner(place[target], link, back=place[wire.source.owner] >= place[target])


def _bond(bond: tuple[str, str], inside: Sequence[Wire], components: Mapping[str, Component]) -> tuple[int, int]:
    """Return the numbers of the two inner wires of a bond."""
    one, other = bond
    found = [
        (first, second)
        for first, there in enumerate(inside)
        for second, back in enumerate(inside)
        if (there.source, back.source) == bond
        and there.target.owner == PortRef(other).owner
        and back.target.owner == PortRef(one).owner
    ]
    if not found:
        message = f'The bond of "{one}" and "{other}" needs a wire from each of them to the component of the other.'
        raise WiringError(message, culprit=one, value=other)
    units = [components[PortRef(name).owner].ports[PortRef(name).port].unit for name in bond]
    try:
        power = not all(units) or unit(".".join(units)).dimension == POWER
    except UnitError as error:
        raise WiringError(f'The bond of "{one}" and "{other}": {error}', culprit=one) from error
    if not power:
        message = (
            f'The bond of "{one}" [{units[0]}] and "{other}" [{units[1]}] is no power; their product must be in W.'
        )
        raise WiringError(message, culprit=one, value=units)
    return found[0]


def check_loops(algorithm: Algorithm, wires: Sequence[Wire], components: Mapping[str, Component]) -> tuple[str, ...]:
    """Refuse algebraic loops that the algorithm does not solve; return those that cannot be excluded, as sentences.

    A loop is algebraic where each output follows its input at once. A wire with `breaks_loop` ends it knowingly.

    Raises:
        WiringError: names the loop.
    """
    members = coupled_of(algorithm.stages(tuple(components))) if isinstance(algorithm, Iterated) else ()
    open_ = [
        wire
        for wire in wires
        if not wire.breaks_loop and not (wire.source.owner in members and wire.target.owner in members)
    ]
    sure = _cycle(open_, components, doubtful=False)
    if sure:
        message = (
            f"Algebraic loop: {' -> '.join(sure)}; each follows the one before at once, and {algorithm.kind} cannot "
            f"solve that. Choose the algorithm iterated for these components, or write breaks_loop = true at the wire "
            f"whose delay of a step you accept."
        )
        raise WiringError(message, culprit=sure[0], value=sure)
    maybe = _cycle(open_, components, doubtful=True)
    silent = " and ".join(dict.fromkeys(PortRef(name).owner for name in maybe if _unsaid(name, components)))
    note = f"An algebraic loop cannot be excluded, because {silent} do not say what their outputs depend on: "
    return (note + " -> ".join(maybe) + ".",) if maybe else ()


def _cycle(wires: Sequence[Wire], components: Mapping[str, Component], doubtful: bool) -> list[str]:
    """Find a loop of outputs and inputs that follow each other at once; `doubtful` counts what is unknown as such."""
    graph: dict[str, set[str]] = {}
    for wire in wires:
        if wire.source.owner in components:
            graph.setdefault(_variable(wire.target, components), set()).add(_variable(wire.source, components))
    for name, component in components.items():
        for output, inputs in component.feedthrough.items():
            known = _inputs(component) if inputs is None and doubtful else inputs or frozenset()
            graph.setdefault(f"{name}.{output}", set()).update(f"{name}.{one}" for one in known)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        found: list[str] = error.args[1]
        return found
    return []


def _inputs(component: Component) -> frozenset[str]:
    return frozenset(port.variable for port in component.ports.values() if port.causality == "input")


def _variable(name: PortRef, components: Mapping[str, Component]) -> str:
    """Return the variable that a full name means, for an element that of its array."""
    port = components[name.owner].ports.get(name.port)
    return f"{name.owner}.{port.variable}" if port else name


def _unsaid(name: str, components: Mapping[str, Component]) -> bool:
    owner, output = PortRef(name).parts
    return components[owner].feedthrough.get(output, frozenset()) is None
