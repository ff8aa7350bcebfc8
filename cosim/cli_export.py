"""`cosim export`: a card to FMUs."""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from cosim.terminal import put, put_json, stage

if TYPE_CHECKING:
    from pyfmi_models.card import Card


class Fmi(StrEnum):
    """FMI versions to export."""

    two = "2"
    three = "3"
    both = "both"


VERSIONS: dict[Fmi, tuple[Literal[2, 3], ...]] = {Fmi.two: (2,), Fmi.three: (3,), Fmi.both: (2, 3)}

KINDS = {".ssp": "ssp", ".mo": "modelica"}


def export(
    card: Annotated[str, typer.Argument(help="A model card (.toml), or the name of a shipped one: paper_mount.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Directory for the FMUs.")],
    fmi: Annotated[Fmi, typer.Option("--fmi", help="FMI version.")] = Fmi.both,
    platform: Annotated[str, typer.Option("--platform", help="host, all, or names with commas between.")] = "host",
    ssp: Annotated[bool, typer.Option("--ssp", help="Also wire plant, controller and a set point: NAME.ssp.")] = False,
    modelica: Annotated[bool, typer.Option("--modelica", help="Also write the plant as Modelica text.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the paths as JSON.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite what is there.")] = False,
) -> None:
    """Write the plant of a card and, where it has one, its controller as FMUs."""
    from cosim.files import check_free, directory
    from pyfmi_models.card import read_card
    from pyfmi_models.export import export_fmu
    from pyfmi_models.export.platforms import platforms_of

    platforms = platforms_of(platform)
    read = read_card(card)
    models = {"plant": read.plant().model()}
    if read.controller is not None:
        models["controller"] = read.controller_model()
    versions, stem = VERSIONS[fmi], Path(card).stem
    wanted = [
        (out / folder / f"{stem}_{part}_fmi{version}.fmu", model, version, machines)
        for part, model in models.items()
        for version in versions
        for folder, machines in _folders(version, platforms).items()
    ]
    others = {out / f"{stem}.ssp": system_writer(read, versions[0], platforms)} if ssp else {}
    others |= modelica_writer(read, out, stem) if modelica else {}
    paths = [path for path, *_ in wanted]
    for path in (*paths, *others):
        check_free(path, force)
    with stage(f"{stem}: {len(wanted)} FMUs") as progress:
        for done, (path, model, version, machines) in enumerate(wanted):
            progress(done, len(wanted))
            directory(path.parent)
            export_fmu(model, path, fmi=version, force=force, platforms=machines)
    for path, write in others.items():
        write(path, force)
    if as_json:
        put_json({"fmus": list(map(str, paths))} | {KINDS[path.suffix]: str(path) for path in others})
    else:
        put("\n".join(map(str, (*paths, *others))))


def _folders(version: Literal[2, 3], platforms: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Subfolders for archives and the machines of each: FMI 2 has one place for two kinds of Linux."""
    both = {"x86_64-linux", "aarch64-linux"} <= set(platforms)
    return {"": platforms} | ({"aarch64-linux": ("aarch64-linux",)} if version == 2 and both else {})


def system_writer(card: "Card", fmi: Literal[2, 3], platforms: tuple[str, ...]) -> Callable[[Path, bool], object]:
    """Return what writes the SSP of a card to a path, by force or not; refuse a card that cannot have one."""
    from cosim.cli_system import system_of
    from pyfmi_models.export.ssp import export_ssp

    system = system_of(card)
    return lambda path, force: export_ssp(system, path, fmi=fmi, force=force, platforms=platforms)


def modelica_writer(card: "Card", out: Path, stem: str) -> dict[Path, Callable[[Path, bool], object]]:
    """Return the path of the Modelica package of a card's plant and what writes it."""
    from pyfmi_models.derivation import derivation_of
    from pyfmi_models.export.modelica import export_modelica, package_name

    plant = card.plant()
    path = out / f"{package_name(stem)}.mo"
    return {path: lambda path, force: export_modelica(plant.model(), path, derivation_of(plant), force=force)}
