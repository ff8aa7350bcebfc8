"""A case: drawn, recorded, sized, judged."""

import numpy as np

from .assess import Judgement, assess, misfit
from .compose import compose
from .recorder import fastest, record
from .reported import reported

NEAR = 0.12
"""A share that is so near to the wanted one is kept."""
ROUNDS = 5
FASTEST = 160.0
"""rad/s; no loop is made faster than this."""


def settle(case):
    """Put the effects' present sizes into the plant; choose the bandwidth."""
    case["plant"] = dict(case["base"])
    for e in case["drawn"]:
        case["plant"] |= e.plant
    case["bandwidth"] = min(fastest(case) * case["speed"], FASTEST)


def simulate(case, which):
    """Simulate recordings; None where the loop is no good."""
    out = []
    for k in which:
        r = record(case, case["kinds"][k], case["seeds"][k], case["temperatures"][k])
        if r is None:
            return None
        out.append(r)
    return out


class Search:
    """Looks for the logarithm of a size at which the share is the wanted one; odds go with the square of a size."""

    def __init__(self, target):
        """Begin at the drawn size."""
        self.target, self.here, self.seen = _odds(target), 0.0, []

    def next(self, share):
        """Take the share found here; return the step to the next size."""
        self.seen.append((self.here, _odds(share)))
        below = max((x for x in self.seen if x[1] < self.target), default=None, key=lambda x: x[1])
        above = min((x for x in self.seen if x[1] >= self.target), default=None, key=lambda x: x[1])
        if below and above:
            x = float(np.interp(self.target, (below[1], above[1]), (below[0], above[0])))
        else:
            x = self.here + float(np.clip(0.5 * (self.target - self.seen[-1][1]), -2.0, 2.0))
        step, self.here = x - self.here, x
        return step


def _odds(share):
    x = float(np.clip(share, 0.01, 0.995))
    return float(np.log(x / (1 - x)))


def _sized(case):
    """Simulate the training recordings at a size whose share is near the wanted one; None and why where it fails."""
    search = Search(case["target"])
    for turn in range(ROUNDS):
        settle(case)
        train = simulate(case, (0, 1))
        if train is None:
            return None, f"the loop is no good ({case['machine']['kind']}: {', '.join(case['complaints'][-2:])})"
        judgement = Judgement(case, train)
        fault = misfit(case, judgement)[1] if turn == 0 else ""
        if fault or not case["drawn"]:
            return (None, fault) if fault else (train, "")
        case["history"].append(round(judgement.share, 3))
        if abs(judgement.share - case["target"]) < NEAR or turn == ROUNDS - 1:
            break
        step = search.next(judgement.share)
        if not any([e.scale(np.exp(step)) for e in case["drawn"]]):
            break
    return train, ""


def make_case(seed, family, effects, kind="", target=None):
    """Make one case.

    Args:
        seed: of everything.
        family: name of the case's family.
        effects: what is concealed.
        kind: kind of an unknown.
        target: wanted share of the training residual's energy that the effect removes; drawn if None.

    Returns:
        (case, recordings, the judge's numbers) and "", or None and why it was rejected.
    """
    rng = np.random.default_rng(seed)
    case = compose(rng, family, effects, kind)
    case["target"] = float(rng.uniform(0.2, 0.95)) if target is None else target
    train, fault = _sized(case)
    if train is None:
        return None, fault
    held = simulate(case, (2,))
    if held is None:
        return None, "the loop is no good in the held-out recording"
    numbers, fault = assess(case, Judgement(case, train + held))
    return (None, fault) if fault else ((case, train + held, numbers), "")


def truth(case):
    """Parameters of the effects in the tool's names."""
    m = case["machine"] | {"s0_true": case["plant"]["s0"]}
    out = {e.name: reported(e, m) for e in case["drawn"]}
    if "stribeck" in out:
        p = case["plant"]
        out["stribeck"] = {"Fs": p["Fc"] * (1 + p["rise"]), "Vs": p["Vs"]}
    return out
