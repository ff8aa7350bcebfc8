"""Time series in CSV as FMI's tools write them: a cell goes to its variable, and a wrong one is told with its place."""

import zipfile
from pathlib import Path

import pytest

from cosim.experiments.series import Series, series_of
from cosim.fmi.component import Port
from cosim.support.errors import FmuError

PORTS = {
    "x": Port("x", 0, "input"),
    "on": Port("on", 1, "input", type="Boolean"),
    "word": Port("word", 2, "input", type="String"),
    "a": Port("a", 3, "input", shape=(2,)),
}


def read(folder: Path, text: str) -> Series:
    with zipfile.ZipFile(folder / "a.fmu", "w") as archive:
        archive.writestr("in.csv", text)
    return series_of(folder / "a.fmu", "in.csv", PORTS)


def test_each_cell_goes_to_its_variable(tmp_path: Path) -> None:
    found = read(tmp_path, "Time,x,on,word,a,other\n0, 1.5,true,hi,1 2,9\n\n0.5,-2,false,,3 4,9\n0.5,3,1,x y,5 6,9\n")
    assert found.times.tolist() == [0.0, 0.5, 0.5]
    assert {name: values.tolist() for name, values in found.numbers.items()} == {
        "x": [1.5, -2.0, 3.0],
        "on": [1.0, 0.0, 1.0],
        "a[1]": [1.0, 3.0, 5.0],
        "a[2]": [2.0, 4.0, 6.0],
    }
    assert found.texts == {"word": ("hi", "", "x y")}
    assert found.strange == ("other",)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,x\n0,1\n", 'its first column must be "time"'),
        ("time,x\n", "is no time series"),
        ("time,x\n0,1\n2,1,3\n", "line 3 has 3 cells, and there are 2 columns"),
        ("time,x\n0,1\n1,2\n0.9,3\n", "the time must not go back"),
        ("time,x\n0,1\nlate,2\n", 'time in line 3 is "late"; it must be a number'),
        ("time,x\n0,much\n", 'x in line 2 is "much"; it must be a number'),
        ("time,a\n0,1 2\n1,1 2 3\n", "a has 2 elements, and line 3 has 3"),
        ("time,x,x\n0,1,1\n", 'two columns "x"'),
    ],
)
def test_what_is_no_series_is_refused_with_its_place(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(FmuError, match=said):
        read(tmp_path, text)
