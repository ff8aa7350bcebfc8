"""From a share of the evidence to a probability that comes true as often as it says.

    p = 1 / (1 + exp(-(OFFSET + SLOPE ln(s / (1 - s)))))

s is an effect's share among its rivals and "none". The share knows only rivals that were tried, and samples are far
from independent, so near one it promises too much. Platt's curve, fitted to what came true in simulated cases:

    cosim prove --cases 126 --seed 1795327940 --out ONE      (code of commit 506baee)
    cosim prove --cases 72 --seed 1795329386 --out TWO      (code of commit 15192a4)
    python tests/benchmarks/calibration.py ONE/proof.json TWO/proof.json --played 0.20 0.48 --out results/calibration

Reference: Platt, Advances in Large Margin Classifiers, 1999.
"""

from math import exp, log

OFFSET, SLOPE = 0.21, 0.52
LEAST = 1e-4
"""Shares nearer to 0 or 1 than this are not told apart."""


def log_odds(share: float) -> float:
    """ln(s / (1 - s)) of a share within its limits."""
    inside = min(max(share, LEAST), 1 - LEAST)
    return log(inside / (1 - inside))


def calibrated(share: float, offset: float = OFFSET, slope: float = SLOPE) -> float:
    """Probability of an effect whose share of the evidence is `share`."""
    return 1 / (1 + exp(-(offset + slope * log_odds(share))))


def share_of(probability: float, offset: float = OFFSET, slope: float = SLOPE) -> float:
    """The share that `calibrated` made a probability of, within its limits."""
    return 1 / (1 + exp(-(log_odds(probability) - offset) / slope))
