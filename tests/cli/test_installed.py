"""What is installed: versions, extras, verbs and readers of other distributions; and none of it is loaded unasked."""

import json
import os
from importlib import metadata
from importlib.resources import files
from math import pi
from pathlib import Path
from typing import Any

import pytest
from commands import ENVIRONMENT, call, python
from imports import PLUG_INS

from cosim.api import doctor as looked
from cosim.support.version import __version__

HELLO = '''"""A verb of somebody else."""
from cosim.support.errors import InputError
GROUP, EXAMPLES = "Machine", ("cosim hello you", "cosim hello --loud you")
def hello(name: str, loud: bool = False) -> None:
    """Greet."""
    if name == "nobody":
        raise InputError("nobody: it must be somebody.")
    print(f"hello {name}" + "!" * loud)
def wave() -> None:
    """Wave."""
    print("waved")
def recognises(lines):
    return lines[0].startswith("log of ours")
def read(path, whole=b"", lines=()):
    """Read a log of our own: a row a line."""
    import os
    import numpy as np
    from cosim.data.columns import Columns
    if path.read_bytes().startswith(b"crash"):
        os.abort()
    t, tau, q = np.loadtxt(path, skiprows=int(len(whole) > 0)).T
    return Columns({"t": t, "tau": tau, "q": q}, units={"q": "deg"})
'''
POINTS = """[cosim.verbs]
hello = hello_of_mine
hardware.wave = hello_of_mine
broken = no_such_module
run = hello_of_mine
[cosim.handles]
greet = hello_of_mine:hello
run = hello_of_mine:hello
[cosim.importers]
ours = hello_of_mine
[cosim.readers]
ours = hello_of_mine:read
csv = hello_of_mine:read
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A folder as an installer leaves it: a module, and a distribution that names it."""
    (tmp_path / "hello_of_mine.py").write_text(HELLO, "utf-8")
    (about := tmp_path / "hello_of_mine-1.0.dist-info").mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: hello-of-mine\nVersion: 1.0\n", "utf-8")
    (about / "entry_points.txt").write_text(POINTS, "utf-8")
    return tmp_path


def mine(site: Path, *words: str) -> tuple[int, str, str]:
    """What Python does where the distribution is: its exit code and what it says on both."""
    done = python(*words, folder=site, PYTHONPATH=os.pathsep.join([str(site), ENVIRONMENT["PYTHONPATH"]]))
    return done.returncode, done.stdout, done.stderr


def cosim(site: Path, *words: str) -> tuple[int, str, str]:
    return mine(site, "-m", "cosim", *words)


def test_a_verb_of_another_distribution_is_run_and_its_mistakes_are_sentences(site: Path) -> None:
    assert cosim(site, "hello", "you", "--loud") == (0, "hello you!\n", "")
    assert cosim(site, "hello", "nobody") == (2, "", "cosim: nobody: it must be somebody.\n")
    assert cosim(site, "hardware", "wave") == (0, "waved\n", "")
    assert "cosim hello --loud you" in cosim(site, "hello", "--help")[1]
    assert "Run a scenario" in cosim(site, "run", "--help")[1], "no plug-in takes the name of a verb that there is"
    (site / "cosim.toml").write_text("[hello]\nloud = true\n", "utf-8")
    assert cosim(site, "hello", "you")[1] == "hello you!\n"
    (site / "cosim.toml").write_text("[helo]\nloud = true\n", "utf-8")
    assert '"helo" is no key' in cosim(site, "hello", "you")[2]
    code = "import cosim; cosim.greet('you'); print('greet' in dir(cosim), cosim.run.__module__)"
    assert mine(site, "-c", code)[1] == "hello you\nTrue cosim.api.run\n", "and Python finds each under its own name"


def test_what_cannot_be_loaded_is_one_sentence_and_hides_nothing_else(site: Path) -> None:
    code, _, said = cosim(site, "broken")
    assert (code, said.count("\n")) == (2, 1)
    assert said.startswith('cosim: The plug-in "broken" of hello-of-mine cannot be loaded: ModuleNotFound')
    _, helped, said = cosim(site, "--help")
    assert "hello" in helped
    assert "Co-simulation" in helped
    assert "cannot be loaded" in said


def test_a_file_of_its_own_kind_is_read_and_one_that_crashes_its_reader_is_a_sentence(site: Path) -> None:
    rows = "\n".join(f"{k / 100} {k % 7} {k % 90}" for k in range(400))
    for name in ("one.ours", "one.csv"):
        (site / name).write_text(rows, "utf-8")
    (site / "two.ours").write_text("crash", "utf-8")
    (site / "two.csv").write_text(f"log of ours\n{rows}", "utf-8")
    code = "import cosim, sys; one = cosim.read(sys.argv[1]); print(len(one['t']), round(one['q'].max(), 9))"
    for name in ("one.ours", "two.csv"):
        assert mine(site, "-c", code, name) == (0, f"400 {round(89 * pi / 180, 9)}\n", "")
    assert "--columns t=#1" in mine(site, "-c", code, "one.csv")[2]  # .csv stays ours, which asks for names
    crashed = mine(site, "-c", code, "two.ours")[2].splitlines()[-1]
    assert "two.ours is damaged: the library that reads .ours files crashed on it" in crashed


def test_versions_abilities_extras_and_caches_are_listed(tmp_path: Path, monkeypatch: Any, capsys: Any) -> None:
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(tmp_path))
    (tmp_path / "fmus").mkdir()
    (tmp_path / "fmus" / "one.fmu").write_bytes(bytes(1500))
    assert call("doctor", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["versions"]["mount-cosim"] == __version__
    assert found["versions"]["numpy"] == metadata.version("numpy")
    assert set(found["works"]) == {"run", "diagnose", "hardware", "export"}
    assert found["works"]["run"] == "yes, compiled loop"
    assert found["caches"] == {"fmus": 1500}
    assert call("doctor") == 0
    said = capsys.readouterr().out
    assert f"Caches in {tmp_path}" in said
    assert "fmus" in said


def test_what_is_missing_comes_with_the_command_that_installs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    there = looked._version_of
    gone = {"asammdf", "ziglang", "casadi"}
    monkeypatch.setattr(looked, "_version_of", lambda name: "" if name in gone else there(name))
    found = looked.doctor()
    assert found.extras["mdf"] == "MDF4 recordings: not installed (pip install asammdf)"
    assert found.works["export"] == "no compiler: pip install ziglang"
    assert found.versions["casadi"] == "missing: reinstall the package"


# What is asked most often loads little: help without numpy, a card without what reads recordings.

CODE = """
import sys
try:
    {does}
finally:
    print(*(one for one in sys.modules if one.startswith({heavy})), file=sys.stderr)
"""
MAIN = "from cosim.cli import main; main()"
CARD = str(files("pyfmi_models") / "cards" / "paper_mount.toml")
NUMBERS, RUN = ("numpy", "casadi", "pyarrow", "pandas", "scipy"), ("run", "sidereal", "--stop", "0.05", "--out", "out")
READS_FITS_OR_DRAWS = ("cosim.data.formats", "pyarrow.compute", "pandas", "scipy", "casadi", "ziglang", "matplotlib")


@pytest.mark.parametrize(
    ("does", "words", "heavy"),
    [
        pytest.param("import cosim", (), (*NUMBERS, "pydantic", "typer"), id="import"),
        pytest.param(MAIN, ("--help",), (*NUMBERS, "pydantic"), id="help"),
        pytest.param(MAIN, ("diagnose", "--help"), NUMBERS, id="help of a verb"),
        pytest.param(MAIN, ("card", "--help"), PLUG_INS, id="a verb of the trunk"),
        pytest.param(MAIN, ("serve", "--help"), ("starlette", "uvicorn", "jinja2"), id="serve"),
        pytest.param(
            MAIN,
            ("show", CARD),
            ("pyarrow", "pandas", "scipy", "matplotlib", "cosim.data.recording", "cosim.system.scenario"),
            id="a card",
        ),
        pytest.param(MAIN, RUN, READS_FITS_OR_DRAWS, id="a run with its page"),
        pytest.param("import cosim.report, cosim.report.terminal", (), ("matplotlib",), id="report"),
    ],
)
def test_nothing_heavy_is_loaded(tmp_path: Path, does: str, words: tuple[str, ...], heavy: tuple[str, ...]) -> None:
    done = python("-c", CODE.format(does=does, heavy=heavy), *words, folder=tmp_path)
    assert done.stderr.splitlines()[-1] == "", done.stderr
    assert (tmp_path / "out" / "run.html").is_file() == (words == RUN)
