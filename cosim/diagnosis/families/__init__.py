"""Families of candidates: for each effect what is worth trying, given what the recordings visit.

One maker a family; a maker yields nothing where its effect is in the mount already or cannot be seen.
"""

from collections.abc import Collection
from typing import NamedTuple

from cosim.diagnosis.candidates import Candidate, Maker, span_of
from cosim.diagnosis.families import friction, mechanics, timing, torque
from cosim.diagnosis.prepare import Array, Prepared
from pyfmi_models.mount import Mount


class Family(NamedTuple):
    """Ids of the effects that a maker makes, and whether it needs a recorded position."""

    ids: tuple[str, ...]
    maker: Maker
    position: bool = True


FAMILIES = (
    Family(("stribeck",), friction.stribeck, position=False),
    Family(("friction_asymmetry",), friction.asymmetry, position=False),
    Family(("position_friction",), friction.periodic),
    Family(("position_friction",), friction.rough_spot),
    Family(("load_dependent_friction",), friction.load_dependent),
    Family(("dwell_breakaway",), friction.dwell),
    Family(("thermal_viscosity",), friction.thermal, position=False),
    Family(("presliding",), friction.presliding),
    Family(("cogging",), torque.cogging),
    Family(("gravity_unbalance",), torque.unbalance),
    Family(("torque_offset",), torque.offset, position=False),
    Family(("periodic_disturbance",), torque.disturbance, position=False),
    Family(("cable_wrap",), torque.cable),
    Family(("quadratic_drag",), torque.drag, position=False),
    Family(("torque_saturation",), torque.saturation, position=False),
    Family(("actuator_lag", "delay"), timing.late, position=False),
    Family(("clock_skew",), timing.clocks, position=False),
    Family(("inertia_variation",), mechanics.inertia),
    Family(("compliance",), mechanics.springs),
    Family(("backlash",), mechanics.plays),
    Family(("encoder_eccentricity",), mechanics.eccentricity),
)
TRIED = tuple(dict.fromkeys(name for family in FAMILIES for name in family.ids))
"""Effects that a diagnosis can name; the catalogue holds more, for cards and FMUs."""


def candidates(
    mount: Mount, prepared: Prepared, residual: Array, level: Array, only: Collection[str] = TRIED
) -> list[Candidate]:
    """List what is worth trying of `only` these effects, given the torque residual at the kept rows."""
    span = span_of(mount, prepared, residual, level)
    usable = [
        family for family in FAMILIES if (prepared.has_position or not family.position) and set(family.ids) & set(only)
    ]
    found = [candidate for family in usable for candidate in family.maker(mount, span)]
    return [candidate for candidate in found if candidate.effect in only]
