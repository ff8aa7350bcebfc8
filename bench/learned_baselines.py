"""A learned term beside regressions of others, inside the range of training and outside of it.

    python bench/learned_baselines.py --seed S --cases 8 --out results/learned

A case is a telescope mount of the home generator with an effect that is in no catalogue (those that depend on the
motion, in rotation), recorded twice to be fitted, once for the proof, and once more on the first set point made half as
large again: positions, speeds and accelerations beyond all that training holds. On all four the tool's delivered model
and the regressions of `cosim_studies/proof/baselines.py` (PySINDy, boosted trees and a Gaussian process of
scikit-learn, kernel ridge) are judged by the held-out error that they leave, relative to that of the refitted base,
whose residual the regressions are given. Writes baselines.md and baselines.json; what is done is not done again.
"""

import argparse
import json
import os
import sys
import time
from itertools import count, islice
from pathlib import Path
from typing import Any

for library in ("OMP", "OPENBLAS"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
sys.path.append(str(Path(__file__).parent))

from learned_terms_page import VARIABLES  # noqa: E402

from cosim.data.recording import Recording  # noqa: E402
from cosim.diagnosis.answer.result import Trace  # noqa: E402
from cosim.diagnosis.diagnose import Outcome, diagnose  # noqa: E402
from cosim.diagnosis.measure.protocol import Structures, traces  # noqa: E402
from cosim.support.files import replacing  # noqa: E402
from cosim.support.statistics import rms  # noqa: E402
from cosim.support.version import __version__  # noqa: E402
from cosim_studies.proof.baselines import NAMES, compared  # noqa: E402
from cosim_studies.proof.generator import OUTSIDE, conceal, perturbed, to_toml  # noqa: E402
from cosim_studies.proof.intervals import median, share  # noqa: E402
from cosim_studies.proof.ledger import commit  # noqa: E402
from cosim_studies.proof.motion import Motion  # noqa: E402
from cosim_studies.proof.recorder import columns_of  # noqa: E402
from cosim_studies.proof.simulated_axis import RECORDINGS, SimulatedAxis, draw_axis, draw_drive, stream  # noqa: E402
from cosim_studies.proof.truth import simulate  # noqa: E402
from pyfmi_models.card import Card, parse_card  # noqa: E402

Row = dict[str, Any]
EFFECTS = tuple(name for name in OUTSIDE if name in VARIABLES)
"""Effects in no catalogue that depend on the motion."""
SECONDS, RATE = 40.0, 1000
"""Length of a recording [s]; rows a second."""
FARTHER, WIDE = 1.5, "wide"
"""How much larger the set point beyond training is, and the name of its recording."""
WHERE = {"inside": RECORDINGS[-1], "outside": WIDE}
METHODS = ("delivered", *NAMES[1:])


def bench_of(seed: int, effect: str, size: float) -> SimulatedAxis:
    """A mount with the effect concealed, which follows a fourth set point as well."""
    bench = draw_axis(seed, "mixed", 1.0, RATE, SECONDS)
    q, v, a = bench.motions[RECORDINGS[0]]
    motion = Motion(bench.pace.home + FARTHER * (q - bench.pace.home), FARTHER * v, FARTHER * a)
    bench.motions[WIDE] = motion
    bench.drives[WIDE] = draw_drive(stream(seed, WIDE), motion, bench.noise)
    bench.temperature[WIDE] = bench.temperature[RECORDINGS[0]]
    conceal(bench, effect, seed, size)
    return bench


def recorded(seed: int, effect: str, size: float) -> tuple[Card, dict[str, Recording]]:
    """The card and the four recordings."""
    bench = bench_of(seed, effect, size)
    bench.mount["loop_inertia"] = 0.0
    card = parse_card(to_toml(perturbed(bench, stream(seed, "card"))), "card.toml")
    bench.mount["loop_inertia"] = card.mount.inertia
    found = {}
    for name in (*RECORDINGS, WIDE):
        raw = simulate(bench.mount, bench.drives[name], bench.temperature[name])
        table = columns_of(bench, name, raw, RATE, stream(seed, f"clock {name}"))
        found[name] = Recording.of({key: table[key].to_numpy() for key in table}, name)
    return card, found


def left(card: Card, outcome: Outcome, known: dict[str, Recording], held: str) -> dict[str, float | None]:
    """Held-out error of each method on one recording, relative to that of the refitted base; None: not installed."""
    models = Structures(card.plant(), outcome.refitted.plant(), outcome.card.plant())
    signals = traces([known[name] for name in RECORDINGS[:2]], [known[held]], models)
    base = rms(signals[-1].missing)
    others = compared(signals, 1.0, METHODS[1:])
    told = {name: found.get("heldout_rms") for name, found in others.items()}
    return {"delivered": _after(signals[-1]) / base} | {name: at and at / base for name, at in told.items()}


def _after(held: Trace) -> float:
    return rms(held.tau - held.after)


def play(seed: int, effect: str, size: float) -> Row:
    """Diagnose one case and judge everything on both recordings that nothing was fitted to."""
    began = time.process_time()
    card, known = recorded(seed, effect, size)
    outcome = diagnose([known[name] for name in RECORDINGS[:2]], [known[RECORDINGS[-1]]], card)
    found = outcome.diagnosis
    row: Row = {"seed": seed, "effect": effect, "size": size, "verdict": list(found.verdict)}
    row["learned"] = list(found.learned.get("quantities", ()))
    row |= {where: left(card, outcome, known, name) for where, name in WHERE.items()}
    return row | {"seconds": time.process_time() - began}


def page(rows: list[Row], command: str) -> str:
    """The page: medians over the cases in which a term is delivered and over all, then every case."""
    lines = ["# Learned terms beside regressions of others", "", f"`{command}`", ""]
    lines += [f"mount-cosim {__version__}, commit {commit()}; a small sample: {len(rows)} cases.", ""]
    lines += [(__doc__ or "").split("\n\n")[2].strip(), ""]
    some = [row for row in rows if row["learned"]]
    for title, chosen in (("All cases", rows), ("Cases in which a term was delivered", some)):
        lines += [
            f"{title} ({len(chosen)}): error left, of the base's 1, median [95 %]; share of cases made worse.",
            "",
        ]
        lines += ["| | inside | worse | 1.5 times beyond training | worse |", "|---|---|---|---|---|"]
        lines += [_line(name, chosen) for name in METHODS] if chosen else []
        lines.append("")
    head = [f"{name}, {where}" for where in WHERE for name in METHODS]
    lines += ["| effect | size | seed | verdict | learned | " + " | ".join(head) + " |", "|---" * (5 + len(head)) + "|"]
    for row in rows:
        values = [_shown(row[where].get(name)) for where in WHERE for name in METHODS]
        texts = [row["effect"], str(row["size"]), str(row["seed"]), " + ".join(row["verdict"]) or "none"]
        lines.append("| " + " | ".join([*texts, ", ".join(row["learned"]) or "-", *values]) + " |")
    return "\n".join([*lines, ""])


def _line(name: str, rows: list[Row]) -> str:
    cells = [name]
    for where in WHERE:
        values = [float(row[where][name]) for row in rows if row[where].get(name) is not None]
        middle, worse = median(values), share([value > 1 for value in values])
        cells += [f"{middle.value:.2f} [{middle.low:.2f}, {middle.high:.2f}]" if values else "-"]
        cells += [f"{100 * (worse.value or 0):.0f} %" if values else "-"]
    return "| " + " | ".join(cells) + " |"


def _shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def main() -> None:
    """Play what is missing, write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--until", type=float, default=1e9, help="seconds after which no case is begun")
    parser.add_argument("--out", type=Path, required=True)
    given, began = parser.parse_args(), time.monotonic()
    given.out.mkdir(parents=True, exist_ok=True)
    table = given.out / "baselines.json"
    rows: list[Row] = json.loads(table.read_text("utf-8")) if table.exists() else []
    drawn = ((given.seed + number, EFFECTS[number % len(EFFECTS)], 1.0) for number in count())
    for seed, effect, size in islice(drawn, given.cases):
        if any(row["seed"] == seed for row in rows) or time.monotonic() - began > given.until:
            continue
        rows.append(play(seed, effect, size))
        print(rows[-1], flush=True)
        with replacing(table, force=True) as file:
            file.write_text(json.dumps(rows, indent=1) + "\n", "utf-8")
    command = f"python bench/learned_baselines.py --seed {given.seed} --cases {given.cases}"
    (given.out / "baselines.md").write_text(page(rows, f"{command} --out results/learned"), "utf-8")


if __name__ == "__main__":
    main()
