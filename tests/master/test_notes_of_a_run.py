"""A run says what does not fit: an FMU's own steps, limits that cannot be, values without effect."""

from dataclasses import replace
from pathlib import Path

import pytest
from simulating import simulate
from start_fmus import C, K, Make, U, V, Y

from cosim.api.show import show
from cosim.fmi.function import FunctionComponent

VERSIONS = pytest.mark.parametrize("version", [2, 3])


def notes(fmu: Path, step: float = 0.01, every: int = 1, **more: object) -> list[str]:
    run = simulate({"a": fmu}, [], record={"y": "a.y"}, step=step, ticks=10, every={"a": every}, **more)
    return list(run.statistics["notes"])


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
        (0.001, 3, "0.003", "components.a.every = 10"),
        (0.005, 1, "0.005", "components.a.every = 2"),
    ],
)
def test_a_step_that_is_no_multiple_of_the_fmus_own_is_noted_with_both_lengths(
    make: Make, version: int, step: float, every: int, given: str, fits: str
) -> None:
    said = f"a goes by steps of its own of 0.01 s and is stepped every {given} s, which is no whole multiple"
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
    assert notes(fmu) == [f"a: {said}."]
    assert show(fmu).facts["note 1"] == f"{said}."
    if "min = 5" in said:
        assert notes(fmu, parameters={"a": {"k": 3.0}}) == [f"a: {said}."]


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
    assert notes(fmu) == ['a: "mood" starts at 7, which is none of its items.']


def test_a_value_for_an_input_that_is_fed_is_noted(make: Make) -> None:
    function = FunctionComponent(lambda t, q: q, {"q": ""}, {"y": ""}, "f")
    parameters = {"a": {"u": 3.0}, "f": {"q": 2.0}}
    wires = [("r", "a.u"), ("a.y", "f.q")]
    run = simulate(
        {"a": make("gain"), "f": function},
        wires,
        record={"y": "f.y"},
        step=0.01,
        ticks=2,
        parameters=parameters,
        signals={"r": 1.0},
    )
    rule = "so the value of its parameters is a first guess and no more."
    assert f'"a.u" is fed by "r", {rule}' in run.statistics["notes"]
    assert f'"f.q" is fed by "a.y", {rule}' in run.statistics["notes"]
