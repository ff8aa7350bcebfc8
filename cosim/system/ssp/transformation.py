"""What happens to a value between two connectors: units are converted first, then a transformation acts.

Linear transformations are for reals; the others are tables of values, and what they do not name stays as it is.

Reference: System Structure and Parameterization 2.0, 4.5.2 (Transformation Choice).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

from cosim.support.units import conversion
from cosim.system.ssp.archive import child, children
from cosim.system.ssp.ssp_file import SspFile

Value = float | int | bool | str
_TABLES = ("Boolean", "Integer", "Enumeration")
_TRUTH = {"true": 1, "1": 1, "false": 0, "0": 0}


@dataclass(frozen=True)
class Transformation:
    """y = factor x + offset, or the value that `table` gives for x; `keep`: no unit is converted before."""

    factor: float = 1.0
    offset: float = 0.0
    table: Mapping[str, str] = field(default_factory=dict)
    keep: bool = False


@dataclass(frozen=True)
class Effect:
    """What a chain of transformations does to a value in the unit of its source; `unit` is that of the result."""

    gain: float = 1.0
    offset: float = 0.0
    table: Mapping[str, str] = field(default_factory=dict)
    unit: str = ""

    def then(self, one: Transformation, unit: str) -> "Effect":
        """Add a connection that ends at a connector in `unit` (empty where none is stated).

        Raises:
            UnitError: the unit that arrives is of another kind.
        """
        gain, offset = (1.0, 0.0) if one.keep else conversion(self.unit, unit)
        gain, offset = one.factor * gain, one.factor * offset + one.offset
        table = {source: one.table.get(target, target) for source, target in self.table.items()}
        table |= {source: target for source, target in one.table.items() if source not in table}
        return Effect(gain * self.gain, gain * self.offset + offset, table, unit or self.unit)

    def apply(self, value: Value) -> Value:
        """Return what becomes of a value that is known beforehand."""
        if self.table:
            return self.table.get(_word(value), value)
        if isinstance(value, bool | str) or (self.gain, self.offset) == (1, 0):
            return value
        return self.gain * value + self.offset


def transformation_of(file: SspFile, element: Element, name: str) -> Transformation:
    """Read the transformation of a connection or mapping entry, for the variable called `name`."""
    keep = element.get("suppressUnitConversion", "false") in ("true", "1")
    linear = child(element, "ssc:LinearTransformation")
    if linear is not None:
        return Transformation(file.number(linear, "factor", 1.0), file.number(linear, "offset"), keep=keep)
    for kind in _TABLES:
        mapping = child(element, f"ssc:{kind}MappingTransformation")
        if mapping is not None:
            return Transformation(table=_table(file, mapping, kind, name), keep=keep)
    return Transformation(keep=keep)


def _table(file: SspFile, mapping: Element, kind: str, name: str) -> dict[str, str]:
    """Read a table; booleans and integers are written as whole numbers, items of enumerations by their names."""
    found: dict[str, str] = {}
    for entry in children(mapping, "ssc:MapEntry"):
        source, target = (_entry(file, entry.get(key, ""), kind, name) for key in ("source", "target"))
        if source in found:
            raise file.error(f'the {kind} mapping of "{name}" names "{source}" twice')
        found[source] = target
    return found


def _entry(file: SspFile, text: str, kind: str, name: str) -> str:
    if kind == "Enumeration":
        return text
    try:
        return str(_TRUTH[text] if kind == "Boolean" else int(text))
    except (KeyError, ValueError) as error:
        raise file.error(f'the {kind} mapping of "{name}" holds "{text}", which is no {kind}') from error


def _word(value: Value) -> str:
    return value if isinstance(value, str) else str(int(value))
