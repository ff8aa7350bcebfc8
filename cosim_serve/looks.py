"""What a dropped file holds, as plain data; called in a process of its own, which a damaged file may take down.

Signals come as the corners of a line that is thinned to a picture's width, so that the page needs no raw samples.
"""

from pathlib import Path

import numpy as np

from cosim.data.preview import Preview, preview
from cosim.data.recording import Recording
from cosim.plots.recording import MEANINGS, facts
from cosim.support.errors import CosimError, InputError, ManyRecordingsError
from cosim.support.plain import Parsed
from cosim_serve.job import Options
from pyfmi_models.errors import ModelError

WIDTH, HEIGHT = 600, 72
"""Size of a line, in units of its picture."""
SHOWN = 8
"""Columns that are drawn; more are named."""
NAMES = 200
"""Columns that can be chosen from."""


def look(path: str, options: Options) -> Parsed:
    """Tell what a recording holds; {"problem": sentence} if it cannot be read.

    Of a file of many recordings "parts" are what tells each apart, with its share of the rows.
    """
    file = Path(path)
    try:
        seen = preview(file, options)
        return _facts_of(file, seen)
    except ManyRecordingsError as error:
        rows = sum(one.rows for one in error.runs)
        return {"problem": _said(error, file), "parts": {one.which: one.rows / rows for one in error.runs}}
    except (CosimError, ModelError) as error:
        return {"problem": _said(error, file)}


def _said(error: Exception, file: Path) -> str:
    return str(error).replace(str(file), file.name)


def look_at_card(text: str, name: str) -> Parsed:
    """Tell what a card says; {"problem": sentence} if it is not good."""
    from pyfmi_models.card import parse_card

    try:
        card = parse_card(text, name)
    except ModelError as error:
        return {"problem": str(error)}
    effects = ", ".join(effect.id for effect in card.effects) or "none"
    told = {"machine": card.mount.name, "axis": card.mount.motion, "friction": card.friction.key, "effects": effects}
    told |= {"controller": card.controller.type if card.controller else "none"}
    return {"facts": told, "columns": card.columns, "notes": list(card.remarks())}


def estimated_card(given: list[tuple[str, Options]]) -> Parsed:
    """Estimate a card from recordings; {"problem": sentence} if they do not tell it."""
    from cosim.api.card import card

    files = [Path(path) for path, _ in given]
    try:
        read = [
            Recording.read(path, options.get("columns", {}), options.get("units", {}), layout=options.get("layout", {}))
            for path, (_, options) in zip(files, given, strict=True)
        ]
        found = card(read)
    except (CosimError, ModelError) as error:
        return {"problem": str(error).replace(f"{files[0].parent}/", "")}
    return {"text": "".join(f"# {note}\n" for note in found.notes) + found.text()}


def shipped_card(name: str) -> str:
    """Return the text of a card that comes with the package (InputError)."""
    from importlib.resources import files

    from pyfmi_models.card import shipped_cards

    if name not in shipped_cards():
        raise InputError(f'"{name}" is no shipped card: {", ".join(shipped_cards())}.', culprit=name)
    return (files("pyfmi_models") / "cards" / f"{name}.toml").read_text("utf-8")


def _facts_of(file: Path, seen: Preview) -> Parsed:
    told = {name: str(value).replace(str(file), file.name) for name, value in facts(seen).items()}
    for name in [one for one in told if one.startswith(("note ", "undecided ", "as an axis", "option", "sha256"))]:
        del told[name]
    recording = seen.recording
    return {
        "facts": told,
        "columns": [_column(recording, name, seen) for name in _order(recording)[:SHOWN]],
        "names": [*seen.found.values][:NAMES],
        "sources": {ours: theirs for ours, theirs in seen.sources.items() if ours in MEANINGS},
        "options": {key: dict(pairs) for key, pairs in seen.options.items()},
        "said": seen.said,
        "undecided": [text.replace(str(file), file.name) for text in seen.undecided],
        "refused": seen.refused.replace(str(file), file.name),
        "notes": [text.replace(str(file), file.name) for text in recording.quality()],
    }


def _order(recording: Recording) -> list[str]:
    """Our own columns first; without the time, which is the axis of the pictures."""
    return sorted((name for name in recording if name != "t"), key=lambda name: name not in MEANINGS)


def _column(recording: Recording, name: str, seen: Preview) -> Parsed:
    values = recording[name]
    good = np.isfinite(values)
    t, values = (recording.t[good], values[good]) if good.any() else (recording.t[:1], np.zeros(1))
    return {
        "name": seen.sources.get(name, name),
        "serves": MEANINGS.get(name, ""),
        "unit": recording.units.get(name, ""),
        "least": f"{values.min():.5g}",
        "greatest": f"{values.max():.5g}",
        "line": line(t, values),
        "begins": float(t[0]),
        "ends": float(t[-1]),
    }


def line(t: np.ndarray, values: np.ndarray) -> str:
    """Return corners "x,y x,y ..." of a signal: least and greatest value of each part, so that no peak is lost."""
    parts = np.array_split(np.arange(len(values)), min(WIDTH // 2, len(values)))
    rows = np.unique([row for part in parts for row in (part[values[part].argmin()], part[values[part].argmax()])])
    span, height = float(t[-1] - t[0]) or 1.0, float(np.ptp(values)) or 1.0
    x = WIDTH * (t[rows] - t[0]) / span
    y = HEIGHT * (1 - (values[rows] - values.min()) / height)
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
