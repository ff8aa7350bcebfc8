"""What a diagnosis with an FMU as its base delivers: a correction FMU, and an SSP of their FMU behind it.

    command -> correction -> their FMU -> position, speed -> correction, controller

The SSP is closed by a set point and a controller, so that it runs as it stands; put your own in their places. It needs
the speed of the FMU under a name, and variables in SI units or without one, because SSP tools do not convert.
"""

from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import Literal

from cosim.data.recording import Recording
from cosim.diagnosis.answer.entries import Improved
from cosim.diagnosis.black_box import BANDWIDTHS, BlackBox
from cosim.fmi.description import describe
from cosim.master.exchange import open_fmu
from cosim.support.errors import UnitError
from cosim.support.units import unit
from pyfmi_models.card import Card
from pyfmi_models.controller_section import ControllerSection
from pyfmi_models.correction import correction, left_out
from pyfmi_models.export import export_fmu
from pyfmi_models.export.ssp import Archive, Connection, System, export_ssp
from pyfmi_models.model import Variable
from pyfmi_models.setpoint import Sine

OURS = {"tau": ("N.m", "N"), "q": ("rad", "m"), "v": ("rad/s", "m/s")}
STOP = 15.0


@dataclass(frozen=True)
class Correction:
    """From the card that is most like an FMU to a better one.

    The SSP moves along a sine of this amplitude [rad or m] and frequency [Hz].
    """

    box: BlackBox
    like: Card
    amplitude: float
    frequency: float

    def deliver(self, better: Card, out: Path) -> Improved:
        """Write `correction.fmu`, and `improved.ssp` where it can be had; return what was written, and why not more."""
        fmi: Literal[2, 3] = 2 if describe(self.box.fmu).fmiVersion.startswith("2") else 3
        model = correction(self.like.plant(), better.plant())
        export_fmu(model, out / "correction.fmu", fmi=fmi, force=True)
        entry: Improved = {"correction": "correction.fmu", "base_fmu": self.box.label}
        if left := left_out(better.plant()):
            entry["not_in_correction"] = list(left)
        refused = self._refused()
        if refused:
            return entry | Improved(no_ssp=refused)
        export_ssp(self._system(better), out / "improved.ssp", fmi=fmi, force=True)
        return entry | Improved(ssp="improved.ssp")

    @property
    def _linear(self) -> bool:
        return self.like.mount.motion == "linear"

    def _theirs(self, name: str) -> str:
        return self.box.variables[name].name if name in self.box.variables else name

    def _refused(self) -> str:
        """Why there is no SSP; empty if there can be one."""
        with open_fmu(self.box.fmu) as fmu:
            if describe(self.box.fmu).coSimulation is None:
                return "their FMU has no co-simulation"
            for name, units in OURS.items():
                theirs = self._theirs(name)
                if theirs not in fmu.ports:
                    return f"their FMU has no {name}; say which of its variables that is (--variables {name}=...)"
                stated = fmu.ports[theirs].unit
                if stated and not _same(stated, units[self._linear]):
                    return f"{theirs} is in {stated}, and SSP tools do not convert to {units[self._linear]}"
        return ""

    def _system(self, better: Card) -> System:
        """Set point, controller, correction and their FMU, wired."""
        plant = self._archive()
        tau, q, v = (f"plant.{self._theirs(name)}" for name in OURS)
        names = ("position", "velocity", "acceleration")
        wires = [
            *((f"set_point.{name}", f"controller.{to}") for name, to in zip(names, ("q_d", "v_d", "a_d"), strict=True)),
            ("controller.tau", "correction.tau"),
            ("correction.corrected", tau),
            (q, "correction.q"),
            (v, "correction.v"),
            (q, "controller.q"),
        ]
        turn = "m" if self._linear else "rad"
        sine = Sine(name="set_point", unit=turn, frequency=self.frequency, amplitude=self.amplitude, smooth_start=2.0)
        controlled = self._controlled(better)
        return System(
            name=f"{plant.description or 'plant'} corrected",
            description=f"{self.box.fmu.name} behind a correction that a diagnosis found",
            components={
                "set_point": sine.model(),
                "controller": controlled.controller_model(),
                "correction": correction(self.like.plant(), better.plant()),
                "plant": plant,
            },
            connections=tuple(Connection(source=source, target=target) for source, target in wires),
            step=controlled.controller.period if controlled.controller else 1e-4,
            stop=STOP,
        )

    def _controlled(self, better: Card) -> Card:
        """The card with a controller: its own, or one without a friction model."""
        if better.controller:
            return better
        rate = BANDWIDTHS[-1]
        section = ControllerSection(kp=rate**2 / 4, kd=rate, observer_bandwidth=2 * rate, compensation="C1")
        return replace(better, controller=section)

    def _archive(self) -> Archive:
        kinds = {
            name: Variable(name=self._theirs(name), unit=u[self._linear], description="") for name, u in OURS.items()
        }
        name, outputs = describe(self.box.fmu).modelName, (kinds["q"], kinds["v"])
        return Archive(path=self.box.fmu, description=name, inputs=(kinds["tau"],), outputs=outputs)


def _same(stated: str, ours: str) -> bool:
    try:
        return unit(stated) == unit(ours)
    except UnitError:
        return False


def motion_of(recording: Recording) -> tuple[float, float]:
    """Amplitude [rad or m] and frequency [Hz] of a sine as large and about as fast as a recording."""
    q = recording["q"]
    size = max(float(q.max() - q.min()) / 2, 1e-9)
    speed = float(abs(q[1:] - q[:-1]).mean() / recording.sample_time)
    return size, max(speed / (4 * size), 1 / (2 * pi * STOP))
