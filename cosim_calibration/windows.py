"""Recordings cut into windows, each simulated from states that the recording gives.

A state is given by the recording where an output that is compared can be set at the start. Unstable or drifting models
are fitted that way; the error of a window does not add up over the recording.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from cosim.support.errors import InputError
from cosim_calibration.experiment import Experiment
from cosim_calibration.initial import states_of
from cosim_calibration.subject import Subject

FEWEST = 4
"""Steps of a window."""


def windows_of(subject: Subject, experiment: Experiment, seconds: float, free: Sequence[str]) -> list[Experiment]:
    """Cut an experiment into windows of some seconds.

    Raises:
        InputError: no output can be set at the start, or a window would hold fewer than `FEWEST` steps.
    """
    states = states_of(subject, experiment, free, "--window")
    length = round(seconds / experiment.step)
    if length < FEWEST:
        text = f"--window {seconds:g}: that is {length} steps of {experiment.step:g} s; {FEWEST} are the fewest."
        raise InputError(text, culprit="--window", value=seconds)
    count = max(1, ceil(experiment.ticks / length))
    parts = [_part(experiment, k * length, min((k + 1) * length, experiment.ticks), states) for k in range(count)]
    return [one for one in parts if one is not None]


def _part(experiment: Experiment, first: int, last: int, states: Sequence[str]) -> Experiment | None:
    """The ticks from `first` to `last`; None where the recording does not give the states there."""
    ticks = experiment.times / experiment.step
    rows = np.flatnonzero((ticks >= first - 1e-3) & (ticks < last + 1e-3))
    if last - first < FEWEST or len(rows) < 2:
        return None
    starts = {name: float(experiment.outputs[name][rows[0]]) for name in states}
    if not np.isfinite(list(starts.values())).all():
        return None
    begin = float(experiment.times[rows[0]])
    return replace(
        experiment,
        name=f"{experiment.name} from {begin:g} s",
        ticks=last - first,
        times=np.maximum(experiment.times[rows] - first * experiment.step, 0.0),
        inputs={name: values[first : last + 1] for name, values in experiment.inputs.items()},
        outputs={name: values[rows] for name, values in experiment.outputs.items()},
        starts=starts,
    )
