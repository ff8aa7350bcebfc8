"""The plant as plain C: the bits of the FMU, no warnings of a strict compiler, several joints in one program."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from nested_runs import InFmpy

from cosim.api.export import export
from pyfmi_models.card import read_card
from pyfmi_models.errors import ExportError
from pyfmi_models.export.c_function import c_files, export_c

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


def test_a_controller_is_no_joint() -> None:
    with pytest.raises(ExportError, match="sampled"):
        c_files(read_card("paper_mount").controller_model())


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
