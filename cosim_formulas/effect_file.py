"""A formula as the file of an effect, for a person to review: the form of docs/adding_physics.md, loaded by nobody.

    load = f,   level (1 + f) and viscous + v f but not below zero,   applied = command - f or command / (1 + f)

f is the formula of a learned table (`formula.py`), each quantity held at the ends of the range that was seen.
Below are the text of such a file, how it reads a quantity, and where a formula acts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cosim.delivery.proposal import PREFIX
from cosim.diagnosis.answer.entries import FormulaEntry
from cosim.support.version import __version__
from cosim_formulas.formula import Shape, interval
from cosim_formulas.spelled import LETTERS, Spelled
from pyfmi_models.effects.learned_base import FOLLOWED, SEEN_WITHIN, SINCE
from pyfmi_models.waves import INPUT, spoken


@dataclass(frozen=True)
class EffectFile:
    """One formula, what `diagnosis.json` says of it, and the file it would be."""

    spelled: Spelled

    def as_json(self) -> FormulaEntry:
        """Return what `diagnosis.json` holds of it under `learned.formula`."""
        return self.spelled.as_json()

    @property
    def id(self) -> str:
        """Id of the effect, and name of its file."""
        quantities = "_and_".join(name.removeprefix(INPUT) for name in self.spelled.names)
        return f"{PREFIX}{self.spelled.effect.kind}_over_{quantities}".replace(" ", "_")

    def text(self, statement: str) -> str:
        """Return the file; `statement` is what the diagnosis says of the learned term, with its errors."""
        kind = self.spelled.effect.kind
        place = PLACES[kind]
        return FILE.format(
            version=__version__,
            statement=statement,
            id=self.id,
            imports=", ".join(sorted((place.base, *place.needed))),
            model_imports=", ".join(["Scalar", *(["Variable"] if self._variables() else []), "parameter"]),
            dataclasses="dataclass, replace" if place.then else "dataclass",
            typing=", ".join([*(["Any"] if self._followed() else []), "ClassVar", *(["Self"] if place.then else [])]),
            ranges="\n".join(self._ranges()),
            name="".join(word.capitalize() for word in self.id.split("_")),
            base=place.base,
            equation=self.spelled.equation(),
            title=f"Proposed: {kind} over {' and '.join(map(spoken, self.spelled.names))}",
            main=self.spelled.outer_names[0],
            main_unit=self._coefficients()[0][-1],
            parameters="\n".join([*self._parameters(), *(["    now: Scalar = 0.0"] if place.then else [])]),
            inputs="\n".join([*self._inputs(), *self._states()]),
            method=place.method,
            body="\n".join(f"        {line}" for line in self._body()),
            returned=place.returned,
            then=place.then,
        )

    def _seen(self) -> tuple[Sequence[float], ...]:
        """The range of each quantity; () of the turn."""
        effect = self.spelled.effect
        if effect.since():
            return ((0.0, self.spelled.formula.tops[0]),)
        found = (getattr(effect, key, ()) for key in ("command_seen", "seen", "by_seen"))
        own = [seen for seen in found if seen]
        return tuple(() if name == "turn" else own.pop(0) for name in self.spelled.names)

    def _locals(self) -> tuple[str, ...]:
        """What each quantity is called in the method."""
        return tuple(LETTERS.get(name, "xy"[k]) for k, name in enumerate(self.spelled.names))

    def _columns(self) -> list[str]:
        return [name for name in self.spelled.names if name not in (*KNOWN, *SINCE)]

    def _followed(self) -> list[str]:
        return [name for name in self.spelled.names if name in (*FOLLOWED, *SINCE)]

    def _rate(self, name: str) -> str:
        """Rate of the state that follows a quantity; of a memory, as `LearnedAfterReversal` has it."""
        if name in RATES:
            return RATES[name]
        by_time = name == "time since reversal"
        ahead, speed = (self._direction(), "") if by_time else ("motion.v", "ca.fabs(motion.v) * ")
        return f"({ahead} - {speed}motion.state[0]) / self.fade"

    def _direction(self) -> str:
        return f"ca.tanh(motion.v / {float(getattr(self.spelled.effect, 'creep', 1.0))!r})"

    def _known(self, name: str) -> str:
        """A quantity as the effect finds it; since a reversal, from what a memory of it has left."""
        if name in SINCE:
            return f"-self.fade * ca.log(ca.fmax((1 - {self._direction()} * motion.state[0]) / 2, 1e-9))"
        return KNOWN.get(name, f'motion.inputs["{name.removeprefix(INPUT)}"]')

    def _variables(self) -> list[str]:
        return [*self._columns(), *self._followed()]

    def _states(self) -> Iterator[str]:
        """States and rates of what is followed: of the two quantities at most one is."""
        if not self._followed():
            return
        (name,) = self._followed()
        one, *_ = self.spelled.effect.states()
        described = f'unit="{one.unit}", description="{one.description}"'
        yield "\n    def states(self) -> tuple[Variable, ...]:"
        yield f'        """What the {spoken(name)} is told by."""'
        yield f'        return (Variable(name="{one.name}", {described}),)'
        yield "\n    def rate(self, motion: Motion) -> Any:"
        yield '        """Follow it."""'
        yield f"        return {self._rate(name)}\n"

    def _ranges(self) -> Iterator[str]:
        for k, (name, seen) in enumerate(zip(self.spelled.names, self._seen(), strict=True)):
            if seen:
                yield f"SEEN_{self._locals()[k].upper()} = ({float(seen[0])!r}, {float(seen[1])!r})"
                yield f'"""Lowest and highest {spoken(name)} [{self.spelled.unit(k)}] in the recordings."""'

    def _coefficients(self) -> list[tuple[str, float, float, str]]:
        return self._numbers()[len(self.spelled.inner_names) :]

    def _numbers(self) -> list[tuple[str, float, float, str]]:
        """Name, value, error and unit, as of a rotary axis: a linear one gets m and N by itself."""
        found, wide = Spelled(self.spelled.effect, self.spelled.formula, linear=False).numbers(), ("width", "period")
        is_span = [unit == "degC" and name.startswith(wide) for name, _, _, unit in found]
        return [(*one[:3], "K" if span else one[3]) for one, span in zip(found, is_span, strict=True)]

    def _parameters(self) -> Iterator[str]:
        limits = (*self._limits(), *[""] * len(self._coefficients()))
        for (name, value, error, unit), bounds in zip(self._numbers(), limits, strict=True):
            low, high = interval(value, error)
            told = f"Fitted; 95 % {low:.4g} to {high:.4g}"
            yield f'    {name}: Scalar = parameter(\n        "{unit}", "{told}", default={value!r}{bounds}\n    )'

    def _limits(self) -> Iterator[str]:
        """Bounds of the numbers inside the forms, as their fit had them."""
        formula, seen = self.spelled.formula, self._seen()
        for (which, form), place in formula.placed().items():
            low, high = seen[which] or (-3.2, 3.2)
            for k, (least, most) in zip(place, zip(*form.bounds(low, high), strict=True), strict=True):
                value = formula.inner[k]
                yield f", low={float(min(least, value)):.6g}, high={float(max(most, value)):.6g}"

    def _inputs(self) -> Iterator[str]:
        if not self._columns():
            return
        made = []
        for name in self._columns():
            (one,) = (one for one in self.spelled.effect.inputs() if one.name == name.removeprefix(INPUT))
            described = f'unit="{one.unit}", description="{one.description}", start={float(one.start)!r}'
            made.append(f'Variable(name="{one.name}", {described}),')
        yield "\n    def inputs(self) -> tuple[Variable, ...]:"
        yield '        """What is recorded beside the motion."""'
        yield "        return ("
        yield from (f"            {one}" for one in made)
        yield "        )\n"

    def _body(self) -> Iterator[str]:
        for name, letter, seen in zip(self.spelled.names, self._locals(), self._seen(), strict=True):
            value = self._known(name)
            edge = f"SEEN_{letter.upper()}"
            yield f"{letter} = {f'ca.fmin(ca.fmax({value}, {edge}[0]), {edge}[1])' if seen else value}"
        pairs = zip(self.spelled.outer_names, self.spelled.formula.shapes, strict=True)
        first, *rest = (" * ".join([f"self.{name}", *self._factors(shape)]) for name, shape in pairs)
        yield f"f = {first}"
        yield from (f"f += {one}" for one in rest)

    def _factors(self, shape: Shape) -> Iterator[str]:
        formula = self.spelled.formula
        placed = formula.placed()
        for k, form in shape.parts:
            own = [f"self.{self.spelled.inner_names[i]}" for i in placed.get((k, form), ())]
            yield form.written(self._locals()[k], own, formula.tops[k])


KNOWN = {
    "position": "motion.q",
    "speed": "motion.v",
    "turn": "ca.atan2(ca.sin(motion.angle), ca.cos(motion.angle))",
    "payload": "ca.fabs(motion.payload)",
    "command": "command",
    "acceleration": f"(motion.v - motion.state[0]) / {SEEN_WITHIN}",
    "way": "motion.state[0]",
}
"""Quantities as an effect finds them; all others are inputs."""
RATES = {"acceleration": KNOWN["acceleration"], "way": "ca.fabs(motion.v)"}
"""Rate of the state that follows a quantity."""


@dataclass(frozen=True)
class Place:
    """Where a formula acts: base class, what it needs of the contract, method with its arguments, what it returns."""

    base: str
    needed: tuple[str, ...]
    method: str
    returned: str
    then: str = ""
    """What follows: a method that needs what this one knows."""


AT_ONCE = """
    def applied(self, state: object, command: Scalar) -> Scalar:
        \"\"\"The command, less by what is needed more.\"\"\"
        return command / ca.fmax(1.0 + self.now, 0.1)
"""
"""Of a drive whose gain depends on the motion: the formula of the moment is kept for this."""
PLACES = {
    "torque": Place("LoadEffect", ("Main", "Motion"), "load(self, motion: Motion) -> Scalar", "f"),
    "friction": Place(
        "FrictionEffect",
        ("Main", "Motion"),
        "level(self, level: Scalar, motion: Motion) -> Scalar",
        "level * ca.fmax(1.0 + f, 0.0)",
    ),
    "viscous": Place(
        "FrictionEffect",
        ("Main", "Motion"),
        "viscous(self, viscous: Scalar, motion: Motion) -> Scalar",
        "viscous + motion.v * ca.fmax(f, -ca.fabs(viscous) / (ca.fabs(motion.v) + 1e-9))",
    ),
    "gain": Place(
        "DriveEffect", ("Main", "Motion"), "given(self, motion: Motion) -> Self", "replace(self, now=f)", AT_ONCE
    ),
    "drive": Place("DriveEffect", ("Main",), "applied(self, state: object, command: Scalar) -> Scalar", "command - f"),
}
PLACES["friction after a reversal"] = PLACES["friction"]
"""Of each kind of learned term that has a value."""

FILE = '''"""Proposed by `cosim diagnose` {version} from recordings; nobody has reviewed it yet.

{statement}

To use it: say what it is and where it comes from, rename file, class and id, and put the file into
pyfmi_models/effects/ (docs/adding_physics.md). A card then holds it with

    [[effects]]
    effect = "{id}"
"""

from dataclasses import {dataclasses}
from typing import {typing}

import casadi as ca

from pyfmi_models.effects.base import {imports}
from pyfmi_models.model import {model_imports}

{ranges}


@dataclass(frozen=True, kw_only=True)
class {name}({base}):
    """{equation}

    Fitted to recordings; each quantity is held at the ends of the range that was seen.
    """

    id: ClassVar[str] = "{id}"
    title: ClassVar[str] = "{title}"
    equation: ClassVar[str] = "{equation}"
    main: ClassVar[Main] = Main("{main}", unit="{main_unit}")
    told_apart_by: ClassVar[str] = "it is fitted to recordings: say what else would look like it"
    action: ClassVar[str] = "Say what makes it, and what to do about it."
{parameters}
{inputs}
    def {method}:
        """The equation above."""
{body}
        return {returned}
{then}
    def statement(self, unit: str = "N·m") -> str:
        """Say it to a mechanic."""
        return f"{{self.title}}: {{self.equation}}."
'''
