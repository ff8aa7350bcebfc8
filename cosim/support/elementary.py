"""Sine, cosine, arctangent and cube root with the same bits on every machine.

numpy's differ in the last bit between processors (it has another library where there is AVX-512), libm's between
systems. These use only what IEEE 754 rounds in one way (+ - * /, floor, comparisons), in a fixed order. They are those
of `detmath_trig.c`, which exported FMUs call, with the same bits; constants are rounded from their definitions here.

Errors, measured against mpmath, in units in the last place; tests/support/test_elementary.py holds them:
    sine, cosine    0.80 for |x| <= 1.6e6; beyond, an absolute error of |x| 2^-52, as if x were no better known
    arctan2         1.45
    cube_root       0.90
Unlike the C, angles beyond 2^50 keep a sine within its bounds, and sides of a point may be denormal. Special values are
those of numpy.
"""

from itertools import accumulate
from math import factorial, frexp, inf, ldexp

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Angles = npt.ArrayLike

BITS = 200
ONE = 1 << BITS
"""Constants are whole numbers in units of 2^-200 until they are rounded, once."""
FAR = float(1 << 50)
"""Angles beyond, whose neighbours are a quarter of a radian apart, are first brought near by whole turns."""
LARGE, SMALL, SCALE = 1e300, 1e-280, float(1 << 100)
"""Where products of an angle's sides would leave the range of numbers, and the factor that brings them back."""


def _widening(k: int) -> int:
    """Return arctan(k / 32) - arctan((k - 1) / 32) = arctan(32 / (1024 + k (k - 1))) by its series."""
    below = 1024 + k * (k - 1)
    power, angle = 32 * ONE // below, 0
    for odd in range(1, BITS // 5, 4):  # x - x^3/3, then x^5/5 - x^7/7 ...; x <= 1/32, so each term brings ten bits
        cube = power * 1024 // (below * below)
        angle += power // odd - cube // (odd + 2)
        power = cube * 1024 // (below * below)
    return angle


def _head_and_tail(number: int) -> tuple[float, float]:
    above, below = (number / ONE).as_integer_ratio()
    return number / ONE, (number - above * ONE // below) / ONE


def _parts(number: int) -> tuple[float, float, float]:
    """Return three parts, of which two have 33 bits: n times these is exact for |n| < 2^20."""
    first = number >> BITS - 32 << BITS - 32
    second = number - first >> BITS - 66 << BITS - 66
    return first / ONE, second / ONE, (number - first - second) / ONE


_ARCTANGENTS = list(accumulate((_widening(k) for k in range(1, 33)), initial=0))
_HEADS, _TAILS = map(np.array, zip(*map(_head_and_tail, _ARCTANGENTS), strict=True))
_QUARTER = 2 * _ARCTANGENTS[32]
PI_2, PI_2_TAIL = _head_and_tail(_QUARTER)
PI_2_A, PI_2_B, PI_2_C = _parts(_QUARTER)
TWO_OVER_PI = ONE / _QUARTER
_SINE = [(1 if i % 4 == 1 else -1) / factorial(i) for i in range(19, 2, -2)]
_COSINE = [(1 if i % 4 == 0 else -1) / factorial(i) for i in range(20, 3, -2)]
_ARCTANGENT = [(1 if i % 4 == 1 else -1) / i for i in range(13, 2, -2)]
"""Taylor's coefficients, the highest first: -x^3/3! + x^5/5! ..., x^4/4! - x^6/6! ..., -x^3/3 + x^5/5 ..."""


def sine(x: Angles) -> Array:
    """Return the sine of angles [rad], in their shape; NaN of what is infinite."""
    return sine_and_cosine(x)[0]


def cosine(x: Angles) -> Array:
    """Return the cosine of angles [rad], in their shape; NaN of what is infinite."""
    return sine_and_cosine(x)[1]


def sine_and_cosine(x: Angles) -> tuple[Array, Array]:
    """Return both, at the price of one: x = n pi/2 + r + tail, and a series for each of r.

    Reference of the reduction: Cody, Waite, Software Manual for the Elementary Functions (1980), chapter 8.
    """
    x = _near(np.asarray(x, dtype=np.float64))
    n, r, tail = _reduced(x)
    square = r * r
    rising, level = _sine_series(r, tail, square), _cosine_series(r, tail, square)
    half = np.floor(n * 0.5)
    odd, turns = n != 2 * half, half * 0.5
    sign = 1 - 4 * (turns - np.floor(turns))
    sines, cosines = sign * np.where(odd, level, rising), sign * np.where(odd, -rising, level)
    return np.where(x == 0, x, sines), cosines  # the series has lost the sign of -0


def _near(x: Array) -> Array:
    far = np.abs(x) >= FAR
    return np.where(far, np.fmod(x, 4 * PI_2), x) if far.any() else x  # fmod is exact


def _reduced(x: Array) -> tuple[Array, Array, Array]:
    """Return n, r and the tail of r; what a difference loses is kept in `lost`."""
    n = np.floor(x * TWO_OVER_PI + 0.5)
    first, second, third = x - n * PI_2_A, n * PI_2_B, n * PI_2_C
    head = first - second
    third -= (first - head) - second
    r = head - third
    return n, r, (head - r) - third


def _sine_series(r: Array, tail: Array, square: Array) -> Array:
    """Return r - r^3/3! + ..., and what the tail adds; in place, for speed, from the smallest term to the largest."""
    value = _polynomial(_SINE, square)
    value *= r * square
    value += tail * (1 - 0.5 * square)
    value += r
    return value


def _cosine_series(r: Array, tail: Array, square: Array) -> Array:
    """Return 1 - r^2/2 + ...; what 1 - r^2/2 loses is added back."""
    half = 0.5 * square
    head = 1 - half
    value = _polynomial(_COSINE, square)
    value *= square * square
    value -= r * tail
    value += (1 - head) - half
    value += head
    return value


def _polynomial(coefficients: list[float], x: Array) -> Array:
    """Horner's scheme, the highest power first."""
    value = coefficients[0] * x
    for coefficient in coefficients[1:-1]:
        value += coefficient
        value *= x
    value += coefficients[-1]
    return value


def arctan2(y: Angles, x: Angles) -> Array:
    """Return the angle [rad] of the point (x, y), from -pi to pi; counted from the nearest axis, so rounded once."""
    y, x = np.asarray(y, dtype=np.float64), np.asarray(x, dtype=np.float64)
    height, width, back = np.abs(y), np.abs(x), np.signbit(x)
    angle = _below_the_diagonal(np.minimum(height, width), np.maximum(height, width))
    flat = np.where(back, (2 * PI_2 - angle) + 2 * PI_2_TAIL, angle)
    steep = np.where(back, PI_2 + angle, PI_2 - angle) + PI_2_TAIL
    return np.asarray(np.copysign(np.where(height > width, steep, flat), y))


def _below_the_diagonal(y: Array, x: Array) -> Array:
    """Return arctan(y / x), 0 <= y <= x: arctan(c) + arctan((y - c x) / (x + c y)), c the nearest multiple of 1/32."""
    y, x = np.where(x == inf, y == inf, y), np.where((x == 0) | (x == inf), 1.0, x)
    scale = np.where(x > LARGE, 1 / SCALE, np.where(x < SMALL, SCALE, 1.0))
    y, x = y * scale, x * scale
    entry = np.floor(y / x * 32 + 0.5)
    c = entry / 32
    t = (y - c * x) / (x + c * y)
    square = t * t
    index = np.fmax(entry, 0).astype(np.intp)  # NaN looks up anything
    small = t * (_polynomial(_ARCTANGENT, square) * square) + _TAILS[index]
    return np.asarray(_HEADS[index] + (t + small))


def cube_root(x: float) -> float:
    """Return x^(1/3) of a number that is not negative, by Newton's method from 1 on a mantissa in [0.5, 4)."""
    if not 0 < x < inf:
        return x
    mantissa, exponent = frexp(x)
    thirds, rest = divmod(exponent, 3)
    cube, root = ldexp(mantissa, rest), 1.0
    for _ in range(7):  # relative errors of at most 0.6, 0.26, 0.05, 2e-3, 6e-6, 3e-11, 0
        root -= (root * root * root - cube) / (3 * root * root)
    return ldexp(root, thirds)
