"""Arrays of FMI 3: wired whole and by index, sized by structural parameters, given start values."""

from pathlib import Path

import pytest
from mirror_fmu import description, mirror
from simulating import simulate
from test_types import LOOPS
from tiny_fmu import described

from cosim.fmi.types import elements, indexed
from cosim.support.errors import FmuError, WiringError
from cosim.system.wire import Wire

__all__ = ["mirror"]


@LOOPS
def test_arrays_are_wired_whole_and_by_index_and_recorded_as_columns(compiled: bool, mirror: dict[int, Path]) -> None:
    recording = simulate(
        {"one": mirror[3], "two": mirror[3]},
        [Wire("one.y", "two.u"), Wire("one.z[2,1]", "two.w[1,2]"), Wire("one.y[2]", "two.float64_in", gain=10.0)],
        record={"y": "two.y", "z": "two.z", "x": "two.float64_out", "u": "two.u"},
        step=0.1,
        ticks=4,
        parameters={"one": {"u": [7, 8, 9], "w": [[10, 20, 30], [40, 50, 60]]}},
        compiled=compiled,
    ).recording
    names = [indexed("y", one) for one in elements((3,))] + [indexed("z", one) for one in elements((2, 3))]
    assert list(recording)[1:] == [*names, "x", "u[1]", "u[2]", "u[3]"]
    assert [recording[name][-1] for name in names] == [7, 8, 9, 1, 40, 3, 4, 5, 6]
    assert recording["x"][-1] == 80
    assert [recording[f"u[{n}]"][-1] for n in (1, 2, 3)] == [7, 8, 9]


@LOOPS
def test_structural_parameters_size_arrays_before_they_are_wired(compiled: bool, mirror: dict[int, Path]) -> None:
    big = {"n": 5, "u": [1, 2, 3, 4, 5]}
    recording = simulate(
        {"one": mirror[3], "two": mirror[3]},
        [Wire("one.y", "two.u")],
        record={"y": "two.y"},
        step=0.1,
        ticks=4,
        parameters={"one": big, "two": {"n": 5}},
        compiled=compiled,
    ).recording
    assert [recording[f"y[{n}]"][-1] for n in range(1, 6)] == [1, 2, 3, 4, 5]
    with pytest.raises(WiringError, match=r'"two.u" has 3 elements and "one.y" 5 elements; wire arrays of one shape'):
        simulate(
            {"one": mirror[3], "two": mirror[3]},
            [Wire("one.y", "two.u")],
            record={"y": "two.y"},
            step=0.1,
            ticks=4,
            parameters={"one": big},
        )


def test_an_element_of_an_array_is_set_beside_the_start_values_of_the_others(mirror: dict[int, Path]) -> None:
    recording = simulate(
        {"m": mirror[3]}, [], record={"y": "m.y"}, step=0.1, ticks=2, parameters={"m": {"u[2]": 9.0}}
    ).recording
    assert [recording[f"y[{n}]"][-1] for n in (1, 2, 3)] == [1, 9, 3]


@pytest.mark.parametrize("start", ["1 x 3", f"1 {'9' * 5000} 3", "1 ² 3"])
def test_start_values_of_an_array_that_are_no_numbers_are_refused(
    mirror: dict[int, Path], tmp_path: Path, start: str
) -> None:
    bad = described(mirror[3], tmp_path / "bad.fmu", description(3).replace('start="1 2 3"', f'start="{start}"'))
    with pytest.raises(FmuError, match="must be a number"):
        simulate({"m": bad}, [], record={"y": "m.y"}, step=0.1, ticks=2, parameters={"m": {"u[3]": 9.0}})


@pytest.mark.parametrize(
    ("wire", "said"),
    [
        (Wire("one.y", "two.float64_in"), '"two.float64_in" has one value and "one.y" 3 elements'),
        (Wire("one.float64_out", "two.u"), '"two.u" has 3 elements and "one.float64_out" one value'),
        (Wire("one.z", "two.u"), '"two.u" has 3 elements and "one.z" 2 x 3 elements'),
        (Wire("one.y[4]", "two.u[1]"), "which is not an output"),
        (Wire("one.y[1]", "two.u[0]"), r'"two.u\[0\]" cannot be fed: it does not exist'),
    ],
)
def test_arrays_that_do_not_fit_are_refused(wire: Wire, said: str, mirror: dict[int, Path]) -> None:
    with pytest.raises(WiringError, match=said):
        simulate({"one": mirror[3], "two": mirror[3]}, [wire], record={"x": "two.float64_out"}, step=0.1, ticks=2)
