"""What a run cannot be is refused before its first step: wires, names, arrays, parameters, FMUs."""

import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulating import simulate
from test_master import VERSIONS, Tiny, control_loop, packed
from tiny_fmu import description

from cosim.fmi.fmu import FmuComponent
from cosim.support.errors import FmuError, SignalError, WiringError
from cosim.system.wire import Wire


@pytest.mark.parametrize(
    ("wires", "sentence"),
    [
        ([("r", "plnt.a")], '"plnt.a" cannot be fed: there is no component "plnt"; components are: plant, controller.'),
        ([("r", "plant.c")], '"plant.c" cannot be fed: it does not exist; inputs of plant are: a, b.'),
        ([("r", "plant.y")], '"plant.y" cannot be fed: it is an output; inputs of plant are: a, b.'),
        ([("r", "plant.k")], '"plant.k" cannot be fed: it is a parameter; inputs of plant are: a, b.'),
        ([("controller.angel", "plant.a")], '"plant.a" is fed by "controller.angel", which is not an output; outputs'),
        ([("plant.b", "plant.a")], '"plant.a" is fed by "plant.b", which is not an output; outputs are: y'),
        ([("s", "plant.a")], '"s" names no component or signal "s"; there are: plant, controller, r.'),
        ([("r", "plant.a"), ("controller.y", "plant.a")], '"plant.a" is fed twice, by "r" and by "controller.y".'),
        ([("r.other", "plant.a")], '"plant.a" is fed by "r.other", which is not one output; outputs are: r.value'),
        ([Wire("r", "plant.a", noise="n")], 'The noise of "plant.a" needs the signal "n", which does not exist'),
        ([Wire("r", "plant.a", unit="V")], '"plant.a" [rad] is fed by "r" [V]: "V" cannot become "rad"'),
        ([Wire("r", "plant.a", unit="zoll")], '"zoll" is no unit known here'),
    ],
)
def test_a_wire_that_does_not_fit_is_refused_before_the_first_step(
    tiny: Tiny, wires: list[tuple[str, str] | Wire], sentence: str
) -> None:
    two = {"plant": tiny[3], "controller": tiny[3]}
    with pytest.raises(WiringError, match=re.escape(sentence)):
        simulate(two, wires, record={"y": "plant.y"}, step=1.0, ticks=1, signals={"r": 1.0})


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"record": {"t": "plant.y"}}, 'The column "t" is time and is always recorded'),
        ({"record": {"q": "plant.x"}}, '"plant.x" cannot be recorded: it does not exist; plant has: a, b, k,'),
        ({"record": {"q": "plnt.x"}}, '"plnt.x" names no component or signal "plnt"; there are: plant, controller, r'),
        ({"signals": {"r": 1.0, "n": 0.0, "plant": 1.0}}, '"plant" names a component and a signal; names must differ.'),
        ({"parameters": {"mount": {}}}, 'Parameters are given for "mount", which is no component; components are'),
    ],
)
def test_names_that_do_not_fit_are_refused(tiny: Tiny, changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(WiringError, match=re.escape(sentence)):
        control_loop(tiny[3], **changes)


def test_noise_in_another_unit_is_refused(tiny: Tiny) -> None:
    from cosim.data.signals import Samples

    with pytest.raises(WiringError, match='its noise "n" is not in rad'):
        control_loop(tiny[3], signals={"r": 1.0, "n": Samples(0.0, "arcsec")})


def test_arrays_that_do_not_fit_are_refused(tiny: Tiny) -> None:
    with pytest.raises(SignalError, match='The signal "r" has 20 samples; the run needs 500'):
        control_loop(tiny[3], signals={"r": np.zeros(20), "n": 0.0})
    with pytest.raises(SignalError, match=r'The signal "r" has the shape \(2, 2\); it must be one value a tick'):
        control_loop(tiny[3], signals={"r": np.zeros((2, 2)), "n": 0.0})


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
    ],
)
def test_an_fmu_that_cannot_run_is_refused(tiny: Tiny, tmp_path: Path, wrong: dict[str, Any], sentence: str) -> None:
    path = packed(tmp_path / "axis.fmu", tiny, **wrong)
    with pytest.raises(FmuError, match=re.escape(sentence)) as caught:
        FmuComponent(path)
    assert str(path) in str(caught.value)


def test_a_file_that_is_no_fmu_is_refused(tmp_path: Path) -> None:
    text, empty = tmp_path / "text.fmu", tmp_path / "empty.fmu"
    text.write_text("hello")
    zipfile.ZipFile(empty, "w").close()
    sentences = {
        tmp_path / "none.fmu": "does not exist.",
        text: "is no FMU: it is not a zip archive.",
        empty: "is no FMU: the archive holds no modelDescription.xml.",
    }
    for path, sentence in sentences.items():
        with pytest.raises(FmuError, match=f"{path} {re.escape(sentence)}"):
            FmuComponent(path)
