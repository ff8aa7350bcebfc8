"""A recording on one screen: facts, a table of its columns, a line of blocks or a picture of each over time."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cosim.data.guiding import guiding
from cosim.data.preview import Preview
from cosim.data.recording import Recording
from cosim.plots.quantities import scale_of
from cosim.plots.style import AFTER, STYLE, Array, thin
from cosim.support.errors import OutputError
from cosim.support.files import replacing
from cosim.support.plain import JsonObject

BLOCKS = "▁▂▃▄▅▆▇█"
WIDTH = 16
"""Blocks of a line: what fits beside the numbers on a screen of 100 characters."""
MEANINGS = {
    "t": "time",
    "tau": "torque",
    "q": "position",
    "v": "speed",
    "q_d": "set point",
    "temperature": "temperature",
}
PICTURES = (".svg", ".png")
DRAWN = 12
"""Columns that a picture holds."""


def facts(shown: Preview) -> JsonObject:
    """Return what a file is, and what to say to use it."""
    recording, found = shown.recording, shown.found
    told: JsonObject = {"written by": found.format, "laid out as": found.layout}
    told |= facts_of(recording)
    told |= {f"undecided {number}": text for number, text in enumerate(shown.undecided, 1)}
    told |= guiding(recording) if found.format == "PHD2 guide log" else {}
    named = "options, for example" if shown.undecided else "options"
    told |= {"as an axis": shown.refused} if shown.refused else {named: shown.said or "none are needed"}
    return {name: value for name, value in told.items() if value}


def facts_of(recording: Recording) -> JsonObject:
    """Return what a recording is."""
    told: JsonObject = {
        "rows": len(recording),
        "rate": f"{1 / recording.sample_time:.6g} Hz",
        "duration": f"{recording.duration:.6g} s",
        "gaps": str(len(recording.gaps)),
        "jitter": f"{recording.jitter:.2%} rms of the sample time",
        "sha256": recording.sha256,
    }
    kept = {"began": "start", "version": "version", "command": "command", "complete": "complete"}
    told |= {name: recording.origin[key] for name, key in kept.items() if recording.origin.get(key)}
    return told | {f"note {number}": note for number, note in enumerate(recording.quality(), 1)}


TAKEN_AS = {"tau": "N.m or N", "q": "rad or m", "q_d": "rad or m", "v": "rad/s or m/s", "temperature": "degC"}
"""Units that are taken where a file states none: those of a rotary axis or of a linear one, as the card says."""


def rows(recording: Recording, sources: Mapping[str, str] | None = None) -> list[dict[str, str]]:
    """Return one row a column: its name in the file, what it serves as, its unit, its range and how it goes."""
    return [
        {
            "column": (sources or {}).get(name, name),
            "serves as": _serving(name),
            "unit": recording.units.get(name, TAKEN_AS.get(name, "?")),
            "least": f"{recording[name].min():.6g}",
            "greatest": f"{recording[name].max():.6g}",
            "mean": f"{recording[name].mean():.6g}",
            "over time": blocks(recording[name]),
        }
        for name in recording
    ]


def _serving(name: str) -> str:
    meaning = MEANINGS.get(name, "")
    return f"{name} ({meaning})" if meaning not in ("", name) else meaning


def blocks(values: Array, width: int = WIDTH) -> str:
    """Draw a column as a line of blocks, each as high as the mean of its part between least and greatest."""
    parts = [part.mean() for part in np.array_split(values, min(width, len(values)))]
    low, high = min(parts), max(parts)
    if not high > low:
        return BLOCKS[0] * len(parts)
    return "".join(BLOCKS[int((part - low) / (high - low) * (len(BLOCKS) - 1) + 0.5)] for part in parts)


def draw(recording: Recording, sources: Mapping[str, str], path: Path, force: bool = False) -> Path:
    """Draw every column over time into an SVG or PNG file, our own columns first.

    Raises:
        OutputError: the file exists and `force` is not set, it cannot be written, or is no kind of picture.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    if path.suffix.lower() not in PICTURES:
        text = f"{path} cannot be drawn; a picture becomes: {', '.join(PICTURES)}."
        raise OutputError(text, culprit=str(path), choices=PICTURES)
    names = sorted((name for name in recording if name != "t"), key=lambda name: name not in MEANINGS)[:DRAWN]
    with mpl.rc_context(STYLE):
        sheet = Figure(figsize=(9, 1.2 + 1.5 * len(names)), layout="constrained")
        axes = sheet.subplots(max(len(names), 1), 1, squeeze=False, sharex=True)[:, 0]
        for one, name in zip(axes, names, strict=False):
            scale = scale_of(recording.units.get(name, ""), float(np.abs(recording[name]).max()))
            one.plot(*thin(recording.t - recording.t[0], recording[name] * scale.factor, 1000), color=AFTER)
            source = sources.get(name, name)
            one.set_title(source if source == name else f"{name} = {source}", loc="left")
            one.set_ylabel(scale.unit or "no unit")
        axes[-1].set_xlabel("time [s]")
        kind = path.suffix.lstrip(".").lower()
        with replacing(path, force) as partial:
            sheet.savefig(partial, format=kind, metadata={"Date": None} if kind == "svg" else None)
    return path
