"""The command line meets a slip half way: it completes names, suggests what was meant, and says how far it is."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from commands import call

from cosim.support.errors import InputError, UndecidedError
from cosim.support.near import near as near_of_runner
from cosim.support.terminal import stage
from pyfmi_models.near import near as near_of_physics

CARD = '[mount]\ninertia = 3.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\n'


def said(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    assert call(*words) == 2
    return " ".join(capsys.readouterr().err.split())


def test_what_looks_like_an_emoji_is_said_as_it_was_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert "a:smile:b" in said(capsys, "show", "a:smile:b")


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ("run siderial --out x", '"sidereal"'),
        ("show two_axes", '"two_axis"'),
        ("export paper_mont --out x", '"paper_mount"'),
        ("identify run.csv --card emsp --out x", '"emps"'),
        ("diagnos", "'diagnose'"),
        ("hardware chek", "'check'"),
    ],
)
def test_a_name_or_a_verb_that_was_nearly_hit_is_suggested(
    capsys: pytest.CaptureFixture[str], words: str, meant: str
) -> None:
    assert f"Did you mean {meant}?" in said(capsys, *words.split())


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("stpe = 0.001\nstop = 1.0\n", '"stpe" is no key of a scenario'),
        ("stpe = 0.001\nstop = 1.0\n", 'Did you mean "step"?'),
        (CARD.replace("inertia", "inertai"), "[mount] inertai is not a key of a card; keys are: name, motion,"),
        (CARD.replace("inertia", "inertai"), 'torque_limit, machine. Did you mean "inertia"?'),
        (CARD + "[encoder]\ncounts = 3\n", 'Did you mean "counts_per_rev"?'),
        (CARD + "[fricton]\n", 'Did you mean "friction"?'),
        (CARD.replace("coulomb", "coulom"), 'Did you mean "coulomb"?'),
        (CARD + "sigam2 = 1.0\n", 'Did you mean "sigma2"?'),
        (CARD + '[[effects]]\neffect = "coging"\n', 'Did you mean "cogging"?'),
    ],
)  # fmt: skip
def test_a_misspelt_key_is_named_before_the_one_that_is_then_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, sentence: str
) -> None:
    path = tmp_path / "axis.toml"
    path.write_text(text)
    assert sentence in said(capsys, "show", path)


def test_a_suggestion_is_made_once_and_only_where_something_is_alike() -> None:
    assert str(InputError("no furlong.", value="furlong", choices=("deg", "rad"))) == "no furlong."
    assert str(InputError("no wires.", value="wires", choices=("wire",))) == 'no wires. Did you mean "wire"?'
    assert str(InputError("x.", culprit="mount.angel", choices=("angle",))) == 'x. Did you mean "angle"?'
    assert str(InputError('x. Did you mean "b"?', value="a1", choices=("a2",))) == 'x. Did you mean "b"?'
    assert str(UndecidedError("which?", decided_by={}, value="torque", choices=("torque1", "torque2"))) == "which?"
    assert str(InputError("long.", value="x" * 10**6, choices=tuple(f"c{k}" for k in range(2000)))) == "long."


def test_the_runner_and_the_physics_suggest_alike() -> None:
    for name, choices in {"Inertai": ("inertia", "name"), "q": ("tau",), "SIDEREAL": ("sidereal",)}.items():
        assert near_of_runner(name, choices) == near_of_physics(name, choices)


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("cosim dia", "diagnose"),
        ("cosim run --fo", "--force"),
        ("cosim run sid", "sidereal"),
        ("cosim export paper_mount_", "paper_mount_directional"),
    ],
)
def test_a_shell_completes_verbs_options_and_shipped_names(line: str, offered: str) -> None:
    words = line.split()
    ask = {"_COSIM_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    command = [sys.executable, "-m", "cosim"]
    done = subprocess.run(command, env=os.environ | ask, capture_output=True, text=True, check=False)
    assert offered in done.stdout.split()


def test_a_stage_that_is_logged_leaves_a_line_off_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with stage("identifying") as progress:
        progress.tell("nothing of this")
        progress.log("friction map")
    assert capsys.readouterr().err.splitlines() == ["identifying", "friction map"]
