"""Marks of diagnoses against sealed truths, and what they add up to; shares have Wilson's intervals at 95 %."""

import json
import math
from collections import Counter
from pathlib import Path
from statistics import median

SIZE = {
    "friction_asymmetry": ("level_asymmetry", 200.0),
    "torque_offset": ("torque", 1.0),
    "delay": ("delay_ms", 1.0),
    "actuator_lag": ("time_constant_ms", 1.0),
    "cogging": ("amplitude", 1.0),
    "gravity_unbalance": ("mgl", 1.0),
    "position_friction": ("relative_amplitude", 100.0),
    "load_dependent_friction": ("coulomb_per_Nm", 100.0),
    "dwell_breakaway": ("torque_per_efold", 1.0),
    "thermal_viscosity": ("viscous_per_degC", 100.0),
    "cable_wrap": ("stiffness", 1.0),
    "quadratic_drag": ("coefficient", 1.0),
    "backlash": ("gap_rad", 1.0),
    "encoder_eccentricity": ("amplitude_rad", 1.0),
    "inertia_variation": ("relative_amplitude", 100.0),
    "periodic_disturbance": ("amplitude", 1.0),
}
"""Main number of an effect and the factor by which `visible_from` prints it. Left out: where less of it means more of
the effect (knee, stiffness, resonance), Stribeck (break-away level, no rise) and clocks (two numbers).
"""
WORDS = ("none", "unknown")
Z = 1.96
BINS = 10
GAP = 0.02
"""Relative fall of the held-out error below which a case has nothing to remove."""


def wilson(hits, n):
    """Return share and its interval."""
    if not n:
        return None
    p, z2 = hits / n, Z * Z
    middle, half = (p + z2 / (2 * n)) / (1 + z2 / n), Z / (1 + z2 / n) * math.sqrt(p * (1 - p) / n + z2 / (4 * n * n))
    return {"share": p, "low": max(0.0, middle - half), "high": min(1.0, middle + half), "hits": hits, "n": n}


def number(x):
    """Read a finite number, else None."""
    return float(x) if isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) else None


def read(path):
    """Read a result: verdict, effects by name, rivals of names, held-out errors; None if there is none."""
    try:
        raw = json.loads(path.read_text("utf-8"))
        verdict = raw["verdict"]
        verdict = [verdict] if isinstance(verdict, str) else [str(x) for x in verdict]
        effects = {}
        for e in raw.get("effects", []):
            effects.setdefault(e["effect"], e)
        held = raw.get("heldout") or {}
        return {
            "verdict": verdict or ["none"],
            "effects": effects,
            "rivals": raw.get("ambiguous_with") or [],
            "before": number(held.get("before_rms")),
            "after": number(held.get("after_rms")),
        }
    except (OSError, ValueError, KeyError, TypeError):
        return None


def set_of(found):
    """Names that the first verdict cannot be told from, with itself."""
    first = found["verdict"][0]
    return {first}.union(*[group for group in found["rivals"] if first in group])


def bound_of(entry):
    """Bound that a "not seen" states, in the unit of its main number."""
    bound = entry.get("bound")
    return number(bound.get("value")) if isinstance(bound, dict) else number(entry.get("visible_from"))


def bounds(truth, found):
    """For each concealed effect that is answered "not seen (< x)": is its size below x?"""
    out = []
    for name in truth["effects"]:
        entry = found["effects"].get(name, {})
        key, factor = SIZE.get(name, ("", 1.0))
        true, x = number(truth["parameters"].get(name, {}).get(key)), bound_of(entry)
        if entry.get("answer") == "not_seen" and true is not None and x is not None:
            out.append(
                {
                    "case": truth["case"],
                    "effect": name,
                    "true": abs(true) * factor,
                    "bound": x,
                    "holds": abs(true) * factor <= x,
                }
            )
    return out


def closed(truth, found):
    """Share of the removable held-out error that was removed; None where there is no gap, or no number."""
    o = truth.get("oracle", {})
    base, best = (
        number(o.get("heldout_base_rms")),
        number(o.get("heldout_oracle_libfriction_rms", o.get("heldout_oracle_rms"))),
    )
    if not base or best is None or not found["before"] or found["after"] is None or 1 - best / base < GAP:
        return None
    return (1 - found["after"] / found["before"]) / (1 - best / base)


def score_case(truth, found):
    """Marks of one case."""
    want = set(truth["effects"]) or {"none"}
    row = {
        "case": truth["case"],
        "family": truth["family"],
        "level": truth["level"],
        "effects": truth["effects"],
        "kind": truth.get("kind", ""),
        "machine": truth.get("machine", "mount"),
        "card": truth.get("base_friction", ""),
        "law": truth.get("truth_friction", ""),
        "rate": truth.get("rate_hz", 1000),
        "missing": found is None,
        "verdict": [],
        "named": [],
        "true_named": [],
        "or_twin": False,
        "right": False,
        "in_set": False,
        "set": [],
        "p": None,
        "bounds": [],
        "closed": None,
        "gap": None,
    }
    if found is None:
        return row
    first, names = found["verdict"][0], set_of(found)
    entry = found["effects"].get(first)
    row |= {
        "verdict": found["verdict"],
        "right": first in want,
        "or_twin": first in want or first in truth.get("indistinguishable", []),
        "in_set": bool(names & want),
        "set": sorted(names),
    }
    row["p"] = number(entry.get("probability")) if entry else None
    named = set(found["verdict"]) - set(WORDS)
    row |= {"named": sorted(named), "true_named": sorted(named & want)}
    if truth["effects"]:
        row |= {"closed": closed(truth, found), "bounds": bounds(truth, found)}
    return row


def calibration(rows):
    """Expected calibration error of the printed probability of a first name that is an effect."""
    told = [(r["p"], r["right"]) for r in rows if r["p"] is not None and r["verdict"] and r["verdict"][0] not in WORDS]
    bins = [[x for x in told if min(int(x[0] * BINS), BINS - 1) == k] for k in range(BINS)]
    table = [
        {"p": sum(p for p, _ in b) / len(b), "right": sum(ok for _, ok in b) / len(b), "n": len(b)} for b in bins if b
    ]
    error = sum(b["n"] * abs(b["p"] - b["right"]) for b in table) / len(told) if told else None
    mean = sum(p for p, _ in told) / len(told) if told else None
    return {
        "ece": error,
        "n": len(told),
        "mean": mean,
        "right": sum(ok for _, ok in told) / len(told) if told else None,
        "bins": table,
    }


def _share(rows, key):
    return wilson(sum(bool(r[key]) for r in rows), len(rows))


def _split(rows, by, key="right"):
    return {
        str(value): _share([r for r in rows if r[by] == value], key) for value in sorted({r[by] for r in rows}, key=str)
    }


def _several(rows):
    """Precision and recall of names where more than one effect is concealed."""
    hits = sum(len(r["true_named"]) for r in rows)
    return {
        "several_precision": wilson(hits, sum(len(r["named"]) for r in rows)),
        "several_recall": wilson(hits, sum(len(r["effects"]) for r in rows)),
        "several_all": wilson(sum(set(r["verdict"]) == set(r["effects"]) for r in rows), len(rows)),
    }


def summary(rows):
    """All numbers of a deck."""
    single = [r for r in rows if len(r["effects"]) == 1 and r["family"] != "unknown"]
    nulls, outside = ([r for r in rows if r["family"] == word] for word in WORDS)
    several = [r for r in rows if len(r["effects"]) > 1]
    named = [r for r in single if r["verdict"] and r["verdict"][0] not in WORDS]
    gaps = [r["closed"] for r in rows if r["closed"] is not None]
    limits = [b for r in rows for b in r["bounds"]]
    out = {
        "cases": len(rows),
        "missing": sum(r["missing"] for r in rows),
        "single": _share(single, "right"),
        "single_or_twin": _share(single, "or_twin"),
        "single_in_set": _share(single, "in_set"),
        "mean_set": sum(len(r["set"]) for r in named) / len(named) if named else None,
        "single_none": wilson(sum(r["verdict"] == ["none"] for r in single), len(single)),
        "single_unknown": wilson(sum(r["verdict"][:1] == ["unknown"] for r in single), len(single)),
        "false_alarms": wilson(sum(r["verdict"] != ["none"] for r in nulls), len(nulls)),
        "false_names": wilson(sum(bool(r["named"]) for r in nulls), len(nulls)),
        "unknown": wilson(sum("unknown" in r["verdict"][:1] for r in outside), len(outside)),
        "unknown_said": wilson(sum("unknown" in r["verdict"] for r in outside), len(outside)),
        "calibration": calibration(rows),
        "closed_median": median(gaps) if gaps else None,
        "closed_cases": len(gaps),
        "without_gap": sum(r["closed"] is None and bool(r["effects"]) for r in rows),
        "bounds_hold": wilson(sum(b["holds"] for b in limits), len(limits)),
        "bounds_broken": [b for b in limits if not b["holds"]],
    }
    out |= _several(several)
    for by in ("level", "family", "machine", "card", "law", "rate"):
        out[f"single_by_{by}"] = _split(single, by)
    out["unknown_by_kind"] = _split([r | {"right": "unknown" in r["verdict"][:1]} for r in outside], "kind")
    out["unknown_by_level"] = _split([r | {"right": "unknown" in r["verdict"][:1]} for r in outside], "level")
    out["null_alarms"] = Counter("+".join(r["verdict"]) for r in nulls if r["verdict"] != ["none"])
    out["wrong_names"] = {
        f: Counter("+".join(r["verdict"]) or "missing" for r in rows if r["family"] == f and not r["right"])
        for f in sorted({r["family"] for r in rows})
    }
    return out


def score(truths, results):
    """Score every truth in a folder; returns the rows."""
    found = [json.loads(path.read_text("utf-8")) for path in sorted(Path(truths).glob("case_*.json"))]
    return [score_case(truth, read(Path(results) / f"{truth['case']}.json")) for truth in found]
