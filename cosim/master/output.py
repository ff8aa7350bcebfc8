"""Where a recording goes, and what it says about where it comes from."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.data.writer import MemoryWriter, StreamWriter
from cosim.support.files import check_room as check_room_at
from cosim.support.version import __version__
from cosim.system.plan import Plan
from cosim.system.system import System
from cosim.system.wiring import Wiring

if TYPE_CHECKING:
    from cosim.data.recording import Recording

Settings = Mapping[str, Mapping[str, Any]]


def check_room(system: System, path: Path | None) -> None:
    """Refuse a recording for which disk or memory has no room."""
    rows, columns = -(-system.ticks // system.decimation), len(system.records) + 1
    advice = "record fewer signals, or one row in more ticks (decimation), or stop earlier"
    check_room_at(path, 8 * rows * columns, f"the recording has {rows:,} rows; {advice}")


def writer_of(
    wiring: Wiring, plan: Plan, origin: Mapping[str, Any], path: Path | None, force: bool = False
) -> MemoryWriter:
    """Return what takes the rows of a plan: a file where a path is given."""
    units = {"t": "s"} | {key: wiring.unit(one) for key, one in wiring.records.items()}
    columns = zip(wiring.records, plan.columns, strict=False)  # what is watched comes after
    kinds = {name: column.kind for name, column in columns if column.kind}
    if path is not None:
        return StreamWriter(path, units, dict(origin), force, kinds)
    return MemoryWriter(units, dict(origin), kinds)


def kept(writer: MemoryWriter, name: str) -> "Recording":
    """Return what a writer without a file holds."""
    from cosim.data.recording import Recording

    known = {key: unit for key, unit in writer.units.items() if unit}
    columns = writer.table()
    others = {key: columns[key] for key in writer.kinds}
    table = {key: np.asarray(one, np.float64) for key, one in columns.items() if one.dtype != object}
    return Recording(name, table, known, writer.origin, others=others)


def origin_of(wiring: Wiring, settings: Settings, plan: Plan) -> Mapping[str, Any]:
    """Say where a recording comes from."""
    return {
        "version": f"mount-cosim {__version__}",
        "step": plan.step,
        "start": plan.start,
        "decimation": plan.decimation,
        "algorithm": wiring.algorithm.model_dump(),
        "every": dict(wiring.every),
        "faults": [fault.model_dump() for fault in wiring.faults],
        "components": {name: {**one.origin, "parameters": settings[name]} for name, one in wiring.components.items()},
        "wires": [asdict(wire) for wire in wiring.wires],
        "record": {name: asdict(record) for name, record in wiring.records.items()},
        "items": _items(wiring),
    }


def _items(wiring: Wiring) -> dict[str, dict[int, str]]:
    """Name the values of recorded enumerations, by column."""
    ports = {name: wiring.port(record.signal) for name, record in wiring.records.items()}
    return {name: dict(port.items) for name, port in ports.items() if port is not None and port.items}
