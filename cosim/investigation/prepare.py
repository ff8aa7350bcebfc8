"""From names to an investigation: scenario, card, machine and limits read and checked, its folder opened."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256 as sha256_of
from math import pi, sqrt
from pathlib import Path

import numpy as np

from cosim.data.recording import Recording
from cosim.investigation.limits import Limits
from cosim.investigation.loop import Settings
from cosim.investigation.machine import CoSimulated
from cosim.support.errors import InputError
from cosim.support.files import sha256
from cosim.system.scenario import read_scenario
from pyfmi_models.card import Card, read_card


@dataclass(frozen=True)
class Given:
    """Everything that an investigation depends on."""

    machine: CoSimulated
    card: Card
    limits: Limits
    settings: Settings
    train: tuple[Recording, ...]
    heldout: tuple[Recording, ...]

    def identity(self) -> dict[str, str]:
        """Hashes and numbers by which a folder is known to hold the same investigation; the budget may be raised."""
        scenario, card = self.machine.scenario.text, Path(self.card.path)
        return {
            "scenario": sha256_of(scenario.encode()).hexdigest(),
            "card": sha256(card) if card.is_file() else self.card.path,
            "machine": sha256(Path(self.machine.machine)) if Path(self.machine.machine).is_file() else "",
            "limits": ", ".join(f"{name}={value!r}" for name, value in self.limits.as_json().items()),
            "recordings": " ".join(one.sha256 for one in (*self.train, *self.heldout)),
            "motion": f"{self.settings.seconds!r} s, seed {self.settings.seed}, {self.settings.design}",
        }


def given(
    scenario: str,
    card: str,
    machine: str,
    limits: Mapping[str, str],
    settings: Settings,
    train: Sequence[Recording],
    heldout: Sequence[Recording],
) -> Given:
    """Read and check everything before anything moves.

    Raises:
        ScenarioError, CardError, InputError: one sentence each.
    """
    if bool(train) != bool(heldout):
        raise InputError("An investigation goes on from recordings to fit and others for the proof: give both or none.")
    moved, believed = CoSimulated(read_scenario(scenario), machine), read_card(card)
    return Given(moved, believed, _limits(moved, believed, limits), settings, tuple(train), tuple(heldout))


def _limits(machine: CoSimulated, card: Card, wanted: Mapping[str, str]) -> Limits:
    """Those of the scenario's own set point and of the card, and others where they are given."""
    loop = sqrt(card.controller.kp) / (2 * pi) if card.controller else None
    found = Limits.visited(machine.asked(), card.mount.torque_limit, loop).with_given(wanted)
    fastest = 0.5 / (machine.scenario.step * machine.scenario.decimation)
    if found.frequency >= fastest:
        raise InputError(f"--limits frequency={found.frequency:g}: the recording shows less than {fastest:g} Hz.")
    if not found.low < machine.home < found.high or not np.isfinite(machine.home):
        span = f"{found.low:g}:{found.high:g}"
        raise InputError(f"--limits position={span}: the axis stands at {machine.home:g}, which is not inside.")
    return found
