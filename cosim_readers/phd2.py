"""Guide logs of PHD2: where the guide star was, in camera pixels, and what the mount was told.

Only the longest stretch of guiding is read. `RARawDistance` and `DECRawDistance` are how far the star was from its lock
position along the axes [px], which the pixel scale of the log makes an angle; `RAGuideDistance` is what was corrected.
There is no torque in it.
Source: `GuidingHeader` and `GuideStep` in guidinglog.cpp of PHD2, log version 2.5.
"""

import csv
import re
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from cosim.data.columns import Columns
from cosim.data.limits import short
from cosim.support.errors import RecordingError

SCALE = re.compile(r"Pixel scale = (?!0*\.?0* )(\d+\.?\d*) arc-sec/px")
BEGINS = re.compile(r"Guiding Begins at (\d{4}-\d\d-\d\d) (\d\d:\d\d:\d\d)")
ANGLES = ("RARawDistance", "DECRawDistance", "RAGuideDistance", "DECGuideDistance")
OTHERS = {"RADuration": "ms", "DECDuration": "ms", "StarMass": "", "SNR": ""}
NO_TORQUE = (
    "a PHD2 guide log holds where a guide star was, and no torque: what friction, cogging or a drive do cannot be told "
    "from it. Drift, periodic error and how well it was guided can: cosim show"
)


def recognises(lines: Sequence[str]) -> bool:
    """Whether a text is a guide log of PHD2."""
    return bool(lines) and lines[0].startswith("PHD2 version") and "Log version" in lines[0]


def read(path: Path, data: bytes, lines: Sequence[str]) -> Columns:
    """Read the longest stretch of guiding of a guide log."""
    text = data.decode("utf-8", "replace")
    sections = [*re.split(r"(?=Guiding Begins at )", text)[1:]]
    if not sections:
        raise RecordingError(f"{path} is a PHD2 guide log in which nothing was guided.", culprit=str(path))
    longest = max(sections, key=lambda section: section.count("\n"))
    notes = [f"{path.stem}: the longest of {len(sections)} stretches of guiding was read."] if len(sections) > 1 else []
    table, dropped = _steps(path, longest)
    if dropped:
        notes.append(f"{path.stem}: {dropped} frames in which the star was lost were left out.")
    scale, began = SCALE.search(longest), BEGINS.match(longest)
    unit = f"{scale[1]} arcsec" if scale else "px"
    if not scale:
        notes.append(f"{path.stem}: the log states no pixel scale, so angles stay in pixels.")
    units = {"t": "s"} | dict.fromkeys(ANGLES, unit if scale else "") | OTHERS
    return Columns(
        table,
        {name: text for name, text in units.items() if text and name in table},
        format="PHD2 guide log",
        start=_start(f"{began[1]}T{began[2]}") if began else "",
        roles={"q": "RARawDistance"},
        lacks={"tau": NO_TORQUE},
        notes=tuple(notes),
    )


def _steps(path: Path, section: str) -> tuple[dict[str, np.ndarray], int]:
    """Return the guide steps by column, and the number of frames without a star."""
    body = section[section.find("Frame,Time") :].split("\n") if "Frame,Time" in section else []
    names = next(csv.reader(body[:1]), [])
    rows = [row for row in csv.reader(line for line in body[1:] if line[:1].isdigit()) if len(row) >= 3]
    kept = [row for row in rows if row[2] != "DROP" and len(row) >= len(names)]
    wanted = {"t": "Time"} | {name: name for name in (*ANGLES, *OTHERS) if name in names}
    try:
        places = {ours: names.index(theirs) for ours, theirs in wanted.items()}
        table = {ours: np.array([float(row[place] or 0) for row in kept]) for ours, place in places.items()}
    except ValueError as error:
        raise RecordingError(f"{path}: {short(str(error))}, in the guide steps.", culprit=str(path)) from None
    return table, len(rows) - len(kept)


def _start(text: str) -> str:
    """Return when guiding began; nothing where the log holds no date."""
    try:
        return datetime.fromisoformat(text).isoformat()
    except ValueError:
        return ""
