"""From names to an investigation: scenario, card, machine and limits read and checked, its folder opened."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256 as sha256_of
from math import pi, sqrt
from pathlib import Path

from cosim.data.recording import Recording
from cosim.hardware.machine import Machine as Hardware
from cosim.investigation.drive import RATE, Driven
from cosim.investigation.limits import Limits
from cosim.investigation.loop import Settings
from cosim.investigation.machine import CoSimulated, Machine
from cosim.investigation.motions import Motion
from cosim.support.errors import InputError
from cosim.support.files import sha256
from cosim.system.scenario import read_scenario
from pyfmi_models.card import Card, read_card


@dataclass(frozen=True)
class Given:
    """Everything that an investigation depends on."""

    loop: CoSimulated
    drive: Driven | None
    card: Card
    limits: Limits
    settings: Settings
    train: tuple[Recording, ...]
    heldout: tuple[Recording, ...]

    @property
    def machine(self) -> Machine:
        """What is moved."""
        return self.drive or self.loop

    @property
    def own(self) -> Motion | None:
        """The first motion; a drive would not end it at rest where it began."""
        return None if self.drive else self.loop.own()

    def identity(self) -> dict[str, str]:
        """Hashes and numbers by which a folder is known to hold the same investigation; the budget may be raised."""
        scenario, card = self.loop.scenario.text, Path(self.card.path)
        drive = self.drive.hardware.model_dump_json() if self.drive else self.loop.machine
        return {
            "scenario": sha256_of(scenario.encode()).hexdigest(),
            "card": sha256(card) if card.is_file() else self.card.path,
            "machine": sha256(Path(drive)) if not self.drive and Path(drive).is_file() else drive,
            "limits": ", ".join(f"{name}={value!r}" for name, value in self.limits.as_json().items()),
            "recordings": " ".join(one.sha256 for one in (*self.train, *self.heldout)),
            "motion": f"{self.settings.seconds!r} s, seed {self.settings.seed}, {self.settings.design}",
        }


def given(
    scenario: str,
    card: str,
    machine: str | Hardware,
    limits: Mapping[str, str],
    settings: Settings,
    train: Sequence[Recording],
    heldout: Sequence[Recording],
    fast: bool = False,
) -> Given:
    """Read and check everything before anything moves; `machine` is a card, a plant FMU, or a drive (`fast`: no clock).

    Raises:
        ScenarioError, CardError, InputError: one sentence each.
    """
    if bool(train) != bool(heldout):
        raise InputError("An investigation goes on from recordings to fit and others for the proof: give both or none.")
    loop, believed = CoSimulated(read_scenario(scenario), machine if isinstance(machine, str) else ""), read_card(card)
    drive = None if isinstance(machine, str) else Driven(loop, machine, fast)
    kept = _limits(loop, drive, believed, limits)
    drive = drive and replace(drive, limits=kept)
    return Given(loop, drive, believed, kept, settings, tuple(train), tuple(heldout))


def _limits(loop: CoSimulated, drive: Driven | None, card: Card, wanted: Mapping[str, str]) -> Limits:
    """Those of the scenario's own set point and of the card, and others where they are given."""
    band = sqrt(card.controller.kp) / (2 * pi) if card.controller else None
    found = Limits.visited(loop.asked(), card.mount.torque_limit, band).with_given(wanted)
    found, home = (drive.within(found), drive.home) if drive else (found, loop.home)
    fastest = 0.5 * RATE if drive else 0.5 / (loop.scenario.step * loop.scenario.decimation)
    if found.frequency >= fastest:
        raise InputError(f"--limits frequency={found.frequency:g}: the recording shows less than {fastest:g} Hz.")
    if not found.low < home < found.high:
        span = f"{found.low:g}:{found.high:g}"
        raise InputError(f"--limits position={span}: the axis stands at {home:g}, which is not inside.")
    return found
