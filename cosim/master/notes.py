"""What a person should know of a system before it runs, though it can: as sentences."""

from collections.abc import Iterator, Mapping
from typing import Any

from cosim.fmi.component import Component
from cosim.master.opening import Settings
from cosim.system.plan import Plan
from cosim.system.wiring import Wiring


def notes_of(wiring: Wiring, plan: Plan, settings: Settings) -> Iterator[str]:
    """Yield what model descriptions say that cannot be right, steps that do not fit, and values without effect."""
    for name, component in wiring.components.items():
        yield from (f"{name}: {doubt}." for doubt in component.doubts)
        yield from _own_step(name, component, plan.step, wiring.every.get(name, 1))
    fed: dict[str, str] = {wire.target: wire.source for wire in wiring.wires}
    for name, given in settings.items():
        yield from (f"{one}." for one in _overruled(name, given, fed))


def _own_step(name: str, component: Component, step: float, every: int) -> Iterator[str]:
    """Note that a component is not stepped by whole multiples of its own step (FMI 3.0.2, 4.4)."""
    own, given = component.own_step, step * every
    if not own or _is_multiple(given, own):
        return
    fits = f"a step of {own:g} s"
    if _is_multiple(own, step):
        fits = f"components.{name}.every = {round(own / step)}"
    says = f"{name} goes by steps of its own of {own:g} s and is stepped every {given:g} s, which is no whole multiple"
    yield f"{says}: what it shows may be {own:g} s old; {fits} fits."


def _overruled(name: str, given: Mapping[str, Any], fed: Mapping[str, str]) -> Iterator[str]:
    for key in given:
        target = f"{name}.{key}"
        if target in fed:
            yield f'"{target}" is fed by "{fed[target]}", so the value of its parameters is a first guess and no more'


def _is_multiple(long: float, short: float) -> bool:
    count = round(long / short)
    return count >= 1 and abs(long / short - count) <= 1e-6 * count
