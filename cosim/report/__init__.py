"""One self-contained HTML page of a diagnosis: no network, at most 1 MB, first screen without JavaScript."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cosim.diagnosis.answer.result import Diagnosis

__all__ = ["render", "write_report"]


def render(diagnosis: "Diagnosis") -> str:
    """Return the page as text. matplotlib and jinja2 are imported here, not with the package."""
    import matplotlib
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    from cosim.plots.style import STYLE
    from cosim.report.page import context

    loader = PackageLoader("cosim.report", "")
    pages = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    with matplotlib.rc_context(rc=STYLE):
        values = context(diagnosis)
    values |= {name: Markup(values[name]) for name in ("css", "script")}
    return pages.get_template("report.html.j2").render(values).lstrip()


def write_report(diagnosis: "Diagnosis", path: Path) -> Path:
    """Write the page and return its path; a file that is there already is replaced, never left half written."""
    from cosim.support.files import replacing

    with replacing(path, True) as partial:
        partial.write_text(render(diagnosis), encoding="utf-8")
    return path
