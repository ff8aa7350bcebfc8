"""Model -> Modelica with flanges: the causal plant inside an acausal component of the Modelica Standard Library.

    flange_a.phi = flange_b.phi = position,   disturbance = -(flange_a.tau + flange_b.tau)

A torque that others put into a flange is positive where it accelerates; the plant's disturbance resists, so it is the
negative sum. Both flanges are on the axis itself, where its friction acts: springs, play and dead time of the plant are
between its command `tau` and the axis, or behind the axis. On a linear axis flanges are translational (s, f).
"""

from collections.abc import Iterator
from pathlib import Path

from pyfmi_models.errors import ExportError
from pyfmi_models.export.book import Book
from pyfmi_models.export.modelica import modelica_text, quoted, write_package
from pyfmi_models.model import Derivation, Model, Variable

LIBRARY = "4.0.0"
"""Version of the Modelica Standard Library whose connectors are used."""
EXTERNAL = "disturbance"
"""Input that the torques of the flanges become."""


def export_flange(model: Model, path: Path, derivation: Derivation | None = None, *, force: bool = False) -> Path:
    """Write the package, which is called as the file, and return its path; errors as `export_modelica`."""
    return write_package(Path(path), lambda name: flange_text(model, name, derivation), force)


def flange_text(model: Model, package: str, derivation: Derivation | None = None) -> str:
    """Write the package of the plant with the class `Joint` beside `Plant`.

    Raises:
        ExportError: the model has no input `disturbance`, or as `modelica_text`.
    """
    if EXTERNAL not in [one.name for one in model.inputs]:
        raise ExportError(f'model "{model.name}" has no input "{EXTERNAL}" for the torque of its flanges')
    joint = [*_joint(model, Book(model, derivation))]
    return modelica_text(model, package, derivation, joint, f'uses(Modelica(version = "{LIBRARY}"))')


def _joint(model: Model, book: Book) -> Iterator[str]:
    linear = next(one.unit for one in model.inputs if one.name == EXTERNAL) == "N"
    domain, way, push = ("Translational", "s", "f") if linear else ("Rotational", "phi", "tau")
    inputs = [one for one in model.inputs if one.name != EXTERNAL]
    within = {one.name: book.reference(one.name, book.parts[""]) for one in (*model.inputs, *model.outputs)}
    position = book.reference(model.states[0].name, book.parts[""])
    yield f"model Joint {quoted(f'{model.description}, with flanges')}"
    for side, what in (("a", "towards the drive"), ("b", "towards the load")):
        yield f'  Modelica.Mechanics.{domain}.Interfaces.Flange_{side} flange_{side} "The axis, {what}";'
    yield from (_connector("Input", one) for one in inputs)
    yield from (_connector("Output", one, f" = plant.{within[one.name]}") for one in model.outputs)
    yield "  Plant plant;"
    yield "equation"
    yield from (f"  plant.{within[one.name]} = {one.name};" for one in inputs)
    yield f"  plant.{within[EXTERNAL]} = -(flange_a.{push} + flange_b.{push});"
    yield from (f"  flange_{side}.{way} = plant.{position};" for side in "ab")
    yield "end Joint;"


def _connector(kind: str, one: Variable, value: str = "") -> str:
    return f'  Modelica.Blocks.Interfaces.Real{kind} {one.name}(unit = "{one.unit}"){value} {quoted(one.description)};'
