"""Checks of a friction law: words, units, equations, energy, its steady sliding, bounds, identification, FMU."""

from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from cosim_checks import recordings, shared
from cosim_checks.plant import Array
from cosim_checks.suite import Check, Checks, NotApplicable, reported, require
from pyfmi_models.friction import LAWS, FrictionLaw
from pyfmi_models.model import Pair, parameters_of

SPEEDS = (1e-7, 1e-4, 3e-3, 0.04, 0.7)
"""From creeping to fast [rad/s]."""
CYCLES, TICKS = 12, 200
"""Random closed motions over which energy is counted, and the pieces of constant speed of each."""
ROUNDING = 1e-9
"""Share of the energy moved that rounding may make."""


def checks_of(law: FrictionLaw) -> Checks:
    """All checks of a law."""
    checks = {
        "words": words,
        "units": shared.units,
        "odd": odd,
        "finite": shared.finite,
        "derivatives": shared.derivatives,
        "passive": passive,
        "steady": steady,
        "advance": advance,
        "bounds": shared.bounds,
        "fmu": shared.fmu,
        "fits_itself": recordings.fits_itself,
    }
    listed: list[tuple[str, Check]] = [(name, reported(partial(check, law))) for name, check in checks.items()]
    return Checks(type(law).__name__, listed)


def words(law: FrictionLaw) -> None:
    """A key for cards, and a docstring with equation and source."""
    kind = type(law)
    require(law.key.isidentifier() and law.key.islower(), f'key = "{law.key}" must be in lower_case.')
    doc = (kind.__doc__ or "").strip()
    require(doc and not doc.startswith(f"{kind.__name__}("), "the class has no docstring: equation, limits, source.")
    names = {one.name.partition(".")[0] for one in parameters_of(law)}
    unknown = [one for one in law.linear if one not in names]
    require(not unknown, f"linear names {', '.join(unknown)}, which are no parameters.")
    strangers = [one for one in law.rivals if one not in LAWS]
    require(not strangers, f"rivals: {', '.join(strangers)} are no laws; laws are: {', '.join(LAWS)}.")


class Formulas:
    """The formulas of a law at numbers: level, torque, rate, states after a while."""

    def __init__(self, law: FrictionLaw) -> None:
        self.law, self.size = law, len(law.states())
        x, v, dt = ca.SX.sym("x", self.size), ca.SX.sym("v"), ca.SX.sym("dt")
        level = law.level(v) + 0 * v
        torque = law.contact(x, v, level) + law.viscous(v)
        named = {"level": level, "torque": torque, "rate": law.rate(x, v, level)}
        named["advance"] = law.advance(x, v, level, dt)
        self._functions = {name: ca.Function(name, [x, v, dt], [ca.SX(one)]) for name, one in named.items()}

    def __call__(self, name: str, state: Any, v: float, dt: float = 1e-4) -> Array:
        """One formula (rows,)."""
        found: Array = self._functions[name](state, v, dt).full().ravel()
        return found

    def start(self, share: float = 0.0) -> Array:
        """States at a share of the level at rest."""
        return np.full(self.size, share * self("level", np.zeros(self.size), 1e-12)[0] / max(self.size, 1))


def odd(law: FrictionLaw) -> None:
    """Backward is forward mirrored, unless a number differs by direction; the level is not negative."""
    if any(isinstance(value, Pair) for value in vars(law).values()):
        raise NotApplicable("numbers differ by direction")
    this = Formulas(law)
    for v in SPEEDS:
        state = this.start(0.4)
        for name in ("torque", "rate", "advance"):
            ahead, back = this(name, state, v), -this(name, -state, -v)
            apart = float(np.max(np.abs(ahead - back), initial=0.0))
            require(apart <= ROUNDING * (1 + np.max(np.abs(ahead), initial=0.0)), f"{name} is not odd at v = {v:g}.")
        level = float(this("level", state, v)[0])
        require(level >= 0, f"level = {level:.3g} N m at v = {v:g} rad/s is negative.")


def passive(law: FrictionLaw) -> None:
    """No closed motion takes more energy from the contact than it gave; `broken_passivity` says where one may."""
    if law.key == "none":
        raise NotApplicable("it is no friction")
    if rule := law.broken_passivity():
        raise NotApplicable(f"broken_passivity says: {rule}")
    this, rng = Formulas(law), np.random.default_rng(0)
    for _ in range(CYCLES):
        v = _cycle(rng)
        path = float(np.abs(v).mean())
        rounds = int(np.clip(1e-3 / path, 2, 40))  # until what the contact bends has become periodic
        wasted, moved = _work(this, v, rounds)
        require(wasted >= -ROUNDING * moved, f"a cycle of {path:.2g} rad gives back {-wasted / (moved or 1):.1g}.")


def _cycle(rng: np.random.Generator) -> Array:
    """Speeds over 1 s that end where they began: waves from 1e-6 rad to 0.1 rad."""
    t = (np.arange(TICKS) + 0.5) / TICKS
    waves = [2 * np.pi * k * 10 ** rng.uniform(-6, -1) * np.sin(2 * np.pi * (k * t + rng.random())) for k in (1, 2, 3)]
    v = np.sum(waves, axis=0)
    return np.asarray(v - v.mean())


def _work(this: Formulas, v: Array, rounds: int) -> tuple[float, float]:
    """Work over the last of some rounds, and the energy moved either way; three Gauss points a piece."""
    state, dt, wasted, moved = this.start(), 1 / TICKS, 0.0, 0.0
    points = tuple(zip((1 - 0.6**0.5, 1.0, 1 + 0.6**0.5), (5 / 18, 8 / 18, 5 / 18), strict=True))
    for turn in range(rounds):
        for speed in v:
            for place, weight in points if turn == rounds - 1 else ():
                inner = this("advance", state, speed, place / 2 * dt) if this.size else state
                power = weight * dt * float(this("torque", inner, speed)[0]) * speed
                wasted, moved = wasted + power, moved + abs(power)
            state = this("advance", state, speed, dt) if this.size else state
        if not this.size and turn == 0 and rounds > 1:
            return _work(this, v, 1)
    return wasted, moved


def steady(law: FrictionLaw) -> None:
    """Sliding at constant speed forgets the past, resists, and is the law's own static map."""
    this, still = Formulas(law), Formulas(law.steady())
    smoothing = float(getattr(law.steady(), "smoothing", 0.0))
    for v in (*SPEEDS, *(-one for one in SPEEDS)):
        far = 1e9 / abs(v)
        ends = [this("torque", this("advance", this.start(one), v, far), v)[0] for one in (-0.9, 0.0, 0.7)]
        spread = float(np.ptp(ends))
        require(spread <= 1e-6 * (1 + abs(ends[0])), f"sliding at {v:g} rad/s remembers its start: {ends} N m.")
        require(np.sign(v) * ends[0] >= 0, f"friction drives: {ends[0]:.3g} N m in steady sliding at {v:g} rad/s.")
        if this.size and abs(v) > 20 * smoothing:
            map_ = still("torque", [], v)[0]
            require(abs(ends[0] - map_) <= 1e-6 * (1 + abs(map_)), f"steady() gives {map_:.4g}, sliding {ends[0]:.4g}.")


def advance(law: FrictionLaw) -> None:
    """`advance` is the solution of `rate` at constant speed: two halves are a whole, and it starts with the rate."""
    if not law.states():
        raise NotApplicable("it has no memory")
    this, dt = Formulas(law), 1e-3
    for v in (1e-4, 3e-3, -0.04, 0.7):
        state = this.start(0.3)
        whole, half = this("advance", state, v, dt), this("advance", this("advance", state, v, dt / 2), v, dt / 2)
        size = 1 + float(np.max(np.abs(whole)))
        require(np.max(np.abs(whole - half)) < 1e-8 * size, f"advance in two halves is not the whole at v = {v:g}.")
        tiny = 1e-9
        slope, rate = (this("advance", state, v, tiny) - state) / tiny, this("rate", state, v)
        scale = 1 + float(np.max(np.abs(rate)))
        require(np.max(np.abs(slope - rate)) < 1e-3 * scale, f"advance does not start with rate at v = {v:g} rad/s.")
