"""MDF4: the channels of a measurement with their units, on one time base.

A file may convert a channel by a formula, which asammdf has numexpr evaluate: a text of a stranger as Python. What
keeps the worst out there was bypassed before (numexpr 564, 2026), so only plain arithmetic reaches it.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from cosim.data.binary.packages import package, vectors
from cosim.data.columns import Columns
from cosim.data.limits import check_cells, short
from cosim.support.errors import RecordingError

ARITHMETIC, LONGEST = frozenset("0123456789.eEXx+-*/(), \t"), 200
"""Signs of numbers, of the channel itself and of four operations, and how many a formula may have."""


def read(path: Path) -> Columns:
    """Read an MDF file."""
    mdf = package("asammdf", "mdf", path).MDF(path)
    try:
        _check_formulas(path, mdf)
        check_cells(path, max((one.channel_group.cycles_nr for one in mdf.groups), default=0), len(mdf.channels_db))
        frame = mdf.to_dataframe(time_from_zero=False)
        units = {name: str(mdf.get(name).unit or "") for name in frame.columns if name in mdf}
    finally:
        mdf.close()
    values = {"t": frame.index.to_numpy()} | {name: frame[name].to_numpy() for name in frame.columns}
    return Columns(vectors(path, values), {name: unit for name, unit in units.items() if unit})


def _check_formulas(path: Path, mdf: Any) -> None:
    for channel in (one for group in mdf.groups for one in group.channels):
        for formula in _formulas(channel.conversion):
            if not is_arithmetic(formula):
                what = f'channel "{short(channel.name)}" is converted by a formula that is no plain arithmetic'
                rule = "formulas of files are not run; save it with its values converted"
                raise RecordingError(f'{path}: {what}, "{short(formula)}"; {rule}.', culprit=str(path), value=formula)


def is_arithmetic(formula: str) -> bool:
    """Whether a formula adds, subtracts, multiplies and divides, and no more: a power may take for ever."""
    return len(formula) <= LONGEST and ARITHMETIC.issuperset(formula) and "**" not in formula


def _formulas(conversion: Any) -> Iterator[str]:
    """Formulas of a conversion and of those that it refers to."""
    if conversion is None or isinstance(conversion, bytes | str):
        return
    formula = getattr(conversion, "formula", None) or ""
    yield formula if isinstance(formula, str) else bytes(formula).decode("latin-1")
    for other in (getattr(conversion, "referenced_blocks", None) or {}).values():
        yield from _formulas(other)
