"""Another distribution brings verbs by entry points: they are run, helped and refused like those of this one."""

import os
import subprocess
import sys
from math import pi
from pathlib import Path

import pytest
from imports import PLUG_INS

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


def cosim(site: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return python(site, "-m", "cosim", *words)


def python(site: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, *words]
    return subprocess.run(
        command, env=os.environ | {"PYTHONPATH": path}, cwd=site, capture_output=True, text=True, check=False
    )


def test_a_verb_of_another_distribution_is_run_and_its_mistakes_are_sentences(site: Path) -> None:
    assert cosim(site, "hello", "you", "--loud").stdout == "hello you!\n"
    refused = cosim(site, "hello", "nobody")
    assert (refused.returncode, refused.stderr) == (2, "cosim: nobody: it must be somebody.\n")
    assert cosim(site, "hardware", "wave").stdout == "waved\n"
    assert "cosim hello --loud you" in cosim(site, "hello", "--help").stdout


def test_defaults_of_a_folder_are_taken_by_it_too(site: Path) -> None:
    (site / "cosim.toml").write_text("[hello]\nloud = true\n", "utf-8")
    assert cosim(site, "hello", "you").stdout == "hello you!\n"
    (site / "cosim.toml").write_text("[helo]\nloud = true\n", "utf-8")
    assert '"helo" is no key' in cosim(site, "hello", "you").stderr


def test_what_cannot_be_loaded_is_one_sentence_and_hides_nothing_else(site: Path) -> None:
    called = cosim(site, "broken")
    assert called.returncode == 2
    assert called.stderr.startswith('cosim: The plug-in "broken" of hello-of-mine cannot be loaded: ModuleNotFound')
    assert called.stderr.count("\n") == 1
    helped = cosim(site, "--help")
    assert "hello" in helped.stdout
    assert "cannot be loaded" in helped.stderr
    assert "Co-simulation" in helped.stdout


def test_no_plug_in_takes_the_name_of_a_verb_that_there_is(site: Path) -> None:
    assert "Run a scenario" in cosim(site, "run", "--help").stdout


def test_python_finds_what_it_brings_under_its_name_and_ours_under_ours(site: Path) -> None:
    code = "import cosim; cosim.greet('you'); print('greet' in dir(cosim), cosim.run.__module__)"
    assert python(site, "-c", code).stdout == "hello you\nTrue cosim.api.run\n"


def test_a_file_of_its_own_kind_is_read_and_one_that_crashes_its_reader_is_a_sentence(site: Path) -> None:
    rows = "\n".join(f"{k / 100} {k % 7} {k % 90}" for k in range(400))
    for name in ("one.ours", "one.csv"):
        (site / name).write_text(rows, "utf-8")
    (site / "two.ours").write_text("crash", "utf-8")
    (site / "two.csv").write_text(f"log of ours\n{rows}", "utf-8")
    code = "import cosim, sys; one = cosim.read(sys.argv[1]); print(len(one['t']), round(one['q'].max(), 9))"
    for name in ("one.ours", "two.csv"):
        done = python(site, "-c", code, name)
        assert done.stdout == f"400 {round(89 * pi / 180, 9)}\n", done.stderr
    assert "--columns t=#1" in python(site, "-c", code, "one.csv").stderr  # .csv stays ours, which asks for names
    crashed = python(site, "-c", code, "two.ours").stderr.splitlines()[-1]
    assert "two.ours is damaged: the library that reads .ours files crashed on it" in crashed


def test_a_verb_of_the_trunk_asks_for_no_plug_in(site: Path) -> None:
    code = "import sys; from cosim.cli import main\ntry: main(['card', '--help'])\nfinally: print({})"
    asked = f"[one for one in sys.modules if one.startswith({(*PLUG_INS, 'hello')!r})]"
    done = subprocess.run(
        [sys.executable, "-c", code.format(asked)], cwd=site, capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines()[-1] == "[]"
