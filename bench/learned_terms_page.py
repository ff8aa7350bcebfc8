"""What `learned_terms.py` leaves behind: shares with Wilson's intervals, medians with a bootstrap's, and every row.

A row: world, family, size (abroad: level), seed; verdict; quantities of what is delivered, and of what was only tried;
base, after, floor: held-out errors of the refitted base, of the delivered model, and the best there could be; equation
of the formula; step: time of a step with the term over that without; seconds of processor of the diagnosis.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cosim.support.files import replacing
from cosim.support.version import __version__
from cosim_studies.proof.intervals import Estimate, median, share
from cosim_studies.proof.ledger import commit
from cosim_studies.proof.page import estimate, met
from cosim_studies.proof.score import Bar, judged

Row = dict[str, Any]
Rows = Sequence[Row]
LEAST_REMOVABLE = 0.1
"""Share of the base's error that must be removable, else nothing is asked of a case."""
VARIABLES = {
    "thermal_tilt": "position and temperature",
    "position_temperature_friction": "position and temperature",
    "remanence": "hysteresis over a long stroke",
    "hysteretic_magnetic_drag": "hysteresis over a long stroke",
    "reversal_kick": "time since reversal",
    "distance_memory_friction": "distance since reversal",
    "dead_band": "torque",
    "drive_deadband": "torque",
    "motor_ripple": "torque and position",
    "drive_fade": "torque and temperature",
    "sluggish_oil": "speed and position",
    "acceleration_drag": "speed and acceleration",
    "run_in": "way travelled",
}
"""What each effect depends on, in the words of the terms; those that only depend on the time of day are not here."""
FORMS = {
    "thermal_tilt": r"k\d q T",
    "position_temperature_friction": r"k\d q T",
    "dead_band": r"tanh\(u",
    "drive_deadband": r"u exp\(−\(u/",
    "reversal_kick": r"exp\(−t/",
    "distance_memory_friction": r"exp\(−d/",
    "motor_ripple": r"command.*sin\(2π\(q",
    "drive_fade": r"command.*k\d T(?![²³])",
    "sluggish_oil": r"v f.*sin\(2π\(q",
    "acceleration_drag": r"v f.*\|a\|",
}
"""What the equation of each effect that has a closed form must hold; hysteresis has none. The torque that a dead band
at home withholds is a clipped line, of which tanh is the form there is; abroad it is a pulse."""
HOWEVER = """
`removed`: (base - after) / (base - floor), of cases where at least a tenth of the base's error can be removed. `floor`:
at home what the refitted base leaves of the same machine, motion and noise without the effect; abroad the true
structure refitted. Effects that only depend on the time (rubbing, random_walk, payload_comes, ground) can be removed
by no function of what is recorded; they stand in a row of their own and in that of all.
"""


def removed(row: Row) -> float | None:
    """Share of what could be removed that is; None where there is next to nothing to remove."""
    base, floor = float(row["base"]), float(row["floor"])
    return (base - float(row["after"])) / (base - floor) if base - floor > LEAST_REMOVABLE * base else None


def unknowns(rows: Rows, learnable: bool = False) -> list[Row]:
    """Cases with an effect outside the catalogue, of medium and large size."""
    own = [row for row in rows if row["family"] != "none" and row["size"] != "subtle"]
    return [row for row in own if row["family"] in VARIABLES or not learnable]


def _removed(rows: Rows) -> list[float]:
    return [share for row in rows if (share := removed(row)) is not None]


def has_form(row: Row) -> bool:
    """Whether the equation that is proposed is the true one's."""
    return bool(re.search(FORMS[row["family"]], row["equation"]))


def _delivered(rows: Rows) -> list[Row]:
    return [row for row in rows if row["quantities"]]


def _worse(rows: Rows) -> Estimate:
    return share([row["after"] > row["before_learned"] for row in _delivered(rows)])


def _right_variables(rows: Rows) -> Estimate:
    return share([VARIABLES[r["family"]] in r["quantities"] for r in unknowns(rows, learnable=True)])


def _right_form(rows: Rows) -> Estimate:
    return share([has_form(row) for row in unknowns(rows) if row["family"] in FORMS])


BARS = (
    Bar("removed", "removed, median, what depends on the motion", lambda r: median(_removed(unknowns(r, True))), 0.6),
    Bar("removed_all", "removed, median, all effects", lambda rows: median(_removed(unknowns(rows))), 0.6),
    Bar("better", "never worse than the base", lambda r: share([x >= 0 for x in _removed(unknowns(r))]), 0.95),
    Bar("worse", "delivered, and worse on the recording that may veto it", _worse, most=0.0),
    Bar("delivered", "a term is delivered", lambda rows: share([bool(r["quantities"]) for r in unknowns(rows)])),
    Bar(
        "nulls",
        "nothing concealed: a term is delivered",
        lambda rows: share([bool(r["quantities"]) for r in rows if r["family"] == "none"]),
        most=0.02,
    ),
    Bar("variables", "the right variables, what depends on the motion", _right_variables, 0.8),
    Bar("form", "the right form, where there is a closed one", _right_form, 0.5),
    Bar("step", "time of a step with the term, median", lambda r: median([x["step"] for x in _delivered(r)]), most=1.3),
    Bar("slowest", "of those, above 1.3", lambda rows: share([x["step"] > 1.3 for x in _delivered(rows)])),
)


def write(out: Path, rows: Rows, facts: Mapping[str, Any]) -> None:
    """Write README.md and learned.json, each complete or as it was."""
    whole = {**facts, "version": __version__, "commit": commit(), "played": len(rows)}
    whole |= {"scores": [judged(bar, rows) for bar in BARS], "rows": list(rows)}
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps(whole, allow_nan=False, indent=1) + "\n"
    for name, content in {"README.md": page(whole), "learned.json": text}.items():
        with replacing(out / name, force=True) as partial:
            partial.write_text(content, "utf-8")


def page(found: Mapping[str, Any]) -> str:
    """The page for people."""
    lines = [
        "# What a learned term is worth",
        "",
        f"    {found['command']}",
        "",
        f"mount-cosim {found['version']}, commit {found['commit']}, code {found['code']}; purpose: {found['purpose']}; "
        f"{found['played']} cases in {found['seconds']:.0f} s. All decks: [decks.md](../decks.md).",
        "",
        *HOWEVER.strip().splitlines(),
        "",
        "| | value [95 %] | cases | asked | |",
        "|---|---|---|---|---|",
        *(
            f"| {one['title']} | {estimate(one)} | {one['n']} | {one['asked']} | {met(one)} |"
            for one in found["scores"]
        ),
        "",
        "| world | concealed | size | verdict | learned | removed | formula | step |",
        "|---|---|---|---|---|---|---|---|",
        *(_line(row) for row in found["rows"]),
    ]
    return "\n".join(lines) + "\n"


def _line(row: Row) -> str:
    learned = ", ".join(row["quantities"]) or (f"tried: {', '.join(row['tried'])}" if row["tried"] else "")
    gone, verdict = removed(row), " + ".join(row["verdict"]) or "none"
    cells = (learned, "" if gone is None else f"{gone:.2f}", row["equation"].replace("|", "∣"))
    step = f"{row['step']:.2f}" if row["step"] else ""
    return f"| {row['world']} | {row['family']} | {row['size']} | {verdict} | {' | '.join(cells)} | {step} |"
