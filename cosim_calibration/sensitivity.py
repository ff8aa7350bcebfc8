"""Derivatives of outputs by parameters from an FMU's own partial derivatives, along a simulation.

With x' = f(x, u, p), y = g(x, u, p) and S = dx/dp the variational equation is

    S' = f_x S + f_p,    dy/dp = g_x S + g_p

Over a step the partial derivatives are the mean of those at its ends: S goes on by the exponential of them, which is of
second order and does not mind a stiff model. A state whose start value is among the parameters starts with dx/dp = 1,
all others with 0. Reference: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, I.14.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from cosim.fmi.description import describe
from cosim.fmi.fmu import FmuComponent
from cosim.support.errors import StepError
from cosim_calibration.experiment import Array, Experiment
from cosim_calibration.subject import Subject


def slopes_of(
    component: FmuComponent, subject: Subject, experiment: Experiment, values: Mapping[str, float], names: Sequence[str]
) -> list[Array] | None:
    """Derivatives of each output of an experiment at its rows, shape (rows, names); None where the FMU gives none.

    Raises:
        StepError: the FMU fails on its way.
    """
    states, rates = _states(subject)
    known = np.array([*states, *(component.ports[one].reference for one in names)], np.uint32)
    unknown = np.array([*rates, *(component.ports[one].reference for one in experiment.outputs)], np.uint32)
    places = np.array([component.ports[one].reference for one in experiment.inputs], np.uint32)
    inputs = np.stack([*experiment.inputs.values(), np.zeros(experiment.ticks + 1)])[:-1].T.copy()
    component.start(values)
    before, after = [], []
    for tick in range(experiment.ticks):
        if len(places):
            component.set(places, inputs[tick])
        before.append(component.derivatives(unknown, known))
        status = component.step(tick * experiment.step, experiment.step)
        if status > 1:
            raise StepError(f"{subject.source} fails at {tick * experiment.step:g} s.", component=component.name)
        after.append(component.derivatives(unknown, known))
        if before[-1] is None or after[-1] is None:
            return None
    first, last = (np.array(one, np.float64) for one in (before, after))
    own = np.array([[float(one == state) for one in known[len(states) :]] for state in states])
    return _at_rows(experiment, len(states), first, last, own.reshape(len(states), len(names)))


def _at_rows(experiment: Experiment, count: int, first: Array, last: Array, start: Array) -> list[Array]:
    """Solve the variational equation; partial derivatives are (ticks, states + outputs, states + names)."""
    from scipy.linalg import expm

    names = start.shape[1]
    mean = np.zeros((len(first), count + names, count + names))
    mean[:, :count] = 0.5 * experiment.step * (first[:, :count] + last[:, :count])
    through = expm(mean)[:, :count]
    sensitivity = start
    found = [_outputs(first[0], count, sensitivity)]
    for k in range(len(first)):
        sensitivity = through[k, :, :count] @ sensitivity + through[k, :, count:]
        found.append(_outputs(last[k], count, sensitivity))
    whole = np.array(found)
    columns = [
        experiment.at_rows({name: whole[:, k, j] for k, name in enumerate(experiment.outputs)}) for j in range(names)
    ]
    return [np.stack(one, axis=1) for one in zip(*columns, strict=True)]


def _outputs(partial: Array, count: int, sensitivity: Array) -> Array:
    """dy/dp = g_x S + g_p."""
    slopes: Array = partial[count:, :count] @ sensitivity + partial[count:, count:]
    return slopes


def _states(subject: Subject) -> tuple[list[int], list[int]]:
    """References of the continuous states and of their derivatives."""
    pairs = [
        (one.variable.derivative.valueReference, one.variable.valueReference)
        for one in describe(subject.source).derivatives
        if one.variable.derivative is not None
    ]
    return [state for state, _ in pairs], [rate for _, rate in pairs]
