"""documentation/ of an FMU: what a person wants to know before using it, and the licences."""

import math
import re
from importlib.resources import files
from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from pyfmi_models.export.build import fmi_headers, sources_of, units_of
from pyfmi_models.export.codegen import TOLERANCE, Generated
from pyfmi_models.export.description import TICK_RULE, version_text
from pyfmi_models.export.diagram import diagram
from pyfmi_models.export.prose import prose
from pyfmi_models.export.units import BASE, Unit, parse_unit
from pyfmi_models.model import Variable

_TABLES = {"Inputs": "input", "Outputs": "output", "Parameters": "parameter", "States": "state"}
_SIGNS = "Torques and forces drive or resist as their descriptions say; speeds and positions share one direction."


def documentation(generated: Generated, platforms: tuple[str, ...]) -> dict[str, bytes]:
    """The files of the folder, name to content."""
    return {
        "documentation/index.html": _page(generated, platforms),
        "documentation/licenses/license.txt": resource("license.txt"),
        "documentation/licenses/fmi-headers.txt": _licence_of_headers().encode(),
    }


def page(template: str, **values: Any) -> bytes:
    """A page from its template in the folder `templates`."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["range"] = _range
    return environment.from_string(resource(template).decode()).render(values).encode()


def _page(generated: Generated, platforms: tuple[str, ...]) -> bytes:
    layout = generated.layout
    tables = {title: layout.of(kind) for title, kind in _TABLES.items()}  # type: ignore[arg-type]
    return page(
        "index.html.j2",
        model=layout.model,
        figure=Markup(diagram(layout.model)),
        prose=lambda text: Markup(prose(text)),
        signs=_SIGNS,
        tables={title: rows for title, rows in tables.items() if rows},
        number=_number,
        units=[parse_unit(name) for name in sorted({row.variable.unit for row in layout.rows})],
        in_base=_in_base,
        tolerance=TOLERANCE,
        most_steps=f"{generated.most_steps:,}".replace(",", " "),
        tick_rule=TICK_RULE.format(period=layout.model.period),
        platforms=platforms,
        build=_build_command(generated),
        version=version_text(),
    )


def _number(value: float) -> str:
    return f"{value:.10g}"


def _range(variable: Variable) -> str:
    low, high = variable.low, variable.high
    if math.isfinite(low) and math.isfinite(high):
        return f"{_number(low)} … {_number(high)}"
    if math.isfinite(low):
        return f"≥ {_number(low)}"
    return f"≤ {_number(high)}" if math.isfinite(high) else ""


def _in_base(unit: Unit) -> str:
    powers = [f"{name}{_raised(power)}" for name, power in zip(BASE, unit.exponents, strict=True) if power]
    numbers = [_number(unit.factor)] if unit.factor != 1 or not powers else []
    offset = f" + {_number(unit.offset)}" if unit.offset else ""
    return " ".join([*numbers, *powers]) + offset


def _raised(power: int) -> str:
    return "" if power == 1 else str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _build_command(generated: Generated) -> str:
    units = " ".join(units_of(sources_of(generated)))
    options = "-std=c11 -O2 -ffp-contract=off -fno-math-errno -fvisibility=hidden -shared -fPIC"
    return f"cc {options} {units} -o {generated.layout.identifier}.so -lm"


def _licence_of_headers() -> str:
    """The comment in which a header of the installed FMPy states copyright and licence."""
    text = fmi_headers()["fmi3Functions.h"].decode()
    found = re.search(r"Copyright \(C\).*?(?=\*/)", text, re.S)
    return f"FMI headers in sources/, from the installed FMPy\n\n{found[0].strip() if found else text}\n"


def resource(name: str) -> bytes:
    """A file of the folder `templates`."""
    return (files("pyfmi_models.export") / "templates" / name).read_bytes()
