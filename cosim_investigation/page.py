"""The story of an investigation as one page: self-contained HTML, without script and without network.

What was open, what was moved to decide it, what each answer was; above it all motions one after the other.
"""

from collections.abc import Iterator
from html import escape
from importlib.resources import files
from pathlib import Path

import numpy as np

from cosim.data.recording import Recording
from cosim.plots.chart import Chart
from cosim.plots.style import AFTER, BEFORE, thin
from cosim.support.files import replacing
from cosim.support.version import __version__
from cosim_investigation.story import SENTENCES, Answered, Moved, Story

SIZE = (720, 260)
"""px."""
POINTS = 400
"""Points of a line for each recording, at most twice as many."""
PROMISED = (
    "Promised: nats are the log of the odds between two causes that the motion was to give, 3 are 20 to 1; new ground "
    "is the share of a motion that no recording had visited. At random: many tones with random phases for as long."
)
ROLES = {"train": "to fit", "heldout": "for the proof"}
WIDEST = "svg { max-width: 760px; min-width: 660px; } .wide td:nth-child(3) { min-width: 15em; }"
"""Picture and texts keep their width on a phone, and scroll: they stay legible."""
LIMITS = {
    "low": ("lowest position", "{}"),
    "high": ("highest position", "{}"),
    "speed": ("speed", "{}/s"),
    "acceleration": ("acceleration", "{}/s²"),
    "torque": ("torque", "{}"),
    "frequency": ("frequency of a tone", "Hz"),
    "forbidden_from": ("no tone from", "Hz"),
    "forbidden_to": ("no tone up to", "Hz"),
}
"""What a limit is called, and its unit behind that of a length."""


def write_page(path: Path, story: Story, folder: Path, command: str, linear: bool = False) -> Path:
    """Write the page of a story whose recordings lie in `folder`, in the place of an older one; returns its path."""
    style = (files("cosim") / "plots" / "run_page.css").read_text("utf-8") + WIDEST
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    head += f"<style>{style}</style><title>Investigation: {escape(story.last.words)}</title>"
    body = "".join(
        [*_head(story, command, linear), _picture(story, folder, linear), _steps(story, linear), *_rest(story, linear)]
    )
    with replacing(path, force=True) as partial:
        partial.write_text(f'<!doctype html><html lang="en">{head}<body><main>{body}</main></body></html>\n', "utf-8")
    return path


def _force(linear: bool) -> str:
    return "N" if linear else "N·m"


def _wide(label: str, inside: str) -> str:
    """What scrolls sideways where it must, also by keyboard."""
    return f'<div class="wide" tabindex="0" role="region" aria-label="{label}">{inside}</div>'


def _head(story: Story, command: str, linear: bool) -> Iterator[str]:
    first, last = story.first, story.last
    facts = {
        "s of motion": f"{story.seconds:.0f}",
        "s after the first answer": f"{story.further:.0f}",
        "answers": str(sum(isinstance(one, Answered) for one in story.steps)),
        f"{_force(linear)}, held-out error, first": f"{first.after:.3g}",
        f"{_force(linear)}, held-out error, last": f"{last.after:.3g}",
    }
    yield f"<h1>{escape(story.answer)}</h1><p>{escape(SENTENCES[story.ended])}</p>"
    yield f'<p class="quiet">{escape(command)} · {escape(__version__)}</p>'
    shown = "".join(f"<span><b>{value}</b>{name}</span>" for name, value in facts.items())
    yield f'<div class="facts">{shown}</div>'


def _picture(story: Story, folder: Path, linear: bool) -> str:
    """All motions one after the other; those for the proof in another colour."""
    lines, start = [], 0.0
    for one in story.steps:
        if isinstance(one, Moved):
            recording = Recording.read(folder / one.file)
            t, q = thin(recording.t - recording.t[0], recording["q"], POINTS)
            lines.append((start + t, q, AFTER if one.role == "train" else BEFORE))
            start += one.seconds
    if not lines:
        return ""
    low, high = min(float(q.min()) for _, q, _ in lines), max(float(q.max()) for _, q, _ in lines)
    unit = "m" if linear else "rad"
    chart = Chart.over(f"Position [{unit}]", "seconds of motion", (0.0, start), (low, high), SIZE)
    for t, q, colour in lines:
        chart.line(np.asarray(t), np.asarray(q), colour)
    said = "Blue: recorded to be fitted. Orange: recorded for the proof."
    return f'<h2>What was moved</h2>{_wide("Position in all motions", chart.svg())}<p class="quiet">{said}</p>'


def _steps(story: Story, linear: bool) -> str:
    rows = "".join(f"<tr><td>{one.number}</td>{_row(one)}</tr>" for one in story.steps)
    unit = _force(linear)
    names = ("step", "what", "motion, or answer")
    numbers = ("s", "promised", "at random", f"held-out error [{unit}]", f"noise [{unit}]")
    head = "".join(f"<th>{name}</th>" for name in names) + "".join(f'<th class="n">{name}</th>' for name in numbers)
    table = _wide("Step by step", f"<table><tr>{head}</tr>{rows}</table>")
    return f'<h2>Step by step</h2>{table}<p class="quiet">{PROMISED}</p>'


def _row(one: Moved | Answered) -> str:
    if isinstance(one, Moved):
        left = f" Left: {one.left}." if one.left else ""
        link = f'<a href="{escape(one.file)}">{escape(one.title)}</a>, {ROLES[one.role]}.{escape(left)}'
        told = (f"{one.seconds:.0f}", *_promises(one))
        numbers = "".join(f'<td class="n">{text}</td>' for text in told)
        return f"<td>moved</td><td>{link}</td>{numbers}<td></td><td></td>"
    open_ = f"<br>Open: {escape('; '.join(one.open))}." if one.open else ""
    numbers = f'<td class="n">{one.after:.3g}</td><td class="n">{one.floor:.3g}</td>'
    return f"<td><b>answer</b></td><td><b>{escape(one.words)}</b>{open_}</td><td></td><td></td><td></td>{numbers}"


def _promises(one: Moved) -> tuple[str, str]:
    """What a motion promised, and tones at random in its place; nothing is promised of the first ones."""
    if one.nats:
        return f"{one.nats:.1f} nats", "" if one.random_nats is None else f"{one.random_nats:.1f} nats"
    if one.ground:
        return f"{one.ground:.0%} new ground", "" if one.random_ground is None else f"{one.random_ground:.0%}"
    return "", ""


def _rest(story: Story, linear: bool) -> Iterator[str]:
    if story.otherwise:
        yield "<h2>What else would tell</h2>" + "".join(f"<p>{escape(one)}</p>" for one in story.otherwise)
    if story.refused:
        yield "<h2>Not moved, as a limit would have been left</h2>"
        yield "".join(f"<p>{escape(one)}</p>" for one in story.refused)
    rows = "".join(_limit(name, value, linear) for name, value in story.limits.items() if value or "forb" not in name)
    yield f"<h2>Limits</h2><table>{rows}</table><p class='quiet'>Checked before, and in what was recorded.</p>"
    yield '<p><a href="diagnosis/diagnosis.json">The last diagnosis</a>, <a href="diagnosis/card.toml">the card</a>, '
    yield '<a href="story.json">this story as data</a></p>'


def _limit(name: str, value: float, linear: bool) -> str:
    """A limit as a row; a forbidden band from 0 to 0 is none."""
    words, unit = LIMITS[name]
    told = _force(linear) if name == "torque" else unit.format("m" if linear else "rad")
    return f'<tr><td>{words}</td><td class="n">{value:.4g}</td><td>{told}</td></tr>'
