"""What `abroad.py` leaves behind: shares with Wilson's intervals, by level and family, and the rows they rest on.

A row is one of the generator's own score (correct: the first word of the verdict is in the truth; closed_lib: share of
the held-out gap to the true structure, refitted under LuGre, that was closed), with `part` and the answer it judges.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosim.support.files import replacing
from cosim.support.version import __version__
from cosim_studies.proof.intervals import Estimate, bootstrap, mean, median, ratio, share
from cosim_studies.proof.ledger import commit
from cosim_studies.proof.page import estimate, met
from cosim_studies.proof.score import Bar, calibration_error_of, judged

Row = dict[str, Any]
Rows = Sequence[Row]
INTRODUCTION = """
The generator was written by others than the authors of the diagnosis and of [proof](../proof/README.md): another plant,
controller, noise, and other effects outside the list. It is no part of this project; FOLDER is where it lies. `level`:
share of the refitted base's training error energy that the true effect removes: subtle below .45, medium below .75,
strong.
"""
OTHERS = ("none", "unknown", "pairs")
"""Families that are not one listed effect."""


def singles(rows: Rows, *levels: str) -> list[Row]:
    """Cases with one listed effect, of some levels or of all."""
    return [row for row in rows if row["family"] not in OTHERS and (not levels or row["level"] in levels)]


def names(row: Row) -> set[str]:
    """Effects that the verdict names."""
    return {name for name in row["verdict"] if name not in ("none", "unknown")}


def answer_set(row: Row) -> set[str]:
    """What the verdict names, and the rivals it could not exclude."""
    named = names(row)
    return named.union(*(group for group in row["answer"].get("ambiguous_with", ()) if named & set(group)))


def alarm(row: Row) -> bool:
    """Something is said to be missing; a crash says nothing."""
    return bool(set(row["verdict"]) - {"none"})


def _first(*levels: str) -> Callable[[Rows], Estimate]:
    return lambda rows: share([bool(row["correct"]) for row in singles(rows, *levels)])


def _of_family(family: str, mark: Callable[[Row], bool], *levels: str) -> Callable[[Rows], Estimate]:
    return lambda rows: share([mark(r) for r in rows if r["family"] == family and (not levels or r["level"] in levels)])


def _in_set(rows: Rows) -> Estimate:
    return share([set(row["effects"]) <= answer_set(row) for row in singles(rows)])


def _set_size(rows: Rows) -> Estimate:
    return mean([float(len(answer_set(row))) for row in singles(rows) if names(row)])


def _precision(rows: Rows) -> Estimate:
    pairs = [row for row in rows if row["family"] == "pairs"]
    return ratio([(len(names(row) & set(row["effects"])), len(names(row))) for row in pairs])


def _recall(rows: Rows) -> Estimate:
    pairs = [row for row in rows if row["family"] == "pairs"]
    return ratio([(len(names(row) & set(row["effects"])), len(row["effects"])) for row in pairs])


def printed(row: Row) -> list[tuple[float, bool]]:
    """Each printed probability of an effect that was offered, and whether it was there."""
    return [(float(one["probability"]), one["effect"] in row["effects"]) for one in row["answer"].get("effects", ())]


def _calibration(rows: Rows) -> Estimate:
    each = [pairs for row in rows if (pairs := printed(row))]
    return bootstrap(each, lambda chosen: calibration_error_of([pair for pairs in chosen for pair in pairs]))


def _closed(rows: Rows) -> Estimate:
    return median([row["closed_lib"] for row in rows if row.get("closed_lib") is not None and row["effects"]])


def _seconds(rows: Rows) -> Estimate:
    return median([row["answer"]["wall_seconds"] for row in rows if "wall_seconds" in row["answer"]])


BARS = (
    Bar("strong", "one effect, strong: the first name is right", _first("strong"), least=0.97),
    Bar("medium", "one effect, medium: the first name is right", _first("medium"), least=0.93),
    Bar("subtle", "one effect, subtle: the first name is right", _first("subtle"), least=0.75),
    Bar("first", "one effect: the first name is right", _first(), least=0.92),
    Bar("in_set", "one effect: the right name is in the answer set", _in_set, least=0.95),
    Bar("set_size", "one effect: mean size of the set, where something is named", _set_size, most=1.6),
    Bar(
        "none_said", 'one effect: "none" is said', lambda rows: share([r["verdict"] == ["none"] for r in singles(rows)])
    ),
    Bar("false_alarms", "nothing concealed: something is said to be missing", _of_family("none", alarm), most=0.02),
    Bar(
        "unknown",
        "outside the list, medium and strong: unknown first",
        _of_family("unknown", lambda row: row["verdict"][:1] == ["unknown"], "medium", "strong"),
        least=0.8,
    ),
    Bar(
        "unknown_all",
        "outside the list: unknown first",
        _of_family("unknown", lambda r: r["verdict"][:1] == ["unknown"]),
    ),
    Bar("precision", "two effects: names that are true", _precision, least=0.9),
    Bar("recall", "two effects: true ones that are named", _recall, least=0.8),
    Bar("calibration_error", "expected calibration error of printed probabilities", _calibration, most=0.05),
    Bar("closed", "median share of the removable held-out RMS that was removed", _closed, least=0.9),
    Bar("crashed", "cases that ended in a traceback", lambda rows: share(["crashed" in r["answer"] for r in rows])),
    Bar("seconds", "median seconds of a diagnosis, one process", _seconds),
)


def scores(rows: Rows) -> list[dict[str, Any]]:
    """Every bar as a JSON object: key, title, value, low, high, n, asked, met, sure."""
    return [judged(bar, rows) for bar in BARS]


def by_family(rows: Rows) -> list[dict[str, Any]]:
    """Cases, right ones with their interval, and what was said, for each family."""
    found = []
    for family in sorted({row["family"] for row in rows}):
        own = [row for row in rows if row["family"] == family]
        right = [set(row["effects"]) <= names(row) if family == "pairs" else bool(row["correct"]) for row in own]
        said = [" + ".join(row["verdict"]) or "crashed" for row in own]
        counts = sorted({(-said.count(word), word) for word in said})
        words = ", ".join(f"{word} {-count}" if count < -1 else word for count, word in counts)
        found.append({"family": family, "cases": len(own), "right": share(right).as_json(), "said": words})
    return found


def write(out: Path, rows: Rows, facts: Mapping[str, Any]) -> None:
    """Write README.md and abroad.json, each complete or as it was."""
    whole = {**facts, "version": __version__, "commit": commit(), "played": len(rows), "scores": scores(rows)}
    whole |= {"families": by_family(rows), "rows": [_short(row) for row in rows]}
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(whole, default=_plain, allow_nan=False) + "\n"
    for name, content in {"README.md": page(whole), "abroad.json": text}.items():
        with replacing(out / name, force=True) as partial:
            partial.write_text(content, "utf-8")


def _short(row: Row) -> dict[str, Any]:
    wanted = ("part", "case", "family", "level", "friction", "effects", "verdict", "correct", "closed_lib", "answer")
    return {name: row.get(name) for name in wanted}


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else str(value)


def page(found: Mapping[str, Any]) -> str:
    """The page for people."""
    lines = [
        "# Abroad: concealed physics of a generator by others",
        "",
        f"    {found['command']}",
        "",
        f"mount-cosim {found['version']}, commit {found['commit']}, code {found['code']}; "
        f"generator {found['generator']} (SHA-256 of its files), seeds from {found['seed']}; "
        f"purpose: {found['purpose']}; {found['played']} cases in {found['seconds']:.0f} s. "
        "All decks: [decks.md](../decks.md).",
        "",
        *INTRODUCTION.strip().splitlines(),
        "",
        "## Measured and asked",
        "",
        "| | value [95 %] | cases | asked | |",
        "|---|---|---|---|---|",
        *(
            f"| {one['title']} | {estimate(one)} | {one['n']} | {one['asked']} | {met(one)} |"
            for one in found["scores"]
        ),
        "",
        "`inconclusive`: the interval holds the bar. Shares have Wilson's interval, the rest a bootstrap over cases.",
        "Where nothing is concealed, unknown is a false alarm too; a crash is wrong everywhere but there.",
        "",
        "## By family",
        "",
        "| concealed | cases | right [95 %] | answered |",
        "|---|---|---|---|",
        *(f"| {f['family']} | {f['cases']} | {estimate(f['right'])} | {f['said']} |" for f in found["families"]),
        "",
        "Right: the first name (pairs: both names are given). Files: [abroad.json](abroad.json): all numbers, cases.",
    ]
    return "\n".join(lines) + "\n"
