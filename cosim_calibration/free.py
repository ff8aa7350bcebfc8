"""Numbers that a calibration may change: where they start, within which bounds, and on which scale they count."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite

from cosim.fmi.component import Port
from cosim.fmi.types import FLOATS
from cosim.support.errors import InputError
from cosim_calibration.subject import Subject, unknown

OPTION = "--free"


@dataclass(frozen=True)
class Free:
    """One number: its name, unit, start and bounds in the model's unit, and a size that counts as a large change.

    `experiment` is the one whose start value it is; -1 for a number that all share.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    scale: float
    experiment: int = -1


def free_of(
    subject: Subject,
    names: Sequence[str],
    given: Mapping[str, float],
    bounds: Mapping[str, tuple[float, float]],
) -> tuple[Free, ...]:
    """Check the names of a calibration and return its numbers.

    Bounds are the variable's min and max unless others are given. The scale is the size of the start value, else the
    nominal, else a tenth of the bounds' distance, else 1.

    Args:
        subject: what is calibrated.
        names: as the user writes them.
        given: values that stand in the place of start values.
        bounds: least and greatest value by name.

    Raises:
        InputError: a name is unknown, none of a number that can be set, or has no start value within its bounds.
    """
    if not names:
        choices = ", ".join(parameters(subject)[:12]) or "none"
        raise InputError(f"{OPTION} names no parameter of {subject.source}; parameters are: {choices}.", culprit=OPTION)
    for name in names:
        if names.count(name) > 1:
            raise InputError(f'{OPTION} "{name}" is given twice; once is enough.', culprit=name)
    for name in bounds:
        if name not in names:
            raise InputError(f'--bounds "{name}": it is not among those of {OPTION}: {", ".join(names)}.', culprit=name)
    return tuple(_free(subject, name, given.get(name), bounds.get(name)) for name in names)


def parameters(subject: Subject) -> tuple[str, ...]:
    """Names of the real numbers that can be identified: parameters first, then start values of others."""
    real = [
        name
        for name in subject.known
        if (port := subject.ports.get(name)) is None or (port.type in FLOATS and not port.shape)
    ]
    ours = [name for name in real if name not in subject.ports or subject.ports[name].causality != "input"]
    first = [name for name in ours if name in subject.ports and subject.ports[name].causality == "parameter"]
    return (*first, *(name for name in ours if name not in first))


def _free(subject: Subject, name: str, given: float | None, bounds: tuple[float, float] | None) -> Free:
    port = subject.ports.get(name)
    _check(subject, name, port)
    low, high = bounds or ((port.low, port.high) if port else (-inf, inf))
    if low > high or (port and bounds and not (port.low <= low and high <= port.high)):
        limits = f", and the model allows {port.low:g} .. {port.high:g}" if port else ""
        text = f'--bounds "{name}={low:g}..{high:g}": the first must be below the second{limits}.'
        raise InputError(text, culprit=name, value=bounds)
    start = _start(subject, name, port, given)
    if not low <= start <= high:
        text = (
            f'{OPTION} "{name}" starts at {start:g}, outside its bounds {low:g} .. {high:g}; --set {name}=... moves it.'
        )
        raise InputError(text, culprit=name, value=start)
    width = high - low if isfinite(high - low) else 0.0
    scale = abs(start) or subject.nominals.get(name, 0.0) or 0.1 * width or 1.0
    unit = port.unit if port else subject.known[name].unit
    return Free(name, unit, start, low, high, scale)


def _check(subject: Subject, name: str, port: Port | None) -> None:
    if port is None and name not in subject.known:
        raise unknown(OPTION, name, subject.source, parameters(subject), "parameters are")
    if port is None:
        return
    if port.causality == "input" and name not in subject.known:
        why = "it is an input that is fed"
    elif port.causality == "input":
        why = "it is an input, which the columns of the recordings give"
    elif port.type not in FLOATS:
        why = f"it is of type {port.type}, and only real numbers can be identified"
    elif port.shape:
        why = f"it is an array; name an element of it, {name}[1]"
    elif not port.settable or name not in subject.known:
        why = f"it {port.not_settable or 'cannot be set'}"
    else:
        return
    choices = parameters(subject)
    text = f'{OPTION} "{name}" is no parameter: {why}; parameters are: {", ".join(choices[:12])}.'
    raise InputError(text, culprit=name, value=name)


def _start(subject: Subject, name: str, port: Port | None, given: float | None) -> float:
    if given is not None:
        return float(given)
    at, scenario = subject.known[name], subject.scenario
    section = scenario.components.get(at.owner)
    wire = next((one for one in scenario.wires if one.target == at.owner), None)
    holders = (
        section.parameters.get(at.key) if section else None,
        port.start if port else None,
        getattr(scenario.signals.get(at.owner), at.key, None),
        getattr(wire, at.key, None),
    )
    for value in holders:
        if isinstance(value, int | float):
            return float(value)
    text = f'{OPTION} "{name}" has no start value in {subject.source}; --set {name}=... gives one.'
    raise InputError(text, culprit=name)
