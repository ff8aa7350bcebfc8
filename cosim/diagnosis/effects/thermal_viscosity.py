"""Friction that drifts with temperature."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from cosim.diagnosis.effects.base import Hypothesis
from cosim.diagnosis.effects.candidates import Candidate, Span, sized
from pyfmi_models.effects.thermal_viscosity import RubbedViscosity, ThermalViscosity, WarmingViscosity
from pyfmi_models.mount import Mount

WARM = 10.0
"""Rise of temperature [K] by which a warm-up is counted: only its product with the coefficient can be seen."""


class ThermalFriction(Hypothesis[ThermalViscosity]):
    """By the recorded temperature; without one by the time since a cold start, or by rubbing."""

    forms = (ThermalViscosity, WarmingViscosity, RubbedViscosity)
    tables = ("friction level over temperature", "speed and temperature")
    sizes: ClassVar[tuple[str, ...]] = ("viscous_per_degC", "coulomb_per_degC")
    rank: ClassVar[float] = 7
    needs_position: ClassVar[bool] = False
    view = "time"

    def candidates(self, mount: Mount, span: Span) -> Iterator[Candidate]:
        """Level and viscous friction, each with its own coefficient."""
        forms: list[ThermalViscosity] = [ThermalViscosity(viscous_per_degC=0.0)]
        if "temperature" not in span.extras:
            forms = [form for share in (0.25, 1.0) for form in _warming(share * span.seconds, span)]
        for form in forms:
            yield sized(form, -0.3, 0.3, self.sizes)

    def must_fall(self, effect: ThermalViscosity) -> tuple[str, ...]:
        """Lubricants thin as they warm; where no thermometer saw it, a level that falls alone may be wearing in."""
        return self.sizes if type(effect) is ThermalViscosity else self.sizes[:1]


def _warming(seconds: float, span: Span) -> tuple[ThermalViscosity, ...]:
    """Warm-ups of this time constant, by time and by rubbing."""
    heat = WARM / (seconds * float(np.mean(np.abs(span.v))))
    return (
        WarmingViscosity(viscous_per_degC=0.0, warm_up_degC=WARM, warm_up_s=seconds),
        RubbedViscosity(viscous_per_degC=0.0, heat_degC_per_rad=heat, cooling_s=seconds),
    )
