"""A model taken apart for a reader: which variable and which equation belongs to which part of it."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain

import casadi as ca

from pyfmi_models.export.expressions import PRODUCT, Node, Writer, graph_of, under
from pyfmi_models.export.layout import layout_of
from pyfmi_models.model import Derivation, Model, Variable

LONG = 8
"""Operations from which on an expression that is needed twice gets a name of its own."""
_WORDS = """algorithm and annotation block break class connect connector constant constrainedby der discrete each else
elseif elsewhen encapsulated end enumeration equation expandable extends external false final flow for function if
import impure in initial inner input loop model not operator or outer output package parameter partial protected public
pure record redeclare replaceable return stream then time true type when while within pi"""
KEYWORDS = frozenset(_WORDS.split())
_TRUTHS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR, ca.OP_NOT)
_PARAMETERS = 3
"""Place of the parameters among the arguments of a model's equations."""


@dataclass(frozen=True)
class Named:
    """A variable by its name in the whole model, and what a part calls it."""

    name: str
    local: str
    variable: Variable


@dataclass(frozen=True)
class Definition:
    """An equation `left = right`; `declares` is the variable that is new with it, where there is one."""

    left: str
    right: str
    declares: Named | None
    output: bool


@dataclass
class Part:
    """A class in the making: what is its own, what it needs from others, and its equations in order."""

    prefix: str
    title: str
    text: str
    parameters: list[Named] = field(default_factory=list)
    inputs: list[Named] = field(default_factory=list)
    states: list[Named] = field(default_factory=list)
    needed: dict[str, Named] = field(default_factory=dict)
    definitions: list[Definition] = field(default_factory=list)
    taken: set[str] = field(default_factory=set)

    def take(self, *wishes: str) -> str:
        """Return the first wish that is no keyword and not taken here, else the last one numbered, and take it."""
        numbered = (f"{wishes[-1]}_{k}" for k in range(2, len(self.taken) + 3))
        found = next(one for one in (*wishes, *numbered) if one not in self.taken and one not in KEYWORDS)
        self.taken.add(found)
        return found


@dataclass(frozen=True)
class _Wanted:
    """A result or quantity that needs an equation; `state` is the state whose rate it is."""

    name: str
    node: Node
    variable: Variable
    state: str = ""
    output: bool = False


class Book:
    """The parts of a model by prefix; the model as a whole has the prefix ""."""

    def __init__(self, model: Model, derivation: Derivation | None = None) -> None:
        self.model = model
        self._symbols = derivation.symbols if derivation else {}
        self._layout = layout_of(model)
        self._variables = {row.variable.name: row.variable for row in self._layout.rows}
        results = graph_of(derivation.equations if derivation else model.equations)
        self._names = {node: self._argument(node) for node in under(chain(*results)) if node.place != (-1, -1)}
        wanted = [*self._quantities(derivation, results), *self._rates(results[0]), *self._outputs(results[1])]
        self.parts = self._empty_parts()
        wanted = [*self._shared(wanted), *wanted]
        self._locals = self._take_names(wanted)
        for one in wanted:
            self._define(one)

    def reference(self, name: str, part: Part) -> str:
        """Write a variable of the whole model as `part` knows it: as an input where it belongs to another part."""
        rate = name.startswith("der(")
        plain = name[4:-1] if rate else name
        owner, local = self._owner(plain), self._locals[plain]
        if owner == part.prefix or not part.prefix:
            path = local if owner == part.prefix else f"{owner}.{local}"
            return f"der({path})" if rate else path
        if name not in part.needed:
            long = f"{owner or 'plant'}_{'der_' if rate else ''}{local}"
            part.needed[name] = Named(name, part.take(self._symbols.get(name, long), long), self._variables[name])
        return part.needed[name].local

    def _argument(self, node: Node) -> str:
        groups = (self._layout.of(kind) for kind in ("time", "state", "input", "parameter"))
        return tuple(groups)[node.place[0]][node.place[1]].variable.name

    def _quantities(self, derivation: Derivation | None, results: list[list[Node]]) -> Iterator[_Wanted]:
        """Yield what the results need and what is more than a variable or a number under another name."""
        needed = set(under(chain(*results[:2])))
        for variable, node in zip(derivation.quantities, results[2], strict=True) if derivation else ():
            new = node not in self._names and variable.name not in self._variables
            if new and node in needed and not node.constant:
                self._names[node], self._variables[variable.name] = variable.name, variable
                yield _Wanted(variable.name, node, variable)

    def _rates(self, nodes: list[Node]) -> Iterator[_Wanted]:
        for row, state, node in zip(self._layout.of("rate"), self.model.states, nodes, strict=True):
            if not node.constant:
                self._names.setdefault(node, row.variable.name)
            yield _Wanted(row.variable.name, node, row.variable, state=state.name)

    def _outputs(self, nodes: list[Node]) -> Iterator[_Wanted]:
        for variable, node in zip(self.model.outputs, nodes, strict=True):
            if not node.constant:
                self._names.setdefault(node, variable.name)
            yield _Wanted(variable.name, node, variable, output=True)

    def _shared(self, wanted: list[_Wanted]) -> list[_Wanted]:
        """Name long expressions that are needed more than once and have no name, from the inside out."""
        uses = Counter(part for node in under([one.node for one in wanted]) for part in node.arguments)
        found: list[_Wanted] = []
        for one in wanted:
            for node in under(one.node.arguments, self._names):
                if node not in self._names and uses[node] > 1 and self._length(node) >= LONG:
                    owner = self._owner(one.name.removeprefix("der("))
                    name = f"{owner}.shared_{len(found) + 1}".removeprefix(".")
                    variable = Variable(name=name, unit="", description="Needed more than once")
                    self._names[node], self._variables[name] = name, variable
                    found.append(_Wanted(name, node, variable))
        return found

    def _length(self, node: Node) -> int:
        """Operations in the text of a node; a truth value counts as none, for it cannot be a real variable."""
        if node in self._names or node.constant or node.operation in _TRUTHS:
            return 0
        return 1 + sum(self._length(one) for one in node.arguments)

    def _empty_parts(self) -> dict[str, Part]:
        known = {chapter.prefix: chapter for chapter in self.model.chapters}
        dotted = [name.partition(".")[0] for name in self._variables if "." in name and not name.startswith("der(")]
        parts, titles = {}, Part("", "", "")
        titles.take("Plant")
        for prefix in dict.fromkeys([one for one in known if one in dotted] + dotted):
            title = titles.take(known[prefix].name if prefix in known else prefix[:1].upper() + prefix[1:])
            parts[prefix] = Part(prefix, title, known[prefix].text if prefix in known else "")
        whole = Part("", "Plant", self.model.description)
        for prefix in parts:
            whole.take(prefix)
        return parts | {"": whole}

    def _take_names(self, wanted: list[_Wanted]) -> dict[str, str]:
        """Give each variable its name in its part; the parts themselves have theirs already."""
        found = {"time": "time"}
        places = {"parameter": "parameters", "input": "inputs", "state": "states"}
        rows = [
            (row.variable, places.get(row.kind, "")) for row in self._layout.rows if row.kind not in ("time", "rate")
        ]
        fresh = [(one.variable, "") for one in wanted if not one.state and not one.output]
        for variable, place in rows + fresh:
            part = self.parts[self._owner(variable.name)]
            local = variable.name.removeprefix(f"{part.prefix}.").replace(".", "_")
            found[variable.name] = part.take(local, f"{local}_{place[:-1] or 'output'}")
            if place:
                getattr(part, place).append(Named(variable.name, found[variable.name], variable))
        return found

    def _define(self, one: _Wanted) -> None:
        part = self.parts[self._owner(one.state or one.name)]
        left = f"der({self._locals[one.state]})" if one.state else self._locals[one.name]
        writer = Writer(_Scope(self, part))
        own = self._names.get(one.node) == one.name
        right = writer.text(one.node) if own or one.node.constant else self.reference(self._names[one.node], part)
        if one.state and own and one.node.operation == ca.OP_DIV and self._fixed(one.node.arguments[1]):
            numerator, factor = one.node.arguments
            left, right = f"{writer.part(factor, PRODUCT)}*{left}", writer.part(numerator, 0)
        new = None if one.state else Named(one.name, self._locals[one.name], one.variable)
        part.definitions.append(Definition(left, right, new, one.output))

    def _fixed(self, node: Node) -> bool:
        """Say whether an expression is made of parameters and numbers only."""
        return all(one.place[0] == _PARAMETERS for one in under([node]) if one.place != (-1, -1))

    def _owner(self, name: str) -> str:
        prefix, dot, _ = name.partition(".")
        return prefix if dot else ""


class _Scope:
    """The names of nodes as one part knows them; what it looks up becomes an input of the part."""

    def __init__(self, book: Book, part: Part) -> None:
        self.book, self.part = book, part

    def __contains__(self, node: object) -> bool:
        return node in self.book._names

    def __getitem__(self, node: Node) -> str:
        name = self.book._names[node]
        return "time" if name == "time" else self.book.reference(name, self.part)
