"""Closed forms that a formula is made of: shapes of one quantity, written once for the fit, the report and a file.

A shape is Python text in `x` and its own numbers `p0`, `p1`; functions are those that NumPy and CasADi both have, so
what is fitted is what is written. A sum of shapes times coefficients is a formula (`formula.py`).
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from cosim.estimation.prepare import Array

Starts = Callable[[float, float], Sequence[tuple[float, ...]]]
MOST_PERIODS = 16
"""Periods over the range: as many as the waves of a table draw. Half a period apart no valley of the loss is missed."""
TINY = 1e-9
"""Added below a logarithm, relative to the range: a power has no value at nothing else."""


@dataclass(frozen=True)
class Form:
    """A shape of one quantity x."""

    name: str
    code: str
    """Of `x`, `p0`, ..., `top` (largest size seen) and functions behind `ca.`"""
    text: str
    """For a reader, with the quantity as {x} and numbers as {p0}, {p1}."""
    power: int = 0
    """Of the unit of x in the shape."""
    numbers: tuple[str, ...] = ()
    """What each number is: "width", "centre", "zero", "period" (unit of x), "rate" (1 by it), "exponent" (none)."""
    starts: Starts = lambda low, high: ((),)
    bounds: Callable[[float, float], tuple[tuple[float, ...], tuple[float, ...]]] = lambda low, high: ((), ())

    def value(self, x: Array, numbers: Sequence[float], top: float) -> Array:
        """Return the shape at x."""
        given = {f"p{k}": one for k, one in enumerate(numbers)}
        return np.asarray(_evaluated(self.code, {"x": x, "top": top, **given}), float) + 0 * x

    def written(self, x: str, names: Sequence[str], top: float) -> str:
        """Return the shape as a line of a file."""
        words = {"x": x, "top": f"{top:.12g}"} | {f"p{k}": name for k, name in enumerate(names)}
        return "".join(words.get(word, word) for word in _words(self.code))


def _evaluated(code: str, given: Mapping[str, Any]) -> Any:
    """Evaluate one of the module's own texts with NumPy."""
    return eval(_compiled(code), {"ca": np, **given})


@cache
def _compiled(code: str) -> Any:
    return compile(code, "<form>", "eval")


def _words(code: str) -> list[str]:
    return re.findall(r"ca\.\w+|\w+|\W", code)


def _widths(*shares: float) -> Starts:
    return lambda low, high: tuple((share * (high - low),) for share in shares)


def _places(low: float, high: float) -> Sequence[tuple[float, ...]]:
    span = high - low
    return tuple(
        (low + at * span, share * span) for at, share in product(np.linspace(0.05, 0.95, 9), (0.06, 0.15, 0.4))
    )


def _within(least: float, most: float) -> Any:
    return lambda low, high: ((least * (high - low),), (most * (high - low),))


FORMS = (
    Form("line", "x", "{x}", 1),
    Form("size", "ca.fabs(x)", "|{x}|", 1),
    Form("square", "x * x", "{x}²", 2),
    Form("signed square", "x * ca.fabs(x)", "{x}|{x}|", 2),
    Form("cube", "x * x * x", "{x}³", 3),
    Form(
        "power",
        f"ca.sign(x) * ca.exp(p0 * ca.log(ca.fabs(x / top) + {TINY}))",
        "sign({x}) |{x}/{top}|^{p0}",
        0,
        ("exponent",),
        lambda low, high: ((0.3,), (0.6,), (1.5,), (2.5,)),
        lambda low, high: ((0.1,), (6.0,)),
    ),
    Form(
        "exponential",
        "ca.exp(ca.fmin(p0 * (x - top), 50.0))",
        "exp({p0} ({x} − {top}))",
        0,
        ("rate",),
        lambda low, high: tuple((rate / (high - low),) for rate in (-6.0, -2.0, 1.0, 3.0)),
        lambda low, high: ((-20 / (high - low),), (20 / (high - low),)),
    ),
    Form("tanh", "ca.tanh(x / p0)", "tanh({x}/{p0})", 0, ("width",), _widths(0.01, 0.05, 0.2), _within(1e-3, 1.0)),
    Form(
        "step",
        "ca.tanh((x - p0) / p1)",
        "tanh(({x} − {p0})/{p1})",
        0,
        ("centre", "width"),
        _places,
        lambda low, high: ((low, 0.01 * (high - low)), (high, 2 * (high - low))),
    ),
    Form(
        "bump",
        "ca.exp(-((x - p0) / p1) * ((x - p0) / p1))",
        "exp(−(({x} − {p0})/{p1})²)",
        0,
        ("centre", "width"),
        _places,
        lambda low, high: ((low, 0.01 * (high - low)), (high, 2 * (high - low))),
    ),
    Form(
        "pulse",
        "x * ca.exp(-(x / p0) * (x / p0))",
        "{x} exp(−({x}/{p0})²)",
        1,
        ("width",),
        _widths(0.02, 0.06, 0.2),
        _within(1e-3, 2.0),
    ),
    Form(
        "sine",
        "ca.sin(6.283185307179586 * (x - p0) / p1)",
        "sin(2π({x} − {p0})/{p1})",
        0,
        ("zero", "period"),
        lambda low, high: tuple(
            (float(low + shift * (high - low) / n), float((high - low) / n))
            for n, shift in product(np.arange(0.5, MOST_PERIODS + 0.5, 0.5), (0.0, 0.25))
        ),
        lambda low, high: ((low - 2 * (high - low), 0.05 * (high - low)), (high, 4 * (high - low))),
    ),
)
FADE = Form(
    "fade",
    "ca.exp(-x / p0)",
    "exp(−{x}/{p0})",
    0,
    ("fade",),
    _widths(0.01, 0.03, 0.1, 0.3),
    _within(1e-4, 3.0),
)
"""What is left of a reversal, over the time or the way since then: the answer of one state."""
SECOND = tuple(one for one in FORMS if one.name in ("line", "exponential"))
"""Shapes of the second quantity of a product."""

__all__ = ["FADE", "FORMS", "SECOND", "Form"]
