"""The equations of a card elsewhere: as plain C with the bits of the FMU, and as a Modelica component with flanges."""

import subprocess
import sys
from math import sin
from pathlib import Path

import numpy as np
import pytest
from modelica_flat import Flat, at_random, in_modelica
from nested_runs import InFmpy

from cosim.api.export import export
from pyfmi_models.card import parse_card, read_card
from pyfmi_models.derivation import derivation_of
from pyfmi_models.errors import ExportError
from pyfmi_models.export.c_function import c_files, export_c
from pyfmi_models.export.flange import export_flange, flange_text
from pyfmi_models.mount import Mount

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2", "-ffp-contract=off")
STEP, ROWS = 2.0**-9, 400


def torques(size: float) -> np.ndarray:
    """Rows of command and external torque that break away, slide, reverse and rest."""
    t = np.arange(ROWS) * STEP
    return size * np.column_stack([8 * np.sin(9 * t) + 2 * np.sin(47 * t), 0.4 * np.cos(5 * t)])


def compiled(folder: Path, program: str) -> Path:
    files = sorted(path.name for path in folder.glob("*.c"))
    command = [sys.executable, "-m", "ziglang", "cc", *STRICT, *files, "-o", program]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / program


def in_fmpy(path: Path, inputs: np.ndarray) -> np.ndarray:
    fmu = InFmpy(path, STEP)
    fmu.start()
    outputs = [one.name for one in fmu.description.modelVariables if one.causality == "output"]
    rows = fmu.run(outputs, len(inputs), inputs={"tau": inputs[:, 0], "disturbance": inputs[:, 1]})
    fmu.close()
    return np.column_stack([rows[name][1:] for name in outputs])


@pytest.mark.parametrize(("card", "size"), [("paper_mount", 1.0), ("emps", 10.0)])
def test_the_function_in_c_gives_the_bits_of_the_fmu(card: str, size: float, tmp_path: Path) -> None:
    inputs = torques(size)
    done = export(card, tmp_path, fmi=3, c=True)
    program = compiled(done.c, "joint")
    rows = "\n".join(f"{tau!r} {load!r}" for tau, load in inputs.tolist())
    said = subprocess.run([program, repr(STEP)], input=rows, capture_output=True, text=True, check=True).stdout
    found = np.array([list(map(float, line.split())) for line in said.splitlines()])
    plant = next(path for path in done.fmus if "plant" in path.name)
    np.testing.assert_array_equal(found, in_fmpy(plant, inputs))
    assert np.ptp(found[:, 0]) > 1e-3, "it moved"
    for length in ("0", "-1e-3", "nan"):  # a step that is none changes nothing and says so
        assert subprocess.run([program, length], input="1 0\n", text=True, stdout=-1, check=False).returncode == 1


def test_two_cards_go_into_one_program(tmp_path: Path) -> None:
    models = [read_card(card).plant().model() for card in ("paper_mount", "emps")]
    for model in models:
        for name, text in c_files(model).items():
            (tmp_path / name).write_text(text)
    names = [model.name for model in models]
    body = "".join(
        f"{name}_joint {name}; {name}_start(&{name}); if ({name}_step(&{name}, 1e-3)) return 1; " for name in names
    )
    (tmp_path / "main.c").write_text(
        "".join(f'#include "{name}.h"\n' for name in names) + f"int main(void) {{ {body}return 0; }}\n"
    )
    subprocess.run([compiled(tmp_path, "both")], check=True)


def test_files_that_are_there_are_only_replaced_with_force(tmp_path: Path) -> None:
    model = read_card("paper_mount").plant().model()
    export_c(model, tmp_path / "c")
    source = next((tmp_path / "c").glob("detmath.c"))
    whole = source.read_bytes()
    source.write_text("mine")
    with pytest.raises(ExportError, match="exists; use force"):
        export_c(model, tmp_path / "c")
    assert source.read_text() == "mine"
    export_c(model, tmp_path / "c", force=True)
    assert source.read_bytes() == whole


# With flanges: parsed by another tool, it has the motion of a hand-written DAE.

LIBRARY = """
package Modelica
  package Blocks package Interfaces
    connector RealInput = input Real;
    connector RealOutput = output Real;
  end Interfaces; end Blocks;
  package Mechanics
    package Rotational package Interfaces
      connector Flange_a Real phi(unit = "rad"); flow Real tau(unit = "N.m"); end Flange_a;
      connector Flange_b Real phi(unit = "rad"); flow Real tau(unit = "N.m"); end Flange_b;
    end Interfaces; end Rotational;
    package Translational package Interfaces
      connector Flange_a Real s(unit = "m"); flow Real f(unit = "N"); end Flange_a;
      connector Flange_b Real s(unit = "m"); flow Real f(unit = "N"); end Flange_b;
    end Interfaces; end Translational;
  end Mechanics;
end Modelica;
"""
"""The connectors that are used, as the Modelica Standard Library 4.0 declares them."""
BRAKED = """[mount]
inertia = 2
torque_limit = 5
[friction]
model = "coulomb"
Fc = 0.5
sigma2 = 3
[[effects]]
effect = "gravity_unbalance"
mgl = 1.5
phase = 0.3
"""


def flat_of(plant: Mount) -> Flat:
    return Flat(flange_text(plant.model(), "Mine", derivation_of(plant)) + LIBRARY, "Mine", "Joint")


def test_a_flanged_joint_moves_as_the_hand_written_equation() -> None:
    """J phi'' = min(tau, limit) + tau_a + tau_b - Fc sign(w) - sigma2 w - mgl sin(phi + phase)."""
    flat = flat_of(parse_card(BRAKED, "braked").plant())
    for phi, w, tau, a, b in ((0.2, 0.4, 1.0, 0.7, -0.2), (-1.0, -0.3, -9.0, 2.0, 3.0)):
        given = {"plant.position": phi, "plant.speed": w, "tau": tau, "flange_a.tau": a, "flange_b.tau": b, "time": 0.0}
        found = flat.values(given)
        applied = max(-5.0, min(5.0, tau))
        friction = 0.5 * (1 if w > 0 else -1) + 3 * w
        wanted = (applied + a + b - friction - 1.5 * sin(phi + 0.3)) / 2
        assert found["der(plant.speed)"] == pytest.approx(wanted, rel=1e-9)
        assert found["der(plant.position)"] == w
        assert (found["flange_a.phi"], found["flange_b.phi"]) == (phi, phi)


@pytest.mark.parametrize("card", ["paper_mount_directional", "altaz_altitude", "emps"])
def test_with_free_flanges_it_is_the_causal_plant(card: str) -> None:
    plant = read_card(card).plant()
    model, flat = plant.model(), flat_of(plant)
    push = "f" if plant.motion == "linear" else "tau"
    t, (states, inputs, _) = at_random(model, 3)
    given = {
        f"plant.{in_modelica(model, one.name)}": x for one, x in zip(model.states, map(float, states), strict=True)
    }
    given |= {one.name: float(u) for one, u in zip(model.inputs, inputs, strict=True)}
    pushed = -given.pop("disturbance")
    found = flat.values(given | {f"flange_a.{push}": pushed, f"flange_b.{push}": 0.0, "time": t})
    parameters = [one.start for one in model.parameters]
    own = model.equations(t, states, inputs, parameters)[0].full().ravel()
    for state, rate in zip(model.states, own, strict=True):
        assert found[f"der(plant.{in_modelica(model, state.name)})"] == pytest.approx(rate, rel=1e-9, abs=1e-12)


def test_a_controller_is_no_joint_and_without_a_torque_from_outside_has_no_flange(tmp_path: Path) -> None:
    controller = read_card("paper_mount").controller_model()
    with pytest.raises(ExportError, match="sampled"):
        c_files(controller)
    with pytest.raises(ExportError, match="disturbance"):
        export_flange(controller, tmp_path / "C.mo")


def test_what_has_the_equations_of_the_fmu_loses_nothing_and_is_in_the_table(tmp_path: Path) -> None:
    done = export("altaz_altitude", tmp_path, fmi=3, modelica_flange=True, c=True, urdf=True)
    by_key = {one.format.key: one for one in done.held}
    assert list(by_key) == ["urdf", "modelica_flange", "c"]
    assert {row.part for row in by_key["c"].rows} >= {"inertia", "gravity_unbalance", "azimuth_centrifugal"}
    assert by_key["c"].lost == by_key["modelica_flange"].lost == 0 < by_key["urdf"].lost
    said = done.as_json()
    assert Path(str(said["c"])).is_dir()
    assert Path(str(said["modelica_flange"])).is_file()
    linear = export("emps", tmp_path, fmi=3, modelica=True, modelica_flange=True)
    assert linear.flange == tmp_path / "EmpsFlange.mo"  # a package of its own, beside the causal one
    text = linear.flange.read_text()
    assert "Modelica.Mechanics.Translational.Interfaces.Flange_a" in text
    assert text.rstrip().endswith("end EmpsFlange;")
    assert 'uses(Modelica(version = "4.0.0"))' in text
    assert "equations of the FMU" in (tmp_path / "altaz_altitude_simulators.txt").read_text()
