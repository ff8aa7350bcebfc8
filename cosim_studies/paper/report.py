"""What `cosim paper` writes: tables, figures and one page that says what agrees, what cannot, and why."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from cosim.support.files import check_free, replacing
from cosim.support.plain import Parsed
from cosim.support.version import __version__
from cosim_studies.paper.checks import checks
from cosim_studies.paper.comparison import Comparison, Plan, compare
from cosim_studies.paper.comparison_figures import comparison_figures
from cosim_studies.paper.comparison_tables import better, rows_csv, tables
from cosim_studies.paper.conditions import condition, conditions, definitions
from cosim_studies.paper.figures import tracking_figures
from cosim_studies.paper.identification import Identification, identification
from cosim_studies.paper.identification_figures import identification_figures
from cosim_studies.paper.identification_tables import identified, table2, table3, varying
from cosim_studies.paper.study import Study, study
from cosim_studies.paper.tables import ratios_of, runs_csv, table4, table_csv, table_text
from cosim_studies.paper.workshop import Workshop

FILES = ("table4.json", "table4.csv", "runs.csv", "definitions.csv", "README.md")
IDENTIFIED = ("identification.json", "table2.csv", "table3.csv", "periods.csv")
COMPARED = ("options.json", "options.csv", "designs.csv", "robustness.csv")


@dataclass(frozen=True, kw_only=True)
class Written:
    """What was found, and the files that say so."""

    table: Parsed
    files: list[Path]


@dataclass(frozen=True, kw_only=True)
class Results:
    """What was run: `conditions()`, `definitions()`, identification, and a comparison where it was asked for."""

    found: Study
    variants: Study
    identified: Identification
    comparison: Comparison | None = None


def reproduce(
    out: Path,
    seeds: Sequence[int],
    command: str,
    plan: Plan | None = None,
    force: bool = False,
    on_progress: Callable[[int, int], None] = lambda done, of: None,
) -> Written:
    """Run all experiments, and a comparison of controllers where there is a plan for one; write everything into `out`.

    Raises:
        OutputError: a file exists and `force` is not given.
    """
    for name in FILES + IDENTIFIED + (COMPARED if plan else ()):
        check_free(out / name, force)
    with TemporaryDirectory() as folder:
        workshop = Workshop(Path(folder))
        found = study(workshop, seeds, on_progress=on_progress)
        variants = study(workshop, seeds[:1], definitions())
        comparison = compare(workshop, plan, found, on_progress) if plan else None
    results = Results(found=found, variants=variants, identified=identification(seeds[0]), comparison=comparison)
    return write(out, results, command, force)


def write(out: Path, results: Results, command: str, force: bool = False) -> Written:
    """Write tables, figures and page."""
    version = f"mount-cosim {__version__}"
    made = {"command": command, "version": version}
    table = table4(results.found) | {"seed": results.found.seeds[0]} | made
    inertia = condition("base").controller.mount.inertia
    figures = {path: _about(path) for path in tracking_figures(results.found, inertia, out, force)}
    texts = {
        "table4.json": json.dumps(table, indent=2) + "\n",
        "table4.csv": table_csv(_rows(table)),
        "runs.csv": runs_csv(results.found),
        "definitions.csv": table_csv(_variants(results.variants)),
    }
    figures = identification_figures(results.identified, out, force) | figures
    texts |= _identified(results.identified)
    if results.comparison:
        figures |= comparison_figures(results.comparison, out, force)
        texts |= _compared(results.comparison, made)
    texts["README.md"] = _page(table, results, figures)
    for name, text in texts.items():
        with replacing(out / name, force) as partial:
            partial.write_text(text, "utf-8")
    return Written(table=table, files=[*(out / name for name in texts), *figures])


def _identified(found: Identification) -> dict[str, str]:
    data = {"table2": table2(found), "table3": table3(found), "periods": varying(found)}
    texts = {f"{name}.csv": rows_csv(rows) for name, rows in data.items()}
    return texts | {"identification.json": json.dumps(data | {"seed": found.seed}, indent=1) + "\n"}


def _compared(found: Comparison, made: dict[str, str]) -> dict[str, str]:
    data = tables(found)
    names = {"options.csv": "options", "designs.csv": "designs", "robustness.csv": "robustness"}
    return {
        "options.json": json.dumps(data | made, indent=1) + "\n",
        **{name: rows_csv(data[key]) for name, key in names.items()},
    }


def _rows(table: Parsed) -> Parsed:
    return {key: entry for key, entry in table.items() if isinstance(entry, dict)}


def _variants(variants: Study) -> Parsed:
    return {one.key: variants.ise(one.key)[0] for one in definitions()}


def _page(table: Parsed, results: Results, figures: dict[Path, str]) -> str:
    titles = {"paper": "the paper, measured"} | {one.key: one.title for one in (*conditions(), *definitions())}
    other = _variants(results.variants)
    return rendered(
        "page.md.j2",
        command=table["command"],
        version=table["version"],
        seeds=results.found.seeds,
        figures=[{"name": path.name, "text": text} for path, text in figures.items()],
        table=table_text(_rows(table), titles),
        definitions=table_text(other, titles),
        checks=checks(table),
        base=ratios_of(table["base"]),
        ideal_c1=table["ideal"]["C1"],
        base_c1=table["base"]["C1"],
        kp_change=100 * (table["base_kp255"]["C1"] / table["base"]["C1"] - 1),
        difference_change=100 * (other["difference"]["C1"] / other["base"]["C1"] - 1),
        limited_c1=other["limited"]["C1"],
        identified=identified(results.identified),
        better=results.comparison and better(results.comparison),
    )


def rendered(template: str, **values: Any) -> str:
    """Fill in a template of this folder; `r` writes a ratio."""
    page = Environment(
        loader=PackageLoader("cosim_studies.paper", "."), undefined=StrictUndefined, keep_trailing_newline=True
    )
    return page.get_template(template).render(r=lambda value: f"{value:.3f}", **values)


def _about(path: Path) -> str:
    number, case = path.stem.removeprefix("fig").split("_")
    return f"{case} as in the paper's Fig. {int(number)}: base, and realistic B with the first seed"
