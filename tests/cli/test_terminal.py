"""The command line meets a slip half way, says how far it is, takes other numbers, and finds a folder for results."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Refused, call, python

import cosim
from cosim.support.errors import InputError, UndecidedError
from cosim.support.near import near as near_of_runner
from cosim.support.terminal import stage
from pyfmi_models.near import near as near_of_physics

CARD = '[mount]\ninertia = 3.0\n[friction]\nmodel = "coulomb"\nFc = 1.0\n'


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
def test_a_name_or_a_verb_that_was_nearly_hit_is_suggested(refused: Refused, words: str, meant: str) -> None:
    assert f"Did you mean {meant}?" in " ".join(refused(*words.split()).split())
    assert "a:smile:b" in refused("show", "a:smile:b"), "what looks like an emoji is said as it was given"


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
def test_a_misspelt_key_is_named_before_one_that_is_then_missing(refused: Refused, text: str, sentence: str) -> None:
    Path("axis.toml").write_text(text)
    assert sentence in " ".join(refused("show", "axis.toml").split())


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
    ask = {"_COSIM_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
    assert offered in python("-m", "cosim", **ask).stdout.split()


def test_a_stage_that_is_logged_leaves_a_line_off_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with stage("identifying") as progress:
        progress.tell("nothing of this")
        progress.log("friction map")
    assert capsys.readouterr().err.splitlines() == ["identifying", "friction map"]


def test_numbers_are_changed_for_one_run_and_the_recording_says_so(scenario: Path) -> None:
    text = scenario.read_text().replace("k = 5.0", "k = 7.0").replace("frequency = 2.0", "frequency = 3.0")
    Path("other.toml").write_text(text)
    asked = cosim.run(scenario, set={"controller.k": 7.0, "r.frequency": 3.0}).recording
    for name, values in cosim.run("other.toml").recording.table.items():
        assert np.array_equal(values, asked[name]), name


def test_the_command_takes_several_numbers_and_a_stop(scenario: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("run", scenario, "--set", "controller.k=7", "n.seed=9", "--stop", "0.25", "--out", "out", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["steps"] == 250
    assert json.loads(Path("out/run.json").read_text()) == told


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("--set controller.kk=7", '"controller.kk" is nothing that can be set; of controller can be set: '),
        ("--set rest.k=7", "there are: plant, controller, r, n."),
        ("--set controller.k", '--set "controller.k": write component.parameter=value.'),
        ("--set controller.k=soft", "--set controller.k=soft: it must be a number, true or false."),
        ("--set controller.k=1 --set controller.k=2", "--set controller.k is given twice"),
        ("--stop 0.2505", "stop = 0.2505 is not a whole number of steps of 0.001 s."),
        ("--stop -1", "stop = -1 must be above 0 s."),
    ],
)
def test_what_cannot_be_set_is_one_sentence(scenario: Path, refused: Refused, arguments: str, sentence: str) -> None:
    assert sentence in refused("run", scenario, *arguments.split(), "--out", "out")
    assert not Path("out").exists()


def test_results_without_a_folder_get_one_of_their_own_which_is_said(scenario: Path, capsys: Any) -> None:
    for number in (1, 2):
        assert call("run", scenario, "--no-page") == 0
        said = capsys.readouterr()
        assert f"results go to cosim_out/loop-{number}\n" in said.err
        assert said.out == f"cosim_out/loop-{number}/recording.parquet\n"


@pytest.mark.parametrize(
    "arguments",
    [
        "run loop.toml --set controller.kk=7",
        "run bad.toml",
        "identify run.csv --system bad.toml --free plant.k",
        "identify run.csv --system loop.toml --free plant.wibble",
        "diagnose run.csv run.csv --card bad.toml",
        "export bad.toml",
        "sweep bad.toml",
        "compare run.csv run.csv",
        "card run.csv",
        "card short.csv",
    ],
)
@pytest.mark.usefixtures("scenario")
def test_where_results_go_is_not_said_of_what_is_refused(arguments: str, refused: Refused) -> None:
    Path("bad.toml").write_text("[mount]\n")
    Path("run.csv").write_text("t,q\n0,1\n")
    Path("short.csv").write_text("t,q,tau\n" + "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(20)))
    assert "results go to" not in refused(*arguments.split())


def test_the_answer_begins_with_how_well_the_axis_followed(scenario: Path) -> None:
    done = cosim.run(scenario, "out", page=False)
    (axis,) = done.statistics["tracking"]
    error = done.recording["q_d"] - done.recording["q"]
    assert axis["rms"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    assert axis["largest"] == np.abs(error).max()
    assert str(done).startswith(f"loop: RMS tracking error {axis['statement'].split()[3]} ")


def test_a_sweep_is_called_from_python_and_tells_its_best_run(scenario: Path) -> None:
    cosim.run(scenario)  # it loads what sweeps are made of, and `cosim.sweep` is a function still
    Path("many.toml").write_text(
        'scenario = "loop.toml"\n[vary]\n"controller.k" = [1.0, 5.0, 3.0]\n'
        '[statistics]\nerror = { signal = "r.position", minus = "plant.y", kind = "rms" }\n'
    )
    found = cosim.sweep("many.toml", "many", workers=1)
    table = found.frame()
    best = table.loc[table["error"].idxmin()]  # type: ignore[attr-defined]
    assert found.best == {"run": best["run"], "controller.k": best["controller.k"], "error": best["error"]}
    assert str(found).startswith(f"best by error: run {best['run']} with ")
    assert len(found.plot().axes) == 1
    assert repr(found).startswith("SweepResult(3 runs, table=")
