"""What a check says: text for a terminal, plain data, and files: check.json and a picture of each experiment."""

import json
from collections.abc import Sequence
from math import isfinite
from pathlib import Path

import numpy as np

from cosim.experiments.check import Checked
from cosim.experiments.comparison import Compared
from cosim.experiments.run import Outcome
from cosim.plots.compare import Overlay, write_figure
from cosim.support.files import directory, replacing
from cosim.support.plain import JsonObject
from cosim.support.version import __version__

JSON = "check.json"
WORDS = {True: "pass", False: "FAIL"}


def deliver(done: Checked, out: Path, force: bool) -> dict[str, Path]:
    """Write check.json and a picture of each experiment that was compared; return the files by kind."""
    directory(out)
    found: dict[str, Path] = {}
    for k, one in enumerate(one for one in done.outcomes if one.simulated):
        path = out / f"experiment_{k + 1}.svg"
        write_figure(_overlay(one), path, force)
        found[f"picture_{k + 1}"] = path
    with replacing(out / JSON, force) as partial:
        partial.write_text(json.dumps(as_json(done), indent=2, allow_nan=False) + "\n", "utf-8")
    return {"json": out / JSON, **found}


def as_json(done: Checked) -> JsonObject:
    """Return a check as plain data; what is no finite number is null."""
    return {
        "fmu": done.path.name,
        "passed": done.passed,
        "standard": done.standard or None,
        "experiments": [_experiment(one) for one in done.outcomes],
        "findings": [{"name": one.name, "passed": one.passed, "statement": one.statement} for one in done.findings],
        "notes": list(done.notes),
        "version": __version__,
    }


def lines_of(done: Checked) -> list[str]:
    """The check as text: a line for each experiment, and one for each variable that fails."""
    lines = [f"{done.path.name}: {WORDS[done.passed]}" + (f" ({done.standard})" if done.standard else "")]
    for one in done.outcomes:
        word = WORDS[one.passed] if one.run else "not run"
        several = "s" * (len(one.compared) > 1)
        count = f"{len(one.compared)} variable{several}" if one.compared else one.reason.removeprefix("not run: ")
        lines.append(f"  {word}  {one.experiment.name} ({one.experiment.purpose}): {count}")
        lines += [f"        {_sentence(row)}" for row in one.compared if not row.passed]
        lines += [f"        {note}" for note in one.notes]
    lines += [f"  {WORDS[one.passed]}  {one.name}: {one.statement}" for one in done.findings]
    return [*lines, *(f"  {note}" for note in done.notes)]


def rows_of(done: Checked) -> list[dict[str, object]]:
    """A row for each variable of each experiment."""
    return [{"experiment": one.experiment.name, **_variable(row)} for one in done.outcomes for row in one.compared]


def _sentence(row: Compared) -> str:
    if row.said:
        return f"{row.name} is {row.said} at {row.at:g} s"
    cause = f"; {row.cause}" if row.cause else ""
    if not isfinite(row.largest):
        return f"{row.name} is no number at {row.at:g} s{cause}"
    times = f", {row.ratio:.3g} times what is allowed" if isfinite(row.ratio) else ""
    return f"{row.name} is {row.largest:.4g} off at {row.at:g} s{times}{cause}"


def _experiment(one: Outcome) -> JsonObject:
    return {
        "name": one.experiment.name,
        "purpose": one.experiment.purpose,
        "run": one.run,
        "passed": one.passed,
        "reason": one.reason or None,
        "variables": [_variable(row) for row in one.compared],
        "notes": list(one.notes),
    }


def _variable(row: Compared) -> JsonObject:
    numbers = {"largest": row.largest, "at": row.at, "allowed": row.allowed, "rms": row.rms}
    plain: JsonObject = {key: value if isfinite(value) else None for key, value in numbers.items()}
    return {"variable": row.name, "passed": row.passed, **plain, "cause": row.cause or row.said or None}


def _overlay(one: Outcome) -> Overlay:
    """Reference and simulation over each other, the variables that fail first."""
    order = sorted(one.compared, key=lambda row: row.passed)
    names = [row.name for row in order if row.name in one.simulated][:MOST]
    rows = _apart(one.times)
    columns = {name: np.stack([one.reference[name][rows], one.simulated[name][rows]]) for name in names}
    return Overlay(("reference", "simulated here"), one.times[rows], columns, one.units, as_stated=True)


def _apart(times: np.ndarray) -> Sequence[int]:
    """Rows of different times: of both sides of an event the last."""
    return [*np.flatnonzero(np.diff(times) > 0).tolist(), len(times) - 1]


MOST = 12
"""Variables that a picture shows."""
