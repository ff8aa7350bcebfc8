"""Times of a scenario as ticks: whole numbers of its step, few enough to be counted."""

from collections.abc import Mapping

from cosim.support.errors import ScenarioError
from cosim.support.numbers import COUNT, shown


def every_of(steps: Mapping[str, tuple[int | None, float | None]], step: float, path: str, most: int) -> dict[str, int]:
    """Return the ticks of a step of the components that do not step at each tick.

    Args:
        steps: by component, what is given: the ticks, or the time in s.
        step: of the scenario in s.
        path: of the scenario, for messages.
        most: ticks of the run.

    Raises:
        ScenarioError: a time is no whole number of steps, or a component would never step.
    """
    found = {}
    for name, (every, time) in steps.items():
        ticks = every or (whole(time, step, path, f"components.{name}.step") if time else 1)
        if ticks > most:
            rule = f"the run has {most:,} ticks, so it would never step"
            message = f"{path}: components.{name} steps every {shown(ticks)} ticks; {rule}."
            raise ScenarioError(message, culprit=name, value=ticks)
        if ticks > 1:
            found[name] = ticks
    return found


def whole(time: float, step: float, path: str, key: str) -> int:
    """Return how many steps a time is, to a millionth.

    Raises:
        ScenarioError: it is no whole number of them, or more than can be counted.
    """
    ticks = round(time / step)
    if ticks > COUNT:
        message = f"{path}: {key} = {time:g} s is {ticks:.3g} steps of {step:g} s; {COUNT:,} can be counted."
        raise ScenarioError(message, culprit=key, value=time)
    if time <= 0:
        raise ScenarioError(f"{path}: {key} = {time:g} must be above 0 s.", culprit=key, value=time)
    if ticks < 1 or abs(time / step - ticks) > 1e-6 * ticks:
        raise ScenarioError(
            f"{path}: {key} = {time} is not a whole number of steps of {step} s.", culprit=key, value=time
        )
    return ticks
