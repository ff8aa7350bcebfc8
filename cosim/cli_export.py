"""`cosim export`: a card to FMUs."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

from cosim.terminal import put, put_json, stage


class Fmi(StrEnum):
    """FMI versions to export."""

    two = "2"
    three = "3"
    both = "both"


VERSIONS: dict[Fmi, tuple[Literal[2, 3], ...]] = {Fmi.two: (2,), Fmi.three: (3,), Fmi.both: (2, 3)}


def export(
    card: Annotated[str, typer.Argument(help="A model card (.toml), or the name of a shipped one: paper_mount.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Directory for the FMUs.")],
    fmi: Annotated[Fmi, typer.Option("--fmi", help="FMI version.")] = Fmi.both,
    platform: Annotated[str, typer.Option("--platform", help="host, or a platform's name.")] = "host",
    as_json: Annotated[bool, typer.Option("--json", help="Print the paths as JSON.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite what is there.")] = False,
) -> None:
    """Write the plant of a card and, where it has one, its controller as FMUs."""
    from cosim.files import check_free, directory
    from pyfmi_models.card import read_card
    from pyfmi_models.export import export_fmu

    read = read_card(card)
    models = {"plant": read.plant().model()}
    if read.controller is not None:
        models["controller"] = read.controller_model()
    versions = VERSIONS[fmi]
    stem = Path(card).stem
    wanted = {
        directory(out) / f"{stem}_{part}_fmi{v}.fmu": (model, v) for part, model in models.items() for v in versions
    }
    for path in wanted:
        check_free(path, force)
    platforms = () if platform == "host" else tuple(platform.split(","))
    with stage(f"{stem}: {len(wanted)} FMUs") as progress:
        for done, (path, (model, version)) in enumerate(wanted.items()):
            progress(done, len(wanted))
            export_fmu(model, path, fmi=version, force=force, platforms=platforms)
    if as_json:
        put_json({"fmus": [str(path) for path in wanted]})
    else:
        put("\n".join(map(str, wanted)))
