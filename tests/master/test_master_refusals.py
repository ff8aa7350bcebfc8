"""What a run cannot be is refused before its first step: wires, names, arrays, parameters, FMUs; doubts are noted."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulating import alone, pair, simulate
from start_fmus import C, K, Make, U, V, Y
from test_master import VERSIONS, Tiny, control_loop, packed
from tiny_fmu import description

from cosim.api.show import show
from cosim.data.signals import Samples
from cosim.fmi.fmu import FmuComponent
from cosim.fmi.function import FunctionComponent
from cosim.support.errors import FmuError, SignalError, WiringError
from cosim.system.wire import Wire


@pytest.mark.parametrize(
    ("wires", "sentence"),
    [
        ([("r", "tow.a")], '"tow.a" cannot be fed: there is no component "tow"; components are: one, two.'),
        ([("r", "one.c")], '"one.c" cannot be fed: it does not exist; inputs of one are: a, b.'),
        ([("r", "one.y")], '"one.y" cannot be fed: it is an output; inputs of one are: a, b.'),
        ([("r", "one.k")], '"one.k" cannot be fed: it is a parameter; inputs of one are: a, b.'),
        ([("two.angel", "one.a")], '"one.a" is fed by "two.angel", which is not an output; outputs'),
        ([("one.b", "one.a")], '"one.a" is fed by "one.b", which is not an output; outputs are: y'),
        ([("s", "one.a")], '"s" names no component or signal "s"; there are: one, two, r.'),
        ([("r", "one.a"), ("two.y", "one.a")], '"one.a" is fed twice, by "r" and by "two.y".'),
        ([("r.other", "one.a")], '"one.a" is fed by "r.other", which is not one output; outputs are: r.value'),
        ([Wire("r", "one.a", noise="n")], 'The noise of "one.a" needs the signal "n", which does not exist'),
        ([Wire("r", "one.a", unit="V")], '"one.a" [rad] is fed by "r" [V]: "V" cannot become "rad"'),
        ([Wire("r", "one.a", unit="zoll")], '"zoll" is no unit known here'),
    ],
)
def test_a_wire_that_does_not_fit_is_refused_before_the_first_step(
    tiny: Tiny, wires: list[tuple[str, str] | Wire], sentence: str
) -> None:
    with pytest.raises(WiringError, match=re.escape(sentence)):
        pair(tiny[3], wires, {"y": "one.y"}, signals={"r": 1.0})


@pytest.mark.parametrize(
    ("changes", "error", "sentence"),
    [
        ({"record": {"t": "plant.y"}}, WiringError, 'The column "t" is time and is always recorded'),
        ({"record": {"q": "plant.x"}}, WiringError, '"plant.x" cannot be recorded: it does not exist; plant has: a, b'),
        ({"record": {"q": "plnt.x"}}, WiringError, '"plnt.x" names no component or signal "plnt"; there are: plant, c'),
        ({"signals": {"r": 1.0, "plant": 1.0}}, WiringError, '"plant" names a component and a signal; names must dif'),
        ({"parameters": {"mount": {}}}, WiringError, 'Parameters are given for "mount", which is no component; compo'),
        ({"signals": {"r": 1.0, "n": Samples(0.0, "arcsec")}}, WiringError, 'its noise "n" is not in rad'),
        ({"signals": {"r": np.zeros(20), "n": 0.0}}, SignalError, 'The signal "r" has 20 samples; the run needs 500'),
        ({"signals": {"r": np.zeros((2, 2)), "n": 0.0}}, SignalError, 'The signal "r" has the shape (2, 2); it must '),
    ],
)
def test_names_units_and_arrays_that_do_not_fit_are_refused(
    tiny: Tiny, changes: dict[str, Any], error: type[Exception], sentence: str
) -> None:
    with pytest.raises(error, match=re.escape(sentence)):
        control_loop(tiny[3], **changes)


@VERSIONS
@pytest.mark.parametrize(
    ("parameters", "sentence"),
    [
        ({"kp": 1.0}, '"plant.kp" does not exist; what can be set: a, b, k, mode, fail_at, nan_at, status.'),
        ({"y": 1.0}, '"plant.y" is calculated by the FMU and cannot be set; what can be set: a, b, k,'),
        ({"k": -1.0}, '"plant.k" is -1; it must lie in 0 .. inf 1.'),
    ],
)
def test_a_parameter_that_does_not_fit_is_named(
    tiny: Tiny, version: int, parameters: dict[str, float], sentence: str
) -> None:
    with pytest.raises(FmuError, match=re.escape(sentence)):
        control_loop(tiny[version], parameters={"plant": parameters})


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"xml": "<fmi"}, "has a modelDescription.xml that cannot be read: "),
        ({"xml": '<fmiModelDescription fmiVersion="1.0"/>'}, "is of FMI 1.0; this tool runs FMI 2.0 and 3.0."),
        ({"xml": description(2).replace("CoSimulation", "ModelExchange")}, "has no co-simulation interface"),
        ({"platform": "vax32"}, "binary; it has vax32. Export it again for this platform."),
        ({"library": b"no library"}, "cannot be instantiated: Failed to load shared library"),
        (b"hello", "is no FMU: it is not a zip archive."),
        (b"PK\5\6" + bytes(18), "is no FMU: the archive holds no modelDescription.xml."),
        (None, "does not exist."),
    ],
)
def test_an_fmu_that_cannot_run_is_refused(tiny: Tiny, tmp_path: Path, wrong: Any, sentence: str) -> None:
    path = tmp_path / "axis.fmu"
    if isinstance(wrong, dict):
        packed(path, tiny, **wrong)
    elif wrong is not None:
        path.write_bytes(wrong)
    with pytest.raises(FmuError, match=re.escape(sentence)) as caught:
        FmuComponent(path)
    assert str(path) in str(caught.value)


# A model description in words that FMI does not know is refused in a sentence; what can be set is set.


@VERSIONS
@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (replace(Y, causality="wibble", initial="exact"), 'causality = "wibble"'),
        (replace(Y, initial="wobble"), 'initial = "wobble"'),
        (replace(Y, initial="calculated", variability="now"), 'variability = "now"'),
    ],
)
def test_a_word_that_fmi_does_not_know_is_refused_by_show_and_run(
    make: Make, version: int, wrong: V, said: str
) -> None:
    fmu = make("gain", version, variables=(U, wrong, K, C))
    with pytest.raises(FmuError, match=f'the variable "y" has {said}; FMI {version}.0 knows '):
        show(fmu)
    with pytest.raises(FmuError, match=said):
        alone(fmu, [], {"y": "one.y"})


def test_a_structural_parameter_is_for_fmi_3(make: Make) -> None:
    size = V("n", 2, "structuralParameter", start="1", initial="exact")
    with pytest.raises(FmuError, match=r'has causality = "structuralParameter"; FMI 2\.0 knows parameter, calculated'):
        show(make("gain", 2, variables=(U, Y, size)))
    assert show(make("gain", 3, variables=(U, Y, size))).tables["variables"]


@VERSIONS
def test_a_start_value_that_a_description_leaves_out_can_be_given(make: Make, version: int) -> None:
    fmu = make("gain", version, variables=(replace(U, start=""), Y, replace(K, start=""), C))
    run = alone(fmu, [], {"y": "one.y"}, parameters={"one": {"u": 3.0, "k": 2.0}})
    assert run.recording["y"].tolist() == [6.0] * 4


@VERSIONS
@pytest.mark.parametrize(
    ("variable", "said"),
    [
        (V("z", 4), '"one.z" is calculated by the FMU and cannot be set; what can be set: u, k, c.'),
        (V("z", 4, variability="constant", initial="exact", start="1"), '"one.z" is a constant and cannot be set'),
        (V("z", 4, "independent"), '"one.z" is the time and cannot be set; what can be set: u, k, c.'),
    ],
)
def test_what_cannot_be_set_says_why(make: Make, version: int, variable: V, said: str) -> None:
    with pytest.raises(FmuError, match=re.escape(said)):
        alone(make("gain", version, variables=(U, Y, K, C, variable)), [], {}, parameters={"one": {"z": 1.0}})


# A run says what does not fit: an FMU's own steps, limits that cannot be, values without effect.


def notes(fmu: Path, step: float = 0.01, every: int = 1, **more: Any) -> list[str]:
    return alone(fmu, [], {"y": "one.y"}, step=step, ticks=10, every={"one": every}, **more).statistics["notes"]


OWN = {
    2: {
        "experiment": '<DefaultExperiment stepSize="0.01"/>',
        "flags": 'canHandleVariableCommunicationStepSize="false"',
    },
    3: {"flags": 'fixedInternalStepSize="0.01" canHandleVariableCommunicationStepSize="true"'},
}


@VERSIONS
@pytest.mark.parametrize(
    ("step", "every", "given", "fits"),
    [
        (0.003, 1, "0.003", "a step of 0.01 s"),
        (0.015, 1, "0.015", "a step of 0.01 s"),
        (0.001, 3, "0.003", "components.one.every = 10"),
        (0.005, 1, "0.005", "components.one.every = 2"),
    ],
)
def test_a_step_that_is_no_multiple_of_the_fmus_own_is_noted_with_both_lengths(
    make: Make, version: int, step: float, every: int, given: str, fits: str
) -> None:
    said = f"one goes by steps of its own of 0.01 s and is stepped every {given} s, which is no whole multiple"
    assert notes(make("gain", version, **OWN[version]), step, every) == [
        f"{said}: what it shows may be 0.01 s old; {fits} fits."
    ]


@VERSIONS
@pytest.mark.parametrize(("off", "noted"), [(0.0, False), (5e-7, False), (2e-6, True), (-2e-6, True), (1e-4, True)])
def test_a_multiple_is_one_to_a_millionth(make: Make, version: int, off: float, noted: bool) -> None:
    """What a decimal loses as a double is no other step; a ten-thousandth of it is."""
    assert bool(notes(make("gain", version, **OWN[version]), 0.03 * (1 + off))) is noted


@pytest.mark.parametrize(
    "more",
    [
        {"experiment": OWN[2]["experiment"], "flags": 'canHandleVariableCommunicationStepSize="true"'},
        {"experiment": '<DefaultExperiment stepSize="much"/>'},
        {"experiment": '<DefaultExperiment stepSize="-1"/>'},
        {},
    ],
)
def test_an_fmu_without_steps_of_its_own_says_nothing(make: Make, more: dict[str, str]) -> None:
    assert notes(make("gain", **more), 0.003) == []


@VERSIONS
@pytest.mark.parametrize(
    ("start", "more", "said"),
    [
        ("7", 'min="0" max="5"', '"k" starts at 7, outside its own limits of 0 .. 5'),
        ("7", 'max="5"', '"k" starts at 7, outside its own limits of -inf .. 5'),
        ("1", 'min="5" max="-5"', '"k" has min = 5 above max = -5; neither is used'),
    ],
)
def test_start_values_outside_their_limits_and_limits_that_contradict_are_noted_and_shown(
    make: Make, version: int, start: str, more: str, said: str
) -> None:
    fmu = make("gain", version, variables=(U, Y, replace(K, start=start, more=more), C))
    assert notes(fmu) == [f"one: {said}."]
    assert show(fmu).facts["note 1"] == f"{said}."
    if "min = 5" in said:
        assert notes(fmu, parameters={"one": {"k": 3.0}}) == [f"one: {said}."]


def test_of_many_such_variables_some_are_named_and_the_others_counted(make: Make) -> None:
    many = [V(f"k{number}", 2, "parameter", start="7", more='max="5"') for number in range(9)]
    facts = show(make("gain", variables=(U, Y, *many))).facts
    assert facts["note 6"] == "4 more variables have start values or limits like these."
    assert "note 7" not in facts


def test_a_start_value_that_no_item_has_is_noted(make: Make) -> None:
    items = '<Item name="calm" value="1"/><Item name="angry" value="2"/>'
    types = (
        f'<TypeDefinitions><SimpleType name="Mood"><Enumeration>{items}</Enumeration></SimpleType></TypeDefinitions>'
    )
    mood = V("mood", 0, "input", "Enumeration", "7", more='declaredType="Mood"')
    fmu = make("integer", variables=(mood, Y), experiment=types)
    assert notes(fmu) == ['one: "mood" starts at 7, which is none of its items.']


def test_a_value_for_an_input_that_is_fed_is_noted(make: Make) -> None:
    function = FunctionComponent(lambda t, q: q, {"q": ""}, {"y": ""}, "f")
    parameters, wires = {"a": {"u": 3.0}, "f": {"q": 2.0}}, [("r", "a.u"), ("a.y", "f.q")]
    given: dict[str, Any] = {"step": 0.01, "ticks": 2, "parameters": parameters, "signals": {"r": 1.0}}
    told = simulate({"a": make("gain"), "f": function}, wires, record={"y": "f.y"}, **given).statistics["notes"]
    rule = "so the value of its parameters is a first guess and no more."
    assert f'"a.u" is fed by "r", {rule}' in told
    assert f'"f.q" is fed by "a.y", {rule}' in told
