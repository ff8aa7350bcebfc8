"""What others would do with the residual of the refitted base, on the same files as the tool.

refit      nothing more: it never names anything and never raises an alarm
sindy      PySINDy's sequentially thresholded ridge regression on a library of some 240 terms: waves up to 80 cycles a
           turn, friction that waves, timing, drag, user columns; alarm: any term stays
boosting   boosted trees of scikit-learn over the features below; alarm: it lowers the error of the training recording
           left out
gp         a Gaussian process of scikit-learn over the same features, a length each, on rows evenly taken; alarm alike
kernel     Gaussian kernel ridge regression on five of the features, which needs no package; alarm alike

Features: position and its wave, speed, acceleration, direction, time since the last reversal, rates of torque and of
acceleration, time since the start, user columns. Each is fitted to the training recordings and judged on the held-out
one with the residual of the tool's own protocol; signs as there: what is modelled here is measured minus model torque
[N m]. The threshold of the sparse regression is the one that does best on the training recording left out, as its users
choose it; the rest is as the packages have it.
"""

import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.diagnosis.answer.result import Trace
from cosim.diagnosis.measure.regression import EVERY, Model, features, kernel
from cosim.support.errors import MissingPackageError
from cosim.support.extras import install
from cosim.support.plain import Parsed
from cosim.support.statistics import rms

Array = npt.NDArray[np.float64]
Fitter = Callable[[Array, Array], Model]

NAMES = ("refit", "sindy", "boosting", "gp", "kernel")
THRESHOLDS = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
"""Size, relative to the residual, from which a term of the library stays."""
ORDERS = range(1, 81)
"""Cycles a turn (or a metre) of the waves in the library of terms."""
RUBBING = range(1, 13)
"""... and of the waves of a friction level."""
ALARM = 0.05
"""Share of the RMS that regression must take from a training recording left out."""
GP_ROWS = 300
"""Rows that a Gaussian process is fitted to: its cost grows with their cube."""


def compared(traces: Sequence[Trace], turn: float = 1.0, names: Sequence[str] = NAMES) -> dict[str, Parsed]:
    """Held-out RMS and alarm of each baseline: {"refit": {"heldout_rms", "alarm"}, ...}; a missing package is said.

    `turn` is by how many radians waves turn in a unit of the position: 1, or 2 pi where that is a metre.
    """
    train = [trace for trace in traces if not trace.heldout]
    (held,) = (trace for trace in traces if trace.heldout)
    answers: dict[str, Parsed] = {}
    for name in names:
        try:
            answers[name] = _judged(name, train, held, turn)
        except MissingPackageError as error:
            answers[name] = {"skipped": str(error)}
    return answers


def _judged(name: str, train: Sequence[Trace], held: Trace, turn: float) -> Parsed:
    if name == "refit":
        return {"heldout_rms": rms(held.missing), "alarm": False}
    if name == "sindy":
        return _sindy(train, held, turn)
    if name == "kernel":
        return _regression(train, held, features, kernel)
    return _regression(train, held, partial(wide, turn=turn), {"boosting": _trees, "gp": _gp}[name]())


def wide(trace: Trace, turn: float = 1.0) -> Array:
    """The features of boosting and of the Gaussian process, (rows, features)."""
    q, v, a, direction, since = features(trace).T
    plain = [q, np.sin(turn * q), np.cos(turn * q), v, a, direction, since, *_rates(trace, a), trace.t - trace.t[0]]
    return np.column_stack([*plain, *(trace.extras[name] for name in _columns(trace))])


def _rates(trace: Trace, a: Array) -> tuple[Array, Array]:
    """Rates of torque and of acceleration: a delay or a lag of the one or the other is a multiple of them."""
    return np.gradient(trace.tau, trace.t), np.gradient(a, trace.t)


def _columns(trace: Trace) -> list[str]:
    return sorted(name for name in trace.extras if name not in ("q_d", "v"))


def terms(trace: Trace, top: float, turn: float = 1.0) -> Array:
    """The library of the sparse regression: what a control engineer would write down; `top` is the highest speed."""
    q, v, a, direction, _ = features(trace).T
    slow = [direction * np.exp(-np.abs(v) / (share * top)) for share in (0.01, 0.05, 0.2)]
    waves = [wave(k * turn * q) for k in ORDERS for wave in (np.sin, np.cos)]
    rubbing = [direction * wave(k * turn * q) for k in RUBBING for wave in (np.sin, np.cos)]
    swinging = [a * wave(k * turn * q) for k in (1, 2) for wave in (np.sin, np.cos)]
    plain = [np.ones_like(q), q, q**3, direction, v, np.abs(v), v * np.abs(v), a, a * np.abs(v), np.abs(a) * v]
    rates = [*_rates(trace, a), np.gradient(np.gradient(trace.tau, trace.t), trace.t)]
    given = [trace.extras[name] for name in _columns(trace)]
    products = [f * column for column in given for f in (np.ones_like(q), direction, v)]
    return np.column_stack([*plain, *slow, *rates, *products, *waves, *rubbing, *swinging])


def _sindy(train: Sequence[Trace], held: Trace, turn: float) -> Parsed:
    stlsq = _stlsq()
    top = max(float(np.abs(trace.v).max()) for trace in train)
    library = {trace.name: terms(trace, top, turn) for trace in (*train, held)}
    sizes = np.sqrt(sum((library[one.name] ** 2).sum(0) for one in train)) + 1e-300
    short = {one.name: _shortened(library[one.name][::EVERY] / sizes, one.missing[::EVERY]) for one in train}

    def fit(traces: Sequence[Trace], threshold: float) -> Array:
        columns, target = (np.concatenate([short[trace.name][part] for trace in traces]) for part in (0, 1))
        # Columns of norm 1 give the ridge its meaning; unbiased, a library this alike explodes on another motion.
        scale, size = np.linalg.norm(columns, axis=0) + 1e-300, np.linalg.norm(target) + 1e-300
        with warnings.catch_warnings():  # that no term is left is one of the answers
            warnings.filterwarnings("ignore", "Sparsity parameter is too big")
            found = stlsq(threshold=threshold, unbias=False).fit(columns / scale, target[:, None] / size)
        return np.asarray(np.ravel(found.coef_) * size / scale / sizes)

    def rest(trace: Trace, weights: Array) -> float:
        return rms(trace.missing - library[trace.name] @ weights)

    def left_out(threshold: float) -> float:
        return sum(rest(one, fit([other for other in train if other is not one], threshold)) for one in train)

    best = min(THRESHOLDS, key=left_out) if len(train) > 1 else THRESHOLDS[-1]
    weights = fit(train, best)
    terms_left = int(np.count_nonzero(weights))
    return {"heldout_rms": rest(held, weights), "alarm": terms_left > 0, "terms": terms_left, "threshold": best}


def _shortened(columns: Array, target: Array) -> tuple[Array, Array]:
    """Columns and target with one row a term and the same normal equations: least squares sees no difference."""
    whole: Array = np.asarray(np.linalg.qr(np.column_stack([columns, target]), mode="r"))
    return whole[:, :-1], whole[:, -1]


def _stlsq() -> Any:
    try:
        from pysindy import STLSQ
    except ImportError as error:
        raise _missing("pysindy") from error
    return STLSQ


def _missing(package: str) -> MissingPackageError:
    return MissingPackageError(f"{package} is not installed: {install('proof')}")


def _regression(train: Sequence[Trace], held: Trace, look: Callable[[Trace], Array], fit: Fitter) -> Parsed:
    model = fit(*_stacked(train, look))
    gains = [_left_out(train, one, look, fit) for one in train] if len(train) > 1 else [0.0]
    alarm = float(np.mean(gains)) > ALARM
    return {"heldout_rms": rms(held.missing - model(look(held))), "alarm": alarm}


def _stacked(traces: Sequence[Trace], look: Callable[[Trace], Array]) -> tuple[Array, Array]:
    """Features and missing torque of several recordings, thinned."""
    rows = np.concatenate([look(trace)[::EVERY] for trace in traces])
    return rows, np.concatenate([trace.missing[::EVERY] for trace in traces])


def _left_out(train: Sequence[Trace], one: Trace, look: Callable[[Trace], Array], fit: Fitter) -> float:
    """Share of the RMS of one recording that a model of the others takes away."""
    model = fit(*_stacked([other for other in train if other is not one], look))
    return 1 - rms(one.missing - model(look(one))) / rms(one.missing)


def _trees() -> Fitter:
    try:
        from sklearn.ensemble import HistGradientBoostingRegressor
    except ImportError as error:
        raise _missing("scikit-learn") from error

    def fit(rows: Array, target: Array) -> Model:
        fitted = HistGradientBoostingRegressor(random_state=0).fit(rows, target)
        return lambda others: np.asarray(fitted.predict(others))

    return fit


def _gp() -> Fitter:
    """A process whose lengths are found by marginal likelihood once, on all recordings, and then kept."""
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    except ImportError as error:
        raise _missing("scikit-learn") from error
    known: list[Any] = []

    def fit(rows: Array, target: Array) -> Model:
        few = slice(None, None, max(1, len(rows) // GP_ROWS))
        middle, spread, size = rows.mean(0), rows.std(0) + 1e-12, float(target.std()) + 1e-300
        shape = ConstantKernel(0.5, (1e-4, 1e2)) * RBF(np.ones(rows.shape[1]), (0.05, 1e3)) + WhiteKernel(
            0.5, (1e-4, 2)
        )
        process = GaussianProcessRegressor(known[0] if known else shape, optimizer=None if known else "fmin_l_bfgs_b")
        with warnings.catch_warnings():  # a length at its bound says that the feature does not matter
            warnings.simplefilter("ignore", ConvergenceWarning)
            process.fit((rows[few] - middle) / spread, target[few] / size)
        known[:] = known or [process.kernel_]
        return lambda others: np.asarray(process.predict((others - middle) / spread) * size)

    return fit
