"""C and pages of an export from their templates."""

import re
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from pyfmi_models.export.c_code import number
from pyfmi_models.model import Model, Variable


def rendered(template: Path, values: dict[str, object]) -> str:
    """A template filled with values; filters write C: macros, comments, numbers with all digits, and code in pages."""
    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    environment.filters |= {
        "macro": lambda text: re.sub(r"\W", "_", text, flags=re.ASCII).upper(),
        "comment": lambda text: text.replace("*/", "* /").replace("\n", " "),
        "number": number,
        "code": "`{}`".format,
    }
    return environment.from_string(template.read_text("utf-8")).render(values | {"number": number})


def groups_of(model: Model) -> list[tuple[str, str, tuple[Variable, ...]]]:
    """The variables of a model by kind: one of them and all of them as names of C, and themselves."""
    groups = {"INPUT": model.inputs, "PARAMETER": model.parameters, "STATE": model.states, "OUTPUT": model.outputs}
    return [(kind, f"{kind}S", variables) for kind, variables in groups.items()]
