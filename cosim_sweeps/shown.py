"""What `cosim show` tells of a sweep: its table, or its file."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pyarrow import parquet

from cosim.api.show_results import Shown
from cosim.data.columns import ORIGIN_KEY
from cosim.support.errors import InputError
from cosim.support.plain import Json
from cosim_sweeps.conduct import PICTURE
from cosim_sweeps.file import read_sweep
from cosim_sweeps.results import Results, read_results

FIRST = 20
"""Runs that are listed, the best first."""


def of_table(path: Path) -> Shown:
    """Return the best runs of a table.

    Raises:
        InputError: it is another's table.
    """
    if not _is_sweep(path):
        raise InputError(f"{path} is no table of a sweep.", culprit=str(path))
    results = read_results(path)
    facts: dict[str, Json] = {"sweep": results.title, "table": str(path)}
    if row := results.best_row():
        facts["best"] = ", ".join(f"{name} = {value:.5g}" for name, value in row.items())
    picture = path.with_name(PICTURE)
    facts |= {"picture": str(picture)} if picture.is_file() else {}
    return facts, {"runs, the best first": _ranked(results)}


def _is_sweep(path: Path) -> bool:
    try:
        held = parquet.read_schema(path).metadata or {}
        return "sweep" in json.loads(held.get(ORIGIN_KEY, b"{}"))
    except (OSError, ValueError):
        return False


def _ranked(results: Results) -> list[Mapping[str, Json]]:
    columns = {**results.varied, **results.statistics}
    first = np.abs(next(iter(results.statistics.values())))
    order = np.argsort(np.where(np.isfinite(first), first, np.inf))[:FIRST]
    return [
        {"run": int(k)} | {results.label(name): f"{values[k]:.5g}" for name, values in columns.items()} for k in order
    ]


def of_file(path: Path) -> Shown:
    """Return what a sweep file asks for.

    Raises:
        SweepError: it breaks a rule.
    """
    wanted = read_sweep(path)
    facts: dict[str, Json] = {
        "sweep": str(path),
        "scenario": str(wanted.scenario),
        "runs": wanted.design.runs,
        "run it": f"cosim sweep {path}",
    }
    return facts, {}
