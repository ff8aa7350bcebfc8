"""Rows of a proof made by hand, and tools that stand in for the diagnosis: they run in the process of the tool."""

import os
from pathlib import Path
from typing import Any

from cosim_studies.proof.generator import OUTSIDE


def row(kind: str, effects: list[str], verdict: list[str], **more: Any) -> dict[str, Any]:
    """A hand-made case: a name in `verdict` was found with probability 0.9."""
    outside = [name for name in effects if name in OUTSIDE]
    entries = [{"effect": name, "listed": name not in outside, "parameters": {}} for name in effects]
    right = [name for name in effects if name not in outside] + ["unknown"] * bool(outside)
    found = [
        {"effect": name, "answer": "found", "probability": 0.9, "parameters": {}, "where": None}
        for name in verdict
        if name != "unknown"
    ]
    answer = {
        **{"verdict": verdict, "effects": found, "ambiguous_with": more.get("groups", []), "depends_on": []},
        **{"intervals": more.get("intervals", {}), "windows": more.get("windows", {}), "baselines": {}},
        "heldout": {"nominal_rms": 3.0, "before_rms": 2.0, "after_rms": more.get("after", 2.0)},
    }
    truth = {"effects": entries, "verdict": right, "mount": {"blend": 0.0}}
    head = {"run": more.get("run", 0), "seed": 1, "kind": kind, "effects": effects, "seal": "", "salt": ""}
    seconds = {"make": 1.0, "tool": 9.0, "ceiling": 1.0}
    best = {"heldout_rms": more["best"]} if "best" in more else {"reason": "none here"}
    return head | {"truth": truth, "status": "ok", "reason": "", "answer": answer, "ceiling": best, "seconds": seconds}


ROWS = [
    row("none", [], []),
    row("none", [], ["cogging"]),
    row("none", [], ["unknown"]),
    row("none", [], []),
    row("one", ["delay"], ["delay"], groups=[["delay", "actuator_lag"]], after=1.08, best=1.0),
    row("one", ["cogging"], ["cogging"], after=1.0, best=1.0),
    row("one", ["stribeck"], ["presliding"], groups=[["presliding", "stribeck"]], after=1.5, best=1.0),
    row("one", ["backlash"], ["compliance"], after=1.9, best=1.99),
    row("one", ["torque_offset"], []),
    row("several", ["delay", "cogging"], ["cogging", "stribeck"]),
    row("several", ["delay", "cogging", "stribeck"], ["delay", "cogging"]),
    row("outside", ["remanence"], ["unknown"]),
    row("outside", ["rubbing"], ["delay"]),
]


def cautious(folder: str) -> dict[str, Any]:
    """See exactly what a user has, and say that nothing is missing."""
    seen = sorted(path.name for path in Path(folder).iterdir())
    assert seen == ["card.toml", "heldout.parquet", "train_1.parquet", "train_2.parquet"]
    held = {"before_rms": 2.0, "after_rms": 2.0, "nominal_rms": 3.0}
    none = {"verdict": [], "ambiguous_with": [], "effects": [], "depends_on": [], "intervals": {}, "windows": {}}
    return none | {"heldout": held, "baselines": {"refit": {"heldout_rms": 2.0, "alarm": False}}}


def crashing(folder: str) -> dict[str, Any]:
    """End without a word."""
    os._exit(3)
