"""Progress in a notebook: one line that is written over and gone at the end; nothing elsewhere."""

import sys
from inspect import Parameter, signature
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from report_example import diagnosis

import cosim
from cosim.api.diagnose import DiagnosisResult
from cosim.api.tables import missing_frame
from cosim.cli.verbs import module_of
from cosim.data.recording import Recording
from cosim.support.notebook import shows_progress
from cosim_serve import example
from pyfmi_models.card import read_card


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the line of a notebook has shown."""
    said: list[str] = []
    shell = SimpleNamespace(config={"IPKernelApp": {}})
    package, displays = ModuleType("IPython"), ModuleType("IPython.display")
    package.get_ipython = lambda: shell  # type: ignore[attr-defined]

    def display(content: dict[str, str], **_: Any) -> Any:
        return SimpleNamespace(update=lambda content, raw: said.append(content["text/plain"]))

    displays.display = display  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", package)
    monkeypatch.setitem(sys.modules, "IPython.display", displays)
    return said


@shows_progress()
def work(*, fails: bool = False, on_progress: Any = lambda text: None) -> str:
    """Work."""
    on_progress("first")
    on_progress("at once after it")
    if fails:
        raise KeyError
    return "done"


def test_a_line_is_shown_and_gone_at_the_end(line: list[str]) -> None:
    assert work() == "done"
    assert line == ["first", ""]  # what comes at once after it is not drawn
    with pytest.raises(KeyError):
        work(fails=True)
    assert line[-1] == ""


def test_who_is_told_himself_sees_no_line_and_outside_a_notebook_none_is_shown(
    line: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    work(on_progress=told.append)
    monkeypatch.setattr(sys.modules["IPython"], "get_ipython", lambda: None)
    work()
    monkeypatch.delitem(sys.modules, "IPython")
    assert work() == "done"
    assert (told, line) == (["first", "at once after it"], [])


def test_a_diagnosis_in_a_notebook_shows_its_stages(line: list[str], tmp_path: Any) -> None:
    text = example.recordings()[example.NAMES[0]]
    (tmp_path / "run.csv").write_text(text[: len(text) // 2].rpartition("\n")[0], "utf-8")
    (tmp_path / "axis.toml").write_text(example.CARD, "utf-8")
    cosim.diagnose(tmp_path / "run.csv", card=tmp_path / "axis.toml")
    assert line[0].startswith("stage 1 of 3: ")
    assert any(one.startswith("stage 2 of 3: ") for one in line)
    assert line[-1] == ""


# Results in a notebook: one line each, tables, figures; and Python calls that offer what the command line does.

CARD = """
[mount]
name = "axis"
inertia = 3.0
[friction]
model = "coulomb"
Fc = 2.0
sigma2 = 1.0
"""


@pytest.fixture
def recording() -> Recording:
    t = np.arange(3000) * 0.005
    q = 0.4 * np.sin(2 * t) + 0.1 * np.sin(5 * t)
    v, a = 0.8 * np.cos(2 * t) + 0.5 * np.cos(5 * t), -1.6 * np.sin(2 * t) - 2.5 * np.sin(5 * t)
    tau = 3.0 * a + 2.4 * np.sign(v) + 1.2 * v
    return Recording.of({"t": t, "tau": tau, "q": q, "q_d": q + 1e-3, "heat": t}, "swing")


def is_one_line(thing: object) -> bool:
    return "\n" not in repr(thing) and len(repr(thing)) < 200


def test_a_recording_is_one_line_and_a_figure_with_its_set_point_beside_the_position(recording: Recording) -> None:
    assert is_one_line(recording)
    before = matplotlib.rcParams["font.size"]
    drawn = recording.plot()
    assert isinstance(drawn, Figure)
    assert [axes.get_title(loc="left") for axes in drawn.axes] == ["tau", "q", "heat"]
    assert [len(axes.lines) for axes in drawn.axes] == [1, 2, 1]
    assert drawn.axes[-1].get_xlabel() == "time [s]"
    assert all(axes.get_ylabel() for axes in drawn.axes)
    assert [axes.get_title(loc="left") for axes in recording.plot("heat").axes] == ["heat"]
    assert matplotlib.rcParams["font.size"] == before  # a reader's own settings stay
    with pytest.raises(cosim.CosimError, match='no column "qq"; columns are: t, tau, q'):
        recording.plot("qq")


def test_a_diagnosis_is_one_line_tables_and_a_figure(tmp_path: Path) -> None:
    (tmp_path / "card.toml").write_text(CARD, "utf-8")
    card = read_card(tmp_path / "card.toml")
    answer = DiagnosisResult(diagnosis("two"), card, card)
    assert is_one_line(answer)
    found = answer.frame()
    assert found.iloc[0]["effect"] == "cogging"
    assert len(found) == len(answer.findings)
    missing = answer.missing_torque
    assert list(missing) == ["recording", "heldout", "t", "q", "v", "missing", "band", "after"]
    held = missing[missing["heldout"]]
    assert 0 < np.std(held["after"]) < np.std(held["missing"])
    drawn = answer.plot()
    assert [axes.get_xlabel() for axes in drawn.axes] == ["validation RMS error [N·m]", "time [s]"]
    bars, held_out = [bar.get_width() for bar in drawn.axes[0].patches], answer.diagnosis.heldout
    assert bars == pytest.approx([held_out.after_rms, held_out.before_rms, held_out.nominal_rms])
    drawn.savefig(tmp_path / "answer.png")
    assert missing_frame(()).empty


def test_an_identification_and_a_run_are_one_line_a_table_and_a_figure(recording: Recording, tmp_path: Path) -> None:
    (tmp_path / "card.toml").write_text(CARD, "utf-8")
    found = cosim.identify(recording, tmp_path / "card.toml")
    table = found.frame().set_index("parameter")
    assert table.loc["friction.Fc", "value"] == pytest.approx(2.4, rel=0.1)
    assert table.loc["friction.Fc", "given"] == 2.0
    assert {axes.get_ylabel() for axes in found.plot().axes} == {"friction [N m]"}
    done = cosim.run("sidereal", stop=0.05)
    assert "time [s]" in {axes.get_xlabel() for axes in done.plot().axes}
    assert is_one_line(found)
    assert is_one_line(done)


SAME = {
    "run": {"sets": "set", "interpreted": "compiled"},
    "compare": {"recordings": "recordings"},
    "investigate": {"drive": "machine", "key": "machine", "move": "machine"},
    "show": {"file": "source", "out": "picture"},
}
"""Options of the command line that have another word in Python."""
FOLDER = dict.fromkeys(("workers", "cluster"), "cosim.diagnose_folder")
METHODS = {"as_json": "as_json", "check": "missing", "propose": "propose", **FOLDER}
"""Options that are a method or a property of the result, or an argument of the call for several machines."""
PYTHON_ONLY = {"on_progress", "on_build", "on_answer", "on_step", "command", "fast"}
"""Arguments that make no sense on a command line: who is told, and what files name as their maker."""
VERBS = ("run", "diagnose", "export", "show", "sweep", "investigate", "card", "compare")


@pytest.mark.parametrize("verb", VERBS)
def test_command_line_and_python_offer_the_same(verb: str) -> None:
    command: Any = getattr(module_of(verb), verb)
    options = {SAME.get(verb, {}).get(name, name) for name in signature(command).parameters}
    arguments = signature(getattr(cosim, verb)).parameters
    assert options - (set(METHODS) - set(arguments)) <= set(arguments), "on the command line only"
    assert set(arguments) - PYTHON_ONLY <= options, "in Python only"
    told = arguments.get("on_progress")
    assert told is None or told.kind is Parameter.KEYWORD_ONLY
