"""A card in the place of the one in a shipped scenario, as a system for an SSP: the same parts, wires and step."""

from dataclasses import replace
from math import pi
from pathlib import Path

from cosim.data.signals import Sine
from cosim.support.errors import ScenarioError
from cosim.system.scenario import Scenario, read_scenario
from cosim.system.sections import ComponentSection
from cosim.system.wire import Wire
from pyfmi_models.card import Card
from pyfmi_models.export.ssp import Connection, System
from pyfmi_models.model import Model
from pyfmi_models.setpoint import Sine as SetPoint

SCENARIO = "sidereal"


def system_of(card: Card) -> System:
    """Wire plant and controller of a card, and a set point, as the scenario `sidereal` does.

    Raises:
        CardError: the card has no controller.
    """
    scenario = read_scenario(SCENARIO)
    parts = {name: _part(one, card) for name, one in scenario.components.items()}
    sources = {name: _set_point(scenario, name, card) for name in scenario.signals}
    name = card.plant().name
    return System(
        name=name,
        description=f"{name}, its controller and a set point, wired as in the scenario {SCENARIO}",
        components=parts | sources,
        connections=tuple(_connection(wire) for wire in scenario.wires),
        step=scenario.step,
        stop=scenario.stop,
        origins={name: _origin(card) for name in parts},
    )


def _origin(card: Card) -> dict[str, object]:
    """Say what a card was identified from and how well, as a diagnosis wrote it there."""
    own: dict[str, object] = {"card": Path(card.path).name} if card.path else {}
    return own | (dict(card.origin) or {"evidence": "none: the numbers are those of the card"})


def _part(component: ComponentSection, card: Card) -> Model:
    return card.plant().model() if component.part == "plant" else card.controller_model()


def _set_point(scenario: Scenario, name: str, card: Card) -> Model:
    signal = scenario.signals[name]
    if not isinstance(signal, Sine):
        raise ScenarioError(f"{scenario.path}: signals.{name} cannot become an FMU; only a sine can.", culprit=name)
    speed = signal.max_velocity or 0.0
    size = signal.amplitude if signal.amplitude is not None else speed / (2 * pi * signal.frequency)
    unit = "rad" if card.mount.motion == "rotary" else "m"
    return SetPoint(
        name=name,
        unit=unit,
        frequency=signal.frequency,
        amplitude=size,
        phase=signal.phase,
        smooth_start=signal.smooth_start,
    ).model()


def _connection(wire: Wire) -> Connection:
    plain = Connection(source=wire.source, target=wire.target, factor=wire.gain, offset=wire.offset)
    if not wire.quantum:
        return plain
    note = f"Left out, as SSP has no quantiser: the encoder's quantum of {wire.quantum:.6g}."
    return replace(plain, note=note)
