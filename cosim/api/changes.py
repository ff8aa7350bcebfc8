"""A scenario with other numbers for one run, by the names that a sweep varies."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from cosim.support.errors import InputError
from cosim.system.address import Value, addresses, find
from cosim.system.scenario import Scenario
from cosim.system.ticks import whole

OPTION = "--set"
TRUTHS = {"true": True, "false": False}


def changed(scenario: Scenario, values: Mapping[str, Value], stop: float | None = None) -> Scenario:
    """Return the scenario with other numbers; its text says which.

    Args:
        scenario: its components have their FMUs.
        values: by name: "controller.kp", "reference.frequency", "plant.tau.gain"; see `cosim.system.address`.
        stop: time at which the run ends instead [s].

    Raises:
        SweepError: there is no such number; lists those that there are.
        ScenarioError: a number cannot have that value, or `stop` is no whole number of steps after the start.
    """
    known = addresses(scenario) if values else {}
    for name, value in values.items():
        scenario = find(name, known, OPTION, "set").set(scenario, value)
    if stop is not None:
        scenario = replace(scenario, ticks=whole(stop - scenario.start, scenario.step, scenario.path, "stop"))
    changes = {**values, **({} if stop is None else {"stop": stop})}
    lines = "".join(f"\n# for this run: {name} = {value}" for name, value in changes.items())
    return replace(scenario, text=scenario.text.rstrip("\n") + lines + "\n") if lines else scenario


def values_of(pairs: Sequence[str]) -> dict[str, Value]:
    """Read `name=value` of a command line: numbers, true or false.

    Raises:
        InputError: names the pair.
    """
    values: dict[str, Value] = {}
    for pair in pairs:
        name, assigned, text = pair.partition("=")
        if not assigned or not name.strip():
            raise InputError(f'{OPTION} "{pair}": write component.parameter=value.', culprit=OPTION, value=pair)
        if name in values:
            raise InputError(f"{OPTION} {name} is given twice; once is enough.", culprit=name)
        values[name] = _value(name, text.strip())
    return values


def _value(name: str, text: str) -> Value:
    if text.lower() in TRUTHS:
        return TRUTHS[text.lower()]
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{OPTION} {name}={text}: it must be a number, true or false.", culprit=name) from None
