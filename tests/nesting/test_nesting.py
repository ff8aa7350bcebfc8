"""A system as one FMU has the bits of its run, takes inputs and parameters from outside, and refuses what it cannot."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmu_tools
import numpy as np
import pytest
from commands import call
from fmpy.validation import validate_fmu
from nested_runs import assert_same_bits, both, nested
from tiny_fmu import described, description

from cosim.api.export import export
from cosim.data.signals import Noise, Steps
from cosim.master.simulate import simulate
from cosim.models.cache import with_fmus
from cosim.support.errors import StepError, WiringError
from cosim.system.algorithm import Energy, GaussSeidel, Iterated, Jacobi
from cosim.system.faults import Freeze
from cosim.system.scenario import read_scenario
from cosim.system.system import Fmu, Function, System
from cosim.system.wire import Record, Wire
from cosim_nesting.nest import nest

Tiny = dict[int, Path]
STEP, TICKS = 0.05, 120
STEP_OF_TOOLS = fmu_tools.STEP


def oscillator(fmu: Path, **changes: Any) -> System:
    """V' = r - x and x' = v as two FMUs."""
    system = System(
        components={"mass": fmu, "spring": fmu},
        wires=[Wire("r", "mass.a"), Wire("spring.y", "mass.b"), Wire("mass.y", "spring.a")],
        records={"v": Record("mass.y"), "x": Record("spring.y")},
        step=STEP,
        ticks=TICKS,
        signals={"r": 1.0},
    )
    return replace(system, **changes)


@pytest.fixture(scope="module")
def plain(tiny: Tiny, tmp_path_factory: pytest.TempPathFactory) -> Tiny:
    """The tiny FMU without units, so that a bond may be anything."""
    folder = tmp_path_factory.mktemp("plain")
    texts = {version: description(version).replace(' unit="rad"', "") for version in tiny}
    return {version: described(tiny[version], folder / f"plain{version}.fmu", texts[version]) for version in tiny}


@pytest.mark.parametrize(
    ("algorithm", "fmi", "every"),
    [
        (Jacobi(kind="jacobi"), 2, 1),
        (Jacobi(kind="jacobi"), 3, 1),
        (GaussSeidel(kind="gauss-seidel", order=["spring", "mass"]), 3, 1),
        (Iterated(kind="iterated", components=["mass", "spring"]), 2, 1),
        (Energy(kind="energy", bonds=[("mass.y", "spring.y")]), 3, 1),
        pytest.param(Jacobi(kind="jacobi"), 2, 4, id="a longer step of the importer is several ticks"),
    ],
)
def test_each_algorithm_has_the_bits_of_the_run(algorithm, fmi, every, plain, tmp_path) -> None:
    """Components of the other FMI version than the whole."""
    assert_same_bits(*both(oscillator(plain[5 - fmi], algorithm=algorithm), tmp_path, fmi, every))


def test_rates_gains_quanta_noise_and_faults_go_along(tiny: Tiny, tmp_path: Path) -> None:
    system = oscillator(
        tiny[3],
        every={"spring": 3},
        wires=[
            Wire("r", "mass.a"),
            Wire("spring.y", "mass.b", gain=0.9, offset=0.01, noise="hiss"),
            Wire("mass.y", "spring.a", quantum=1e-3),
        ],
        signals={
            "r": Steps(kind="steps", times=[1.0, 3.0], values=[1.0, -2.0]),
            "hiss": Noise(kind="noise", rms=1e-3, seed=7),
        },
        parameters={"mass": {"k": 1.3}, "spring": {"k": 0.7}},
        faults=[Freeze.model_validate({"on": "spring.a", "kind": "freeze", "from": 2.0, "until": 2.5})],
    )
    assert_same_bits(*both(system, tmp_path, 3))


@pytest.mark.parametrize("name", ["sidereal", "two_axis"])
def test_shipped_scenarios_have_the_bits_of_their_run(name: str, tmp_path: Path) -> None:
    """Of all columns that a component or a signal gives: an input acts in the tick after its time."""
    scenario = with_fmus(read_scenario(name))
    fed = {str(wire.target) for wire in scenario.wires}
    system = scenario.system()
    given = {n: one for n, one in system.records.items() if one.mode == "sample" and str(one.signal) not in fed}
    assert len(given) > 3
    ours, theirs = both(replace(system, ticks=3000, decimation=1, records=given), tmp_path, 3)
    for column, values in ours.items():
        np.testing.assert_array_equal(values, theirs[column], err_msg=column)


def test_an_ssp_becomes_one_fmu_that_is_valid_and_runs_in_our_master_too(tmp_path: Path) -> None:
    ssp = export("paper_mount", tmp_path / "a", fmi=3, ssp=True).ssp
    done = export(ssp, tmp_path / "b", as_fmu=True)
    assert [one.name for one in done.fmus] == ["paper_mount_fmi2.fmu", "paper_mount_fmi3.fmu"]
    assert not [problem for path in done.fmus for problem in validate_fmu(path)]
    scenario = read_scenario(ssp)
    names = {"q": Record("mount.q"), "tau": Record("controller.tau")}
    inside = replace(scenario.system(), ticks=2000, records=names)
    whole = System(
        components={"all": Fmu(done.fmus[1])},
        records={"q": Record("all.mount.q"), "tau": Record("all.controller.tau")},
        step=inside.step,
        ticks=inside.ticks,
    )
    one, other = simulate(inside).recording, simulate(whole).recording
    for column in names:
        np.testing.assert_array_equal(one[column], other[column])


def test_inputs_and_parameters_come_from_outside(tiny: Tiny, tmp_path: Path) -> None:
    """What no wire feeds is an input of the whole; a parameter may be another one than the scenario's."""
    free = oscillator(tiny[3], wires=[Wire("spring.y", "mass.b"), Wire("mass.y", "spring.a")], signals={})
    push = np.cos(0.3 * np.arange(TICKS))
    fmu = nested(free, tmp_path, 3)
    fmu.start({"mass.k": 1.5, "mass.a": float(push[0])})
    rows = fmu.run(["mass.y", "spring.y"], TICKS, inputs={"mass.a": push})
    fmu.close()
    recording = simulate(oscillator(tiny[3], signals={"r": push}, parameters={"mass": {"k": 1.5}})).recording
    np.testing.assert_array_equal(recording["v"], rows["mass.y"][:TICKS])
    np.testing.assert_array_equal(recording["x"], rows["spring.y"][:TICKS])


def test_an_fmu_of_a_system_is_a_component_of_another(tiny: Tiny, tmp_path: Path) -> None:
    inner = tmp_path / "inner.fmu"
    nest(oscillator(tiny[3]), {2: inner})
    system = System(
        components={"one": inner, "two": inner},
        records={"x": Record("one.spring.y"), "v": Record("two.mass.y")},
        step=2 * STEP,
        ticks=50,
    )
    (tmp_path / "outer").mkdir()
    assert_same_bits(*both(system, tmp_path / "outer", 3))


def test_a_system_without_signals_takes_none_along_however_long_it_runs(tiny: Tiny, tmp_path: Path) -> None:
    endless = System(components={"it": tiny[3]}, records={"y": Record("it.y")}, step=1e-3, ticks=10**12)
    (path,) = nest(endless, {3: tmp_path / "endless.fmu"})
    assert path.stat().st_size < 1_000_000
    moving = replace(
        endless, signals={"u": Noise(kind="noise", rms=1.0, seed=1, unit="rad")}, wires=[Wire("u.value", "it.a")]
    )
    assert "do not go into an FMU: 1 signals at 1,000,000,000,001 ticks" in refusal(moving, tmp_path)


def test_several_instances_and_a_reset_begin_anew(tiny: Tiny, tmp_path: Path) -> None:
    one = nested(oscillator(tiny[2]), tmp_path, 2)
    one.start()
    first = one.run(["spring.y"], 50)
    one.fmu.reset()
    one.start()
    again = one.run(["spring.y"], 50)
    one.close()
    np.testing.assert_array_equal(first["spring.y"], again["spring.y"])


@pytest.mark.parametrize("fmi", [2, 3])
def test_steps_that_do_not_fit_are_refused(fmi: int, tiny: Tiny, tmp_path: Path) -> None:
    moving = oscillator(tiny[3], signals={"r": Steps(kind="steps", times=[9.0], values=[1.0])}, ticks=10)
    fmu = nested(moving, tmp_path, fmi)
    fmu.start()
    for time, size in ((0.0, 0.4 * STEP), (STEP, STEP), (0.0, 11 * STEP)):
        with pytest.raises(Exception, match="DoStep"):
            fmu.fmu.doStep(time, size)
    fmu.fmu.doStep(0.0, 10 * STEP)
    fmu.fmu.freeInstance()


def test_a_component_that_fails_ends_the_step_and_its_name_is_said(tiny: Tiny, tmp_path: Path) -> None:
    nest(oscillator(tiny[3], parameters={"spring": {"fail_at": 1.0}}), {3: tmp_path / "system.fmu"})
    whole = System(
        components={"all": tmp_path / "system.fmu"}, records={"x": Record("all.spring.y")}, step=STEP, ticks=TICKS
    )
    with pytest.raises(StepError, match=r"spring failed at 1 s with status 3"):
        simulate(whole)


def test_another_importer_has_the_same_bits(tiny: Tiny, tmp_path: Path) -> None:
    pytest.importorskip("libcosimpy.CosimExecution")
    wires = [*oscillator(tiny[3]).wires, Wire("zero", "spring.b")]
    fmu = nested(oscillator(tiny[3], wires=wires, signals={"r": 1.0, "zero": 0.0}, step=STEP_OF_TOOLS), tmp_path, 2)
    fmu.start()
    ours = fmu.run(["mass.y", "spring.y"], 40)
    fmu.close()
    out, path = tmp_path / "rows.npz", tmp_path / "system2.fmu"
    command = [sys.executable, fmu_tools.__file__, "libcosim", str(path), "40", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    theirs = dict(zip(fmu_tools.names_of(str(path))[0], np.load(out)["rows"].T, strict=True))
    for name, values in ours.items():
        np.testing.assert_array_equal(values[1:], theirs[name])


@pytest.mark.parametrize("fmi", [2, 3])
def test_derivatives_are_not_promised_and_asking_for_them_is_an_error(fmi: int, tiny: Tiny, tmp_path: Path) -> None:
    """Never zeros that look like derivatives: a calibration elsewhere would stop at its start."""
    fmu = nested(oscillator(tiny[3], wires=[Wire("spring.y", "mass.b"), Wire("mass.y", "spring.a")]), tmp_path, fmi)
    assert fmu.description.coSimulation.providesDirectionalDerivative is False
    fmu.start()
    asked = [fmu.places["mass.y"]], [fmu.places["mass.a"]], [1.0]
    with pytest.raises(Exception, match="GetDirectionalDerivative failed with status 3"):
        fmu.fmu.getDirectionalDerivative(*asked)
    if fmi == 3:
        assert fmu.description.coSimulation.providesAdjointDerivatives is False
        with pytest.raises(Exception, match="GetAdjointDerivative failed with status 3"):
            fmu.fmu.getAdjointDerivative(asked[1], asked[0], asked[2])
    fmu.fmu.freeInstance()


def refusal(system: System, folder: Path) -> str:
    with pytest.raises(WiringError) as refused:
        nested(system, folder, 3)
    return str(refused.value)


def test_what_cannot_be_nested_is_said_in_a_sentence(tiny: Tiny, tmp_path: Path) -> None:
    python = Function("file.py:f", {"a": "rad"}, {"y": "rad"}, "here")
    assert '"mass" is a Python function' in refusal(
        oscillator(tiny[3], components={"mass": python, "spring": tiny[3]}), tmp_path
    )
    exchange = Fmu(tiny[3], "model-exchange")
    said = refusal(oscillator(tiny[3], components={"mass": exchange, "spring": tiny[3]}), tmp_path)
    assert "stepped by model-exchange, and only co-simulation can be nested: leave `interface` out" in said
    assert "starts at 2 s" in refusal(oscillator(tiny[3], start=2.0), tmp_path)
    direct = described(tiny[3], tmp_path / "direct.fmu", description(3, direct=True))
    ring = oscillator(direct, parameters={"mass": {"mode": 2.0, "k": 0.5}, "spring": {"mode": 2.0, "k": 0.5}})
    assert "ring" in refusal(ring, tmp_path)
    whole = described(tiny[3], tmp_path / "whole.fmu", description(3).replace("Float64", "Int32").replace("1e9", "9"))
    assert "doubles only" in refusal(System(components={"it": whole}, records={}, step=STEP, ticks=3), tmp_path)
    assert not list(tmp_path.glob("system*.fmu"))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["sidereal", "--as-fmu", "--mujoco"], "--mujoco is of a card"),
        (["paper_mount", "--as-fmu"], "no such scenario"),
        (["sidereal", "--as-fmu", "--platform", "all"], "builds for this computer"),
        (["nothing.ssp", "--as-fmu"], "nothing.ssp"),
        (["theirs.ssp"], "theirs.ssp is a system, not a card; with --as-fmu"),
    ],
)
def test_wrong_use_of_the_command_is_a_sentence(words, sentence, tmp_path, capsys) -> None:
    assert call("export", *words, "--out", tmp_path) == 2
    assert sentence in capsys.readouterr().err


def test_the_command_prints_the_path_and_overwrites_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["export", "sidereal", "--as-fmu", "--fmi", "3", "--json", "--out", str(tmp_path)]
    assert call(*asked) == 0
    (path,) = json.loads(capsys.readouterr().out)["fmus"]
    assert Path(path).is_file()
    assert call(*asked) == 2
    assert "exists already" in capsys.readouterr().err
