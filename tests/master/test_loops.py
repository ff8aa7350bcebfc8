"""Any plan gives the same bits in C and in Python: components, wires, rates, algorithms and faults at random."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter
from simulating import simulate
from tiny_fmu import described, description, tiny

from cosim.fmi.fmu import FmuComponent
from cosim.master.result import RunResult
from cosim.support.errors import StepError
from cosim.system.algorithm import GaussSeidel, Iterated, Jacobi
from cosim.system.faults import Fault
from cosim.system.wire import Record, Wire

__all__ = ["tiny"]

NAMES = ("one", "two", "three")
SOURCES = ("r", "n", *(f"{name}.y" for name in NAMES))


@st.composite
def wires(draw: Any) -> list[Wire]:
    found = []
    for target in (f"{name}.{port}" for name in NAMES for port in "ab"):
        source = draw(st.sampled_from((None, *SOURCES)))
        if source:
            gain, quantum = draw(st.sampled_from((1.0, -0.5, 0.9))), draw(st.sampled_from((0.0, 0.0, 0.01)))
            noise = draw(st.sampled_from(("", "n")))
            found.append(Wire(source, target, gain=gain, quantum=quantum, noise=noise, breaks_loop=True))
    return found


@st.composite
def systems(draw: Any) -> dict[str, Any]:
    wired = draw(wires())
    order = tuple(draw(st.permutations(NAMES)))
    algorithm = draw(st.sampled_from([Jacobi(), GaussSeidel(kind="gauss-seidel", order=order), "iterated"]))
    every = {name: draw(st.sampled_from((1, 1, 2, 3, 5))) for name in NAMES}
    if algorithm == "iterated":
        members = order[: draw(st.integers(1, 3))]
        algorithm = Iterated(kind="iterated", components=members, theta=draw(st.sampled_from((0.5, 1.0))))
        every |= dict.fromkeys(members, 1)
        wired = [
            replace(one, quantum=0.0)
            if {one.source.partition(".")[0], one.target.partition(".")[0]} <= set(members)
            else one
            for one in wired
        ]
    kinds = [{"kind": "freeze"}, {"kind": "scale", "factor": 0.5}, {"kind": "noise", "rms": 0.1, "seed": 3}]
    places = ["r", *(wire.target for wire in wired)]
    faults = [
        {"on": draw(st.sampled_from(places)), "from": draw(st.floats(0, 0.4)), **draw(st.sampled_from(kinds))}
        for _ in range(draw(st.integers(0, 3)))
    ]
    records = {
        f"c{k}": Record(signal, draw(st.sampled_from(("sample", "mean"))))
        for k, signal in enumerate((*SOURCES, *(wire.target for wire in wired)))
    }
    return {
        "wires": wired,
        "algorithm": algorithm,
        "every": every,
        "faults": [TypeAdapter(Fault).validate_python(fault) for fault in faults],
        "record": records,
        "decimation": draw(st.integers(1, 4)),
        "parameters": {name: {"mode": draw(st.sampled_from((0.0, 1.0, 2.0))), "k": 0.7} for name in NAMES},
    }


@pytest.fixture(scope="module")
def three(tiny: dict[int, Path], tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("direct")
    fmus = {v: described(tiny[v], folder / f"{v}.fmu", description(v, direct=True)) for v in (2, 3)}
    parts = {name: FmuComponent(fmus[2 + (name == "two")], name) for name in NAMES}
    yield parts
    for part in parts.values():
        part.close()


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(system=systems())
def test_any_plan_gives_the_same_bits_in_c_and_in_python(three: Any, system: dict[str, Any]) -> None:
    check_both(three, system)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(system=systems(), columns=st.sampled_from((1, 64, 65, 300)))
def test_so_does_a_plan_in_which_each_tick_is_a_step_of_all_and_a_row(
    three: Any, system: dict[str, Any], columns: int
) -> None:
    """These have a way of their own through the C, up to 64 columns."""
    names = [signal.signal for signal in system["record"].values()]
    system["record"] = {f"c{k}": Record(names[k % len(names)]) for k in range(columns)}
    check_both(three, {**system, "algorithm": Jacobi(), "every": dict.fromkeys(NAMES, 1), "decimation": 1})


def check_both(three: Any, system: dict[str, Any]) -> None:
    r = np.sin(np.arange(47) * 0.3)
    common: dict[str, Any] = {"step": 1e-2, "ticks": 47, "signals": {"r": r, "n": 0.01 * np.cos(r * 99)}}
    first, second = (outcome(three, compiled=compiled, **common, **system) for compiled in (True, False))
    if isinstance(first, str) or isinstance(second, str):
        assert first == second
        return
    assert [run.statistics["loop"] for run in (first, second)] == ["compiled", "interpreted"]
    assert first.statistics["coupling"] == second.statistics["coupling"]
    for name in first.recording:
        np.testing.assert_array_equal(first.recording[name], second.recording[name])


def outcome(*args: Any, **options: Any) -> RunResult | str:
    """Return the run, or the sentence of its failure: iteration need not converge on any plan."""
    try:
        return simulate(*args, **options)
    except StepError as error:
        return str(error)
