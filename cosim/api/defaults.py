"""What a diagnosis does where less is given: a card from the recordings, and a recording kept out of the fit."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cosim.data.recording import Recording
from pyfmi_models.card import Card

KEPT = 0.7
"""Share of the time of a single recording that is fitted; the rest proves, which must hold a few swings."""


def split(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording], str]:
    """Keep a recording out of the fit: recordings to fit, those that prove, and a sentence that says so.

    Of several the last one is kept, as recordings are mostly given in the order in which they were taken: what changed
    in the machine meanwhile is seen. A single one is cut in time, which proves less: both parts are one motion of one
    day.
    """
    if len(recordings) > 1:
        *train, last = recordings
        said = f"{last.name}, the last of {len(recordings)} recordings, is for validation and not fitted"
        return train, [last], f"{said}; --heldout chooses another."
    (one,) = recordings
    first = int(KEPT * len(one))
    parts = [_rows(one, slice(0, first), "begin"), _rows(one, slice(first, None), "end")]
    said = f"{one.name} is the only recording: its first {100 * KEPT:.0f} % are fitted, the rest is for validation"
    return parts[:1], parts[1:], f"{said}, which is weaker than a second recording (--heldout)."


def _rows(one: Recording, rows: slice, part: str) -> Recording:
    """Some rows of a recording as one of its own."""
    table, others = ({name: np.array(values[rows]) for name, values in of.items()} for of in (one.table, one.others))
    origin = dict(one.origin)
    if isinstance(origin.get("file"), dict):
        origin["file"] = {**origin["file"], "rows": part}  # type: ignore[dict-item]
    return replace(one, name=f"{one.name} ({part})", table=table, others=others, origin=origin)


def estimated(train: Sequence[Recording], motion: str, on_progress: Callable[[str], None]) -> tuple[Card, str]:
    """Estimate a card from the recordings that may be fitted, and say so."""
    from cosim.api.card import estimated_card  # what most diagnoses are given

    on_progress("estimating a card from the recordings")
    found = estimated_card(train, motion, is_asked=False)
    known = [one for one in found.numbers if one.is_determined]
    names = ", ".join(f"{one.name.rpartition('.')[2]} {one.value:.4g} {one.unit}" for one in known)
    said = f"No card was given; it is estimated from the recordings{': ' if names else ''}{names}."
    return found.card, " ".join([said, *found.notes])
