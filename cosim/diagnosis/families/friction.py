"""Friction: its level over direction, place, load, rest, temperature, and what it does before it slides."""

from collections.abc import Iterator
from dataclasses import replace
from math import atan2, hypot, pi

import numpy as np

from cosim.diagnosis.candidates import Candidate, Span, has
from cosim.diagnosis.families.periodogram import peaks
from cosim.diagnosis.prepare import Array
from pyfmi_models.effects import (
    Effect,
    FrictionAsymmetry,
    LocalFriction,
    PayloadEffect,
    PeriodicFriction,
    StribeckEffect,
)
from pyfmi_models.effects.dwell_breakaway import DwellBreakaway
from pyfmi_models.effects.load_dependent_friction import LoadDependentFriction
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.effects.thermal_viscosity import RubbedViscosity, ThermalViscosity, WarmingViscosity
from pyfmi_models.model import Pair
from pyfmi_models.mount import Mount

WARM = 10.0
"""Rise of temperature [K] by which a warm-up is counted: only its product with the coefficient can be seen."""
CURVES = (0.01, 0.03, 0.07, 0.15, 0.3)
"""Widths of Stribeck curves that are tried, and that fits start from, relative to the top speed. A fit does not cross
the gap between two recorded speeds: a curve narrower than that is flat at the next speed, and has no slope there."""


def asymmetry(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Both directions at once."""
    if has(mount, FrictionAsymmetry) or mount.friction.key == "none":
        return
    linear = ("level_asymmetry", "viscous_asymmetry")
    neutral = FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=0.0)

    def start(c: Array) -> Effect:
        a, b = (float(np.clip(x, -0.9, 0.9)) for x in c)
        return FrictionAsymmetry(level_asymmetry=a, viscous_asymmetry=b)

    yield Candidate("friction_asymmetry", (neutral,), linear, start)


def periodic(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Strongest cycles of what changes its sign with the speed."""
    if mount.friction.key == "none":
        return
    for cycles in peaks(span, span.residual * np.sign(span.v), lowest=0.3):

        def start(c: Array, cycles: float = cycles) -> Effect:
            return PeriodicFriction(
                cycles_per_rev=cycles, relative_amplitude=min(hypot(*c), 0.9), phase=atan2(-c[1], c[0])
            )

        pair = tuple(PeriodicFriction(cycles_per_rev=cycles, relative_amplitude=0.0, phase=p) for p in (0.0, -pi / 2))
        yield Candidate("position_friction", pair, ("relative_amplitude",), start)


def rough_spot(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Two widths, places all over the range."""
    if mount.friction.key == "none" or has(mount, LocalFriction):
        return
    low, high = np.quantile(span.q, [0.01, 0.99])
    for share in (0.03, 0.08):
        width = share * (high - low)
        for center in np.arange(low + width, high - width / 2, 1.7 * width):
            spot = LocalFriction(q_center=float(center), width=float(width), relative_amplitude=0.0)

            def start(c: Array, spot: LocalFriction = spot) -> Effect:
                return replace(spot, relative_amplitude=float(np.clip(c[0], -0.9, 15)))

            yield Candidate("position_friction", (spot,), ("relative_amplitude",), start)


def stribeck(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Curves of several widths, for a law that has none."""
    law = mount.friction
    if mount.friction.key == "none" or getattr(law, "Fs", None) is not None or has(mount, StribeckEffect):
        return
    base = contact_level(mount)
    for share in CURVES:
        Vs = share * span.top

        def start(c: Array, Vs: float = Vs) -> Effect:
            # Far from a level at rest the tangent says little: a fit that starts from half to twice finds its way.
            return StribeckEffect(Fs=float(np.clip(base + c[0], 0.5 * base, 2 * base)), Vs=Vs)

        yield Candidate("stribeck", (StribeckEffect(Fs=base, Vs=Vs),), ("Fs",), start)


def load_dependent(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Only a known weight tells the load."""
    if mount.friction.key == "none" or not has(mount, PayloadEffect) or has(mount, LoadDependentFriction):
        return
    start = lambda c: LoadDependentFriction(coulomb_per_Nm=float(np.clip(c[0], 1e-6, 5)))  # noqa: E731
    yield Candidate("load_dependent_friction", (LoadDependentFriction(coulomb_per_Nm=0.0),), ("coulomb_per_Nm",), start)


def dwell(mount: Mount, span: Span) -> Iterator[Candidate]:
    """Ages of the contact that a small or a larger slip renews."""
    if mount.friction.key == "none" or has(mount, DwellBreakaway):
        return
    for share in (1e-3, 4e-3):
        fresh = DwellBreakaway(torque_per_efold=0.0, onset_s=0.1, memory_rad=share * span.reach)

        def start(c: Array, fresh: DwellBreakaway = fresh) -> Effect:
            return replace(fresh, torque_per_efold=max(float(c[0]), 1e-6 * contact_level(mount)))

        yield Candidate("dwell_breakaway", (fresh,), ("torque_per_efold",), start)


def thermal(mount: Mount, span: Span) -> Iterator[Candidate]:
    """By the recorded temperature; without one by the time since a cold start, or by rubbing."""
    if mount.friction.key == "none" or has(mount, ThermalViscosity):
        return
    forms: list[ThermalViscosity] = [ThermalViscosity(viscous_per_degC=0.0)]
    if "temperature" not in span.extras:
        forms = [form for share in (0.25, 1.0) for form in _warming(share * span.seconds, span)]
    for form in forms:

        def start(c: Array, form: ThermalViscosity = form) -> Effect:
            viscous, level = (float(np.clip(x, -0.3, 0.3)) for x in c)
            return replace(form, viscous_per_degC=viscous, coulomb_per_degC=level)

        yield Candidate("thermal_viscosity", (form,), ("viscous_per_degC", "coulomb_per_degC"), start)


def _warming(seconds: float, span: Span) -> tuple[ThermalViscosity, ...]:
    """Warm-ups of this time constant, by time and by rubbing."""
    heat = WARM / (seconds * float(np.mean(np.abs(span.v))))
    return (
        WarmingViscosity(viscous_per_degC=0.0, warm_up_degC=WARM, warm_up_s=seconds),
        RubbedViscosity(viscous_per_degC=0.0, heat_degC_per_rad=heat, cooling_s=seconds),
    )


def presliding(mount: Mount, span: Span) -> Iterator[Candidate]:
    """A contact that bends, for a law that knows none."""
    if mount.friction.key == "none" or mount.law.states():
        return
    for reach in np.geomspace(1e-4, 1e-2, 5) * span.reach:
        bent = Presliding(sigma0=contact_level(mount) / float(reach))

        def start(_: Array, bent: Presliding = bent) -> Effect:
            return bent

        yield Candidate("presliding", (bent,), (), start)


def contact_level(mount: Mount) -> float:
    """Coulomb level of a friction law, the mean of both directions [N m]; 0 if it has none."""
    level = getattr(mount.friction, "Fc", None)
    return float(np.mean(level)) if isinstance(level, Pair) else float(level or 0.0)
