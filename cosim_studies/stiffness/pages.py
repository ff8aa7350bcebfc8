"""The comparison as files: tables for reading, and the same for programs."""

import csv
import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from math import inf
from pathlib import Path

from cosim.support.files import replacing
from cosim.support.plain import JsonObject
from cosim.support.version import __version__
from cosim_studies.stiffness.comparison import Limit, Row

FILES = ("stiffness.csv", "stiffness.json", "stiffness.txt")


def table_text(rows: Sequence[Row]) -> str:
    """Write the rows of one step as a plain table of at most 80 columns."""
    lines = [f"{'motion':<18} {'method':<26} {'error of z':>11} {'of torque [N m]':>16}"]
    last = ""
    for row in rows:
        numbers = f"{row.z_error:>11.1e} {row.torque_error:>16.1e}" if row.stable else f"{'diverges':>11}"
        lines.append(f"{row.regime if row.regime != last else '':<18} {row.method:<26} {numbers}")
        last = row.regime
    return "\n".join(lines) + "\n"


def limits_text(limits: Sequence[Limit]) -> str:
    """Write the stability limits as a plain table."""
    lines = [f"{'step [ms]':>9}  {'method':<15} {'stable up to a steady speed of [deg/s]':>38}"]
    lines += [f"{1e3 * one.step:>9g}  {one.method:<15} {one.degrees:>38.3g}" for one in limits]
    return "\n".join(lines) + "\n"


def whole_text(rows: Sequence[Row], limits: Sequence[Limit]) -> str:
    """Write all tables: one a step, then the limits."""
    steps = list(dict.fromkeys(row.step for row in rows))
    parts = [f"step {1e3 * step:g} ms\n{table_text([row for row in rows if row.step == step])}" for step in steps]
    return "\n".join([*parts, limits_text(limits)])


def write(rows: Sequence[Row], limits: Sequence[Limit], card: str, directory: Path, force: bool = False) -> list[Path]:
    """Write stiffness.csv, stiffness.json, stiffness.txt and README.md; return their paths.

    Raises:
        OutputError: a file exists and `force` is not given.
    """
    paths = [directory / name for name in FILES]
    with replacing(paths[0], force) as partial, partial.open("w", newline="") as file:
        table = csv.DictWriter(file, [item.name for item in fields(Row)], lineterminator="\n")
        table.writeheader()
        table.writerows(asdict(row) for row in rows)
    with replacing(paths[1], force) as partial:
        partial.write_text(json.dumps(_story(rows, limits, card), indent=2) + "\n", "utf-8")
    with replacing(paths[2], force) as partial:
        partial.write_text(whole_text(rows, limits), "utf-8")
    return paths


def _story(rows: Sequence[Row], limits: Sequence[Limit], card: str) -> JsonObject:
    # JSON has no infinity: an error that diverges is null.
    plain = [{key: None if value == inf else value for key, value in asdict(row).items()} for row in rows]
    bounds = [asdict(one) | {"degrees": one.degrees} for one in limits]
    return {"version": f"mount-cosim {__version__}", "card": card, "rows": plain, "limits": bounds}
