"""HDF5, and MAT v7.3 which is HDF5: every dataset that is a vector or a table of them, whatever its group.

A file is read from itself alone: links and datasets that lead to other files are refused, and so is what costs more
than it holds (`hdf5_chunks`).
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.binary.channels import columns_of_arrays, is_table
from cosim.data.columns import Columns
from cosim.data.limits import check_cells, check_columns, check_time, short
from cosim.support.errors import RecordingError
from cosim_readers.hdf5_chunks import check_chunks, pieces
from cosim_readers.package import package

INTERNAL, HANDLE = "#", "MATLAB_object_decode"
"""First sign of the groups in which MATLAB keeps its objects, and the attribute of what leads to one."""
UNITS = ("unit", "units")
"""Attributes of a dataset in which tools write its unit."""
DEEPEST = 100
"""Groups within each other; the library itself ends the process at some ten thousands."""


def read(path: Path) -> Columns:
    """Read an HDF5 file; datasets of one name in several groups keep the name of their group."""
    h5py = package("h5py", "hdf5", path)
    with h5py.File(path, "r") as file:
        items = _vectors(path, h5py, file)
        arrays = {name: _values(path, item) for name, item in items.items()}
        stated = {name: text for name, item in items.items() if (text := _unit(item))}
        objects = any(name.startswith(INTERNAL) for name in file)
    columns = columns_of_arrays(path, arrays, stated, "/")
    if objects and not columns.values:
        raise opaque(path)
    return columns


def opaque(path: Path) -> RecordingError:
    """Refuse a MAT file that holds nothing but objects."""
    text = (
        f"{path} holds MATLAB objects (a table, timeseries or Dataset of Simulink), which only MATLAB can open. There, "
        "save their numbers: writetable, or vectors t, q, tau with save"
    )
    return RecordingError(f"{text}.", culprit=str(path))


def _vectors(path: Path, h5py: Any, file: Any) -> dict[str, Any]:
    """Return the numeric datasets by path that have at most one dimension longer than one, and tables."""
    items: dict[str, Any] = {}
    for name, item in _datasets(path, h5py, file):
        numeric = item.dtype.kind in "fiub" and item.shape is not None and HANDLE not in item.attrs
        if numeric and (sum(length > 1 for length in item.shape) <= 1 or is_table(item.shape)):
            items[name] = item
            check_columns(path, len(items))
    check_cells(path, sum(int(item.size) for item in items.values()), 1)
    for name, item in items.items():
        check_chunks(path, name, item)
    return items


def _datasets(path: Path, h5py: Any, file: Any) -> Iterator[tuple[str, Any]]:
    """Walk through groups to their datasets, each once, whatever refers to it."""
    seen, waiting = set(), [(file.id, "")]
    while waiting:
        group, above = waiting.pop()
        for link in _links(path, h5py, group, above):
            name = f"{above}{link.decode('utf-8', 'replace')}"
            about = h5py.h5o.get_info(group, link)
            key = about.fileno, about.addr
            if key in seen or name.startswith(INTERNAL):
                continue
            seen.add(key)
            check_time(path)
            if about.type == h5py.h5o.TYPE_GROUP:
                if name.count("/") >= DEEPEST:
                    text = f"{path} has more than {DEEPEST} groups within each other, beginning at"
                    raise RecordingError(f'{text} "{short(name)}".', culprit=str(path), value=DEEPEST)
                waiting.append((h5py.h5o.open(group, link), f"{name}/"))
            elif about.type == h5py.h5o.TYPE_DATASET:
                item = h5py.Dataset(h5py.h5o.open(group, link))
                _check_own(path, name, item)
                yield name, item


def _links(path: Path, h5py: Any, group: Any, above: str) -> list[bytes]:
    """Return the names of a group's objects; a link to another file is refused, one within the file is an alias."""
    names: list[bytes] = []
    group.links.iterate(names.append)
    own: list[bytes] = []
    for name in names:
        kind = group.links.get_info(name).type
        check_time(path)
        if kind == h5py.h5l.TYPE_HARD:
            own.append(name)
        elif kind != h5py.h5l.TYPE_SOFT:
            to = group.links.get_val(name)[0].decode("utf-8", "replace") if kind == h5py.h5l.TYPE_EXTERNAL else "there"
            raise _elsewhere(path, f"{above}{name.decode('utf-8', 'replace')}", "is a link to another file", to)
    return own


def _check_own(path: Path, name: str, item: Any) -> None:
    """Refuse a dataset whose numbers are not in the file itself."""
    plan = item.id.get_create_plist()
    if plan.get_external_count():
        raise _elsewhere(
            path, name, "keeps its numbers in another file", plan.get_external(0)[0].decode("utf-8", "replace")
        )
    if item.is_virtual:
        raise _elsewhere(path, name, "is put together from other datasets", plan.get_virtual_filename(0))


def _elsewhere(path: Path, name: str, what: str, where: str) -> RecordingError:
    rule = "a recording is read from its own file alone. Copy it into one: h5repack or h5copy"
    text = f'{path}: "{short(name)}" {what} ({short(where)}); {rule}.'
    return RecordingError(text, culprit=str(path), value=where)


def _values(path: Path, item: Any) -> np.ndarray:
    """Return the numbers of a dataset, read in pieces between which the time is looked at."""
    values = np.empty(item.shape, item.dtype)
    for piece in pieces(item):
        check_time(path)
        values[piece] = item[piece]
    return np.squeeze(values)


def _unit(item: Any) -> str:
    """Return the unit that an attribute states; one that is no single text states none."""
    for key in UNITS:
        if key in item.attrs:
            about = item.attrs.get_id(key)
            stated = item.attrs[key] if about.shape in ((), (1,)) and about.dtype.kind in "OS" else ""
            one = stated[0] if isinstance(stated, np.ndarray) else stated
            return one.decode("utf-8", "replace") if isinstance(one, bytes) else one if isinstance(one, str) else ""
    return ""
