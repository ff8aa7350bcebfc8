"""Answers as they are stored, and how two of them are compared.

Of a diagnosis the net keeps what a user relies on: verdict, sets, answer and probability of every effect, its
parameters and its bound, held-out errors, doubts, the numbers of the better card. One line of JSON a case.
"""

import json
import os
import subprocess
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from bench.net.cases import NetCase
from cosim.diagnosis.answer.names import with_names

Answer = dict[str, Any]


class Tolerance(NamedTuple):
    """Up to which difference two numbers are the same: of probabilities, and of others relative to the larger."""

    probability: float
    relative: float


SAME = Tolerance(1e-6, 1e-9)
"""On one machine with the same libraries."""
ALIKE = Tolerance(0.01, 0.01)
"""Between machines, whose linear algebra differs in last bits, so that a fit may end a step earlier or later."""
STORED = Path(__file__).parent / "stored"
NOT_COMPARED = ("seconds",)


def answered(command: list[str], case: NetCase, folder: Path) -> Answer:
    """Make a case in a folder, diagnose it in a process of its own, and return what is kept of the answer."""
    folder.mkdir(parents=True)
    case.write(folder)
    begun = time.perf_counter()
    words = [*command, "diagnose", *case.arguments(folder), "--out", str(folder / "out")]
    one_thread = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS")}
    done = subprocess.run(words, capture_output=True, text=True, env=os.environ | one_thread, check=False)
    if done.returncode:
        return {"verdict": ["refused"], "words": done.stderr.strip().splitlines()[-1][-200:], "seconds": 0.0}
    return of_folder(folder / "out") | {"seconds": round(time.perf_counter() - begun, 1)}


def of_folder(out: Path) -> Answer:
    """What the net keeps of a diagnosis that was written into a folder."""
    kept = of_document(json.loads((out / "diagnosis.json").read_text("utf-8")))
    return kept | {"card": dict(_numbers(tomllib.loads((out / "card.toml").read_text("utf-8"))))}


def of_document(document: dict[str, Any]) -> Answer:
    """What the net keeps of diagnosis.json."""
    held = document["heldout"]
    return {
        "verdict": document["verdict"],
        "sets": document["ambiguous_with"],
        "depends_on": document["depends_on"],
        "effects": {name: _effect(one) for name, one in with_names(document["effects"])},
        "heldout": {name: held[name] for name in ("nominal_rms", "before_rms", "after_rms", "floor_rms")},
        "law": document["friction_law"].get("proposed", ""),
        "sanity": sorted(one["finding"] for one in document["sanity"]),
    }


def _effect(one: dict[str, Any]) -> dict[str, Any]:
    bound = one.get("bound") or {}
    kept = {"answer": one["answer"], "probability": one["probability"], "parameters": one.get("parameters", {})}
    return kept | {"bound": [bound.get("value"), bound.get("power")]}


def _numbers(value: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Every number of a card by its full name, but for its origin."""
    if isinstance(value, dict):
        for key, item in value.items():
            if key != "origin":
                yield from _numbers(item, f"{name}.{key}".strip("."))
    elif isinstance(value, list):
        for number, item in enumerate(value):
            yield from _numbers(item, f"{name}.{number}")
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield name, float(value)


def differences(stored: Any, answer: Any, allowed: Tolerance = SAME, name: str = "") -> list[str]:
    """Each entry in which two answers differ by more than a tolerance, with both values."""
    if isinstance(stored, dict) and isinstance(answer, dict):
        keys = [key for key in sorted({*stored, *answer}) if key not in NOT_COMPARED]
        pairs = [(f"{name}.{key}".strip("."), stored.get(key), answer.get(key)) for key in keys]
    elif isinstance(stored, list) and isinstance(answer, list) and len(stored) == len(answer):
        pairs = [(f"{name}.{k}", *both) for k, both in enumerate(zip(stored, answer, strict=True))]
    else:
        return [] if _are_same(stored, answer, allowed, name) else [f"{name}: stored {stored}, now {answer}"]
    return [one for key, old, new in pairs for one in differences(old, new, allowed, key)]


def _are_same(stored: Any, answer: Any, allowed: Tolerance, name: str) -> bool:
    if not (isinstance(stored, (int, float)) and isinstance(answer, (int, float))):
        return bool(stored == answer)
    most = allowed.probability if name.endswith("probability") else allowed.relative * max(abs(stored), abs(answer))
    return abs(stored - answer) <= most


def write(case: NetCase, answer: Answer) -> None:
    """Store an answer in the file of its group, in place of the one that was there."""
    path = STORED / f"{case.group}.jsonl"
    path.parent.mkdir(exist_ok=True)
    known = _stored(path) | {case.name: answer}
    lines = [json.dumps({"case": name, **known[name]}) for name in sorted(known)]
    path.write_text("\n".join(lines) + "\n", "utf-8")


def read(case: NetCase) -> Answer | None:
    """The stored answer of a case."""
    return _stored(STORED / f"{case.group}.jsonl").get(case.name)


def _stored(path: Path) -> dict[str, Answer]:
    if not path.exists():
        return {}
    rows = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
    return {row.pop("case"): row for row in rows}
