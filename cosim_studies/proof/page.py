"""What a proof leaves behind: numbers for programs, a table of cases, figures, and a page for people.

`proof.json`:
    command, seed, cases, seconds      how it was made; `played` is the number of cases done
    version, code                      of the project, and SHA-256 of the code that decides the scores
    scores       [{key, title, value, low, high, n, asked, met, sure}]   95 % intervals; met is null where nothing was
                 asked; sure if the whole interval says the same
    confusion    {concealed: {first answer: cases}}                cases with at most one effect
    reliability  [{printed, true, low, high, n}]                   bins of printed probabilities
    gaps         [share of the removable held-out RMS removed]
    no_gap       {reason: cases}                                   where that share is not defined
    families     [{effect, cases, right_first, in_set, answers, gap_closed, no_gap, parameter_errors}]
    powers       [{effect, bins, curve, at, dots}]                 by the size that was drawn, see `power.py`
    levels       [{level, cases, right_first, in_set}]             by what there was to gain
    outside      [{effect, cases, shape, unknown, named, without}] effects outside the list
    friction     [{friction, cases, and the main scores}]          by what rubbed in truth
    setups       [{setup, cases, and the main scores}]             by what else was drawn for a machine
    baselines    [{baseline, skipped, gain_nothing, gain_something, alarms_nothing, alarms_something}]
    rows         [what each case left behind, see `play.py`]
"""

import csv
import io
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from cosim.support.files import replacing
from cosim.support.plain import JsonObject
from cosim_studies.proof import marks, power, score
from cosim_studies.proof.cases import SHARES, SIZES
from cosim_studies.proof.figures import draw_calibration, draw_confusion, draw_gaps, draw_powers
from cosim_studies.proof.marks import Row
from cosim_studies.proof.outside import SHAPED

FIGURES = ("confusion.svg", "calibration.svg", "gap.svg", "power.svg")
MADE = ("deck.json", "runs.jsonl", "seals.jsonl", "proof.json", "cases.csv", "README.md", *FIGURES)
"""Everything that a proof writes; the first is what it depends on."""


def proof(rows: Sequence[Row], facts: Mapping[str, Any]) -> JsonObject:
    """What `proof.json` holds (see the module), of the cases played so far."""
    pairs = list(chain.from_iterable(marks.probabilities(row) for row in rows))
    concealing = score.kind(rows, "one", "several")
    return {
        **facts,
        "played": len(rows),
        "scores": score.scored(rows),
        "confusion": score.confusion(rows),
        "reliability": score.bins(pairs),
        "gaps": [gap for row in concealing if (gap := marks.gap_closed(row)) is not None],
        "no_gap": dict(Counter(_no_gap(row) for row in concealing if marks.gap_closed(row) is None)),
        "families": score.families(rows),
        "powers": power.powers(rows),
        "levels": power.by_level(rows),
        "outside": power.outside(rows, tuple(SHAPED)),
        "friction": score.by_friction(rows),
        "setups": score.by_setup(rows),
        "baselines": score.baselines(rows),
        "rows": list(rows),
    }


def _no_gap(row: Row) -> str:
    if row["status"] != "ok":
        return "the tool gave no answer"
    few = f"the true structure removes less than {marks.LEAST_REMOVABLE:.0%}"
    return few if "heldout_rms" in row["ceiling"] else str(row["ceiling"].get("reason", "it could not be fitted"))


def write(out: Path, found: Mapping[str, Any]) -> None:
    """Write everything into `out`, which belongs to this proof; each file complete or as it was."""
    draw_confusion(found["confusion"], out / FIGURES[0])
    draw_calibration(found["reliability"], out / FIGURES[1])
    draw_gaps(found["gaps"], out / FIGURES[2])
    draw_powers(found["powers"], out / FIGURES[3])
    texts = {
        "cases.csv": _cases(found["rows"]),
        "README.md": page(found),
        "proof.json": json.dumps(found, allow_nan=False) + "\n",
    }
    for name, text in texts.items():
        with replacing(out / name, force=True) as partial:
            partial.write_text(text, "utf-8")


def _cases(rows: Sequence[Row]) -> str:
    file = io.StringIO()
    table = csv.DictWriter(file, list(_line(rows[0])), lineterminator="\n")
    table.writeheader()
    table.writerows(_line(row) for row in rows)
    return file.getvalue()


def _line(row: Row) -> JsonObject:
    """One case as a row of `cases.csv`; RMS in N m."""
    held = row["answer"]["heldout"] if row["status"] == "ok" else {}
    gap = marks.gap_closed(row)
    return {
        "case": row["run"],
        "seed": row["seed"],
        "kind": row["kind"],
        "size": f"{row['size']:.2f}" if row["effects"] and "size" in row else "",
        **{name: row["truth"].get("setup", {}).get(name, "") for name in ("machine", "card", "contact")},
        "concealed": " + ".join(row["effects"]) or "none",
        "answered": " + ".join(marks.verdict(row)),
        "answer_set": " + ".join(sorted(marks.answer_set(row))),
        "depends_on": "; ".join(row["answer"]["depends_on"]) if row["status"] == "ok" else row["reason"],
        "right": "yes" if marks.exact(row) else "no",
        **{name: _number(held.get(name)) for name in ("nominal_rms", "before_rms", "after_rms")},
        "true_structure_rms": _number(row["ceiling"].get("heldout_rms")),
        "gap_closed": _number(gap),
        "no_ceiling": row["ceiling"].get("reason", ""),
        "seconds": f"{row['seconds']['tool']:.1f}",
        "seal": row["seal"],
    }


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


def page(found: Mapping[str, Any]) -> str:
    """The page for people."""
    environment = Environment(
        loader=PackageLoader("cosim_studies.proof", "."), undefined=StrictUndefined, keep_trailing_newline=True
    )
    return environment.get_template("page.md.j2").render(
        found,
        shares=SHARES,
        sizes=SIZES,
        edges=power.EDGES,
        shown=power.SHOWN,
        bins=score.BINS,
        least_removable=marks.LEAST_REMOVABLE,
        lines=[_line(row) for row in found["rows"] if not marks.exact(row)],
        number=estimate,
        met=met,
        short=_short,
    )


def met(one: Mapping[str, Any], missed: str = "**missed**") -> str:
    """Whether the bar is met; "inconclusive" where the interval holds the bar, whatever the value."""
    word = {True: "met", False: missed, None: ""}[one["met"]]
    return word if one["sure"] or not word else "inconclusive"


def estimate(one: Mapping[str, Any]) -> str:
    """A value with its interval."""
    if one["value"] is None:
        return "-"
    return f"{one['value']:.3g} [{one['low']:.2g}, {one['high']:.2g}]"


def _short(errors: Mapping[str, Mapping[str, Any]]) -> str:
    """Median errors of parameters: relative in per cent, phases in rad."""
    texts = (
        f"{name} {one['median']:.2g} rad" if name == "phase" else f"{name} {one['median']:.0%}"
        for name, one in errors.items()
    )
    return ", ".join(texts)
