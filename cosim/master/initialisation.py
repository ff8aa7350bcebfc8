"""Values at the start reach the inputs that they are wired to while components are in initialisation mode.

Components that wait for nobody's outputs come first: their inputs are set, they leave initialisation mode, and their
outputs are read and go on along the wires. Components that wait for each other stay there together. The order among
their variables is that of the dependencies which their model descriptions state (what is not stated may follow every
input), so an output is read after the inputs that it follows. Where variables depend on each other in a ring,
`agreement` makes them agree. Then everything is read again: what changes was stated wrongly, and all is made to agree.

Row 0 of a recording is what components have after initialisation mode. Where an event is due at the start (model
exchange) it is what they have at its end, because the event belongs to the first step.

Reference: FMI 2.0.5, 2.2.8 (InitialUnknowns) and 4.2.4; FMI 3.0.2, 2.3.3 (initialization mode).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosim.fmi.types import FLOATS
from cosim.master.agreement import Member, agree, arrive, is_close, is_settled
from cosim.master.opening import Settings
from cosim.master.start_graph import Arrival, Node, StartGraph
from cosim.system.graph import rings
from cosim.system.plan import Part, Plan


def initialise(plan: Plan, settings: Settings, signals: np.ndarray) -> list[str]:
    """Take components from initialisation mode to the start of the run, with what the wires bring them.

    Args:
        plan: its components are in initialisation mode; its bus is filled with the values of tick 0.
        settings: parameters and start values that the components were given.
        signals: those of tick 0, shape (signals,).

    Returns:
        Notes: what was not as the standard has it.

    Raises:
        StepError: a component refuses, or gives what is no finite number.
        FmuError: a component does not leave initialisation mode.
        WiringError: values that depend on each other in a ring do not agree.
    """
    plan.bus[plan.signal : plan.signal + plan.signals] = signals
    for part in plan.parts:
        plan.bus[part.input : part.input + len(part.input_names)] = _start_values(part, settings.get(part.name, {}))
    graph = StartGraph(plan)
    return [note for members in rings(graph.parts_before()) for note in _Group(graph, members).initialise()]


def _start_values(part: Part, given: Mapping[str, Any]) -> list[float]:
    """Return the start values of real inputs that are fed, from which a ring is solved; 0 where none is said."""
    found = []
    for port in (part.component.ports[name] for name in part.input_names):
        value = given.get(port.name, port.start)
        if port.array in given:
            value = np.ravel(given[port.array])[port.element]
        is_number = port.type in FLOATS and isinstance(value, int | float) and not isinstance(value, bool)
        found.append(float(value) if is_number else 0.0)
    return found


class _Group:
    """Parts, by number, that wait for each other's outputs, or one that waits for nobody's."""

    def __init__(self, graph: StartGraph, members: Sequence[int]) -> None:
        self._graph, self._plan, self._members = graph, graph.plan, members
        self._notes: list[str] = []
        acting = [one for one in graph.arrivals(members) if self._acts(one)]
        self._inner = [one for one in acting if self._is_inner(one)]
        self._broken = self._breaking(acting)
        self._arriving: dict[Node, list[Arrival]] = {one.target: [] for one in acting}
        for one in acting:
            self._arriving[one.target] += [] if one in self._broken else [one]

    def initialise(self) -> list[str]:
        """Set inputs, leave initialisation mode and read outputs; returns notes."""
        for arrival in self._broken:
            self._read([arrival.source] if arrival.source else [])
            arrive(self._plan, arrival)
        whole = [one for arrivals in self._arriving.values() for one in arrivals]
        nodes: dict[Node, set[Node]] = {node: set() for node in self._arriving}
        before = nodes | self._graph.before(whole, self._members)
        for ring in rings(before):
            if len(ring) > 1 or ring[0] in before[ring[0]]:
                agree(self._plan, self._taking_part(ring))
            else:
                self._take(ring[0])
        if self._inner and not is_settled(self._plan, everyone := self._taking_part(list(before))):
            agree(self._plan, everyone)
        sent = [float(self._plan.bus[one.link.source]) for one in self._inner]
        for number in self._members:
            self._leave(number)
        for arrival, value in zip(self._inner, sent, strict=True):
            self._compare(arrival, value)
        return self._notes

    def _acts(self, arrival: Arrival) -> bool:
        """Say whether a wire can bring something in initialisation mode; note where it cannot."""
        if not self._is_inner(arrival) or arrival.source is None or self._graph.is_readable(arrival.source):
            return True
        says = f'"{arrival.given}" is a local variable, which FMI 2 lets nobody read in initialisation mode'
        self._notes.append(f'{says}; "{arrival.taken}" was initialised with its own start value.')
        return False

    def _is_inner(self, arrival: Arrival) -> bool:
        return arrival.source is not None and arrival.source.part in self._members

    def _breaking(self, acting: Sequence[Arrival]) -> set[Arrival]:
        """Return the wires that were asked to break a ring and are part of one."""
        found = rings(self._graph.before(acting, self._members))
        place = {node: number for number, ring in enumerate(found) for node in ring}
        asked = [one for one in acting if one.link.breaks_loop and self._is_inner(one)]
        return {one for one in asked if one.source and place[one.source] == place[one.target]}

    def _take(self, node: Node) -> None:
        """Read an output; set an input to what its wires bring."""
        if not node.is_input:
            self._read([node])
            return
        for arrival in self._arriving[node]:
            arrive(self._plan, arrival)
        misfit = self._graph.access(node.part, True, [node]).set(lenient=True)
        if misfit:  # an algorithm may carry another value before the first step
            self._notes.append(f"{misfit}; it was initialised with its own start value.")

    def _read(self, nodes: Sequence[Node]) -> None:
        for node in nodes:
            self._graph.access(node.part, False, [node]).get()

    def _taking_part(self, nodes: Sequence[Node]) -> list[Member]:
        """Return the parts of these variables with what arrives at their inputs, in the order of the variables."""
        return [
            Member(
                inputs=self._graph.access(number, True, nodes),
                outputs=self._graph.access(number, False, nodes),
                arriving=[one for node in nodes if node[:2] == (number, True) for one in self._arriving[node]],
            )
            for number in dict.fromkeys(node.part for node in nodes)
        ]

    def _leave(self, number: int) -> None:
        """End initialisation mode, and read what the component has then, or had at the end of it."""
        component = self._plan.parts[number].component
        shown = self._graph.outputs(number, readable=True)
        if component.event_at_start:
            shown.get()
        kept = self._plan.bus[shown.places]
        component.exit_initialisation()
        self._graph.outputs(number, readable=False).get()
        if component.event_at_start:
            self._plan.bus[shown.places] = kept

    def _compare(self, arrival: Arrival, sent: float) -> None:
        """Note a value that changed though it had been handed on."""
        found = float(self._plan.bus[arrival.link.source])
        if not is_close(arrival, found, sent):
            says = f'"{arrival.given}" is {sent:.6g} in initialisation mode and {found:.6g} after it'
            target = f'"{arrival.taken}" was initialised with the former'
            self._notes.append(f"{says}, where FMI lets nothing change; {target}.")
