"""Tables that lie on their side: a line holds a signal, its name in front, and perhaps its unit.

    t [ms],0,1,2,3, ...
    tau,Nm,1.2,1.3,1.3,1.4, ...

Few long lines of equally many numbers are read so, and no others: a table with more columns than rows is none.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_cells
from cosim.data.text.fields import NOTHING, is_value, split
from cosim.data.text.layout import Layout
from cosim.data.text.table import names_of
from cosim.data.text.unit_words import is_unit

LINES = 100
"""Lines that such a table has at most, its preamble among them: a log of an axis has some tens of signals."""
SAMPLES = 50
"""Numbers that each of its lines has at least; more than any preamble has."""
LONGER = 5
"""A line has so many times as many numbers as there are lines: else it may stand upright."""
SEPARATORS = ("\t", ";", ",", " ")
HEAD = 4096
"""Bytes of a line by which its separator is judged."""


Signal = tuple[str, str, Sequence[str]]
"""A line: its name and unit, as far as they are there, and its numbers as they are written."""


def read(path: Path, data: bytes) -> Columns | None:
    """Read a table that lies on its side; None if a text is none such."""
    if data.count(b"\n") > LINES:
        return None
    lines = [line.strip() for line in data.decode("utf-8", "replace").split("\n")]
    long = [line for line in lines if len(line) > 2 * SAMPLES]
    separator = next((sign for sign in SEPARATORS if long and all(one[:HEAD].count(sign) > 3 for one in long)), "")
    if len(long) < 2 or not separator:
        return None
    check_cells(path, max(line.count(separator) for line in long), len(long))
    signals = [_signal(line.rstrip(f"{separator};"), separator) for line in long]
    count = len(signals[0][2])
    if any(len(numbers) != count for _, _, numbers in signals) or count < max(SAMPLES, LONGER * len(signals)):
        return None
    return _columns(path, signals, separator)


def _signal(line: str, separator: str) -> Signal:
    """Part a line into its name, its unit and its numbers."""
    fields = split(line, separator)
    first = next((place for place, field in enumerate(fields) if is_value(field, ".") or is_value(field, ",")), 0)
    lead = fields[:first]
    unit = lead.pop() if len(lead) > 1 and is_unit(lead[-1].strip("[]() ")) else ""
    return " ".join(lead).lstrip("#% "), unit, fields[first:]


def _columns(path: Path, signals: Sequence[Signal], separator: str) -> Columns | None:
    decimal = "," if separator != "," and any("," in text for *_, one in signals for text in one[:SAMPLES]) else "."
    plain = [[text.replace(decimal, ".") for text in numbers] for *_, numbers in signals]
    try:
        arrays = [np.array([np.nan if text in NOTHING else float(text) for text in one]) for one in plain]
    except ValueError:
        return None
    named = all(name for name, _, _ in signals)
    words = tuple(name for name, _, _ in signals) if named else ()
    stated = tuple(text for _, text, _ in signals) if named else ()
    layout = Layout(separator, decimal, len(signals), 0, words, stated)
    names, units, contradictions = names_of(layout)
    note = f"{path.stem}: its table lies on its side and was turned: each of its {len(signals)} long lines is a column."
    return Columns(
        dict(zip(names, arrays, strict=True)),
        units,
        layout=f"a signal a line, {layout}",
        notes=(note,),
        numbered=not named,
        contradictions=contradictions,
    )
