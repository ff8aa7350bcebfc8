"""The paper's Table 4 beside what was simulated: as data, as CSV and as text."""

import csv
import io
from collections.abc import Mapping
from typing import Any

import numpy as np

from cosim.support.plain import JsonObject
from cosim_studies.paper.conditions import CASES, conditions
from cosim_studies.paper.study import Study

PAPER = {"C1": 47.58, "C2a": 12.75, "C2b": 73.71, "C3a": 9.29, "C3b": 41.29}
"""Table 4 of the paper: ISE over 15 s [arcsec^2 s]."""
ORDER = ("C3a", "C2a", "C3b", "C1", "C2b")
"""Cases from the smallest error to the largest, as the paper found them."""


def table4(study: Study) -> JsonObject:
    """Return Table 4 by condition: ISE by case, or for random conditions the statistics over the seeds."""
    found: JsonObject = {"paper": PAPER}
    for condition in conditions():
        runs = study.ise(condition.key)
        if runs:
            found[condition.key] = statistics(runs) if condition.random else runs[0]
    return found


def statistics(runs: list[dict[str, float]]) -> JsonObject:
    """Return mean ISE of C1, mean and standard deviation of the ratios to it, and how often the paper's order holds."""
    ratios = {case: [run[case] / run["C1"] for run in runs] for case in CASES if case != "C1" and case in runs[0]}
    return {
        "C1": float(np.mean([run["C1"] for run in runs])),
        "mean_ratio": {case: float(np.mean(values)) for case, values in ratios.items()},
        "ratio_std": {case: float(np.std(values, ddof=1)) for case, values in ratios.items()} if len(runs) > 1 else {},
        "order_share": float(np.mean([in_order(run) for run in runs])),
        "seeds": len(runs),
    }


def in_order(run: Mapping[str, float]) -> bool:
    """Whether the cases of one run stand in the paper's order."""
    values = [run[case] for case in ORDER if case in run]
    return values == sorted(values)


def ratios_of(entry: Mapping[str, Any]) -> dict[str, float]:
    """Return the ratios to C1 of one row of `table4`."""
    known: dict[str, float] = entry.get("mean_ratio") or {case: entry[case] / entry["C1"] for case in CASES[1:]}
    return known


def table_csv(table: Mapping[str, Any]) -> str:
    """Write Table 4 as CSV: one row a condition, ISE of C1 and ratios to it."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["condition", "C1_arcsec2_s", *(f"{case}_to_C1" for case in CASES[1:]), "order_share", "seeds"])
    for key, entry in table.items():
        ratios = ratios_of(entry)
        rest = [entry.get("order_share", ""), entry.get("seeds", "")]
        rows.writerow([key, f"{entry['C1']:.6g}", *(f"{ratios[case]:.6g}" for case in CASES[1:]), *rest])
    return text.getvalue()


def runs_csv(study: Study) -> str:
    """Write every run as CSV."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["condition", "case", "seed", "ise_arcsec2_s"])
    rows.writerows([t.condition, t.case, t.seed, f"{t.outcome.ise:.8g}"] for t in study.trials)
    return text.getvalue()


def table_text(table: Mapping[str, Any], titles: Mapping[str, str]) -> str:
    """Write Table 4 as Markdown."""
    lines = ["| condition | C1 | C2a | C2b | C3a | C3b | paper's order |", "|---|---|---|---|---|---|---|"]
    for key, entry in table.items():
        ratios, spread = ratios_of(entry), entry.get("ratio_std") or {}
        cells = [_ratio(ratios[case]) + (f" ± {spread[case]:.2f}" if case in spread else "") for case in CASES[1:]]
        share = f"{100 * entry['order_share']:.0f} % of {entry['seeds']}" if "seeds" in entry else _yes(entry)
        lines.append(f"| {titles[key]} | {entry['C1']:.2f} | {' | '.join(cells)} | {share} |")
    return "\n".join(lines) + "\n"


def _ratio(value: float) -> str:
    return f"{value:.3f}" if value >= 1e-3 else f"{value:.0e}"


def _yes(entry: Mapping[str, float]) -> str:
    return "yes" if in_order(entry) else "no"
