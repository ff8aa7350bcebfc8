"""A continuous model -> plain C99: a header, a function that steps it, a small program that shows how.

The equations are those of the FMU, line by line, with the same deterministic maths and the same adaptive RODAS4, so its
numbers are the FMU's bit for bit. There is no heap and nothing global: joints of several cards go into one program.
"""

import re
from pathlib import Path

from pyfmi_models.errors import ExportError
from pyfmi_models.export.codegen import SHIM, TOLERANCE, generate
from pyfmi_models.export.templates import groups_of, rendered
from pyfmi_models.model import Model

FOLDER = SHIM / "function"
COMMAND = "cc -std=c99 -O2 -ffp-contract=off *.c -o joint"
"""How the program is built."""
_WHOLE = ("rates", "outputs", "step")
"""Functions of the FMU that a step needs."""


def c_files(model: Model) -> dict[str, str]:
    """Every file of the project, name to text; the function is called as the model.

    Raises:
        ExportError: the model is sampled (a controller: that is a firmware), or has no states.
    """
    if model.period is not None or not model.states:
        raise ExportError(f'model "{model.name}" is sampled or has no states; a C function is written of a plant')
    generated = generate(model)
    name = generated.layout.identifier
    values = {
        "model": model,
        "name": name,
        "equations": _only(generated.files["equations.c"]),
        "most_steps": generated.most_steps,
        "tolerance": TOLERANCE,
        "groups": groups_of(model),
    }
    written = {f"{name}.h": "joint.h.j2", f"{name}.c": "joint.c.j2", "main.c": "main.c.j2"}
    fixed = {path.name: path.read_text("utf-8") for path in SHIM.glob("detmath*")}
    return {file: rendered(FOLDER / template, values) for file, template in written.items()} | dict(
        sorted(fixed.items())
    )


def export_c(model: Model, folder: Path, *, force: bool = False) -> Path:
    """Write the project into a folder of its own and return its path.

    Raises ExportError if one of its files exists and `force` is not given, or as `c_files`.
    """
    folder, files = Path(folder), c_files(model)
    for name in files:
        if (folder / name).exists() and not force:
            raise ExportError(f"{folder / name} exists; use force to replace it")
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def _only(equations: str) -> str:
    """The functions that a step needs, each with the comment in front of it."""
    functions = re.findall(r"(/\* [^\n]*\*/\nstatic void model_(\w+)\(.*?\n}\n)", equations, re.DOTALL)
    return "\n".join(text for text, role in functions if role in _WHOLE)
