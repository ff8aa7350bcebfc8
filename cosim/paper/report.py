"""What `cosim paper` writes: tables, figures and one page that says what agrees, what cannot, and why."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

import cosim
from cosim.files import check_free, replacing
from cosim.paper.checks import checks
from cosim.paper.conditions import condition, conditions, definitions
from cosim.paper.figures import tracking_figures
from cosim.paper.study import Study, study
from cosim.paper.tables import ratios_of, runs_csv, table4, table_csv, table_text
from cosim.paper.workshop import Workshop

FILES = ("table4.json", "table4.csv", "runs.csv", "definitions.csv", "README.md")


@dataclass(frozen=True, kw_only=True)
class Written:
    """What was found, and the files that say so."""

    table: dict[str, Any]
    files: list[Path]


def reproduce(
    out: Path,
    seeds: Sequence[int],
    command: str,
    force: bool = False,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Written:
    """Run all experiments and write everything into `out`.

    Raises:
        OutputError: a file exists and `force` is not given.
    """
    for name in FILES:
        check_free(out / name, force)
    with TemporaryDirectory() as folder:
        workshop = Workshop(Path(folder))
        found = study(workshop, seeds, progress=progress)
        variants = study(workshop, seeds[:1], definitions())
    return write(out, found, variants, command, force)


def write(out: Path, found: Study, variants: Study, command: str, force: bool = False) -> Written:
    """Write tables, figures and page of a study under all `conditions()` and of one under all `definitions()`."""
    version = f"mount-cosim {cosim.__version__}"
    table = table4(found) | {"seed": found.seeds[0], "command": command, "version": version}
    figures = tracking_figures(found, condition("base").controller.mount.inertia, out, force)
    texts = {
        "table4.json": json.dumps(table, indent=2) + "\n",
        "table4.csv": table_csv(_rows(table)),
        "runs.csv": runs_csv(found),
        "definitions.csv": table_csv(_variants(variants)),
        "README.md": _page(table, variants, figures, found.seeds),
    }
    for name, text in texts.items():
        with replacing(out / name, force) as partial:
            partial.write_text(text, "utf-8")
    return Written(table=table, files=[*(out / name for name in texts), *figures])


def _rows(table: dict[str, Any]) -> dict[str, Any]:
    return {key: entry for key, entry in table.items() if isinstance(entry, dict)}


def _variants(variants: Study) -> dict[str, Any]:
    return {one.key: variants.ise(one.key)[0] for one in definitions()}


def _page(table: dict[str, Any], variants: Study, figures: list[Path], seeds: Sequence[int]) -> str:
    titles = {"paper": "the paper, measured"} | {one.key: one.title for one in (*conditions(), *definitions())}
    other = _variants(variants)
    page = Environment(loader=PackageLoader("cosim.paper", "."), undefined=StrictUndefined, keep_trailing_newline=True)
    return page.get_template("page.md.j2").render(
        command=table["command"],
        version=table["version"],
        seeds=seeds,
        figures=[{"name": path.name, "text": _about(path)} for path in figures],
        table=table_text(_rows(table), titles),
        definitions=table_text(other, titles),
        checks=checks(table),
        base=ratios_of(table["base"]),
        r=lambda value: f"{value:.3f}",
        ideal_c1=table["ideal"]["C1"],
        base_c1=table["base"]["C1"],
        kp_change=100 * (table["base_kp255"]["C1"] / table["base"]["C1"] - 1),
        difference_change=100 * (other["difference"]["C1"] / other["base"]["C1"] - 1),
        limited_c1=other["limited"]["C1"],
    )


def _about(path: Path) -> str:
    number, case = path.stem.removeprefix("fig").split("_")
    return f"{case} as in the paper's Fig. {int(number)}: base, and realistic B with the first seed"
