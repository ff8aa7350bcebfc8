"""What `cosim show` tells of a calibration."""

from pathlib import Path

from cosim.api.show_results import Shown, document_of
from cosim.support.plain import Json, Parsed


def of_identified(path: Path) -> Shown:
    """Tell what `identify --fmu` or `--system` found: numbers, what is not determined, errors of the outputs."""
    document = document_of(path, "source", "numbers", "outputs", "heldout")
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
