"""Elementary functions of set points: last bits against mpmath, the bits of the C that FMUs call, special values."""

import ast
import ctypes
import math
from collections.abc import Callable
from pathlib import Path

import mpmath
import numpy as np
import pytest

from cosim.support import elementary
from cosim.support.elementary import arctan2, cosine, cube_root, sine, sine_and_cosine
from pyfmi_models.export.build import compile_shared
from pyfmi_models.export.codegen import SHIM
from pyfmi_models.export.platforms import PLATFORMS, host

ROOT = Path(__file__).parents[2]
COUNT = 3000
EXACT_BELOW = 1.6e6
RANDOM = np.random.default_rng(11)
MANY = b"""#define DETMATH_KEEP_NAMES
#include "detmath.h"
void many_sin(const double *x, double *out, long n) { for (long i = 0; i < n; i++) out[i] = det_sin(x[i]); }
void many_cos(const double *x, double *out, long n) { for (long i = 0; i < n; i++) out[i] = det_cos(x[i]); }
void many_atan2(const double *y, const double *x, double *out, long n) {
    for (long i = 0; i < n; i++) out[i] = det_atan2(y[i], x[i]);
}
"""
Function = Callable[..., np.ndarray]


def decades(low: float, high: float, count: int = COUNT) -> np.ndarray:
    return RANDOM.choice([-1.0, 1.0], count) * 10 ** RANDOM.uniform(low, high, count)


def beside(x: np.ndarray) -> np.ndarray:
    """Each number and its two neighbours."""
    return np.concatenate([x, np.nextafter(x, -np.inf), np.nextafter(x, np.inf)])


QUARTERS = np.concatenate([np.arange(-300, 300), RANDOM.integers(300, 1_018_000, 700)]) * (np.pi / 2)
ANGLES = np.concatenate([
    RANDOM.uniform(-10, 10, COUNT),
    RANDOM.uniform(-EXACT_BELOW, EXACT_BELOW, COUNT),
    decades(-320, 6.2),
    beside(QUARTERS),
    beside(QUARTERS / 2),
])  # fmt: skip
WIDE, HIGH = (
    np.concatenate([RANDOM.standard_normal(COUNT), decades(-20, 20), RANDOM.uniform(0, 1, COUNT), decades(-290, 300)])
    for _ in range(2)
)


def error_in_ulp(value: float, exact: mpmath.mpf) -> float:
    exponent = max(mpmath.frexp(exact)[1] - 1, -1022) if exact else -1022
    return float(abs(mpmath.mpf(value) - exact) / mpmath.mpf(2) ** (exponent - 52))


def worst(values: np.ndarray, exact: Callable[..., mpmath.mpf], *arguments: np.ndarray) -> float:
    rows = zip(values.tolist(), *(one.tolist() for one in arguments), strict=True)
    with mpmath.workprec(220):
        return max(error_in_ulp(value, exact(*map(mpmath.mpf, others))) for value, *others in rows)


def bits(values: np.ndarray) -> np.ndarray:
    """Bits of each value; any NaN is like any other."""
    return np.where(np.isnan(values), np.nan, values).view(np.int64)


def same(a: np.ndarray, b: np.ndarray) -> bool:
    return np.array_equal(bits(np.asarray(a)), bits(np.asarray(b)))


def test_sine_and_cosine_keep_the_errors_that_are_stated() -> None:
    sines, cosines = sine_and_cosine(ANGLES)
    assert worst(sines, mpmath.sin, ANGLES) <= 0.8
    assert worst(cosines, mpmath.cos, ANGLES) <= 0.8


def test_the_angle_of_a_point_keeps_the_error_that_is_stated_also_where_its_sides_are_denormal() -> None:
    least = np.repeat([5e-324, 1e-310, 1e-290], 4)
    y = np.concatenate([HIGH, least * np.tile([1.0, 2.0, 7.0, 5.0], 3)])
    x = np.concatenate([WIDE, least * np.tile([3.0, 3.0, 9.0, -4.0], 3)])
    assert worst(arctan2(y, x), mpmath.atan2, y, x) <= 1.45


def test_a_cube_root_keeps_the_error_that_is_stated_and_cubes_come_out_whole() -> None:
    numbers = np.abs(np.concatenate([decades(-307, 307), RANDOM.uniform(0.1, 10, COUNT)]))
    assert worst(np.array([cube_root(x) for x in numbers.tolist()]), mpmath.cbrt, numbers) <= 0.9
    assert [cube_root(float(n**3)) for n in range(100)] == list(range(100))
    assert (cube_root(0.0), cube_root(math.inf)) == (0.0, math.inf)


@pytest.mark.parametrize("decade", [7, 9, 12, 15, 17, 100, 300])
def test_far_angles_are_as_uncertain_as_their_last_place_and_stay_on_the_circle(decade: int) -> None:
    x = decades(decade - 0.5, decade, 300)
    sines, cosines = sine_and_cosine(x)
    np.testing.assert_allclose(sines * sines + cosines * cosines, 1.0, rtol=1e-15)
    with mpmath.workprec(1300):
        exact = np.array([float(mpmath.sin(mpmath.mpf(one))) for one in x.tolist()])
    assert (np.abs(sines - exact) <= np.abs(x) * 2.0**-52).all()


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    sources = {path.name: path.read_bytes() for path in SHIM.glob("detmath*")} | {"many.c": MANY}
    flags = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-shared", "-fPIC")
    return ctypes.CDLL(str(compile_shared(sources, "many.so", PLATFORMS[host()].target, flags)))


def in_c(library: ctypes.CDLL, name: str, *arguments: np.ndarray) -> np.ndarray:
    given = [np.ascontiguousarray(one) for one in arguments]
    out = np.empty_like(given[0])
    pointers = [ctypes.c_void_p(one.ctypes.data) for one in (*given, out)]
    getattr(library, f"many_{name}")(*pointers, ctypes.c_long(len(out)))
    return out


def test_set_points_and_fmus_have_the_same_bits(library: ctypes.CDLL) -> None:
    x = np.concatenate([ANGLES, decades(6, 15), [0.0, -0.0, 5e-324, -5e-324, np.nan]])
    assert same(sine(x), in_c(library, "sin", x))
    assert same(cosine(x), in_c(library, "cos", x))
    assert same(arctan2(HIGH, WIDE), in_c(library, "atan2", HIGH, WIDE))


@pytest.mark.parametrize(("function", "of_numpy"), [(sine, np.sin), (cosine, np.cos)])
def test_sines_of_zeros_and_of_what_is_no_number_are_those_of_numpy(function: Function, of_numpy: Function) -> None:
    x = np.array([0.0, -0.0, 5e-324, -5e-324, np.nan])
    assert same(function(x), of_numpy(x))
    with pytest.warns(RuntimeWarning, match="invalid value"):
        assert np.isnan(function([np.inf, -np.inf])).all()


def test_angles_of_special_points_are_those_of_python_without_a_warning() -> None:
    values = (0.0, -0.0, 1.0, -1.0, 1e308, 1e-308, math.inf, -math.inf, math.nan)
    y, x = (np.array(one) for one in zip(*((y, x) for y in values for x in values), strict=True))
    assert same(arctan2(y, x), np.array([math.atan2(b, a) for b, a in zip(y.tolist(), x.tolist(), strict=True)]))


@pytest.mark.parametrize("function", [sine, cosine, lambda x: arctan2(x, 1 - x)], ids=["sine", "cosine", "arctan2"])
def test_length_stride_and_shape_of_an_array_do_not_matter(function: Function) -> None:
    x = ANGLES[:1000]
    whole = function(x)
    assert same(whole[123:130], function(x[123:130]))
    assert same(whole, function(np.repeat(x, 3)[::3]))
    assert same(whole, function(x.reshape(10, 100)).ravel())
    assert [float(function(one)) for one in x[:50].tolist()] == whole[:50].tolist()


def test_constants_are_their_definitions_rounded_to_nearest() -> None:
    with mpmath.workprec(300):
        for i in range(33):
            exact = mpmath.atan(mpmath.mpf(i) / 32)
            head, tail = float(elementary._HEADS[i]), float(elementary._TAILS[i])
            assert (head, tail) == (float(exact), float(exact - mpmath.mpf(head)))
        rest = mpmath.pi / 2 - mpmath.mpf(elementary.PI_2_A) - mpmath.mpf(elementary.PI_2_B)
        assert float(rest) == elementary.PI_2_C
        assert float(2 / mpmath.pi) == elementary.TWO_OVER_PI
    for part, places in ((elementary.PI_2_A, 32), (elementary.PI_2_B, 66)):
        assert (part * 2.0**places).is_integer()
        assert part * 2.0**places < 2.0**33


ROUNDED_ONE_WAY = {
    *("sqrt", "floor", "fmod", "abs", "minimum", "maximum", "fmax", "signbit", "copysign", "clip", "deg2rad"),
    "add",  # one after the other, by `accumulate`
}
NO_ARITHMETIC = {
    *("asarray", "array", "ndarray", "float64", "intp", "where", "searchsorted", "stack", "concatenate"),
    *("zeros_like", "full_like", "random", "pi", "newaxis"),
}
OF_MATH = {"pi", "inf", "sqrt", "factorial", "frexp", "ldexp"}


def asked(tree: ast.AST) -> set[str]:
    """What a module asks numpy and `math` for, and `**`, beyond what IEEE 754 rounds in one way."""
    found = {"**" for node in ast.walk(tree) if isinstance(node, ast.Pow)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in ("np", "math"):
            found.add(node.attr)
        elif isinstance(node, ast.ImportFrom) and node.module in ("math", "numpy"):
            found |= {alias.name for alias in node.names} - OF_MATH
    return found - ROUNDED_ONE_WAY - NO_ARITHMETIC


@pytest.mark.parametrize("name", ["support/elementary", "data/profile", "data/star", "data/set_points"])
def test_set_points_ask_for_nothing_that_differs_between_machines(name: str) -> None:
    assert asked(ast.parse((ROOT / "cosim" / f"{name}.py").read_text("utf-8"))) == set()


@pytest.mark.parametrize(
    "line", ["np.sin(x)", "x**3", "from math import cos", "np.hypot(x, y)", "np.power(x, 3)", "np.sum(x)"]
)
def test_what_differs_between_machines_is_noticed(line: str) -> None:
    assert asked(ast.parse(line))
