"""Any plan gives the same bits in C and in Python: components, wires, rates, algorithms and faults at random."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oscillators import BOTH, Tiny
from pydantic import TypeAdapter, ValidationError
from simulating import alone, simulate
from small_loop import text_of
from tiny_fmu import described, description

from cosim.data.recording import Recording
from cosim.fmi.fmu import FmuComponent
from cosim.master.result import RunResult
from cosim.master.simulate import run as run_scenario
from cosim.support.errors import ScenarioError, StepError, WiringError
from cosim.system.algorithm import GaussSeidel, Iterated, Jacobi
from cosim.system.faults import Fault
from cosim.system.scenario import parse_scenario
from cosim.system.schedule import delays
from cosim.system.wire import Record, Wire

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
    decimation = draw(st.integers(1, 4))
    if draw(st.booleans()):  # all step and are recorded at each tick: the C has a way of its own up to 64 columns
        names = [one.signal for one in records.values()]
        records = {f"c{k}": Record(names[k % len(names)]) for k in range(draw(st.sampled_from((1, 64, 65, 300))))}
        algorithm, every, decimation = Jacobi(), dict.fromkeys(NAMES, 1), 1
    return {
        "wires": wired,
        "algorithm": algorithm,
        "every": every,
        "faults": [TypeAdapter(Fault).validate_python(fault) for fault in faults],
        "record": records,
        "decimation": decimation,
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


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(system=systems())
def test_any_plan_gives_the_same_bits_in_c_and_in_python(three: Any, system: dict[str, Any]) -> None:
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


# Wires delay as long as an algorithm says, and a slow component lives by its own ticks.

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
    stated = delays(algorithm, CHAIN, NAMES, every)
    told = [(one.least, one.most) for one in stated.values()]
    assert told == [one if isinstance(one, tuple) else (one, one) for one in expected]
    # a tick at which the last one looks at what the one before it saw
    looks = next(k for k in range(60, 90) if k % every.get("three", 1) == (k - told[2][0]) % every.get("two", 1) == 0)
    impulse = np.zeros(200)
    impulse[looks - told[2][0] - told[1][0]] = 1.0
    record, parameters = {name: f"{name}.a" for name in NAMES}, {name: {"mode": 1.0} for name in NAMES}
    given: dict[str, Any] = {"parameters": parameters, "algorithm": algorithm, "every": every, "compiled": compiled}
    given |= {"step": 1e-3, "ticks": 200, "signals": {"r": impulse}}
    seen = simulate(dict.fromkeys(NAMES, tiny[3]), CHAIN, record=record, **given).recording
    ticks = {name: np.flatnonzero(seen[name]) for name in NAMES}
    for before, after, (least, most) in zip(NAMES, NAMES[1:], told[1:], strict=False):
        assert ticks[after][0] - ticks[before][0] == least
        assert ticks[after][-1] - ticks[before][0] <= most + every.get(after, 1) - 1


def slow(fmu: Path, every: int, *wires: tuple[str, str], **more: Any) -> Recording:
    """What is seen and shown by a component that steps every so many ticks."""
    record = {"seen": "one.a", "shown": "one.y"}
    return alone(fmu, [("r", "one.a"), *wires], record, step=1e-3, every={"one": every}, **more).recording


def test_a_slow_component_sees_its_inputs_at_its_ticks_and_shows_its_outputs_after_its_step(tiny: Tiny) -> None:
    ramp = np.arange(40.0)
    found = slow(tiny[2], 5, signals={"r": ramp}, ticks=40, parameters={"one": {"mode": 1.0}})
    held = ramp - ramp % 5
    np.testing.assert_array_equal(found["seen"], held)
    np.testing.assert_array_equal(found["shown"], np.concatenate([np.zeros(5), held[:-5]]))


def test_a_slow_component_integrates_over_its_own_step(tiny: Tiny) -> None:
    found = slow(tiny[3], 10, ("one.y", "one.b"), signals={"r": 1.0}, ticks=105)
    np.testing.assert_allclose(found["shown"], 1 - 0.99 ** (np.arange(105) // 10), rtol=1e-12)


@BOTH
def test_a_failure_of_a_slow_component_names_the_tick_where_its_step_began(tiny: Tiny, compiled: bool) -> None:
    parameters = {"one": {"fail_at": 0.021}}
    with pytest.raises(StepError, match=r"one returned an error at tick 20 \(0.02 s\)"):
        slow(tiny[3], 10, signals={"r": 1.0}, ticks=100, parameters=parameters, compiled=compiled)


# A fault breaks a wire or a signal from its tick on, in C and in Python with the same bits.


RAMP = np.arange(50.0)
INSIDE = (RAMP >= 10) & (RAMP < 30)


def fault(**what: Any) -> Any:
    return TypeAdapter(Fault).validate_python({"from": 0.01, "until": 0.03} | what)


def run(fmu: Path, *faults: Any, **options: Any) -> Recording:
    wires, record = [Wire("r", "one.a", gain=2.0), ("r", "one.b")], {"a": "one.a", "b": "one.b", "r": "r"}
    return alone(fmu, wires, record, step=1e-3, ticks=50, signals={"r": RAMP}, faults=faults, **options).recording


KINDS = [
    ({"kind": "override", "value": -1.0}, lambda x: 0 * x - 1),
    ({"kind": "scale", "factor": 0.5}, lambda x: x / 2),
    ({"kind": "offset", "value": 3.0}, lambda x: x + 3),
    ({"kind": "freeze"}, lambda x: 0 * x + x[10]),
]


@BOTH
@pytest.mark.parametrize("on", ["one.a", "r"])
@pytest.mark.parametrize(("what", "does"), KINDS)
def test_a_fault_on_an_input_breaks_its_wire_and_on_a_signal_all_that_it_feeds(
    tiny: Tiny, on: str, what: Any, does: Any, compiled: bool
) -> None:
    seen, wrong = run(tiny[3], fault(on=on, **what), compiled=compiled), np.where(INSIDE, does(RAMP), RAMP)
    fed = {"a": np.where(INSIDE, does(2 * RAMP), 2 * RAMP), "b": RAMP, "r": RAMP}
    for name, values in (fed if on == "one.a" else {"a": 2 * wrong, "b": wrong, "r": wrong}).items():
        np.testing.assert_array_equal(seen[name], values)


@pytest.mark.parametrize("on", ["one.b", "r"])
def test_noise_is_seeded_and_the_same_in_c_and_python(tiny: Tiny, on: str) -> None:
    noisy = fault(on=on, kind="noise", rms=0.1, seed=4)
    runs = [run(tiny[3], noisy, compiled=compiled)["b"] for compiled in (True, False)]
    np.testing.assert_array_equal(*runs)
    error = runs[0] - RAMP
    assert not error[~INSIDE].any()
    # Twenty numbers: their RMS is known to 16 %, so the draw itself is compared, and its RMS over many.
    expected = fault(on=on, kind="noise", rms=0.1, seed=4).noise().stream(0.01)(np.arange(20_000))[0]
    np.testing.assert_allclose(error[INSIDE], expected[:50][INSIDE], rtol=1e-12, atol=1e-14)
    assert expected.std() == pytest.approx(0.1, rel=0.02)


def test_faults_act_in_their_order_and_without_an_end_they_stay(tiny: Tiny) -> None:
    stays = TypeAdapter(Fault).validate_python({"on": "one.b", "kind": "offset", "value": 1.0, "from": 0.02})
    seen = run(tiny[3], stays, fault(on="one.b", kind="scale", factor=2.0))["b"]
    expected = np.where(RAMP >= 20, RAMP + 1, RAMP)
    np.testing.assert_array_equal(seen, np.where(INSIDE, 2 * expected, expected))


def test_a_slow_component_meets_the_fault_at_its_own_ticks(tiny: Tiny) -> None:
    seen = run(tiny[3], fault(on="one.b", kind="freeze"), every={"one": 4})["b"]
    looked = RAMP - RAMP % 4
    np.testing.assert_array_equal(seen, np.where((looked >= 12) & (looked < 30), 12, looked))


def test_a_fault_on_nothing_or_with_its_end_before_its_begin_is_refused(tiny: Tiny) -> None:
    with pytest.raises(WiringError, match=r'on "one\.k", which is no signal and no input that a wire feeds'):
        run(tiny[3], fault(on="one.k", kind="freeze"))
    with pytest.raises(WiringError, match=r'"r.velocity", which is not one output; outputs are: r.value'):
        run(tiny[3], fault(on="r.velocity", kind="freeze"))
    with pytest.raises(ValidationError, match=r"until = 0.005 must lie after from = 0.01"):
        fault(on="r", kind="freeze", until=0.005)


def test_faults_are_read_from_a_scenario_and_kept_in_the_recording(tiny: Tiny) -> None:
    tables: dict[str, Any] = {"stop": 0.05, "step": 1e-3, "record": {"signals": ["one.a"]}}
    tables |= {"components": {"one": {"fmu": tiny[3]}}, "signals": {"r": {"kind": "ramp", "velocity": 1.0}}}
    hangs: dict[str, Any] = {"on": "one.a", "kind": "override", "value": 7.0, "from": 0.02}
    text = text_of({"one.a": "r.position"}, faults=[hangs], **tables)
    done = run_scenario(parse_scenario(text, "x.toml", Path())).recording
    np.testing.assert_allclose(done["one.a"], np.where(RAMP < 20, RAMP * 1e-3, 7.0), atol=1e-15)
    assert done.origin["faults"] == [{"on": "one.a", "start": 0.02, "until": None, "kind": "override", "value": 7.0}]
    with pytest.raises(
        ScenarioError, match=r'"faults.0.override.factor" is no key of a scenario; keys there are: on, from'
    ):
        parse_scenario(text_of({}, faults=[hangs | {"factor": 7.0}], **tables), "x.toml", Path())
