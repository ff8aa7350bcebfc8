"""The friction that a simulator can hold, nearest to the card's along a motion.

Two laws are held in simulators: Fc sign(v) + sigma2 v everywhere, and LuGre with the exponent 2 where there are
bristles. A card's law that is one of them is taken as it is; else the numbers of the nearer one are those with the
least squares of the torque that differs along the motion. Effects that change friction are part of what is met.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.optimize import least_squares

from cosim.estimation.fit import with_values
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Array, Piece
from cosim_simulators.motion import top_speed
from pyfmi_models.effects import Effect, FrictionEffect, TorqueOffset
from pyfmi_models.effects.stribeck import StribeckEffect
from pyfmi_models.friction import Coulomb, Dahl, FrictionLaw, Frictionless, LuGre
from pyfmi_models.friction.base import each_way
from pyfmi_models.model import Pair
from pyfmi_models.mount import Mount

DEFLECTION = 1e-6
"""Deflection at which bristles slide that stand for a sharp change of sign, as a share of the positions visited."""
FAR = 10.0
"""Numbers of bristles are fitted up to this factor from the card's: beyond, nothing was compared."""
FREE = {Coulomb: ("Fc", "sigma2"), LuGre: ("sigma0", "Fc", "Fs", "Vs", "sigma2")}
"""Parameters that are fitted where a law is not held as it is."""


@dataclass(frozen=True)
class HeldFriction:
    """A law that a simulator has, and whether it is the card's own."""

    law: FrictionLaw
    exact: bool
    beside: tuple[Effect, ...] = ()
    """A constant torque that stands for the difference of the directions."""


def level_and_viscous(mount: Mount) -> tuple[float, float]:
    """Coulomb level [N m; N] and viscous coefficient [N m s/rad; N s/m] of a mount that has no other friction."""
    law = mount.friction
    return (float(law.Fc), float(law.sigma2)) if isinstance(law, Coulomb) else (0.0, 0.0)


def torque(mount: Mount, pieces: Sequence[Piece]) -> Array:
    """Torque that a mount needs along the kept rows of all pieces [N m; N], filtered."""
    inverse = Inverse(mount, (), alone=True)
    return np.concatenate([inverse.torque(piece, np.zeros(0))[0][piece.kept] for piece in pieces])


def without_friction_effects(mount: Mount) -> Mount:
    """The mount without effects that change its friction."""
    return replace(mount, effects=tuple(one for one in mount.effects if not isinstance(one, FrictionEffect)))


def held_friction(mount: Mount, bristle: bool, constant: bool, pieces: Sequence[Piece]) -> HeldFriction:
    """The law nearest to the friction of a mount along a motion.

    `bristle`: LuGre's bristles are there too; `constant`: a constant torque is, which can do what a level does that
    differs by direction, F (1 + a sign v) sign v = F sign v + a F.
    """
    plain = without_friction_effects(mount)
    if len(plain.effects) == len(mount.effects) and (same := _same(mount.friction, bristle)):
        return HeldFriction(same, True)
    start = _bristles(mount, pieces) if bristle and type(mount.friction) is not Frictionless else _coulomb(mount)
    # How short bristles are that stand for a jump is no matter of a fit: its answer would be none at all.
    free = [name for name in FREE[type(start)] if name != "sigma0" or hasattr(mount.law, "sigma0")]
    beside = (TorqueOffset(torque=0.0),) if constant else ()
    tried = replace(plain, friction=start, effects=(*plain.effects, *beside))
    names = [f"friction.{name}" for name in free]
    names += [f"{list(tried.components())[-1]}.torque"] if constant else []
    found = _fitted(tried, names, torque(mount, pieces), pieces)
    return HeldFriction(found.friction, False, found.effects[len(plain.effects) :])


def _same(law: FrictionLaw, bristle: bool) -> FrictionLaw | None:
    """The law itself in words of a simulator, where it has it."""
    if any(isinstance(getattr(law, one.name), Pair) for one in fields(law)):
        return None
    if type(law) in (Frictionless, Coulomb):
        return law
    if bristle and type(law) is LuGre and (law.Fs is None or law.delta == 2):
        return law
    if bristle and type(law) is Dahl and law.n == 1:
        return LuGre(sigma0=law.sigma0, sigma2=law.sigma2, Fc=law.Fc)
    return None


def _mean(law: FrictionLaw, name: str) -> float | None:
    """Mean of a number over both directions; None where the law has none."""
    found = [getattr(one, name, None) for one in each_way(law)]
    return None if None in found else float(np.mean([float(one) for one in found if one is not None]))


def _coulomb(mount: Mount) -> Coulomb:
    levels = [float(one.level(top_speed(mount))) for one in each_way(mount.law)]
    return Coulomb(Fc=max(float(np.mean(levels)), 1e-3), sigma2=_mean(mount.law, "sigma2") or 0.0)


def _bristles(mount: Mount, pieces: Sequence[Piece]) -> LuGre:
    """LuGre with the numbers that the law has; a law without bristles gets short ones."""
    law, seen = mount.law, next((one for one in mount.effects if isinstance(one, StribeckEffect)), None)
    level = _mean(law, "Fc") or _coulomb(mount).Fc
    peak, speed = (_mean(law, "Fs"), _mean(law, "Vs")) if seen is None else (float(seen.Fs), float(seen.Vs))
    reach = float(max(np.ptp(piece.q) for piece in pieces))
    stiffness = _mean(law, "sigma0") or (peak or level) / (DEFLECTION * reach)
    return LuGre(
        sigma0=stiffness,
        sigma1=_mean(law, "sigma1") or 0.0,
        sigma2=_mean(law, "sigma2") or 0.0,
        Fc=level,
        Fs=peak or 1.01 * level,
        Vs=speed or top_speed(mount) / 10,
    )


def _fitted(mount: Mount, free: Sequence[str], target: Array, pieces: Sequence[Piece]) -> Mount:
    """The mount with the numbers that leave least of `target`."""
    inverse = Inverse(mount, tuple(free))
    coulomb, start = isinstance(mount.friction, Coulomb), inverse.present
    scale = np.maximum(np.abs(start), 1e-3 * float(np.max(np.abs(target))))
    first = np.maximum(start / scale, 1e-3)
    constant = np.array([name.endswith(".torque") for name in free])
    low = np.where(constant, -np.inf, 0.0 if coulomb else first / FAR)
    high = np.where(constant | coulomb, np.inf, first * FAR)

    def misfit(x: Array) -> Array:
        return np.asarray(stacked(inverse, pieces, x * scale)[0] - target)

    def slopes(x: Array) -> Array:
        return np.asarray(stacked(inverse, pieces, x * scale)[1] * scale)

    found = least_squares(
        misfit,
        first,
        jac=slopes,
        bounds=(low, high),
        max_nfev=60,
    )
    return with_values(mount, free, found.x * scale)
