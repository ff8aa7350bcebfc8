"""What this project wrote itself, on one screen: folders of runs, diagnoses, sweeps and so on, and their files."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim.support.errors import InputError
from cosim.support.plain import Json, Parsed
from cosim.support.plugins import RESULTS, loaded, names

Shown = tuple[dict[str, Json], dict[str, Sequence[Mapping[str, Json]]]]
DIAGNOSIS, RUN = "diagnosis.json", "run.json"
COMPARISON, CHECK = "compare.json", "check.json"


def result(path: Path) -> Shown | None:
    """Return facts and tables of a folder or file that a verb wrote; None for anything else.

    Raises:
        InputError: the file is one of ours by its name, and cannot be read.
    """
    known = (*_READERS, *names(RESULTS))
    if path.is_dir():
        found = [path / name for name in known if (path / name).is_file()]
        return _read_result(found[0]) if found else None
    if path.name not in known or not path.is_file():
        return None
    return _read_result(path, may_be_foreign=path.name not in (DIAGNOSIS, RUN))


def _read_result(path: Path, may_be_foreign: bool = False) -> Shown | None:
    """Read a file of ours; what in it is not as we write it is a sentence (InputError)."""
    read: Callable[[Path], Shown] = _READERS.get(path.name) or loaded(RESULTS, path.name)
    try:
        return read(path)
    except InputError:
        if may_be_foreign:
            return None  # a recording that happens to have this name
        raise
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        text = f"{path} is named as a file of this project, and is not as it was written: {error}."
        raise InputError(text, culprit=str(path)) from error


def document_of(path: Path, *keys: str) -> Parsed:
    """Read a JSON object.

    Raises:
        InputError: it cannot be read, or lacks a key.
    """
    try:
        document = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read: {error}.", culprit=str(path)) from error
    if not isinstance(document, dict) or not set(keys) <= set(document):
        text = f"{path} is named as a file of this project, and lacks {' and '.join(keys)}."
        raise InputError(text, culprit=str(path))
    return document


def _diagnosis(path: Path) -> Shown:
    from cosim.diagnosis.answer.names import with_names

    document = document_of(path, "verdict", "effects", "heldout")
    held = document["heldout"]
    facts: dict[str, Json] = {
        "diagnosis": str(path),
        "missing": ", ".join(document["verdict"]) or "nothing that these recordings can show",
        "validation RMS error": f"{_short(held, 'before_rms')} (refitted card) -> {_short(held, 'after_rms')} "
        f"(improved card); noise floor {_short(held, 'floor_rms')}",
        "made by": str(document.get("provenance", {}).get("command", "")),
    }
    report = path.with_name("report.html")
    facts |= {"open": str(report)} if report.is_file() else {}
    words = {"found": "detected", "ambiguous": "possible", "not_proven": "not confirmed", "not_seen": "not detected"}
    rows: list[Mapping[str, Json]] = [
        {
            "effect": name,
            "answer": words.get(one["answer"], str(one["answer"]).replace("_", " ")),
            "probability": f"{one.get('probability', 0.0):.2f}" if one["answer"] in ("found", "ambiguous") else "",
            "statement": one.get("statement", ""),
        }
        for name, one in with_names(document["effects"])
    ]
    return {name: value for name, value in facts.items() if value}, {"effects": rows}


def _short(held: Mapping[str, Any], name: str) -> str:
    value = held.get(name)
    return f"{value:.3g}" if isinstance(value, float | int) else "?"


def _run(path: Path) -> Shown:
    document = document_of(path, "steps", "seconds")
    facts: dict[str, Json] = {"run": str(path.parent), "scenario": str(document.get("scenario", ""))}
    tracked = [str(one["statement"]) for one in document.get("tracking", ()) if "statement" in one]
    facts |= {f"tracking {k}" if tracked[1:] else "tracking": text for k, text in enumerate(tracked, 1)}
    facts |= {"simulated": f"{document.get('simulated_seconds', 0.0):.6g} s in {document['steps']:,} steps"}
    facts |= {f"note {k}": str(note) for k, note in enumerate(document.get("notes", ()), 1)}
    beside = {"recording": "recording.parquet", "pictures": "run.html"}
    found = {kind: str(path.with_name(name)) for kind, name in beside.items() if path.with_name(name).is_file()}
    return facts | dict(found), {}


def rounded(value: Json) -> Json:
    """A number as it is read; what is none as it is."""
    return float(f"{value:.4g}") if isinstance(value, float) else value


def _comparison(path: Path) -> Shown:
    document = document_of(path, "recordings", "span", "rows", "differences")
    first = str(document["recordings"][0])
    facts: dict[str, Json] = {
        "comparison": str(path),
        "of": ", ".join(map(str, document["recordings"])),
        "in common": f"{document['span'][0]:.6g} to {document['span'][1]:.6g} s, {document['rows']:,} rows",
    }
    page = path.with_name("compare.html")
    facts |= {"open": str(page)} if page.is_file() else {}
    columns = ("column", "other", "unit", "rms", "largest", "at")
    rows = [{name: rounded(one[name]) for name in columns} for one in document["differences"]]
    return facts, {f"differences from {first}": rows}


def _check(path: Path) -> Shown:
    document = document_of(path, "fmu", "passed", "experiments", "findings")
    words = {True: "pass", False: "FAIL"}
    facts: dict[str, Json] = {"check": str(path), "of": str(document["fmu"]), "result": words[document["passed"]]}
    facts |= {one["name"]: f"{words[one['passed']]}: {one['statement']}" for one in document["findings"]}
    rows: list[Mapping[str, Json]] = [
        {
            "experiment": each["name"],
            "variable": one["variable"],
            "": words[one["passed"]],
            "largest difference": "" if one["largest"] is None else f"{one['largest']:.4g}",
            "allowed": "" if one["allowed"] is None else f"{one['allowed']:.4g}",
            "at [s]": "" if one["at"] is None else f"{one['at']:g}",
            "cause": one["cause"] or "",
        }
        for each in document["experiments"]
        for one in each["variables"]
    ]
    silent = [one for one in document["experiments"] if not one["variables"]]
    facts |= {f"experiment {one['name']}": f"{words[one['passed']]}: {one['reason'] or 'ran'}" for one in silent}
    return facts, {"variables": rows} if rows else {}


_READERS: dict[str, Callable[[Path], Shown]] = {
    DIAGNOSIS: _diagnosis,
    RUN: _run,
    COMPARISON: _comparison,
    CHECK: _check,
}
