"""How much the effect matters in a case, and whether the case is worth giving."""

import numpy as np

from . import judge
from .users_card import TANH

LEVELS = (("subtle", 0.45), ("medium", 0.75), ("strong", 1.01))
"""Share of the refitted base's residual energy that the true effect removes, up to which a level goes."""
LEAST_TRAIN, LEAST_HELD, LEAST_MEMBER = 0.12, 0.08, 0.10
LIMITS = {"bristles": 0.3, "parasite": 0.3, "law_misfit": 0.65}
"""Shares that something else than the effect may remove: held torque that a static law cannot say, the current loop,
the true friction in place of the card's law. Beyond it the card lacks more than what is called its lack.
"""
FACTORS = (0.5, 1.8)
"""The true torque must be found with about its true size."""
LEAST_TWIN = 1.01
"""Residual energy with a lag in place of a delay (or the reverse), below which 30 Hz cannot tell them apart."""
TWINS = {"delay": ("delay", "actuator_lag"), "actuator_lag": ("lag", "delay")}


def base_of(case):
    """Build the judge's base structure for a card."""
    c, p, m = case["card"], case["plant"], case["machine"]
    start = {
        "kappa": c.get("s0", 1.0) / c["Fc"],
        "rho": max(c.get("Fs", 0) / c["Fc"] - 1, 0.02),
        "Vs": c.get("Vs", 1.0),
    }
    if p["law"] != TANH and c["law"] == "lugre":
        start["kappa"] = p["s0"] / p["Fc"]
    moving = c["law"] != "lugre" and "presliding" not in case["effects"]
    still = max(p["vsmall"], 30 * m["resolution"])
    return judge.Base(c["law"], c["stribeck"], bool(m["payload_mgl"]), start, still, moving)


class Judgement:
    """The judge's numbers for a case: `less` is the refitted base, `more` the base with the true effect."""

    def __init__(self, case, recordings):
        """Refit both on the training recordings; an effect of the reading is undone in the rows of the truth."""
        self.case, self.names, self.records = case, recordings[0]["names"], recordings
        self.base = base_of(case)
        right = "unskewed" if "ppm" in case["plant"] else "aligned"
        self.seen = [judge.rows(r) for r in recordings]
        self.true = self.seen
        if any("reading" in e.channels for e in case["drawn"]):
            self.true = [judge.rows(r | {"q": r[right]}) for r in recordings]
        self.less = judge.fit(self.base, self.seen[:2], [])
        self.more = judge.fit(self.base, self.true[:2], self.columns(case["drawn"]), self.less.theta)

    @property
    def share(self):
        """Part of the training residual's energy that the truth removes."""
        return 1 - judge.energy(self.more, self.true[:2]) / max(judge.energy(self.less, self.seen[:2]), 1e-300)

    @property
    def factors(self):
        """Factors that the true torques got, by channel."""
        channels = [self.names[c] for c in self.more.channels]
        return dict(zip(channels, self.more.factors[len(self.more.factors) - len(channels) :], strict=True))

    def columns(self, drawn, *more):
        """Find the channel numbers of effects."""
        names = [c for e in drawn for c in e.channels if c != "reading"] + list(more)
        return [self.names.index(c) for c in dict.fromkeys(names)]

    def extra(self, channel):
        """Tell what a further channel would remove beside the truth."""
        more = judge.fit(self.base, self.true[:2], self.columns(self.case["drawn"], channel), self.more.theta)
        return judge.share(self.more, more, self.true[:2])

    def without(self, e):
        """Tell how much one effect matters beside the others."""
        others = [x for x in self.case["drawn"] if x is not e]
        rows = self.seen if "reading" in e.channels else self.true
        fitted = judge.fit(self.base, rows[:2], self.columns(others), self.more.theta)
        return 1 - judge.energy(self.more, self.true[:2]) / judge.energy(fitted, rows[:2])

    def twin(self, channel):
        """Energy with the best lag in place of a delay (or the reverse), relative to that of the truth."""
        column, true, found = self.names.index(channel), self.case["plant"][channel], []
        for T in true * np.array([0.6, 0.8, 1.0, 1.25, 1.6]):
            rows = []
            for r, shown in zip(self.records[:2], self.true, strict=False):
                other = r["missing"].copy()
                other[:, column] = r["tau"] - judge.late(r["tau"], r["dt"], T, lag=channel == "delay")
                rows.append(judge.rows(r | {"missing": other, "q": shown.source}))
            fitted = judge.fit(self.base, rows, self.columns(self.case["drawn"]), self.more.theta)
            found.append(judge.energy(fitted, rows))
        return min(found) / judge.energy(self.more, self.true[:2])

    def heldout(self):
        """RMS of the third recording's residual before and after."""
        before, after = judge.energy(self.less, self.seen[2:]), judge.energy(self.more, self.true[2:])
        return before**0.5, after**0.5


def misfit(case, judgement):
    """Tell what something else than the effect would remove; the second value is a reason to reject."""
    out = {"parasite": judgement.extra("parasite"), "law_misfit": judgement.extra("dry"), "bristles": 0.0}
    if case["card"]["law"] != "lugre" and "presliding" not in case["effects"]:
        out["bristles"] = judgement.extra("bristles")
    machine = f"{case['machine']['kind']} {case['truth']}/{case['card']['law']}"
    over = [f"{name} {out[name]:.2f} ({machine})" for name, top in LIMITS.items() if out[name] > top]
    return out, ", ".join(over)


def assess(case, judgement):
    """Collect the judge's numbers; the second value is a reason to reject."""
    before, after = judgement.heldout()
    more, fault = misfit(case, judgement)
    out = more | {"share_train": judgement.share, "share_heldout": 1 - (after / before) ** 2, "partial": {},
                  "heldout_base_rms": before, "heldout_oracle_rms": after, "channel_factors": judgement.factors,
                  "twin": None}  # fmt: skip
    return out, fault or (_assess_effects(case, judgement, out) if case["drawn"] else "")


def _assess_effects(case, judgement, out):
    train, held, first = out["share_train"], out["share_heldout"], next(iter(judgement.factors.values()), 1.0)
    if train < LEAST_TRAIN or held < LEAST_HELD:
        return f"effect too weak ({train:.2f}, {held:.2f})"
    if not FACTORS[0] < first < FACTORS[1]:
        return f"factor of the effect is {first:.2f}"
    for name in set(TWINS) & set(case["effects"]):
        out["twin"] = judgement.twin(TWINS[name][0])
    if len(case["drawn"]) > 1:
        out["partial"] = {e.name: judgement.without(e) for e in case["drawn"]}
        if min(out["partial"].values()) < LEAST_MEMBER:
            return f"member too weak ({out['partial']})"
    return ""


def level_of(case, numbers):
    """Name the level of a share."""
    return "none" if not case["effects"] else next(name for name, top in LEVELS if numbers["share_train"] < top)


def twins(case, numbers):
    """Name the effects that the judge cannot tell from the concealed ones."""
    alike = numbers["twin"] is not None and numbers["twin"] < LEAST_TWIN
    return [TWINS[e][1] for e in case["effects"] if e in TWINS and alike]
