"""Wires delay as long as an algorithm says, and a slow component lives by its own ticks."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from oscillators import BOTH, Tiny
from simulating import simulate
from tiny_fmu import tiny

from cosim.support.errors import StepError
from cosim.system.algorithm import GaussSeidel, Iterated, Jacobi
from cosim.system.schedule import delays
from cosim.system.wire import Wire

__all__ = ["tiny"]

CHAIN = [Wire("r", "one.a"), Wire("one.y", "two.a"), Wire("two.y", "three.a")]
SLOW = {"two": 10}
CAMERA = {"two": 2, "three": 6}


@BOTH
@pytest.mark.parametrize(
    ("algorithm", "every", "expected"),
    [
        (Jacobi(), {}, [0, 1, 1]),
        (GaussSeidel(kind="gauss-seidel"), {}, [0, 0, 0]),
        (GaussSeidel(kind="gauss-seidel", order=("two", "one", "three")), {}, [0, 1, 0]),
        (Iterated(kind="iterated", components=("one", "three")), {}, [0, 1, 1]),
        (Jacobi(), SLOW, [0, 1, (10, 19)]),
        (GaussSeidel(kind="gauss-seidel"), SLOW, [0, 0, (9, 18)]),
        (Jacobi(), CAMERA, [0, 1, 2]),
        (GaussSeidel(kind="gauss-seidel"), CAMERA, [0, 0, 2]),
    ],
)
def test_an_impulse_takes_as_many_ticks_as_the_delays_say(
    tiny: Tiny, algorithm: Any, every: Mapping[str, int], expected: list[Any], compiled: bool
) -> None:
    names = ("one", "two", "three")
    stated = delays(algorithm, CHAIN, names, every)
    told = [(one.least, one.most) for one in stated.values()]
    assert told == [one if isinstance(one, tuple) else (one, one) for one in expected]
    # a tick at which the last one looks at what the one before it saw
    looks = next(k for k in range(60, 90) if k % every.get("three", 1) == (k - told[2][0]) % every.get("two", 1) == 0)
    impulse = np.zeros(200)
    impulse[looks - told[2][0] - told[1][0]] = 1.0
    seen = simulate(
        dict.fromkeys(names, tiny[3]),
        CHAIN,
        record={name: f"{name}.a" for name in names},
        step=1e-3,
        ticks=200,
        signals={"r": impulse},
        parameters={name: {"mode": 1.0} for name in names},
        algorithm=algorithm,
        every=every,
        compiled=compiled,
    ).recording
    ticks = {name: np.flatnonzero(seen[name]) for name in names}
    for before, after, (least, most) in zip(names, names[1:], told[1:], strict=False):
        assert ticks[after][0] - ticks[before][0] == least
        assert ticks[after][-1] - ticks[before][0] <= most + every.get(after, 1) - 1


def test_a_slow_component_sees_its_inputs_at_its_ticks_and_shows_its_outputs_after_its_step(tiny: Tiny) -> None:
    ramp = np.arange(40.0)
    run = simulate(
        {"camera": tiny[2]},
        [("r", "camera.a")],
        record={"seen": "camera.a", "shown": "camera.y"},
        step=0.01,
        ticks=40,
        signals={"r": ramp},
        parameters={"camera": {"mode": 1.0}},
        every={"camera": 5},
    )
    held = ramp - ramp % 5
    np.testing.assert_array_equal(run.recording["seen"], held)
    np.testing.assert_array_equal(run.recording["shown"], np.concatenate([np.zeros(5), held[:-5]]))


def test_a_slow_component_integrates_over_its_own_step(tiny: Tiny) -> None:
    run = simulate(
        {"slow": tiny[3]},
        [("r", "slow.a"), ("slow.y", "slow.b")],
        record={"y": "slow.y"},
        step=1e-3,
        ticks=105,
        signals={"r": 1.0},
        every={"slow": 10},
    )
    np.testing.assert_allclose(run.recording["y"], 1 - 0.99 ** (np.arange(105) // 10), rtol=1e-12)


def test_a_failure_of_a_slow_component_names_the_tick_where_its_step_began(tiny: Tiny) -> None:
    for compiled in (True, False):
        with pytest.raises(StepError, match=r"slow returned an error at tick 20 \(0.02 s\)"):
            simulate(
                {"slow": tiny[3]},
                [("r", "slow.a")],
                record={"y": "slow.y"},
                step=1e-3,
                ticks=100,
                signals={"r": 1.0},
                every={"slow": 10},
                parameters={"slow": {"fail_at": 0.021}},
                compiled=compiled,
            )
