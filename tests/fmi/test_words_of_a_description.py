"""A model description in words that FMI does not know is refused in a sentence; what can be set is set."""

import re
from dataclasses import replace

import pytest
from commands import call
from simulating import simulate
from start_fmus import C, K, Make, U, V, Y

from cosim.api.show import show
from cosim.support.errors import FmuError

VERSIONS = pytest.mark.parametrize("version", [2, 3])


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
    make: Make, version: int, wrong: V, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    fmu = make("gain", version, variables=(U, wrong, K, C))
    with pytest.raises(FmuError, match=f'the variable "y" has {said}; FMI {version}.0 knows '):
        show(fmu)
    with pytest.raises(FmuError, match=said):
        simulate({"a": fmu}, [], record={"y": "a.y"}, step=0.1, ticks=1)
    assert call("show", fmu) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_a_structural_parameter_is_for_fmi_3(make: Make) -> None:
    size = V("n", 2, "structuralParameter", start="1", initial="exact")
    with pytest.raises(FmuError, match=r'has causality = "structuralParameter"; FMI 2\.0 knows parameter, calculated'):
        show(make("gain", 2, variables=(U, Y, size)))
    assert show(make("gain", 3, variables=(U, Y, size))).tables["variables"]


@VERSIONS
def test_a_start_value_that_a_description_leaves_out_can_be_given(make: Make, version: int) -> None:
    bare = (replace(U, start=""), Y, replace(K, start=""), C)
    given = {"a": {"u": 3.0, "k": 2.0}}
    fmu = make("gain", version, variables=bare)
    run = simulate({"a": fmu}, [], record={"y": "a.y"}, step=0.1, ticks=2, parameters=given)
    assert run.recording["y"].tolist() == [6.0, 6.0]


@VERSIONS
@pytest.mark.parametrize(
    ("variable", "said"),
    [
        (V("z", 4), '"a.z" is calculated by the FMU and cannot be set; what can be set: u, k, c.'),
        (
            V("z", 4, variability="constant", initial="exact", start="1"),
            '"a.z" is a constant and cannot be set; what can be set: u, k, c.',
        ),
        (V("z", 4, "independent"), '"a.z" is the time and cannot be set; what can be set: u, k, c.'),
    ],
)
def test_what_cannot_be_set_says_why(make: Make, version: int, variable: V, said: str) -> None:
    fmu = make("gain", version, variables=(U, Y, K, C, variable))
    with pytest.raises(FmuError, match=re.escape(said)):
        simulate({"a": fmu}, [], record={"y": "a.y"}, step=0.1, ticks=1, parameters={"a": {"z": 1.0}})
