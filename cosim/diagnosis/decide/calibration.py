"""From what an effect explains, and no rival explains as well, to a probability that comes true as often as it says.

    s = (posterior share among rivals and "none") x (share of the residual energy that the effect removes)
    p = 1 / (1 + exp(-(OFFSET + SLOPE ln(s / (1 - s)))))

Evidence alone promises too much: it knows only rivals that were tried. Where the truth was concealed, an effect that
removes a tenth of the energy is right less than half of the time, whatever its evidence, one that removes nine tenths
nearly always: the former may imitate what is missing, the latter leaves no room for that. Platt's curve, fitted to 102
named effects of two generators, neither of them that of results/proof; from one of them alone it would be 2.2, 1.0
(telescope mounts), from the other 1.2, 1.1 (other machines): see results/abroad/calibration.md.

Reference: Platt, Advances in Large Margin Classifiers, 1999.
"""

from math import exp, log

OFFSET, SLOPE = 1.7, 1.05
LIKELY, SURE = 0.5, 0.8
"""Probabilities from which an effect is called found (it is more likely there than not), and from which no word of
doubt stands beside it. Report, terminal and page follow `Finding.answer`, which is decided with the former."""
LEAST = 1e-4
"""Shares nearer to 0 or 1 than this are not told apart."""


def log_odds(share: float) -> float:
    """ln(s / (1 - s)) of a share within its limits."""
    inside = min(max(share, LEAST), 1 - LEAST)
    return log(inside / (1 - inside))


def calibrated(share: float, offset: float = OFFSET, slope: float = SLOPE) -> float:
    """Probability of an effect with this share, see the module."""
    return 1 / (1 + exp(-(offset + slope * log_odds(share))))
