"""The gallery of effects, from the code: what each is, how it looks in data, what tells it apart, where it is from.

The pictures are those of the report, of a motion made up here: an axis of 2 kg m² with Coulomb friction of 1 N·m and 3
N·m·s/rad that moves to and fro at many speeds, with rests. "Before" is the model without the effect, "after" with it.
"""

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from effect_examples import EXAMPLES, LAW, mount
from literature import LITERATURE

from cosim.data.recording import Recording
from cosim.diagnosis.answer.result import Finding
from cosim.diagnosis.effects import TRIED
from cosim.diagnosis.measure.breakdown import Samples
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Piece, prepare
from cosim.plots.quantities import ANGLE, TORQUE, TURNING
from cosim.plots.style import STYLE
from cosim.report.figures_dynamic import effect as draw
from cosim.report.quantities import Scales
from cosim.report.repairs import MACHINES, repairs_of
from pyfmi_models.effects import CATALOGUE, Effect, GravityUnbalance, LocalFriction
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.friction import LuGre
from pyfmi_models.model import parameters_of

RATE, SECONDS, CUTOFF, NOISE = 250, 60, 30.0, 0.02
"""Hz, s, Hz, N m."""
BRISTLES = LuGre(sigma0=2e4, sigma1=90.0, sigma2=3.0, Fc=1.0, Fs=1.0, Vs=0.05)
COLOURS = {"ink": "#1A1A1A", "before": "#CC6A00", "after": "#00558C", "grey": "#5A6068", "line": "#C9CED3"}
COLOURS |= {"shade": "#EEF0F1", "band": "#8A939B", "grid": "#E3E6E8", "hatch": "#A9B0B6", "paper": "#FFFFFF"}


SHOWN: dict[str, Effect] = {
    "position_friction": LocalFriction(q_center=-0.8, width=0.1, relative_amplitude=1.0),
    "compliance": Compliance(antiresonance_hz=2.5, resonance_hz=4.0),
}
"""Numbers that this motion shows well, where those of the tests do not."""


def write_gallery(folder: Path) -> None:
    """Write `effects.md` and its pictures into a folder."""
    import matplotlib as mpl

    folder.mkdir(exist_ok=True)
    shown = {form.id: SHOWN.get(form.id, form) for form in EXAMPLES if form.id in TRIED}
    piece = prepare([motion()], CUTOFF).pieces[0]
    with mpl.rc_context(STYLE):
        parts = [section(name, one, folder, piece) for name, one in sorted(shown.items(), key=lambda p: p[1].title)]
    text = [INTRODUCTION, thumbnails(shown), *parts, *of_cards_alone()]
    (folder / "effects.md").write_text("\n".join(text), "utf-8")


def thumbnails(shown: dict[str, Effect]) -> str:
    """Return all pictures small, each a link to its effect."""
    named = sorted(shown.items(), key=lambda pair: pair[1].title)
    cells = (
        f'<a href="#{name}"><img src="../_images/{name}.svg" alt="" loading="lazy">{one.title}</a>'
        for name, one in named
    )
    return "\n".join(["```{raw} html", '<div class="thumbnails">', *cells, "</div>", "```", ""])


INTRODUCTION = f"""# Gallery of effects

Every effect that a card may hold and a diagnosis looks for, drawn from the code when this site is built. The pictures
are those of the [report](../report.md): an axis of 2 kg m² with friction of 1 N·m and 3 N·m·s/rad moves to and fro for
{SECONDS} s, with rests. Orange is the model without the effect, blue with it. An effect torque *resists*: it stands
on the right of J q'' = τ − friction − loads − effects with a minus.
Measured machines: [gallery of machines](../machines.md).
"""


OF_CARDS = """## Effects of cards alone

Cards may hold these too, and FMUs, C, Modelica and firmware compute them. A diagnosis does not look for them yet: a
recording with one that its card does not hold is at best called "unknown".
"""


def of_cards_alone() -> Iterator[str]:
    """Yield what is said of the effects that a diagnosis does not look for, without pictures."""
    yield OF_CARDS
    shown = {form.id: form for form in reversed(EXAMPLES) if form.id not in TRIED}
    for name, one in sorted(shown.items(), key=lambda p: p[1].title):
        told, literature = described(type(one))
        yield f"### {one.title}\n\n`{name}`, {one.place.lower()}. {told}\n\n*In words:* {one.statement()}\n"
        yield from (f"*{title}:* {text}\n" for title, text in _said(one, literature) if text)
        yield _table(one) + "\n"


def _said(one: Effect, literature: str) -> Iterator[tuple[str, str]]:
    yield "Equation", f"`{one.equation}`" if one.equation else ""
    yield "How to distinguish", f"{one.told_apart_by}."
    yield "What to do", one.action
    yield "Literature", literature


def section(name: str, one: Effect, folder: Path, piece: Piece) -> str:
    """Return what is said of one effect; its picture is written."""
    return "\n".join(line for part in _parts(name, one, folder, piece) for line in (part, ""))


def _parts(name: str, one: Effect, folder: Path, piece: Piece) -> Iterator[str]:
    told, from_code = described(type(one))
    yield f"({name})=\n## {one.title}"
    yield f"`{name}`, {one.place.lower()}. {told}"
    yield f"*In words:* {one.statement()}"
    yield f"*Equation:* `{one.equation}`"
    yield _picture(name, one, folder, piece)
    rivals = ", ".join(f"[{CATALOGUE[rival][0].title.lower()}](#{rival})" for rival in one.rivals if rival in CATALOGUE)
    yield f"*How to distinguish it from {rivals or 'the others'}:* {one.told_apart_by or 'nothing else looks like it'}."
    yield f"*What to do:* {one.action}"
    yield from _repairs(name)
    yield _table(one)
    yield f"*Literature:* {from_code or LITERATURE[name]}"


def _repairs(name: str) -> Iterator[str]:
    """Yield what to check at the machine, in order, and the repair by kind of machine."""
    if (known := repairs_of(name)) is None:
        raise ValueError(f"{name} has no checks and repairs")
    yield "*Three checks, the quickest first:*"
    for number, check in enumerate(known.checks, 1):
        results = (f"   - {seen[:1].upper()}{seen[1:]}: {means}." for seen, means in check.results)
        yield "\n".join([f"{number}. {check.do}", "", *results])
    rows = (f"| {MACHINES[kind]} | {text} |" for kind, text in known.by_machine.items())
    yield "\n".join(["| Machine | Repair |", "|---|---|", *rows])


def described(form: type[Effect]) -> tuple[str, str]:
    """Return the first paragraph of a docstring, and the literature it names."""
    text = inspect.cleandoc(form.__doc__ or "")
    said, _, literature = text.partition("Reference")
    first = " ".join(said.split("\n\n")[0].split())
    return first, " ".join(literature.lstrip("s:").split())


def _table(one: Effect) -> str:
    rows = [f"| `{v.name}` | {v.unit} | {_plain(v.description)} |" for v in parameters_of(one)]
    return "\n".join(["| Parameter | Unit | Meaning |", "|---|---|---|", *rows])


def _plain(text: str) -> str:
    return re.sub(r"([|*_<>\[\]])", r"\\\1", text)


def motion() -> Recording:
    """Return a motion to and fro at many speeds, with rests, and what else an effect may ask for."""
    rng, t = np.random.default_rng(3), np.arange(SECONDS * RATE) / RATE
    speed = np.repeat(rng.uniform(0.03, 0.8, SECONDS) * np.tile([1.0, 1.0, -1.0, -1.0], SECONDS // 4), RATE)
    speed[np.repeat(rng.random(SECONDS) < 0.2, RATE)] = 0.0
    window = np.hanning(2 * (RATE // 4) + 1)
    v = np.convolve(np.pad(speed, RATE // 4, mode="edge"), window / window.sum(), "valid")
    q = np.cumsum(v) / RATE
    table = {"t": t, "q": q, "tau": 2.0 * np.gradient(v, t) + np.sign(v)}
    table |= {"temperature": 20 + 12 * (1 - np.exp(-t / 25)), "load_torque": 3.0 * np.sin(0.4 * t)}
    table |= {"neighbour_position": 0.5 * np.sin(2 * t)}
    return Recording("made up", table)


def _picture(name: str, one: Effect, folder: Path, piece: Piece) -> str:
    chosen, scales = samples(one, piece), Scales(TORQUE[0], ANGLE[0], TURNING[0])
    parameters: dict[str, Any] = {v.name: float(v.start) for v in parameters_of(one)}
    finding = Finding(effect=name, title=one.title, answer="found", probability=1, gain=1, parameters=parameters)
    picture = draw(finding, chosen, scales)
    if picture is None:
        raise ValueError(f"{name} has no picture")
    svg = re.sub(r"var\(--(\w+)\)", lambda found: COLOURS[found[1]], picture.svg)
    svg = svg.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" font-family="sans-serif" ', 1)
    (folder / f"{name}.svg").write_text(
        svg.replace("href=", "xlink:href=").replace(
            "<svg ", '<svg xmlns:xlink="http://www.w3.org/1999/xlink" style="background:#fff" ', 1
        ),
        "utf-8",
    )
    return f"```{{figure}} {name}.svg\n:alt: {one.title} in data\n\n{picture.caption}\n```"


def samples(one: Effect, piece: Piece) -> Samples:
    """Return what a recording of an axis with an effect shows, beside the model without and with it."""
    law = BRISTLES if one.id == "dwell_breakaway" else LAW
    beside = (GravityUnbalance(mgl=4.0, phase=0.2),) if one.id == "load_dependent_friction" else ()
    rng, nothing = np.random.default_rng(1), np.zeros(0)
    plain, whole = mount(*beside, friction=law), mount(*beside, one, friction=law)
    base, full = (Inverse(each, ()).torque(piece, nothing)[0] for each in (plain, whole))
    noise = piece.lowpass(rng.normal(0, 4 * NOISE, len(piece.t))[:, None])[:, 0]
    rows = piece.inside
    columns = (piece.t, piece.q, piece.v, full + noise, full + noise - base, noise, np.floor(piece.t))
    return Samples(*(np.asarray(column, float)[rows] for column in columns))
