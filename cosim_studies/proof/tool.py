"""The tool under test, as a user has it: a folder with recordings and a card in, an answer out; nothing else is known.

`answer` is the function that is tested; any other with the same signature may take its place.
"""

from math import pi
from pathlib import Path

from cosim.data.recording import Recording
from cosim.delivery.deliver import as_json
from cosim.diagnosis.answer.result import Diagnosis
from cosim.diagnosis.diagnose import diagnose
from cosim.reading import read_recordings
from cosim.support.plain import JsonObject, Parsed
from cosim_studies.proof.baselines import compared
from cosim_studies.proof.simulated_axis import RECORDINGS
from pyfmi_models.card import Card, read_card

KEPT = ("verdict", "ambiguous_with", "friction_law", "intervals", "depends_on", "seconds", "version")
OFFERED = ("found", "ambiguous", "not_proven")
"""Answers about an effect that are kept; the others say that it was not seen."""


def given(folder: str) -> tuple[Card, list[Recording], Recording]:
    """Card, training recordings and the held-out one of a folder."""
    card = read_card(Path(folder) / "card.toml")
    paths = [Path(folder) / f"{name}.parquet" for name in RECORDINGS]
    *train, held = read_recordings(paths, card.columns, None, None, card.mount.motion)
    return card, train, held


def answer(folder: str) -> JsonObject:
    """Diagnose, and let the baselines have a look at the same residual."""
    card, train, held = given(folder)
    found = diagnose(train, [held], card).diagnosis
    return scored(found) | {"baselines": compared(found.traces, 2 * pi if card.mount.motion == "linear" else 1.0)}


def scored(found: Diagnosis) -> JsonObject:
    """What of `diagnosis.json` is scored, and the window of time of each recording that was looked at."""
    whole: Parsed = as_json(found)
    parts = ("effect", "answer", "probability", "parameters", "where")
    offered = [{name: one[name] for name in parts} for one in whole["effects"] if one["answer"] in OFFERED]
    windows = {trace.name: [float(trace.t[0]), float(trace.t[-1])] for trace in found.traces}
    return {name: whole[name] for name in KEPT} | {
        "effects": offered,
        "heldout": whole["heldout"],
        "windows": windows,
    }
