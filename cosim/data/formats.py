"""File formats of recordings: bytes to named columns, nothing judged yet.

Text of any layout (also .gz), JSON, Parquet, arrays of NumPy, and what is plugged in (`cosim.support.plugins`): MAT,
HDF5, MDF4, MCAP and bags of ROS 1 and 2. Units come along where a file states them; see `Columns`.
"""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from cosim.data.binary import apart, numpy_files, parquet
from cosim.data.columns import Columns
from cosim.data.limits import LIMIT, allowed_by, short, within
from cosim.data.long_form import in_columns
from cosim.data.questions import OF_ROWS
from cosim.data.text import json_records
from cosim.data.text.own_times import parted
from cosim.data.text.reader import read_text
from cosim.support.errors import RecordingError
from cosim.support.plugins import READERS, loaded, names
from cosim.support.suffixes import JSONS, TEXTS, recordings

CONVERTED = {
    ".tdms": "a TDMS file of LabVIEW; write it as CSV with npTDMS (tdmsinfo, to_dataframe().to_csv) or DIAdem",
    ".ulg": "a log of PX4; write its topics as CSV with ulog2csv (pip install pyulog)",
    ".wpilog": "a log of WPILib; export it as CSV with AdvantageScope",
    ".hoot": "a log of CTRE Phoenix; convert it with owlet to .wpilog or MCAP, or export CSV with AdvantageScope",
    ".bin": "a binary file, perhaps a log of ArduPilot; write that as CSV with mavlogdump.py --format csv",
    ".svdx": "a project of TwinCAT Scope; export its channels as CSV in Scope View",
    ".mdf": "an older MDF file; convert it to MDF4 with asammdf",
    ".blf": "a log of a CAN bus; decode it with its DBC file to MDF4 or CSV (asammdf)",
    **dict.fromkeys((".bbl", ".bfl"), "a log of Betaflight; write it as CSV with blackbox_decode"),
    **dict.fromkeys((".xlsx", ".xls", ".ods"), "a spreadsheet; save its table as CSV"),
    **dict.fromkeys(
        (".pkl", ".pickle"), "a pickle, which is a program and is never loaded; save its table as Parquet or CSV"
    ),
    ".zip": "an archive; unpack it and give the recording in it",
}
"""What a file of a suffix is that is not read here, and how it becomes one that is."""


def read_columns(path: Path, layout: Mapping[str, str] | None = None) -> Columns:
    """Read every column of a file; `layout` is what `--layout` says.

    Raises:
        RecordingError: the file is missing, empty, too large, of an unknown kind, or cannot be read.
        MissingPackageError: its format needs an optional package.
        PlugInError: what is plugged in for its suffix cannot be loaded.
    """
    _check_file(path)
    suffix = suffix_of(path)
    reader = _reader(path, suffix)
    stated = {key: text for key, text in (layout or {}).items() if key not in (LIMIT, *OF_ROWS)}
    here = partial(read_text, stated=stated) if reader is read_text else reader

    def read(path: Path) -> Columns:
        columns = here(path) if suffix in _READERS else apart.read_apart(path, suffix, reader)
        return in_columns(path, parted(path, columns))

    with within(allowed_by(path, (layout or {}).get(LIMIT, ""))):
        columns = apart.explained(path, suffix, read)
    if not any(len(values) for values in columns.values.values()):
        raise RecordingError(f"{path} holds no samples.", culprit=str(path))
    return columns


def is_recording(path: Path) -> bool:
    """Whether a file is of a kind that may hold a recording, and no folder."""
    return suffix_of(path) in recordings() and path.is_file()


def _reader(path: Path, suffix: str) -> Callable[..., Columns]:
    """What reads files of a suffix: one of ours, or what is plugged in for it; else say how it becomes one that is."""
    if suffix in _READERS:
        return _READERS[suffix]
    if (name := suffix.removeprefix(".")) in names(READERS):
        plugged: Callable[..., Columns] = loaded(READERS, name)
        return plugged
    unknown = f"of no known kind{f', {suffix}' if suffix else ''}; known are: {', '.join(recordings())}"
    reason = CONVERTED.get(path.suffix.lower(), unknown)
    raise RecordingError(f"{path} is {reason}.", culprit=str(path))


def _check_file(path: Path) -> None:
    try:
        if not path.exists():
            raise RecordingError(f"{path} does not exist.", culprit=str(path))
    except (OSError, ValueError) as error:  # a name that is too long, or holds a zero byte
        reason = getattr(error, "strerror", None) or str(error)
        raise RecordingError(f"{short(str(path))!r} cannot be opened: {reason}.", culprit=str(path)) from error
    if not path.is_file():
        raise RecordingError(f"{path} is not a file{_inside(path)}.", culprit=str(path))
    if path.stat().st_size == 0:
        raise RecordingError(f"{path} is empty.", culprit=str(path))


def _inside(path: Path) -> str:
    """Name the recording in the folder of a bag."""
    bags = sorted(one.name for one in path.glob("*.*") if one.suffix in (".mcap", ".db3")) if path.is_dir() else []
    return f" but the folder of a bag; give {path / bags[0]}" if bags else ""


def suffix_of(path: Path) -> str:
    """Return the suffix that tells the kind of a file: `.csv`, `.csv.gz`."""
    return "".join(path.suffixes[-2:]).lower() if path.suffix.lower() == ".gz" else path.suffix.lower()


_READERS: dict[str, Callable[..., Columns]] = {
    **dict.fromkeys(TEXTS, read_text),
    **dict.fromkeys(JSONS, json_records.read),
    **{".parquet": parquet.read, ".npz": numpy_files.read, ".npy": numpy_files.read},
}
"""Those that cannot crash or hang on a damaged file; what is plugged in has a process of its own."""
