"""What a learned term adds to a step of the paper's plant in C.

python bench/learned_step.py     (--json prints the numbers)

Two FMUs of one plant, without and with a term, step by turns through the same motion; a ratio is that of such a pair,
and the median of the pairs counts.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from pyfmi_models.card import read_card
from pyfmi_models.effects import Effect
from pyfmi_models.effects.learned import LearnedFriction, LearnedTorque
from pyfmi_models.effects.learned_drive import LearnedDrive
from pyfmi_models.effects.learned_memory import LearnedAfterReversal, LearnedHysteresis
from pyfmi_models.export import build_library
from pyfmi_models.model import Model

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/tools"))

from export_models import Driver

STEP, BLOCK = 1e-4, 2000
WAVES = tuple(0.1 / (1 + k) for k in range(9))
TERMS: dict[str, Effect] = {
    "torque over position": LearnedTorque(over="position", seen=(-1.0, 1.0), torque=WAVES),
    "torque over the turn": LearnedTorque(over="turn", torque=(*WAVES, *WAVES[1:])),
    "friction over position": LearnedFriction(over="position", seen=(-1.0, 1.0), level_change=WAVES),
    "friction over speed": LearnedFriction(over="speed", seen=(-0.1, 0.1), level_change=WAVES),
    "drive": LearnedDrive(command_seen=(-9.0, 9.0), missing=WAVES),
    "hysteresis": LearnedHysteresis(strokes=(0.1, 0.2, 0.4, 0.8), torque=WAVES[:4]),
    "after a reversal": LearnedAfterReversal(times=(0.1, 0.4, 1.6), level_change=WAVES[:3]),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    found = {name: ratio(effect, options.rounds) for name, effect in TERMS.items()}
    rows = "\n".join(f"{name:24s} {value:.2f}" for name, value in found.items())
    print(json.dumps(found, indent=2) if options.json else rows)


def ratio(effect: Effect, rounds: int) -> float:
    """Time of a step with the term over that of one without."""
    plain = read_card("paper_mount")
    models = [card.plant().model() for card in (plain, replace(plain, effects=(*plain.effects, effect)))]
    return ratio_of(models, rounds)


def ratio_of(models: Sequence[Model], rounds: int) -> float:
    """Time of a step of the second model over that of the first."""
    drivers = [Driver(model, build_library(model), 3) for model in models]
    for driver in drivers:
        driver.start()
    pairs = [[_seconds(driver, k) for driver in drivers] for k in range(rounds)]
    return median(after / before for before, after in pairs[1:])


def _seconds(driver: Driver, block: int) -> float:
    driver.set("tau", 4.0 * float(np.sin(0.7 * block)))
    began = perf_counter()
    driver.run(BLOCK * STEP * block, BLOCK, STEP)
    return perf_counter() - began


if __name__ == "__main__":
    main()
