"""What calibrations and checks of FMUs wrote, on one screen."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from cosim.support.plain import Json, Parsed

Shown = tuple[dict[str, Json], dict[str, Sequence[Mapping[str, Json]]]]


def calibration(path: Path, document: Parsed) -> Shown:
    """Tell what `identify --fmu` or `--system` found: numbers, what is not determined, errors of the outputs."""
    facts: dict[str, Json] = {"calibration": str(path), "of": str(document["source"]["name"])}
    facts |= {f"note {k}": str(note) for k, note in enumerate(document.get("notes", ()), 1)}
    for kind in ("report", "fmu", "parameter_set"):
        beside = path.with_name(str(document.get("files", {}).get(kind, "")) or "-")
        facts |= {kind.replace("_", " "): str(beside)} if beside.is_file() else {}
    numbers = [
        {
            "number": name,
            "value": f"{one['value']:.6g}",
            "standard error": "not determined" if (error := one["standard_error"]) is None else f"{error:.2g}",
            "unit": one["unit"],
            "was": f"{one['start']:.4g}",
        }
        for name, one in document["numbers"].items()
    ]
    undetermined = [{"sentence": str(one["statement"])} for one in document.get("not_determined", ())]
    fitted = [{"recording": one["recording"], **_errors(one["output"], one)} for one in document["outputs"]]
    held = [{"recording": "kept out", **_errors(name, one)} for name, one in (document["heldout"] or {}).items()]
    tables = {"numbers": numbers, "not determined": undetermined, "RMS error of each output": fitted + held}
    return facts, {name: rows for name, rows in tables.items() if rows}


def _errors(output: str, one: Parsed) -> dict[str, Json]:
    return {
        "output": output,
        "before": f"{one['before_rms']:.3g}",
        "after": f"{one['after_rms']:.3g}",
        "unit": str(one["unit"]),
    }


def checked(path: Path, document: Parsed) -> Shown:
    """Tell what `check` found: experiments with their variables, and what was looked at beside."""
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
