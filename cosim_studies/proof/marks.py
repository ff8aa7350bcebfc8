"""Marks of one case: what was concealed, beside what the tool answered.

A row is what a case left behind (see `play.py`). A tool that crashed or took too long has named nothing and is wrong
wherever an answer was due.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf, pi
from typing import Any

from cosim_studies.proof.ceiling import in_card_words

Row = Mapping[str, Any]
Spans = Sequence[Sequence[float]]

NO_NAMES = ("none", "unknown")
SHAKEN = ("ground", "vibration", "wind")
"""What is concealed where `broadband_disturbance`, a word for something without a name, is true."""
LEAST_REMOVABLE = 0.05
"""Share of the held-out RMS that the true structure must remove, else there is no gap to close."""


def concealed(row: Row) -> tuple[str, ...]:
    """Names that should be given; what is outside the list has none."""
    return tuple(entry["effect"] for entry in row["truth"]["effects"] if entry["listed"])


def verdict(row: Row) -> tuple[str, ...]:
    """The verdict, ("none",) for an empty one; how the tool ended where it gave none."""
    if row["status"] != "ok":
        return (str(row["status"]),)
    return tuple(row["answer"]["verdict"]) or ("none",)


def names(row: Row) -> tuple[str, ...]:
    """Effects that the verdict names, first the largest."""
    return tuple(name for name in verdict(row) if row["status"] == "ok" and name not in NO_NAMES)


def answer_set(row: Row) -> set[str]:
    """What the verdict names, and the rivals it could not exclude."""
    named = set(names(row))
    groups = row["answer"]["ambiguous_with"] if named else []
    return named.union(*(group for group in groups if named & set(group)))


def alarm(row: Row) -> bool:
    """Something is said to be missing, with a name or without."""
    return bool(names(row)) or says_unknown(row)


def says_unknown(row: Row) -> bool:
    """Something is said to be missing that the list does not hold."""
    return "unknown" in verdict(row)


def right_first(row: Row) -> bool:
    """The first name is a true one."""
    return verdict(row)[0] in concealed(row)


def in_set(row: Row) -> bool:
    """All true names are in the answer set."""
    return set(concealed(row)) <= answer_set(row)


def exact(row: Row) -> bool:
    """The verdict is the truth, nothing more and nothing less."""
    return set(verdict(row)) == set(row["truth"]["verdict"] or ("none",))


def wrong_single(row: Row) -> bool:
    """One name without a rival, and it is wrong."""
    only = answer_set(row)
    return len(only) == 1 and not only & set(concealed(row))


def hits(row: Row) -> int:
    """True names in the verdict."""
    return len(set(names(row)) & set(concealed(row)))


def probabilities(row: Row) -> Iterator[tuple[float, bool]]:
    """Each printed probability of an effect that was offered, and whether it was there."""
    for finding in row["answer"]["effects"] if row["status"] == "ok" else ():
        if finding["answer"] in ("found", "ambiguous"):
            yield float(finding["probability"]), finding["effect"] in told_rightly(row)


def told_rightly(row: Row) -> tuple[str, ...]:
    """Names that should be given, and the word for what shakes the machine where that is concealed."""
    shaken = any(entry["effect"] in SHAKEN for entry in row["truth"]["effects"])
    return (*concealed(row), "broadband_disturbance") if shaken else concealed(row)


def gap_closed(row: Row) -> float | None:
    """Share of the held-out RMS that the true structure removes which the tool removed too; None where undefined."""
    best = row.get("ceiling", {}).get("heldout_rms")
    if best is None or row["status"] != "ok":
        return None
    before, after = (row["answer"]["heldout"][name] for name in ("before_rms", "after_rms"))
    return None if before - best < LEAST_REMOVABLE * before else float((before - after) / (before - best))


def removable(row: Row) -> float | None:
    """Share of the refitted base's held-out error energy that the true structure removes; None without a ceiling."""
    best = row.get("ceiling", {}).get("heldout_rms")
    if best is None or row["status"] != "ok":
        return None
    return float(1 - (best / row["answer"]["heldout"]["before_rms"]) ** 2)


def is_findable(row: Row) -> bool:
    """The true structure, refitted, predicts the held-out recording better than the base that it contains."""
    best = row.get("ceiling", {})
    return bool(best.get("heldout_rms", inf) < best.get("base_rms", inf))


def findable(row: Row) -> tuple[str, ...]:
    """Of several effects those without which the true structure, refitted, predicts the held-out recording worse."""
    best = row.get("ceiling", {})
    return tuple(name for name, left in best.get("without", {}).items() if best["heldout_rms"] < left)


def has_gap(row: Row) -> bool:
    """There is something to gain, as far as a refit of the true structure can tell."""
    return gap_closed(row) is not None


def gain(row: Row, baseline: str) -> float | None:
    """Share of the refitted base's held-out RMS that a baseline, or the tool itself ("cosim"), removes."""
    if row["status"] != "ok":
        return None
    before, after = (row["answer"]["heldout"][name] for name in ("before_rms", "after_rms"))
    left = after if baseline == "cosim" else row["answer"]["baselines"].get(baseline, {}).get("heldout_rms")
    return None if left is None else float(1 - left / before)


def raises_alarm(row: Row, baseline: str) -> bool | None:
    """Whether a baseline, or the tool itself, says that something is missing; None if it did not run."""
    if row["status"] != "ok":
        return None
    if baseline == "cosim":
        return alarm(row)
    found = row["answer"]["baselines"].get(baseline, {}).get("alarm")
    return None if found is None else bool(found)


def places(row: Row) -> Iterator[tuple[str, float | None]]:
    """For each effect that acts in a part only: its axis, and intersection over union; None if no place was given."""
    for entry in row["truth"]["effects"]:
        where = entry.get("where")
        if where and where["axis"] == "time":
            yield "time", _overlap_in_time(row, where["intervals"])
        elif where:
            yield where["axis"], _overlap(row, entry["effect"], where)


def _overlap(row: Row, effect: str, true: Mapping[str, Any]) -> float | None:
    findings = row["answer"]["effects"] if row["status"] == "ok" else ()
    for finding in findings:
        place = finding["where"]
        if finding["effect"] == effect and place and place["axis"] == true["axis"]:
            return iou(place["regions"], true["regions"])
    return None


def _overlap_in_time(row: Row, true: Mapping[str, Spans]) -> float | None:
    """Mean over the recordings of the overlap of flagged and true intervals, both within what was looked at."""
    if row["status"] != "ok" or not alarm(row):
        return None
    answer = row["answer"]
    each = [iou(answer["intervals"].get(name, []), spans, answer["windows"][name]) for name, spans in true.items()]
    return sum(each) / len(each)


def iou(one: Spans, other: Spans, window: Sequence[float] | None = None) -> float:
    """Length of the intersection of two sets of intervals over that of their union, within a window."""
    low, high = window or (-float("inf"), float("inf"))
    sets = [[(max(a, low), min(b, high)) for a, b in spans if min(b, high) > max(a, low)] for spans in (one, other)]
    edges = sorted({edge for spans in sets for span in spans for edge in span})
    both = either = 0.0
    for a, b in pairwise(edges):
        inside = [any(x <= a and b <= y for x, y in spans) for spans in sets]
        both += (b - a) * all(inside)
        either += (b - a) * any(inside)
    return both / either if either else 0.0


def parameter_errors(row: Row) -> Iterator[tuple[str, str, float]]:
    """Effect, parameter and error of each number of an effect that was rightly named.

    Relative to the truth; phases in rad.
    """
    findings = {f["effect"]: f["parameters"] for f in row["answer"]["effects"]} if row["status"] == "ok" else {}
    for entry in row["truth"]["effects"]:
        if entry["effect"] in names(row):
            true, found = in_card_words(entry), findings[entry["effect"]]
            for name in sorted(set(true) & set(found)):
                if isinstance(true[name], float | int) and isinstance(found[name], float | int):
                    error = _error(name, float(found[name]), float(true[name]))
                    if error is not None:
                        yield entry["effect"], name, error


def _error(name: str, found: float, true: float) -> float | None:
    if name == "phase":
        return abs((found - true + pi) % (2 * pi) - pi)
    return abs(found / true - 1) if true else None
