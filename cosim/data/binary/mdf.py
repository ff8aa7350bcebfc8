"""MDF4: the channels of a measurement with their units, on one time base.

A file may convert a channel by a formula, which asammdf has numexpr evaluate: a text of a stranger as Python. What
keeps the worst out there was bypassed before (numexpr 564, 2026), so only plain arithmetic reaches it.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cosim.data.binary.packages import package, vectors
from cosim.data.columns import Columns
from cosim.data.limits import check_cells, short
from cosim.support.errors import RecordingError

ARITHMETIC = re.compile(r"(?!.*\*\*)(?:[Xx]\d?|\d+\.?\d*(?:[eE][+-]?\d+)?|[-+*/(),\s])*")
"""Numbers, the channel itself and four operations; no powers, which may take for ever."""


def read(path: Path) -> Columns:
    """Read an MDF file."""
    mdf = package("asammdf", "mdf", path).MDF(path)
    _check_formulas(path, mdf)
    check_cells(path, max((group.channel_group.cycles_nr for group in mdf.groups), default=0), len(mdf.channels_db))
    frame = mdf.to_dataframe(time_from_zero=False)
    units = {name: str(mdf.get(name).unit or "") for name in frame.columns if name in mdf}
    values = {"t": frame.index.to_numpy()} | {name: frame[name].to_numpy() for name in frame.columns}
    mdf.close()
    return Columns(vectors(path, values), {name: unit for name, unit in units.items() if unit})


def _check_formulas(path: Path, mdf: Any) -> None:
    for channel in (one for group in mdf.groups for one in group.channels):
        for formula in _formulas(channel.conversion):
            if not ARITHMETIC.fullmatch(formula):
                text = (
                    f'{path}: channel "{short(channel.name)}" is converted by a formula that is no plain arithmetic, '
                )
                rule = "and formulas of files are not run; save it with its values converted."
                raise RecordingError(f'{text}"{short(formula)}", {rule}', culprit=str(path), value=formula)


def _formulas(conversion: Any) -> Iterator[str]:
    """Formulas of a conversion and of those that it refers to."""
    if conversion is None or isinstance(conversion, bytes | str):
        return
    formula = getattr(conversion, "formula", None) or ""
    yield formula if isinstance(formula, str) else bytes(formula).decode("latin-1")
    for other in (getattr(conversion, "referenced_blocks", None) or {}).values():
        yield from _formulas(other)
