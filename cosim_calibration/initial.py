"""Start values of outputs: single readings of the recording, or numbers of their own, found like the others.

A start value that is free belongs to one experiment: it moves the rows of that one alone. A recording has one
experiment, or as many as windows are cut of it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cosim.fmi.types import FLOATS
from cosim.support.errors import InputError
from cosim_calibration.experiment import Experiment
from cosim_calibration.free import Free
from cosim_calibration.subject import Subject

INITIALS = ("recorded", "free")
MOST = 400
"""Free start values: each is a column of derivatives as long as the recordings."""


def states_of(subject: Subject, experiment: Experiment, free: Sequence[str], option: str) -> list[str]:
    """Outputs of a recording that can be set at the start.

    Raises:
        InputError: there are none; `option` asks for them.
    """
    found = [name for name in experiment.outputs if _is_state(subject, name) and name not in free]
    if found:
        return found
    outputs = ", ".join(experiment.outputs)
    text = f"{option}: {subject.source} lets nobody set {outputs} at the start, so a simulation cannot begin from them"
    raise InputError(f"{text}; leave {option} out to simulate from the model's own start.", culprit=option)


def from_first_row(experiment: Experiment, states: Sequence[str]) -> Experiment:
    """The experiment, started from its first reading of each state."""
    readings = {name: float(experiment.outputs[name][0]) for name in states}
    return replace(experiment, starts={name: value for name, value in readings.items() if np.isfinite(value)})


def with_free_starts(
    subject: Subject, experiments: Sequence[Experiment], free: Sequence[str]
) -> tuple[list[Experiment], tuple[Free, ...]]:
    """The experiments, each with free start values, and these numbers.

    Raises:
        InputError: there are more than `MOST`.
    """
    names: set[str] = set()
    found: list[Experiment] = []
    numbers: list[Free] = []
    for k, one in enumerate(experiments):
        own = {}
        for variable in states_of(subject, one, free, "--initial free"):
            name = f"{variable} at the start of {one.name}"
            name = name if name not in names else f"{name} ({k + 1})"
            names.add(name)
            own[variable] = name
            numbers.append(_free(subject, one, variable, name, k))
        found.append(replace(one, own=own))
    if len(numbers) > MOST:
        text = f"--initial free: {len(numbers):,} start values in {len(found):,} windows; {MOST} are the most"
        raise InputError(f"{text}: give longer windows.", culprit="--initial")
    return found, tuple(numbers)


def _free(subject: Subject, experiment: Experiment, variable: str, name: str, number: int) -> Free:
    port = subject.ports[variable]
    given = (experiment.starts or {}).get(variable, port.start)
    start = float(np.clip(given if isinstance(given, int | float) else 0.0, port.low, port.high))
    spread = float(np.nanstd(experiment.outputs[variable]))
    return Free(name, port.unit, start, port.low, port.high, spread or abs(start) or 1.0, number)


def _is_state(subject: Subject, name: str) -> bool:
    port = subject.ports.get(name)
    return port is not None and port.settable and port.type in FLOATS and name in subject.known
