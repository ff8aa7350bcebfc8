"""What a machine may have beside what a controller was made for: a flexible mode, dead time, a noisier encoder."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import sqrt
from typing import Literal

from cosim_studies.paper.conditions import Condition
from pyfmi_models.effects import Delay, Effect
from pyfmi_models.effects.compliance import Compliance

FAR = 0.2
"""Share of the inertia behind the flexible mode."""
MODES_HZ = {0.01: (15.0, 20.0, 30.0, 45.0, 60.0), 0.05: (15.0, 30.0, 60.0)}
"""Resonances by their damping ratio."""
DELAYS_MS = (1.0, 2.0, 3.0, 4.0)
NOISES = (2.0, 5.0)
"""Encoder noise as multiples of the condition's."""


@dataclass(frozen=True, kw_only=True)
class Stress:
    """One thing that is other than thought: a flexible mode [Hz] with its damping ratio, a delay [ms], a noise."""

    kind: Literal["as designed", "mode", "delay", "noise"]
    value: float = 0.0
    damping: float = 0.0

    @property
    def key(self) -> str:
        """Short name, as "mode 20 Hz 1 %"."""
        names = {
            "as designed": "as designed",
            "mode": f"mode {self.value:g} Hz {100 * self.damping:g} %",
            "delay": f"delay {self.value:g} ms",
            "noise": f"noise x{self.value:g}",
        }
        return names[self.kind]

    def on(self, condition: Condition) -> Condition:
        """Return the condition with this in its plant or encoder."""
        noise = condition.encoder_noise * (self.value if self.kind == "noise" else 1.0)
        plant = replace(condition.plant, effects=(*condition.plant.effects, *self._effects()))
        key = f"{condition.key}: {self.key}"
        return replace(condition, key=key, plant=plant, encoder_noise=noise)

    def _effects(self) -> Iterator[Effect]:
        if self.kind == "delay":
            yield Delay(delay_ms=self.value)
        if self.kind == "mode":
            held = self.value * sqrt(1 - FAR)
            yield Compliance(antiresonance_hz=held, resonance_hz=self.value, damping_ratio=self.damping)


def stresses() -> tuple[Stress, ...]:
    """Return all situations of the robustness map; the first changes nothing."""
    modes = (Stress(kind="mode", value=hz, damping=damping) for damping, found in MODES_HZ.items() for hz in found)
    delays = (Stress(kind="delay", value=ms) for ms in DELAYS_MS)
    noises = (Stress(kind="noise", value=times) for times in NOISES)
    return (Stress(kind="as designed"), *modes, *delays, *noises)
