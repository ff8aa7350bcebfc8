"""Fit the curve of `cosim/diagnosis/decide/calibration.py` to decks that were played with known truth.

python bench/calibration.py DECK/proof.json ... --played 0 1 --out results/abroad

`--played` are offset and slope of the package that played the decks: their printed probabilities are turned back into
shares of the evidence. The decks must be others than the one that is scored. Prints the two numbers to write into the
module; the error of calibration is cross-validated: each case's probabilities come from a curve fitted to the others.
"""

import argparse
import json
from math import exp
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

import cosim
from cosim.diagnosis.decide.calibration import OFFSET, SLOPE, calibrated, log_odds
from cosim_studies.proof.marks import probabilities
from cosim_studies.proof.score import bins, calibration_error_of

PRIOR = 4.0
"""Variance of the prior of both numbers about "as it is": offset 0, slope 1."""
FOLDS = 10
Pairs = list[tuple[float, bool]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("decks", type=Path, nargs="+", metavar="proof.json")
    parser.add_argument("--played", type=float, nargs=2, default=(OFFSET, SLOPE), metavar=("OFFSET", "SLOPE"))
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    decks = [json.loads(path.read_text("utf-8")) for path in options.decks]
    text = page(decks, tuple(options.played))
    print(text)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "calibration.md").write_text(text, "utf-8")


def share_of(probability: float, offset: float = OFFSET, slope: float = SLOPE) -> float:
    """The share that `calibrated` made a probability of, within its limits."""
    return 1 / (1 + exp(-(log_odds(probability) - offset) / slope))


def raw(row: dict[str, Any], played: tuple[float, float]) -> Pairs:
    """Shares of the evidence that one case printed as probabilities, and whether they came true."""
    return [(share_of(p, *played), true) for p, true in probabilities(row)]


def fitted(pairs: Pairs) -> tuple[float, float]:
    """Offset and slope of the most probable curve."""
    x = np.array([log_odds(share) for share, _ in pairs])
    sign = np.where([true for _, true in pairs], 1.0, -1.0)

    def cost(numbers: npt.NDArray[np.float64]) -> float:
        prior = (numbers[0] ** 2 + (numbers[1] - 1) ** 2) / (2 * PRIOR)
        return float(np.logaddexp(0, -sign * (numbers[0] + numbers[1] * x)).sum() + prior)

    offset, slope = minimize(cost, [0.0, 1.0], bounds=[(None, None), (0.01, None)]).x
    return float(offset), float(slope)


def crossed(cases: list[Pairs]) -> Pairs:
    """Probabilities of each case by the curve of the cases in other folds."""
    found: Pairs = []
    for fold in range(FOLDS):
        numbers = fitted([pair for k, case in enumerate(cases) if k % FOLDS != fold for pair in case])
        inside = [pair for k, case in enumerate(cases) if k % FOLDS == fold for pair in case]
        found += [(calibrated(share, *numbers), true) for share, true in inside]
    return found


def page(decks: list[dict[str, Any]], was: tuple[float, float]) -> str:
    """The page of results/."""
    rows = [row for deck in decks for row in deck["rows"]]
    cases = [pairs for row in rows if (pairs := raw(row, was))]
    pairs = [pair for case in cases for pair in case]
    offset, slope = fitted(pairs)
    after = crossed(cases)
    played = ", ".join(f"seed {deck['seed']} ({len(deck['rows'])} cases, code {deck['code'][:16]})" for deck in decks)
    lines = [
        "# Probabilities that come true",
        "",
        *(f"    cosim prove --cases {len(deck['rows'])} --seed {deck['seed']} --out DECK" for deck in decks),
        f"    python bench/calibration.py DECK/proof.json --played {was[0]:g} {was[1]:g} --out results/abroad",
        "",
        f"mount-cosim {cosim.__version__}. Decks of `cosim prove`: {played}; {len(pairs)} probabilities in "
        f"{len(cases)} cases. The package has offset {OFFSET}, slope {SLOPE}; these decks ask for:",
        "",
        f"    OFFSET, SLOPE = {offset:.2f}, {slope:.2f}",
        "",
        f"Expected calibration error, 10 bins: shares of the evidence {calibration_error_of(pairs):.3f}, "
        f"calibrated (cross-validated over cases) {calibration_error_of(after):.3f}.",
        "",
        "| calibrated | came true | probabilities |",
        "| --- | --- | --- |",
    ]
    lines += [f"| {one['printed']:.2f} | {one['true']:.2f} | {one['n']} |" for one in bins(after)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
