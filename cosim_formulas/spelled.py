"""A formula in words: equation, numbers with unit and 95 % range, as diagnosis.json and the report have them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from cosim.diagnosis.answer.entries import FormulaEntry, NumberEntry
from cosim_formulas.formula import Formula, Shape, interval
from pyfmi_models.effects.learned_base import SINCE, LearnedEffect
from pyfmi_models.waves import INPUT, UNITS, spoken

LETTERS = {
    "position": "q",
    "turn": "q",
    "speed": "v",
    "command": "u",
    "temperature": "T",
    "payload": "M",
    "acceleration": "a",
    "way": "s",
    "time since reversal": "t",
    "distance since reversal": "d",
}
LEFT = {
    "torque": "torque",
    "drive": "not given",
    "friction": "friction × (1 + f), f",
    "viscous": "added drag = v f, f",
    "gain": "command × (1 + f), f",
    "friction after a reversal": "friction × (1 + f), f",
}
"""What a formula says, by the kind of its term."""
DRAG = {"N.m": "N.m.s/rad", "N": "N.s/m"}
"""Unit of a coefficient of drag, by that of a torque."""


@dataclass(frozen=True)
class Spelled:
    """A formula of one learned effect."""

    effect: LearnedEffect
    formula: Formula
    linear: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Quantities, as a card names them."""
        return self.effect.quantities() or (self.effect.since(),)

    @property
    def letters(self) -> tuple[str, ...]:
        """Quantities, as an equation has them."""
        return tuple(LETTERS.get(name, name.removeprefix(INPUT)) for name in self.names)

    @property
    def inner_names(self) -> tuple[str, ...]:
        """Names of the numbers inside the forms: width, centre2, ..."""
        own = [number for _, form in self.formula.forms for number in form.numbers]
        return tuple(f"{name}{k + 1}" if own.count(name) > 1 else name for k, name in enumerate(own))

    @property
    def outer_names(self) -> tuple[str, ...]:
        """Names of the coefficients."""
        return tuple(f"k{k}" for k in range(1, len(self.formula.shapes) + 1))

    def equation(self) -> str:
        """Return the formula for a reader."""
        pairs = zip(self.outer_names, self.formula.shapes, strict=True)
        return f"{LEFT[self.effect.kind]} = " + " + ".join(
            " ".join([name, *self._factors(shape)]) for name, shape in pairs
        )

    def _factors(self, shape: Shape) -> Iterator[str]:
        placed = self.formula.placed()
        for k, form in shape.parts:
            own = [self.inner_names[i] for i in placed.get((k, form), ())]
            words = {f"p{i}": name for i, name in enumerate(own)}
            top = f"{self.formula.tops[k]:.4g}"
            yield form.text.replace("{top}", top).format(x=self.letters[k], **words)

    def units(self) -> tuple[str, ...]:
        """Units of the inner numbers, then of the coefficients."""
        own = [self.unit(k) for k in range(len(self.names))]
        powers = {"exponent": 0, "rate": -1}
        numbers = [(k, powers.get(number, 1)) for k, form in self.formula.forms for number in form.numbers]
        inner = [own[k] if power > 0 else _over("1", [(own[k], -power)]) for k, power in numbers]
        torque = "N" if self.linear else "N.m"
        base = DRAG[torque] if self.effect.kind == "viscous" else torque if self.effect.in_torque else "1"
        outer = [_over(base, [(own[k], form.power) for k, form in shape.parts]) for shape in self.formula.shapes]
        return (*inner, *outer)

    def unit(self, which: int) -> str:
        """Unit of quantity number `which`."""
        unit = (UNITS | SINCE).get(self.names[which], "1")
        return unit.replace("rad", "m").replace("N.m", "N") if self.linear else unit

    def numbers(self) -> tuple[tuple[str, float, float, str], ...]:
        """Name, value, standard error and unit of every number."""
        values = (*self.formula.inner, *self.formula.coefficients)
        names = (*self.inner_names, *self.outer_names)
        return tuple(zip(names, values, self.formula.errors, self.units(), strict=True))

    def as_json(self) -> FormulaEntry:
        """Return what `diagnosis.json` holds of it under `learned.formula`."""
        told: dict[str, NumberEntry] = {
            name: {"value": v, "interval": [*interval(v, e)], "unit": u} for name, v, e, u in self.numbers()
        }
        return {
            "kind": self.effect.kind,
            "over": [spoken(name) for name in self.names],
            "equation": self.equation(),
            "parameters": told,
        }


def _over(base: str, powers: Sequence[tuple[str, int]]) -> str:
    parts = [_plain(unit, power) for unit, power in powers if power and unit != "1"]
    if not parts or parts == [base]:
        return "1" if parts else base
    above, _, below = base.partition("/")
    base, parts = above, [*([below] if below else []), *parts]
    return f"{base}/{parts[0]}" if len(parts) == 1 and "." not in parts[0] else f"{base}/({'.'.join(parts)})"


def _plain(unit: str, power: int) -> str:
    """A power of a unit without a slash: rad2.s-2."""
    above, _, below = unit.partition("/")
    raised = [f"{one}{power if power > 1 else ''}" for one in above.split(".")]
    return ".".join(raised + ([f"{below}-{power}"] if below else []))
