"""`python -m cosim_studies.stiffness --out DIR`: tables, limits and the picture, from one card."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

from cosim.support.errors import CosimError
from cosim.support.files import check_free, replacing
from cosim_studies.stiffness.archive import co_simulation, model_exchange
from cosim_studies.stiffness.comparison import FMU, compare, limits
from cosim_studies.stiffness.errata import again
from cosim_studies.stiffness.figure import SPEEDS, draw
from cosim_studies.stiffness.motion import FASTEST, REGIMES, STEP, sine
from cosim_studies.stiffness.pages import FILES, whole_text, write
from cosim_studies.stiffness.readme import readme
from pyfmi_models.card import Card, read_card
from pyfmi_models.errors import ModelError

STEPS = (STEP, 10 * STEP)
CVODE = "FMU in CVode"


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare on one card, print the tables, write and draw them."""
    parser = ArgumentParser(prog="python -m cosim_studies.stiffness", description=main.__doc__)
    parser.add_argument("--card", default="paper_mount", help="a card (.toml) or the name of a shipped one")
    parser.add_argument("--out", type=Path, required=True, help="directory for the tables, the picture and a page")
    parser.add_argument("--force", action="store_true", help="overwrite what is there")
    given = parser.parse_args(arguments)
    try:
        _report(read_card(given.card), given.out, given.force)
    except (CosimError, ModelError) as error:
        parser.exit(2, f"{error}\n")


def _report(card: Card, directory: Path, force: bool) -> None:
    picture, page = directory / "stiffness.svg", directory / "README.md"
    for path in (*(directory / name for name in FILES), picture, page):
        check_free(path, force)
    solvers, rows = {FMU: co_simulation, CVODE: model_exchange}, []
    for step in STEPS:
        rows += compare(card, step, (*REGIMES, FASTEST), solvers)
    bounds = limits(card, STEPS)
    print(whole_text(rows, bounds), end="")
    paths = write(rows, bounds, card.path, directory, force)
    sweeps = {step: compare(card, step, [sine(float(peak)) for peak in SPEEDS]) for step in STEPS}
    paths.append(draw(sweeps, bounds, picture, force))
    with replacing(page, force) as partial:
        partial.write_text(readme(rows, bounds, again(), card.path), "utf-8")
    for path in (*paths, page):
        print(path)


if __name__ == "__main__":
    main()
