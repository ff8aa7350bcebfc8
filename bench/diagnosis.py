"""Proof of the diagnosis, rebuilt by one command each.

    python bench/diagnosis.py emps --data FOLDER --out results/measured        measured, not in the project
    python bench/diagnosis.py measured --data FOLDER --out results/measured    six measured machines
    python bench/diagnosis.py null --cases 10 --out results/proof           the card's own physics, 15 % off

Each writes a table and a page with version, seeds and inputs.
"""

import argparse
import csv
import platform
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import cosim
from cosim.data.recording import Recording
from cosim.delivery.closed_loop import close_loop
from cosim.diagnosis.diagnose import diagnose
from pyfmi_models.card import Card, read_card
from pyfmi_models.export import export_fmu

sys.path.append(str(Path(__file__).parent))
from judges import moving
from measured import machines
from measured import rows as machine_rows

ROWS = 1000
"""Rows a second of the simulated recordings."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("emps", "measured", "null"))
    parser.add_argument("--data", type=Path, default=None, help="folder of the measured recordings")
    parser.add_argument("--cases", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    makers = {"emps": emps, "measured": measured, "null": null}
    started = time.perf_counter()
    rows = list(makers[given.what](given))
    write(given, rows, time.perf_counter() - started)


def write(given: argparse.Namespace, rows: list[dict[str, Any]], seconds: float) -> None:
    given.out.mkdir(parents=True, exist_ok=True)
    with (given.out / f"{given.what}.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    head, body = list(rows[0]), ["| " + " | ".join(str(value) for value in row.values()) + " |" for row in rows]
    seeds = "" if given.data else f" --cases {given.cases} --seed {given.seed}"
    data = " --data FOLDER" if given.data else ""
    text = [
        f"# {TITLES[given.what]}",
        "",
        f"    python bench/diagnosis.py {given.what}{data}{seeds} --out {given.out}",
        "",
        f"Made by mount-cosim {cosim.__version__} on Python {platform.python_version()} in {seconds:.0f} s.",
        "",
        "| " + " | ".join(head) + " |",
        "|" + " --- |" * len(head),
        *body,
        "",
        NOTES[given.what],
    ]
    (given.out / PAGES[given.what]).write_text("\n".join(text) + "\n", "utf-8")
    print("\n".join(text))


PAGES = {"emps": "emps.md", "measured": "README.md", "null": "null.md"}
TITLES = {
    "measured": "Measured machines: physics that the card conceals, and the error on recordings that were not fitted",
    "emps": "EMPS: a measured ball-screw axis whose standard model lacks direction-dependent friction and a delay",
    "null": "Null: recordings made by exactly the card's physics, its numbers 15 % off",
}
NOTES = {
    "measured": "Held-out RMS by the protocol of each recording's README; `95 %`: of the delivered model, drawing "
    "whole seconds (of the screws: recordings) with replacement; `first look` is what that README found by "
    "hand. How each is read stands in bench/measured.py: columns, units, card, what is held out. `refitted` "
    "is the base of the card with its numbers fitted, `names alone` what is delivered "
    "without a learned term, `with what is learned` the delivered model (the same where nothing was learned), `no "
    "veto` what training alone proposed. Of a set the model holds the first member. The official protocol of EMPS "
    "simulates the position "
    "in open loop from the force, with 20 samples to start from (bench/official.py). Copies of two machines "
    "with one mistake each: `python bench/corrupted.py --data FOLDER --out "
    "results/measured`, [corrupted.md](corrupted.md).\n\n"
    "Of the screws each recording holds one speed, for 3 to 128 s. Their means are judged against each other, as those "
    "of the README are: rows that repeat one operating point say little that is new.\n\n"
    "Of EMPS what falls toward rest (Fs < Fc) is no Stribeck friction; it is called viscous friction that rises less "
    "than the speed, and the bar of 2.0 N is met. Not reached, and why: its ripple of 400 cycles/m is found in "
    "training and does not hold on the other day. The anti-backlash screw's payload, a small constant beside a "
    "torque that ripples by more, is not named: its rest is larger than 7 % of the friction and is called unknown; "
    "no Stribeck curve is named there, as it should be. The motor hardly turns back, where friction cannot be told "
    "from torque: fewer of the cogging's orders are found than it has, what bends like a contact there may not be "
    "named, so that `unknown` stands before the cogging, which removes .89 of the error energy (from .9 on it were "
    "sure), and with the neighbour motor turned the model is worse than the base, as the README warns. Real "
    "machines leave more than simulated ones: `unknown` beside a name says so. What is learned of the servo lowers the "
    "error of the held-out runs in the tool's own band, and raises it in the rows that its README judges (faster than "
    "0.08 rad/s, the duty unfiltered): .19 to .21 V.",
    "emps": "Card `emps` (linear, symmetric Coulomb + viscous); trained on estimation.parquet, held out "
    "validation_pulses.parquet. RMS in N. `clear` is clear motion only, |v| > 2 mm/s, 100 Hz on both sides, as in the "
    "recording's README; the other two follow the protocol of 30 Hz over all samples. The held-out recording has a "
    "veto: a ripple of 400 cycles/m is found in training and dropped, as its phase does not hold on the other day; `no "
    "veto` is the error with it. Nothing in the tool is special to this axis. Commands stamped at the start of their "
    "hold would read as half a sample (0.5 ms) of delay; the recording's documentation does not exclude that.",
    "null": "Plant and controller FMUs of the paper's card; inertia and friction drawn within 15 %, encoder noise as "
    "stated, three set points. The right answer is none.",
}


def measured(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    for machine in machines(given.data):
        print(machine.name, file=sys.stderr)
        yield from machine_rows(machine)


def emps(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    card = read_card("emps")
    train, held = (
        Recording.read(given.data / f"{name}.parquet", card.columns) for name in ("estimation", "validation_pulses")
    )
    outcome = diagnose([train], [held], card)
    found, clear = outcome.diagnosis, moving(2e-3, 100.0)
    delay = next((f for f in found.findings if f.effect == "delay" and f.parameters), None)
    yield {
        "recordings": f"{train.sha256[:8]} / {held.sha256[:8]}",
        "verdict": " + ".join(found.verdict),
        "delay [ms]": f"{delay.parameters['delay_ms']:.3f}" if delay else "-",
        "refitted": f"{found.heldout.before_rms:.2f}",
        "with effects": f"{found.heldout.after_rms:.2f}",
        "clear refitted": f"{clear(outcome.refitted.plant(), [held]):.2f}",
        "clear with effects": f"{clear(outcome.card.plant(), [held]):.2f}",
        "clear, no veto": f"{clear(outcome.proposed.plant(), [held]):.2f}",
        "seconds": f"{found.seconds:.0f}",
    }


def null(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    for seed in range(given.seed, given.seed + given.cases):
        noise = 0.0 if seed % 2 else 3e-7
        found = null_case(seed, noise)
        held = found.heldout
        yield {
            "seed": seed,
            "encoder noise [rad]": noise,
            "verdict": " + ".join(found.verdict) or "none",
            "refitted [N.m]": f"{held.before_rms:.4g}",
            "as delivered [N.m]": f"{held.nominal_rms:.4g}",
            "seconds": f"{found.seconds:.1f}",
        }


def null_case(seed: int, noise: float, seconds: float = 30.0) -> Any:
    """Diagnose recordings made by the paper's card with numbers 15 % off; noise is white encoder noise [rad rms]."""
    rng = np.random.default_rng(seed)
    card = read_card("paper_mount")
    truth = perturbed(card, rng)
    with tempfile.TemporaryDirectory() as folder:
        plant = export_fmu(truth.plant().model(), Path(folder) / "plant.fmu")
        controller = export_fmu(card.controller_model(), Path(folder) / "controller.fmu")
        made = [simulated(plant, controller, card, rng, noise, seconds, kind) for kind in range(3)]
    return diagnose(made[:2], made[2:], card).diagnosis


def perturbed(card: Card, rng: np.random.Generator, by: float = 0.15) -> Card:
    law = card.friction
    names = ("sigma0", "sigma1", "sigma2", "Fc", "Fs", "Vs")
    changed = replace(law, **{name: getattr(law, name) * (1 + rng.uniform(-by, by)) for name in names})
    section = card.mount.model_copy(update={"inertia": card.mount.inertia * (1 + rng.uniform(-by, by))})
    return replace(card, mount=section, friction=changed)


def simulated(
    plant: Path, controller: Path, card: Card, rng: np.random.Generator, noise: float, seconds: float, kind: int
) -> Recording:
    t = np.arange(int(seconds * ROWS)) / ROWS
    tones = rng.uniform(0.03, 0.5, 4 + kind)
    sizes = rng.uniform(0.3, 1, 4 + kind) / tones * 0.01
    start = np.clip(t / 2.5, 0, 1) ** 3 * (10 - 15 * np.clip(t / 2.5, 0, 1) + 6 * np.clip(t / 2.5, 0, 1) ** 2)
    waves = (a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(sizes, tones, rng.uniform(0, 6, 9), strict=False))
    wanted = Recording(f"set_point_{kind}", {"t": t, "q": start, "q_d": start * sum(waves)})
    made = close_loop(plant, controller, card, wanted, f"recording_{kind}")
    table = dict(made.table)
    table["q"] = table["q"] + noise * rng.standard_normal(len(table["q"]))
    return Recording(made.name, table, made.units)


if __name__ == "__main__":
    main()
