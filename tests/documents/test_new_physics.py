"""docs/adding_physics.md holds: its three files in a copy of the packages make a law and an effect, nothing else."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from commands import python
from fmpy import simulate_fmu
from wandering import swing

import cosim
import pyfmi_models
from cosim.diagnosis.effects import TRIED
from pyfmi_models.effects import CATALOGUE, FORMS

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "adding_physics.md").read_text("utf-8")
EXPORT = """
from pyfmi_models.card import read_card
from pyfmi_models.card_writer import card_text
from pyfmi_models.card import parse_card
from pyfmi_models.export import export_fmu
card = read_card("tube.toml")
assert parse_card(card_text(card), "tube.toml") == card
export_fmu(card.plant().model(), "tube.fmu")
"""
QUICKLY = ("--out", "found", "--quick", "--json")


def effects_in(paragraph: str) -> set[str]:
    """The effects that a paragraph of the guide names, by its first words."""
    (text,) = re.findall(rf"^{re.escape(paragraph)}.*?\n\n", GUIDE, re.MULTILINE | re.DOTALL)
    return {name for name in re.findall(r"`(\w+)`", text.partition(" says that ")[0]) if name in CATALOGUE}


def test_the_guide_says_which_effects_a_diagnosis_does_not_look_for_or_cannot_hold() -> None:
    assert effects_in("An effect without a hypothesis") == set(CATALOGUE) - set(TRIED) - {"learned"}
    assert effects_in("`is_determined = False`") == {form.id for form in FORMS if not form.is_determined}


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", GUIDE, re.MULTILINE | re.DOTALL)


OWN_FILES = [block for block in blocks("python") if block.startswith(("# pyfmi_models/", "# cosim/"))]
"""The blocks that are files of the packages."""


def run(folder: Path, *arguments: str, own: bool = True) -> str:
    """What Python prints in a folder, with the packages of the folder or those that are installed."""
    done = python(*arguments, folder=folder, **({"PYTHONPATH": str(folder)} if own else {}))
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the packages, the guide's files in it, and the guide's card."""
    folder = tmp_path_factory.mktemp("copy")
    for package in (pyfmi_models, cosim):
        source = Path(str(package.__file__)).parent
        shutil.copytree(source, folder / source.name)  # with what is compiled: each command would do it again
    for block in OWN_FILES:
        name = block.partition("\n")[0].removeprefix("# ")
        assert not (folder / name).exists()
        (folder / name).write_text(block, "utf-8")
    (folder / "tube.toml").write_text(blocks("toml")[0], "utf-8")
    return folder


def test_a_law_and_an_effect_of_one_file_each_are_exported_from_a_card(copy: Path) -> None:
    run(copy, "-c", EXPORT)
    inputs = np.array([(0, 9.0, 15.0), (30, 9.0, 15.0)], dtype=[("time", float), ("tau", float), ("wind", float)])
    found = simulate_fmu(str(copy / "tube.fmu"), stop_time=30.0, output_interval=0.1, input=inputs)
    q, v = found["q"], found["v"]
    # Newton, with the guide's equations: J v' = 9 - 2 - 12 sqrt(v) - 0.02 15^2 sin(q)
    needed = 2.0 + 12.0 * np.sqrt(np.maximum(v, 0)) + 4.5 * np.sin(q)
    moving = v > 0.01
    assert moving.sum() > 100
    assert np.abs(30.0 * np.gradient(v, found["time"])[moving] + needed[moving] - 9.0).max() < 0.15


def test_the_property_tests_meet_them_by_themselves(copy: Path) -> None:
    chosen = "HerschelBulkley or herschel_bulkley or WindLoad"
    files = [str(*(ROOT / "tests").glob(f"*/test_{one}_properties.py")) for one in ("effect", "friction")]
    out = run(copy, "-m", "pytest", "-p", "no:cacheprovider", "-k", chosen, *files)
    assert int(re.findall(r"(\d+) passed", out)[-1]) >= 10


def in_the_wind(seed: int, gusts: float) -> str:
    """20 s of the guide's tube under a gusty wind, by the guide's own equations, as the text of a CSV."""
    t = np.arange(4000) / 200
    q, v, acceleration = swing(t, [(0.5, 0.11, seed), (0.1, 0.37, 1.0 + seed), (0.03, 0.9, 2.0)])
    wind = 9.0 + 4.0 * np.sin(2 * np.pi * gusts * t)
    tau = 30.0 * acceleration + (2.0 + 12.0 * np.sqrt(np.abs(v))) * np.sign(v) + 0.02 * wind**2 * np.sin(q - 0.4)
    noisy = tau + 0.02 * np.random.default_rng(seed).standard_normal(len(t))
    rows = (f"{a:.4f},{b:.9g},{c:.12g},{d:.9g}" for a, b, c, d in zip(t, noisy, q, wind, strict=True))
    return "\n".join(["t [s],tau [N.m],q [rad],wind", *rows, ""])


def test_a_diagnosis_finds_the_effect_in_recordings(copy: Path) -> None:
    names = ["one.csv", "two.csv", "three.csv"]
    for seed, name in enumerate(names):
        (copy / name).write_text(in_the_wind(seed, 0.07 + 0.05 * seed), "utf-8")
    calm = blocks("toml")[0].partition("[[effects]]")[0]
    (copy / "calm.toml").write_text(calm, "utf-8")
    told = run(copy, "-m", "cosim", "diagnose", *names[:2], "--heldout", names[2], "--card", "calm.toml", *QUICKLY)
    found = json.loads(told)
    assert found["verdict"] == ["wind_load"]
    (wind,) = [one for one in found["effects"] if one["effect"] == "wind_load"]
    assert wind["parameters"]["coefficient"] == pytest.approx(0.02, rel=0.05)
    assert wind["parameters"]["direction"] == pytest.approx(0.4, abs=0.1)
    assert 'effect = "wind_load"' in (copy / "found" / "card.toml").read_text("utf-8")


def test_the_same_files_in_a_folder_of_their_own_pass_the_checks(tmp_path: Path) -> None:
    (mine := tmp_path / "mine").mkdir()
    for block in OWN_FILES:
        path = Path(block.partition("\n")[0].removeprefix("# "))
        name = f"{path.stem}_hypothesis.py" if "diagnosis" in path.parts else path.name
        (mine / name).write_text(block.replace("pyfmi_models.effects.wind_load", "wind_load"), "utf-8")
    (tmp_path / "tube.toml").write_text(blocks("toml")[0], "utf-8")
    assert "wind_load" in run(tmp_path, "-m", "cosim", "show", "tube.toml", "--plugins", "mine", own=False)
    (script,) = [block for block in blocks("python") if block.startswith("# check_mine.py")]
    table = run(tmp_path, "-c", script, own=False)
    assert table.count("passed") == 9, table
    assert table.count("not applicable") == 1, table
