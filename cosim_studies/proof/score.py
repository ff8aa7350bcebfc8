"""Scores of a proof: each number with its interval, the cases it rests on, and the bar that was set before.

Bars are those of the design (issues 6 and 15). A bar is met if the value is on its right side; `sure` if all of the
interval is on the same side as the value.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from cosim.support.plain import Parsed
from cosim_studies.proof import marks
from cosim_studies.proof.baselines import NAMES
from cosim_studies.proof.intervals import NOTHING, Estimate, bootstrap, mean, median, ratio, share
from cosim_studies.proof.marks import Row

FEW = 8
"""Cases below which a bootstrap that never varies says nothing."""
BINS = 10
"""Bins of equal width for the calibration of probabilities."""
DRAWS = 500
"""Draws of outcomes by which the calibration error of right probabilities is known to a twentieth of its spread."""
BASELINES = ("cosim", *NAMES)
Rows = Sequence[Row]


@dataclass(frozen=True)
class Bar:
    """A number, how it is found from all rows, and what was asked of it; `least` or `most`, or neither."""

    key: str
    title: str
    of: Callable[[Rows], Estimate]
    least: float | None = None
    most: float | None = None

    def bar_text(self) -> str:
        """What was asked, in words."""
        return f">= {self.least:g}" if self.least is not None else f"<= {self.most:g}" if self.most is not None else ""

    def met(self, value: float | None) -> bool | None:
        """Whether a value is on the right side; None where nothing was asked or found."""
        if value is None or not self.bar_text():
            return None
        return value >= self.least if self.least is not None else bool(self.most is not None and value <= self.most)


def kind(rows: Rows, *kinds: str) -> list[Row]:
    """Rows of some kinds of case."""
    return [row for row in rows if row["kind"] in kinds]


def _share(mark: Callable[[Row], bool], *kinds: str) -> Callable[[Rows], Estimate]:
    return lambda rows: share([mark(row) for row in kind(rows, *kinds)])


def _share_of_findable(mark: Callable[[Row], bool]) -> Callable[[Rows], Estimate]:
    return lambda rows: share([mark(row) for row in kind(rows, "one") if marks.is_findable(row)])


def _precision(rows: Rows) -> Estimate:
    return ratio([(marks.hits(row), len(marks.names(row))) for row in kind(rows, "several")])


def _recall(rows: Rows) -> Estimate:
    return ratio([(marks.hits(row), len(marks.concealed(row))) for row in kind(rows, "several")])


def _recall_of_findable(rows: Rows) -> Estimate:
    wanted = [(set(marks.names(row)), marks.findable(row)) for row in kind(rows, "several")]
    return ratio([(len(named.intersection(those)), len(those)) for named, those in wanted])


def _set_size(rows: Rows) -> Estimate:
    return mean([float(len(marks.answer_set(row))) for row in kind(rows, "one") if marks.names(row)])


def _gap(rows: Rows) -> Estimate:
    gaps = (marks.gap_closed(row) for row in kind(rows, "one", "several"))
    return median([gap for gap in gaps if gap is not None])


def _places(rows: Rows) -> Estimate:
    return median([overlap or 0.0 for row in rows for _, overlap in marks.places(row)])


def _places_given(rows: Rows) -> Estimate:
    return median([overlap for row in rows for _, overlap in marks.places(row) if overlap is not None])


def _seconds(rows: Rows) -> Estimate:
    return median([row["seconds"]["tool"] for row in rows if row["status"] == "ok"])


def calibration_error(rows: Rows) -> Estimate:
    """Expected calibration error with an interval from a bootstrap over cases."""
    each = [pairs for row in rows if (pairs := list(marks.probabilities(row)))]
    return bootstrap(each, lambda chosen: calibration_error_of(list(chain.from_iterable(chosen))))


def calibration_error_by_chance(rows: Rows) -> Estimate:
    """Calibration error that the same printed probabilities would show if each were exactly right.

    Its mean and the middle 95 % of draws: bins of few cases miss the diagonal by chance alone, so an error within this
    interval is no evidence of a wrong probability. Broecker and Smith, Weather and Forecasting 22 (2007) 651.
    """
    printed = np.array([p for row in rows for p, _ in marks.probabilities(row)])
    if not len(printed):
        return NOTHING
    draws = np.random.default_rng(0).random((DRAWS, len(printed))) < printed
    errors = [calibration_error_of(list(zip(printed.tolist(), draw.tolist(), strict=True))) for draw in draws]
    low, high = (float(edge) for edge in np.quantile(errors, (0.025, 0.975)))
    return Estimate(float(np.mean(errors)), low, high, len(printed))


def bins(pairs: Sequence[tuple[float, bool]]) -> list[Parsed]:
    """Reliability: for each bin that holds any, mean probability, share that was true with its interval, count."""
    place = [min(int(p * BINS), BINS - 1) for p, _ in pairs]
    found = []
    for k in sorted(set(place)):
        inside = [pair for pair, at in zip(pairs, place, strict=True) if at == k]
        true = share([right for _, right in inside])
        printed = float(np.mean([p for p, _ in inside]))
        found.append({"printed": printed, "true": true.value, "low": true.low, "high": true.high, "n": true.n})
    return found


def calibration_error_of(pairs: Sequence[tuple[float, bool]]) -> float:
    """Mean distance of printed probabilities from the share that came true, over bins by their counts."""
    reliability = bins(pairs)
    total = sum(one["n"] for one in reliability)
    return float(sum(one["n"] * abs(one["printed"] - one["true"]) for one in reliability) / total) if total else np.nan


BARS = (
    Bar("false_alarms", "nothing concealed: something is said to be missing", _share(marks.alarm, "none"), most=0.02),
    Bar("right_first", "one effect: the first name is right", _share(marks.right_first, "one"), least=0.95),
    Bar("in_set", "one effect: the right name is in the answer set", _share(marks.in_set, "one"), least=0.95),
    Bar("findable_first", "... of those that can be found: first", _share_of_findable(marks.right_first), least=0.85),
    Bar("findable_in_set", "... of those that can be found: in the set", _share_of_findable(marks.in_set), least=0.92),
    Bar("set_size", "one effect: mean size of the set, where something is named", _set_size, most=1.6),
    Bar("wrong_single", "one effect: a single name, and wrong", _share(marks.wrong_single, "one"), most=0.05),
    Bar("exact", "one effect: the verdict is the truth and nothing else", _share(marks.exact, "one")),
    Bar("precision", "two or three effects: names that are true", _precision, least=0.9),
    Bar("recall", "two or three effects: true ones that are named", _recall, least=0.8),
    Bar("findable_recall", "... of those without which the truth predicts worse", _recall_of_findable, least=0.6),
    Bar("unknown", "outside the list: unknown", _share(marks.exact, "outside"), least=0.91),
    Bar("named_outside", "outside the list: a name is attached", _share(lambda r: bool(marks.names(r)), "outside")),
    Bar("calibration_error", "expected calibration error of printed probabilities", calibration_error, most=0.05),
    Bar("calibration_by_chance", "... that right ones would show by chance", calibration_error_by_chance),
    Bar("gap_closed", "median share of the removable held-out RMS that was removed", _gap, least=0.9),
    Bar("no_gap", "one or more effects: no gap to close", _share(lambda r: not marks.has_gap(r), "one", "several")),
    Bar("localisation", "median IoU of local effects, 0 where no place was given", _places, least=0.7),
    Bar("localisation_given", "median IoU of local effects, where a place was given", _places_given),
    Bar("seconds", "median seconds of a diagnosis, one process", _seconds),
)


def scored(rows: Rows) -> list[Parsed]:
    """Every score as a JSON object: key, title, value, low, high, n, asked, met, sure."""
    return [judged(bar, rows) for bar in BARS]


def judged(bar: Bar, rows: Rows) -> Parsed:
    """One score as a JSON object; an interval of no width over few cases is a bootstrap's, and makes nothing sure."""
    found = bar.of(rows)
    head = {"key": bar.key, "title": bar.title, **found.as_json()}
    sides = {bar.met(value) for value in (found.value, found.low, found.high)}
    sure = len(sides) == 1 and (found.low != found.high or found.n >= FEW)
    return head | {"asked": bar.bar_text(), "met": bar.met(found.value), "sure": sure}


def confusion(rows: Rows) -> dict[str, dict[str, int]]:
    """Cases with at most one effect: what was concealed, and how often each first answer was given to it."""
    table: dict[str, dict[str, int]] = {}
    for row in kind(rows, "none", "one", "outside"):
        line = table.setdefault(_label(row), {})
        first = marks.verdict(row)[0]
        line[first] = line.get(first, 0) + 1
    return dict(sorted(table.items()))


def _label(row: Row) -> str:
    return " + ".join(entry["effect"] for entry in row["truth"]["effects"]) or "none"


def families(rows: Rows) -> list[Parsed]:
    """Cases with one effect, by family: count, right first, in the set, median gap closed, error of its numbers."""
    alone = kind(rows, "one")
    return [_family(name, [row for row in alone if _label(row) == name]) for name in sorted({_label(r) for r in alone})]


def _family(name: str, rows: Rows) -> Parsed:
    gaps = [gap for row in rows if (gap := marks.gap_closed(row)) is not None]
    errors: dict[str, list[float]] = {}
    for row in rows:
        for _, parameter, error in marks.parameter_errors(row):
            errors.setdefault(parameter, []).append(error)
    return {
        "effect": name,
        "cases": len(rows),
        "right_first": sum(map(marks.right_first, rows)),
        "in_set": sum(map(marks.in_set, rows)),
        "answers": [" + ".join(marks.verdict(row)) for row in rows],
        "gap_closed": float(np.median(gaps)) if gaps else None,
        "no_gap": len(rows) - len(gaps),
        "parameter_errors": {key: {"median": float(np.median(e)), "n": len(e)} for key, e in errors.items()},
    }


SETUPS = ("machine", "card", "contact", "loop", "rate_hz", "payload")
"""What was drawn for a machine, by which the main scores are told apart."""


def by_setup(rows: Rows) -> list[Parsed]:
    """The main shares for each value of what was drawn for a machine."""
    found = []
    for key in SETUPS:
        values = {setup[key] for row in rows if (setup := row["truth"].get("setup"))}
        for value in sorted(values):
            own = [row for row in rows if row["truth"].get("setup", {}).get(key) == value]
            label = f"{key.removesuffix('_hz').replace('_', ' ')}: {value}"
            found.append({"setup": label, "cases": len(own), **_main(own)})
    return found


def by_friction(rows: Rows) -> list[Parsed]:
    """The main shares by what rubbed in truth: a bristle alone, or slip blocks beside it."""
    kinds = {"bristle": lambda blend: blend == 0, "slip blocks": lambda blend: blend > 0}
    return [
        {"friction": name, **_main(_those(rows, wanted)), "cases": len(_those(rows, wanted))}
        for name, wanted in kinds.items()
    ]


def _those(rows: Rows, wanted: Callable[[float], bool]) -> list[Row]:
    return [row for row in rows if wanted(row["truth"]["mount"]["blend"])]


def _main(rows: Rows) -> Parsed:
    keys = ("false_alarms", "right_first", "in_set", "unknown")
    return {bar.key: bar.of(rows).as_json() for bar in BARS if bar.key in keys}


def baselines(rows: Rows) -> list[Parsed]:
    """The tool and each baseline: held-out gain with and without a concealed effect, alarms on both."""
    return [_baseline(rows, name) for name in BASELINES]


def _baseline(rows: Rows, name: str) -> Parsed:
    nothing, something = kind(rows, "none"), kind(rows, "one", "several", "outside")
    found: Parsed = {"baseline": name, "skipped": _skipped(rows, name)}
    for key, cases in (("nothing", nothing), ("something", something)):
        gains = [gain for row in cases if (gain := marks.gain(row, name)) is not None]
        alarms = [alarm for row in cases if (alarm := marks.raises_alarm(row, name)) is not None]
        found[f"gain_{key}"] = (median(gains) if gains else NOTHING).as_json()
        found[f"alarms_{key}"] = share(alarms).as_json()
    return found


def _skipped(rows: Rows, name: str) -> str:
    answers = (row["answer"].get("baselines", {}).get(name, {}) for row in rows if row["status"] == "ok")
    return next((str(one["skipped"]) for one in answers if "skipped" in one), "")
