"""documentation/index.html of an FMU: what a person wants to know before using it."""

from importlib.resources import files

from jinja2 import Environment, StrictUndefined

from pyfmi_models.export.codegen import TOLERANCE
from pyfmi_models.export.description import TICK_RULE
from pyfmi_models.export.layout import Layout

_TABLES = {"Inputs": "input", "Outputs": "output", "Parameters": "parameter", "States": "state"}


def documentation_page(layout: Layout, description_html: str | None = None) -> str:
    """Render the page: the model's sentence, the given HTML, the tables of variables, how time passes in it."""
    template = (files("pyfmi_models.export") / "templates" / "index.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    tables = {title: layout.of(kind) for title, kind in _TABLES.items()}  # type: ignore[arg-type]
    return environment.from_string(template).render(
        model=layout.model,
        tables={title: rows for title, rows in tables.items() if rows},
        description_html=description_html,
        tolerance=TOLERANCE,
        tick_rule=TICK_RULE.format(period=layout.model.period),
    )
