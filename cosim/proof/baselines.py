"""What others would do with the residual of the refitted base, on the same files as the tool.

refit        nothing more: it never names anything and never raises an alarm
sindy        PySINDy's sequentially thresholded ridge regression on a library of terms; alarm: any term stays
regression   a smooth black box over q, v, a, direction and time since reversal: boosted trees of scikit-learn, where
             it is not installed a Gaussian kernel; alarm: it lowers the error of the training recording left out

Each is fitted to the training recordings and judged on the held-out one with the residual of the tool's own protocol;
signs as there: what is modelled here is measured minus model torque [N m]. The threshold of the sparse regression is
the one that does best on the training recording left out, as its users choose it; the rest is as the packages have it.
"""

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.protocol import rms
from cosim.diagnosis.regression import EVERY, Model, features, kernel, stacked
from cosim.diagnosis.result import Trace
from cosim.errors import MissingPackageError

Array = npt.NDArray[np.float64]

THRESHOLDS = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
"""Size, relative to the residual, from which a term of the library stays."""
ORDERS = range(1, 13)
"""Waves over a turn in the library of terms."""
ALARM = 0.05
"""Share of the RMS that regression must take from a training recording left out."""


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


def terms(trace: Trace, top: float) -> Array:
    """The library of the sparse regression: what a control engineer would write down; `top` is the highest speed."""
    q, v, a, direction, _ = features(trace).T
    slow = direction * np.exp(-np.abs(v) / (0.05 * top))
    waves = [wave(k * q) for k in ORDERS for wave in (np.sin, np.cos)]
    rubbing = [direction * wave(k * q) for k in ORDERS[:4] for wave in (np.sin, np.cos)]
    plain = [np.ones_like(q), q, direction, v, v * np.abs(v), slow, a, a * np.abs(v), np.abs(a) * v]
    return np.column_stack([*plain, *waves, *rubbing])


def _sindy(train: Sequence[Trace], held: Trace) -> dict[str, Any]:
    stlsq = _stlsq()
    top = max(float(np.abs(trace.v).max()) for trace in train)
    library = {trace.name: terms(trace, top) for trace in (*train, held)}

    def fit(traces: Sequence[Trace], threshold: float) -> Array:
        columns = np.concatenate([library[trace.name][::EVERY] for trace in traces])
        target = np.concatenate([trace.missing[::EVERY] for trace in traces])
        sizes, size = np.linalg.norm(columns, axis=0) + 1e-300, np.linalg.norm(target) + 1e-300
        # Columns of norm 1 give the ridge its meaning; unbiased, a library this alike explodes on another motion.
        with warnings.catch_warnings():  # that no term is left is one of the answers
            warnings.filterwarnings("ignore", "Sparsity parameter is too big")
            found = stlsq(threshold=threshold, unbias=False).fit(columns / sizes, target[:, None] / size)
        return np.asarray(np.ravel(found.coef_) * size / sizes)

    def left(trace: Trace, weights: Array) -> float:
        return rms(trace.missing - library[trace.name] @ weights)

    def left_out(threshold: float) -> float:
        return sum(left(one, fit([other for other in train if other is not one], threshold)) for one in train)

    best = min(THRESHOLDS, key=left_out) if len(train) > 1 else THRESHOLDS[-1]
    weights = fit(train, best)
    terms_left = int(np.count_nonzero(weights))
    return {"heldout_rms": left(held, weights), "alarm": terms_left > 0, "terms": terms_left, "threshold": best}


def _stlsq() -> Any:
    try:
        from pysindy import STLSQ
    except ImportError as error:
        text = "pysindy is not installed; pip install 'mount-cosim[proof]' brings it."
        raise MissingPackageError(text) from error
    return STLSQ


def _regression(train: Sequence[Trace], held: Trace) -> dict[str, Any]:
    kind, fit = _regressor()
    model = fit(*stacked(train))
    gains = [_left_out(train, one, fit) for one in train] if len(train) > 1 else [0.0]
    alarm = float(np.mean(gains)) > ALARM
    return {"heldout_rms": rms(held.missing - model(features(held))), "alarm": alarm, "kind": kind}


def _left_out(train: Sequence[Trace], one: Trace, fit: Callable[[Array, Array], Model]) -> float:
    """Share of the RMS of one recording that a model of the others takes away."""
    model = fit(*stacked([other for other in train if other is not one]))
    return 1 - rms(one.missing - model(features(one))) / rms(one.missing)


def _regressor() -> tuple[str, Callable[[Array, Array], Model]]:
    try:
        from sklearn.ensemble import HistGradientBoostingRegressor
    except ImportError:
        return "Gaussian kernel", kernel

    def trees(rows: Array, target: Array) -> Model:
        fitted = HistGradientBoostingRegressor(random_state=0).fit(rows, target)
        return lambda others: np.asarray(fitted.predict(others))

    return "boosted trees", trees
