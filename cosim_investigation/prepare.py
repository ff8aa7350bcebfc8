"""From names to an investigation: scenario, card, machine and limits read and checked, its folder opened."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256 as sha256_of
from math import isfinite, pi, sqrt
from pathlib import Path

from cosim.data.recording import Recording
from cosim.hardware.machine import Machine as Hardware
from cosim.support.errors import InputError
from cosim.support.files import sha256
from cosim.system.scenario import read_scenario
from cosim_investigation.drive import RATE, Driven
from cosim_investigation.limits import KEPT, Limits, frequency_of
from cosim_investigation.loop import SHORTEST, Settings
from cosim_investigation.machine import CoSimulated, Machine
from cosim_investigation.motions import Motion
from pyfmi_models.card import Card, read_card

LONGEST = 3600.0
"""Seconds of one motion at most: at 1 kHz an hour has 3.6 million rows, the most that a diagnosis is tried with."""


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
    _check(settings)
    loop, believed = CoSimulated(read_scenario(scenario), machine if isinstance(machine, str) else ""), read_card(card)
    drive = None if isinstance(machine, str) else Driven(loop, machine, fast)
    kept = _limits(loop, drive, believed, limits, settings.seconds)
    drive = drive and replace(drive, limits=kept)
    return Given(loop, drive, believed, kept, settings, tuple(train), tuple(heldout))


def _limits(loop: CoSimulated, drive: Driven | None, card: Card, wanted: Mapping[str, str], seconds: float) -> Limits:
    """Those of the scenario's own set point and of the card, and others where they are given."""
    band = sqrt(card.controller.kp) / (2 * pi) if card.controller else None
    asked = loop.own_motion()
    own = 0.0 if drive else frequency_of(*asked[1:], loop.scenario.step)
    found = Limits.visited(asked, card.mount.torque_limit, band, own).with_given(wanted)
    found = drive.within(found) if drive else found
    if still := [name for name in ("speed", "acceleration") if not getattr(found, name)]:
        text = f"The set point of {loop.scenario.name} does not move, and without a {still[0]} nothing else may"
        raise InputError(f"{text}; give --limits position=, speed= and acceleration=.", culprit="--limits")
    fastest = 0.5 * RATE if drive else 0.5 / (loop.scenario.step * loop.scenario.decimation)
    if found.frequency >= fastest:
        raise InputError(f"--limits frequency={found.frequency:g}: the recording shows less than {fastest:g} Hz.")
    if KEPT * found.frequency * seconds < 1:
        rule = f"a motion of {seconds:g} s has no tone below {1 / (KEPT * seconds):.3g} Hz"
        raise InputError(f"--limits frequency={found.frequency:g}: {rule}; give a higher one, or longer --seconds.")
    home = drive.home if drive else loop.home
    if not found.low < home < found.high:
        span = f"{found.low:g}:{found.high:g}"
        raise InputError(f"--limits position={span}: the axis stands at {home:g}, which is not inside.")
    return found


def _check(settings: Settings) -> None:
    """Refuse times and a seed that are none (InputError)."""
    if not (isfinite(settings.budget) and settings.budget > 0):
        text = f"--budget {settings.budget:g}s: it is a time above 0, as 300s or 5min."
        raise InputError(text, culprit="--budget", value=settings.budget)
    if not SHORTEST <= settings.seconds <= LONGEST:
        text = f"--seconds {settings.seconds:g}: a motion lasts from {SHORTEST:g} to {LONGEST:g} s."
        raise InputError(text, culprit="--seconds", value=settings.seconds)
    if settings.seed < 0:
        raise InputError(f"--seed {settings.seed}: it is a whole number from 0.", culprit="--seed", value=settings.seed)
