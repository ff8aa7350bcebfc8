"""Values at the start reach what they are wired to in initialisation mode; row 0 shows what FMUs have then."""

import re
from typing import Any

import numpy as np
import pytest
from oscillators import BOTH, VERSIONS
from simulating import simulate
from start_fmus import Make, U, V, Y

from cosim.fmi.alias import Alias
from cosim.fmi.function import FunctionComponent
from cosim.master.result import RunResult
from cosim.support.errors import StepError, WiringError
from cosim.system.system import Fmu
from cosim.system.wire import Wire

PYTHON = "It was asked for: the loop ran in Python."
ANY = V("any", 4, "input", start="0")
"""An input that no output follows, through which a component waits for another."""
GIVES = (Y, V("c", 3, "parameter", start="0"), ANY)


def started(components: dict[str, Any], wires: list[Any], record: dict[str, Any], **more: Any) -> RunResult:
    return simulate(components, wires, record=record, **({"step": 0.01, "ticks": 5} | more))


def at_start(components: dict[str, Any], wires: list[Any], *names: str, **more: Any) -> list[float]:
    """The values of signals in row 0."""
    recording = started(components, wires, {name: name for name in names}, **more).recording
    return [float(recording[name][0]) for name in names]


@BOTH
@VERSIONS
@pytest.mark.parametrize(
    ("follows", "interface"), [("u", "CoSimulation"), (None, "CoSimulation"), ("u", "ModelExchange")]
)
def test_a_lag_starts_at_what_it_is_fed(
    make: Make, version: int, follows: str | None, interface: str, compiled: bool
) -> None:
    lag = Fmu(make("lag", version, follows=follows, interface=interface))
    components = {"lag": lag, "source": make("source", version, follows="")}
    wires = [Wire("source.y", "lag.u", gain=2.0, offset=1.0)]
    parameters = {"source": {"c": 5.0}}
    run = started(components, wires, {"x": "lag.x", "u": "lag.u"}, parameters=parameters, compiled=compiled)
    np.testing.assert_allclose(run.recording["x"], [11.0] * 5, rtol=1e-9)
    np.testing.assert_array_equal(run.recording["u"], [11.0] * 5)
    assert run.statistics["notes"] == ([] if compiled else [PYTHON])


@BOTH
@VERSIONS
@pytest.mark.parametrize("source", ["fmu", "signal", "parameter"])
def test_a_controller_takes_as_home_what_it_meets_at_the_start(
    make: Make, version: int, source: str, compiled: bool
) -> None:
    fmus = {"home": make("home", version), "source": make("source", version)}
    wires = {"fmu": [("source.y", "home.u")], "signal": [("r", "home.u")], "parameter": []}[source]
    parameters = {"source": {"c": 5.0}, "home": {"u": 5.0} if source == "parameter" else {}}
    run = started(fmus, wires, {"tau": "home.y"}, parameters=parameters, signals={"r": 5.0}, compiled=compiled)
    np.testing.assert_array_equal(run.recording["tau"], [0.0] * 5)


@VERSIONS
def test_units_convert_at_the_start_too(make: Make, version: int) -> None:
    names = {"lag": {"angle": Alias("u", "rad"), "now": Alias("x", "rad")}}
    wires = [Wire("r", "lag.angle", unit="deg")]
    given: dict[str, Any] = {"signals": {"r": 180.0}, "variables": names}
    assert at_start({"lag": make("lag", version)}, wires, "lag.now", **given) == pytest.approx([np.pi])


@VERSIONS
def test_what_an_fmu_computes_only_when_initialisation_ends_is_handed_on(make: Make, version: int) -> None:
    """FMI wants it computed before; where nobody waits for each other it arrives all the same."""
    fmus = {"lag": make("lag", version), "late": make("late", version)}
    wires = [("r", "late.u"), ("late.y", "lag.u")]
    assert at_start(fmus, wires, "late.y", "lag.x", signals={"r": 5.0}) == [5.0, 5.0]


def test_what_changes_when_initialisation_ends_is_noted_where_it_had_been_handed_on(make: Make) -> None:
    fmus = {"late": make("late", variables=(U, Y, ANY)), "lag": make("lag", follows="u")}
    wires = [("r", "late.u"), ("late.y", "lag.u"), ("lag.y", "late.any")]
    run = started(fmus, wires, {"x": "lag.x"}, signals={"r": 5.0})
    assert run.recording["x"][0] == 0.0
    said = '"late.y" is 0 in initialisation mode and 5 after it, where FMI lets nothing change; "lag.u" was initialised'
    assert run.statistics["notes"][-1].startswith(said)


@VERSIONS
def test_inputs_are_set_in_initialisation_mode_and_only_outputs_are_read_in_it(make: Make, version: int) -> None:
    fmus = {"a": make("strict", version), "b": make("strict", version)}
    wires = [("a.y", "b.u"), Wire("b.y", "a.u", gain=0.5, offset=1.0)]
    assert at_start(fmus, wires, "a.y", "b.w", parameters={"a": {"u": 3.0}}) == pytest.approx([2.0, 2.0])
    assert at_start({"a": fmus["a"]}, [], "a.y", parameters={"a": {"u": 3.0}}) == [3.0]


def test_a_local_variable_of_fmi_2_is_read_when_its_component_is_initialised(make: Make) -> None:
    """In a ring it cannot be: the input keeps its start value, and a note says so."""
    names = {"a": {"seen": Alias("w")}}
    fmus = {"a": make("strict"), "lag": make("lag")}
    wires = [("r", "a.u"), ("a.seen", "lag.u")]
    assert at_start(fmus, wires, "lag.x", signals={"r": 4.0}, variables=names) == [4.0]
    ring = started(fmus, [("a.seen", "lag.u"), ("lag.y", "a.u")], {"x": "lag.x"}, variables=names)
    said = '"a.seen" is a local variable, which FMI 2 lets nobody read in initialisation mode; "lag.u" was initialised'
    assert ring.statistics["notes"][-1].startswith(said)


@VERSIONS
def test_an_output_is_read_after_the_inputs_that_it_follows(make: Make, version: int) -> None:
    """Each input is set once, though the two components wait for each other."""
    fmus = {"once": make("once", version, follows="u"), "source": make("source", version, follows="", variables=GIVES)}
    wires = [("source.y", "once.u"), ("once.y", "source.any")]
    assert at_start(fmus, wires, "once.y", parameters={"source": {"c": 7.0}}) == [7.0]


@VERSIONS
def test_what_cannot_be_computed_yet_is_waited_for(make: Make, version: int) -> None:
    """1 / u is refused at u = 0, and nothing is said of what it follows."""
    fmus = {"inverse": make("inverse", version), "source": make("source", version, variables=GIVES)}
    wires = [("source.y", "inverse.u"), ("inverse.y", "source.any")]
    assert at_start(fmus, wires, "inverse.y", parameters={"source": {"c": 4.0}}) == [0.25]


RING = [("a.y", "b.u"), ("b.y", "a.u")]


@VERSIONS
def test_dependencies_that_are_stated_wrongly_change_nothing(make: Make, version: int) -> None:
    fmus = {name: make("liar", version, follows="") for name in "ab"}
    assert at_start(fmus, RING, "a.y", "b.y", parameters={"a": {"k": -0.5, "c": 3.0}}) == pytest.approx([2.0, 2.0])


@BOTH
@VERSIONS
@pytest.mark.parametrize("k", [0.5, -3.0, 12.0])
def test_a_linear_ring_is_solved_at_the_start(make: Make, version: int, k: float, compiled: bool) -> None:
    """The solution of y = k y + 1, to which plain iteration leads for |k| < 1 only."""
    fmus = {name: make("gain", version) for name in "ab"}
    found = at_start(fmus, RING, "b.y", parameters={"a": {"k": k, "c": 1.0}}, compiled=compiled)
    assert found == pytest.approx([1 / (1 - k)], rel=1e-9)


@VERSIONS
@pytest.mark.parametrize("given", [True, False])
def test_a_ring_that_is_not_linear_is_solved_from_start_values(make: Make, version: int, given: bool) -> None:
    """The solutions of u = 2 - v^2, v = 2 - u^2 are 1 and -2; directional derivatives are used where both give them."""
    flag = {2: 'providesDirectionalDerivative="true"', 3: 'providesDirectionalDerivatives="true"'}[version]
    fmus = {name: make("square", version, flags=flag if given else "") for name in "ab"}
    for start, solution in ((0.8, 1.0), (-1.8, -2.0)):
        parameters = {name: {"c": 2.0, "u": start} for name in fmus}
        found, calls = at_start(fmus, RING, "a.y", "a.calls", parameters=parameters)
        assert found == pytest.approx(solution, rel=1e-9)
        assert (calls >= 1000) == given  # the FMU counts derivatives by thousands


def test_a_ring_without_a_solution_is_named_with_its_residual(make: Make) -> None:
    """There is none of u = 4 + v^2, v = 4 + u^2; a wire that breaks the ring is followed once, from the start value."""
    fmus = {name: make("square") for name in "ab"}
    parameters = {name: {"c": 4.0, "k": -1.0} for name in fmus}
    with pytest.raises(WiringError, match="The values at the start depend on each other and do not agree: ") as caught:
        started(fmus, RING, {"y": "a.y"}, parameters=parameters)
    for said in ("a.y -> b.u -> b.y -> a.u", "a residual of", "breaks_loop = true"):
        assert said in str(caught.value)
    broken = [("a.y", "b.u"), Wire("b.y", "a.u", breaks_loop=True)]
    assert at_start(fmus, broken, "a.y", "b.y", parameters=parameters, ticks=1) == [4 + 4**2, 4 + 20**2]


@BOTH
def test_other_types_arrive_at_the_start(make: Make, compiled: bool) -> None:
    fmus = {"one": make("integer"), "two": make("integer")}
    wires = [("one.n_out", "two.n"), ("one.on_out", "two.on"), ("one.text_out", "two.text")]
    parameters = {"one": {"n": 4, "on": True, "text": "ready"}}
    record = {"n": "two.n_out", "on": "two.on_out", "text": "two.text_out"}
    run = started(fmus, wires, record, parameters=parameters, compiled=compiled)
    assert [run.recording[name][0] for name in ("n", "on")] == [6, 1]
    assert run.recording.others["text"][0] == "ready"


@BOTH
def test_arrays_and_single_precision_arrive_at_the_start(make: Make, compiled: bool) -> None:
    fmus = {"one": make("array", 3), "two": make("array", 3)}
    given: dict[str, Any] = {"parameters": {"one": {"u": [1.0, 2.0, 3.0]}}, "compiled": compiled}
    for wire, expected in ((("one.y", "two.u"), [4, 8, 12]), (("one.y[2]", "two.u[3]"), [0, 0, 8])):
        run = started(fmus, [wire], {"y": "two.y"}, **given)
        assert [run.recording[f"y[{place}]"][0] for place in (1, 2, 3)] == expected
    single = {name: make("single", 3) for name in "ab"}
    found = at_start(single, RING, "b.y", parameters={"a": {"k": -3.0, "c": 1.0}}, compiled=compiled)
    assert found == pytest.approx([0.25], rel=1e-6)


@BOTH
def test_a_python_function_has_its_inputs_at_the_start_and_outputs_of_0(make: Make, compiled: bool) -> None:
    function = FunctionComponent(lambda t, q: 2 * q, {"q": ""}, {"y": ""}, "double")
    fmus = {"double": function, "lag": make("lag"), "source": make("source")}
    wires = [("source.y", "double.q"), ("double.y", "lag.u")]
    given: dict[str, Any] = {"parameters": {"source": {"c": 5.0}}, "compiled": compiled}
    assert at_start(fmus, wires, "double.q", "double.y", "lag.x", **given) == [5.0, 0.0, 0.0]
    given["parameters"] = {"double": {"q": 3.0}}
    alone = started({"double": function}, [], {"y": "double.y"}, **given)
    np.testing.assert_array_equal(alone.recording["y"], [0, 6, 6, 6, 6])
    with pytest.raises(WiringError, match=re.escape("\"double.q\" is 'far'; it must be a number, or an output of a")):
        started({"double": function}, [], {"y": "double.y"}, parameters={"double": {"q": "far"}})


def test_a_value_that_is_no_number_is_named_where_it_comes_from(make: Make) -> None:
    fmus = {"infinite": make("gain"), "lag": make("lag")}
    wires = [("r", "infinite.u"), ("infinite.y", "lag.u")]
    sentence = 'an output that is not a finite number at tick 0 (0 s), in initialisation mode: "infinite.y" is inf.'
    with pytest.raises(StepError, match=re.escape(sentence)):
        started(fmus, wires, {"x": "lag.x"}, signals={"r": 1e300}, parameters={"infinite": {"k": 1e300}})


def test_an_fmu_that_refuses_an_input_at_the_start_is_named(make: Make) -> None:
    fmus = {"once": make("once", follows=""), "b": make("gain", follows="u")}
    sentence = r"once returned an error at tick 0 \(0 s\), in initialisation mode; its last inputs: u = "
    with pytest.raises(StepError, match=sentence):
        started(fmus, [("b.y", "once.u"), ("once.y", "b.u")], {"y": "once.y"})
