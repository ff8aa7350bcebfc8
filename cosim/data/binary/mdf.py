"""MDF4: the channels of a measurement with their units, on one time base."""

from pathlib import Path

from cosim.data.binary.packages import package, vectors
from cosim.data.columns import Columns
from cosim.data.limits import check_cells


def read(path: Path) -> Columns:
    """Read an MDF file."""
    mdf = package("asammdf", "mdf", path).MDF(path)
    check_cells(path, max((group.channel_group.cycles_nr for group in mdf.groups), default=0), len(mdf.channels_db))
    frame = mdf.to_dataframe(time_from_zero=False)
    units = {name: str(mdf.get(name).unit or "") for name in frame.columns if name in mdf}
    values = {"t": frame.index.to_numpy()} | {name: frame[name].to_numpy() for name in frame.columns}
    mdf.close()
    return Columns(vectors(path, values), {name: unit for name, unit in units.items() if unit})
