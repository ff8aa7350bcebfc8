"""What others would do with the residual of the refitted base, on the same files as the tool.

refit        nothing more: it never names anything and never raises an alarm
sindy        PySINDy's sequentially thresholded least squares on a library of terms; alarm: any term stays
regression   a smooth black box over q, v, a, direction and time since reversal: boosted trees of scikit-learn, where
             it is not installed a Gaussian kernel; alarm: it lowers the error of the training recording left out

Each is fitted to the training recordings and judged on the held-out one with the residual of the tool's own protocol;
signs as there: what is modelled here is measured minus model torque [N m]. None was tuned; thresholds are those of the
packages, or a round number stated here.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.result import Trace
from cosim.errors import MissingPackageError

Array = npt.NDArray[np.float64]
Model = Callable[[Array], Array]
"""From features (rows, features) to torque (rows,)."""

EVERY = 4
"""Rows of a trace for each row that is fitted: the trace is filtered at 30 Hz and has eight rows a period of that."""
THRESHOLD = 0.1
"""PySINDy's default; columns and residual are scaled to RMS 1, so a term of a tenth of the residual stays."""
ORDERS = range(1, 13)
"""Waves over a turn in the library of terms."""
ALARM = 0.05
"""Share of the RMS that regression must take from a training recording left out."""
CENTRES = 800
"""Rows that a kernel is placed at."""


def compared(traces: Sequence[Trace]) -> dict[str, dict[str, Any]]:
    """Held-out RMS and alarm of each baseline: {"refit": {"heldout_rms", "alarm"}, ...}; a missing package is said."""
    train = [trace for trace in traces if not trace.heldout]
    (held,) = (trace for trace in traces if trace.heldout)
    answers: dict[str, dict[str, Any]] = {"refit": {"heldout_rms": rms(held.missing), "alarm": False}}
    for name, judge in (("sindy", _sindy), ("regression", _regression)):
        try:
            answers[name] = judge(train, held)
        except MissingPackageError as error:
            answers[name] = {"skipped": str(error)}
    return answers


def rms(x: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(x**2)))


def features(trace: Trace) -> Array:
    """Position, speed, acceleration, direction, logarithm of the time since the last reversal."""
    direction = np.sign(trace.v)
    turned = np.flatnonzero(np.diff(direction, prepend=direction[:1]) != 0)
    last = np.concatenate([[0], turned])[np.searchsorted(turned, np.arange(len(trace.t)), side="right")]
    since = trace.t - trace.t[last]
    return np.column_stack([trace.q, trace.v, np.gradient(trace.v, trace.t), direction, np.log(since + 1e-2)])


def terms(trace: Trace, top: float) -> Array:
    """The library of the sparse regression: what a control engineer would write down; `top` is the highest speed."""
    q, v, a, direction, _ = features(trace).T
    slow = direction * np.exp(-np.abs(v) / (0.05 * top))
    waves = [wave(k * q) for k in ORDERS for wave in (np.sin, np.cos)]
    rubbing = [direction * wave(k * q) for k in ORDERS[:4] for wave in (np.sin, np.cos)]
    plain = [np.ones_like(q), q, direction, v, v * np.abs(v), slow, a, a * np.abs(v), np.abs(a) * v]
    return np.column_stack([*plain, *waves, *rubbing])


def _sindy(train: Sequence[Trace], held: Trace) -> dict[str, Any]:
    optimizer = _stlsq()
    top = max(float(np.abs(trace.v).max()) for trace in train)
    columns = np.concatenate([terms(trace, top) for trace in train])[::EVERY]
    target = np.concatenate([trace.missing for trace in train])[::EVERY]
    sizes, size = np.sqrt((columns**2).mean(0)) + 1e-300, rms(target)
    weights = np.ravel(optimizer.fit(columns / sizes, target[:, None] / size).coef_) * size / sizes
    left = held.missing - terms(held, top) @ weights
    return {"heldout_rms": rms(left), "alarm": bool(np.any(weights)), "terms": int(np.count_nonzero(weights))}


def _stlsq() -> Any:
    try:
        from pysindy import STLSQ
    except ImportError as error:
        text = "pysindy is not installed; pip install 'mount-cosim[proof]' brings it."
        raise MissingPackageError(text) from error
    return STLSQ(threshold=THRESHOLD)


def _regression(train: Sequence[Trace], held: Trace) -> dict[str, Any]:
    kind, fit = _regressor()
    model = fit(*_stacked(train))
    gains = [_left_out(train, one, fit) for one in train] if len(train) > 1 else [0.0]
    alarm = float(np.mean(gains)) > ALARM
    return {"heldout_rms": rms(held.missing - model(features(held))), "alarm": alarm, "kind": kind}


def _left_out(train: Sequence[Trace], one: Trace, fit: Callable[[Array, Array], Model]) -> float:
    """Share of the RMS of one recording that a model of the others takes away."""
    model = fit(*_stacked([other for other in train if other is not one]))
    return 1 - rms(one.missing - model(features(one))) / rms(one.missing)


def _stacked(traces: Sequence[Trace]) -> tuple[Array, Array]:
    rows = np.concatenate([features(trace) for trace in traces])[::EVERY]
    return rows, np.concatenate([trace.missing for trace in traces])[::EVERY]


def _regressor() -> tuple[str, Callable[[Array, Array], Model]]:
    try:
        from sklearn.ensemble import HistGradientBoostingRegressor
    except ImportError:
        return "Gaussian kernel", kernel

    def trees(rows: Array, target: Array) -> Model:
        fitted = HistGradientBoostingRegressor(random_state=0).fit(rows, target)
        return lambda others: np.asarray(fitted.predict(others))

    return "boosted trees", trees


def kernel(rows: Array, target: Array, ridge: float = 1e-2) -> Model:
    """Kernel ridge regression on evenly spaced centres; widths are the spread of each feature.

    k(x, c) = exp(-|x - c|^2 / 2) of features scaled to unit spread; ridge relative to the mean of the normal matrix.
    """
    middle, spread = rows.mean(0), rows.std(0) + 1e-300
    centres = ((rows - middle) / spread)[:: max(1, len(rows) // CENTRES)]

    def lifted(others: Array) -> Array:
        x = (others - middle) / spread
        squares = (x**2).sum(1)[:, None] + (centres**2).sum(1) - 2 * x @ centres.T
        return np.asarray(np.exp(-squares / 2))

    columns = lifted(rows)
    normal = columns.T @ columns
    weights = np.linalg.solve(normal + ridge * np.trace(normal) / len(normal) * np.eye(len(normal)), columns.T @ target)
    return lambda others: np.asarray(lifted(others) @ weights)
