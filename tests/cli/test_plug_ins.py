"""Another distribution brings verbs by entry points: they are run, helped and refused like those of this one."""

import os
import subprocess
import sys
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
'''
POINTS = """[cosim.verbs]
hello = hello_of_mine
hardware.wave = hello_of_mine
broken = no_such_module
run = hello_of_mine
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
    path = os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "cosim", *words]
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


def test_a_verb_of_the_trunk_asks_for_no_plug_in(site: Path) -> None:
    code = "import sys; from cosim.cli import main\ntry: main(['card', '--help'])\nfinally: print({})"
    asked = f"[one for one in sys.modules if one.startswith({(*PLUG_INS, 'hello')!r})]"
    done = subprocess.run(
        [sys.executable, "-c", code.format(asked)], cwd=site, capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines()[-1] == "[]"
