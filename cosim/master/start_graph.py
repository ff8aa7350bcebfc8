"""What follows what at the start: the variables on the bus of a plan, their wires, and what FMUs say of them."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from cosim.fmi.component import Port
from cosim.master.access import Access
from cosim.system.plan import Link, Plan


class Node(NamedTuple):
    """A variable of a part; names of one value reference are one variable, and so are the elements of an array."""

    part: int
    is_input: bool
    type: str
    reference: int


@dataclass(frozen=True, eq=False)
class Arrival:
    """A wire with the variables at its ends, and their full names; a signal is no variable and has no name here."""

    link: Link
    source: Node | None
    target: Node
    given: str
    taken: str


class StartGraph:
    """The variables and wires of a plan."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self._indices: dict[Node, list[int]] = defaultdict(list)
        self._at: dict[int, tuple[Node, str]] = {}
        for number, part in enumerate(plan.parts):
            for is_input, first in ((True, part.input), (False, part.output)):
                for index, name in enumerate(self._names(number, is_input)):
                    node = _node(number, is_input, part.component.ports[name])
                    self._indices[node].append(index)
                    self._at[first + index] = node, f"{part.name}.{name}"
        self._inputs: dict[int, list[Node]] = defaultdict(list)
        for node in self._indices:
            self._inputs[node.part] += [node] if node.is_input else []

    def parts_before(self) -> dict[int, set[int]]:
        """Return of each part the parts that feed it."""
        every = {number: self.arrivals([number]) for number in range(len(self.plan.parts))}
        return {number: {one.source.part for one in found if one.source} for number, found in every.items()}

    def arrivals(self, members: Iterable[int]) -> Iterator[Arrival]:
        """Yield the wires to these parts."""
        for link in (link for number in members for link in self.plan.parts[number].links):
            source, given = self._at.get(link.source, (None, ""))
            target, taken = self._at[link.target]
            yield Arrival(link, source, target, given, taken)

    def before(self, arrivals: Iterable[Arrival], members: Collection[int]) -> dict[Node, set[Node]]:
        """Return what each variable follows: an input the outputs of `members` that feed it, an output its inputs."""
        found: dict[Node, set[Node]] = defaultdict(set)
        for one in arrivals:
            found[one.target] |= {one.source} if one.source and one.source.part in members else set()
        for output in set().union(*found.values()):
            found[output] = {node for node in self._followed(output) if node in found}
        return dict(found)

    def is_readable(self, output: Node) -> bool:
        """Say whether FMI lets an output be read in initialisation mode."""
        return self._port(output).variable in self.plan.parts[output.part].component.initial_dependencies

    def access(self, part: int, is_input: bool, nodes: Iterable[Node]) -> Access:
        """Reach those of the variables that are inputs (or outputs) of a part."""
        own = (node for node in nodes if node[:2] == (part, is_input))
        return Access.of(self.plan, part, sorted(place for node in own for place in self._indices[node]), is_input)

    def outputs(self, part: int, readable: bool) -> Access:
        """Reach all outputs of a part that are used, or those that can be read in initialisation mode."""
        nodes = (self._at[self.plan.parts[part].output + index][0] for index in range(len(self._names(part, False))))
        return self.access(part, False, dict.fromkeys(one for one in nodes if not readable or self.is_readable(one)))

    def _followed(self, output: Node) -> Iterable[Node]:
        component = self.plan.parts[output.part].component
        names = component.initial_dependencies[self._port(output).variable]
        if names is None:
            return self._inputs[output.part]
        return (_node(output.part, True, component.ports[name]) for name in names if name in component.ports)

    def _port(self, node: Node) -> Port:
        name = self._names(node.part, node.is_input)[self._indices[node][0]]
        return self.plan.parts[node.part].component.ports[name]

    def _names(self, part: int, is_input: bool) -> tuple[str, ...]:
        found = self.plan.parts[part]
        return found.input_names if is_input else found.output_names


def _node(part: int, is_input: bool, port: Port) -> Node:
    return Node(part, is_input, port.type, port.reference)
