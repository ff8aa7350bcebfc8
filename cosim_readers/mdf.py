"""MDF4: the channels of a measurement with their units, each group with its own times.

Samples that the file marks as invalid are NaN here. A channel that several groups hold is named after its device.

A file may convert a channel by a formula, which asammdf has numexpr evaluate: a text of a stranger as Python. What
keeps the worst out there was bypassed before (numexpr 564, 2026), so only plain arithmetic reaches it.
"""

import mmap
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import check_cells, check_unpacked, listed, short
from cosim.support.errors import RecordingError
from cosim_readers.package import package

ARITHMETIC, LONGEST = frozenset("0123456789.eEXx+-*/(), \t"), 200
"""Signs of numbers, of the channel itself and of four operations, and how many a formula may have."""
PACKED, STATED = b"##DZ", 32
"""Mark of a packed block, and where in it its size unpacked is stated (ASAM MDF 4.2, DZBLOCK)."""
TIME = 1
"""Kind of a master channel that is a time; others are angles, distances and indices (ASAM MDF 4.2, cn_sync_type)."""


def read(path: Path) -> Columns:
    """Read an MDF file."""
    opener = package("asammdf", "mdf", path).MDF
    _check_packed(path)
    mdf = opener(path)
    try:
        _check_formulas(path, mdf)
        check_unpacked(path, sum(one.cycles_nr * _bytes(one) for one in (group.channel_group for group in mdf.groups)))
        check_cells(path, max((one.channel_group.cycles_nr for one in mdf.groups), default=0), len(mdf.channels_db))
        return _columns(path, mdf)
    finally:
        mdf.close()


def _check_packed(path: Path) -> None:
    """Refuse packed blocks that say that they unpack to more than the file may."""
    size = 0
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        place = data.find(PACKED)
        while place >= 0:
            size += int.from_bytes(data[place + STATED : place + STATED + 8], "little")
            check_unpacked(path, size, "what is packed in it")
            place = data.find(PACKED, place + len(PACKED))


def _bytes(group: Any) -> int:
    """Return the bytes of a record of a group of channels."""
    return int(group.samples_byte_nr) + int(getattr(group, "invalidation_bytes_nr", 0))


def _columns(path: Path, mdf: Any) -> Columns:
    signals = [signal for group in mdf.virtual_groups for signal in _signals(mdf, group)]
    untimed = tuple(signal.name for signal in signals if (signal.master_metadata or ("", 0))[1] != TIME)
    signals = [one for one in signals if one.name not in untimed]
    if untimed and not signals:
        text = f"{path}: none of its channels has a time: {listed(untimed)}."
        raise RecordingError(text, culprit=str(path), value="t")
    names = _names(mdf, signals)
    values = {name: _valid(one) for name, one in zip(names, signals, strict=True)}
    units = {name: str(one.unit) for name, one in zip(names, signals, strict=True) if one.unit}
    clocks = {name: one.timestamps for name, one in zip(names, signals, strict=True)}
    notes = (f"{path.stem}: channels without a time were left out: {listed(untimed)}.",) if untimed else ()
    return Columns(values, units, clocks=clocks, notes=notes)


def _signals(mdf: Any, group: int) -> Iterator[Any]:
    """Channels of a group that are numbers, one a sample."""
    pairs = [(None, own, place) for own, places in mdf.included_channels(group)[group].items() for place in places]
    signals = mdf.select(pairs, copy_master=False) if pairs else ()
    yield from (one for one in signals if one.samples.dtype.kind in "fiub" and one.samples.ndim == 1)


def _valid(signal: Any) -> np.ndarray:
    samples = np.asarray(signal.samples, dtype=np.float64)
    bits = signal.invalidation_bits
    return samples if bits is None else np.where(np.asarray(bits, bool), np.nan, samples)


def _names(mdf: Any, signals: Sequence[Any]) -> list[str]:
    """Names of channels; of those of one name the name of the device, or the number of the group, stands before it."""
    often = Counter(one.name for one in signals)
    devices = [_device(mdf, one) for one in signals]
    alike = Counter((device, one.name) for device, one in zip(devices, signals, strict=True))
    told = [
        device if device and alike[device, one.name] == 1 else f"group {one.group_index + 1}"
        for device, one in zip(devices, signals, strict=True)
    ]
    return [
        f"{label}.{one.name}" if often[one.name] > 1 else one.name for label, one in zip(told, signals, strict=True)
    ]


def _device(mdf: Any, signal: Any) -> str:
    group = mdf.groups[signal.group_index].channel_group
    return str(getattr(group, "acq_name", "") or getattr(signal.source, "name", "") or "")


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
