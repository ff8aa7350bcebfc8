"""Progress in a notebook: one line that is written over and gone at the end; nothing elsewhere."""

import sys
from inspect import Parameter, signature
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import cosim
from cosim.support.notebook import shows_progress
from cosim_serve import example


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


def test_who_is_told_himself_sees_no_line(line: list[str]) -> None:
    told: list[str] = []
    work(on_progress=told.append)
    assert (told, line) == (["first", "at once after it"], [])


def test_outside_a_notebook_nothing_is_shown(line: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["IPython"], "get_ipython", lambda: None)
    work()
    monkeypatch.delitem(sys.modules, "IPython")
    assert work() == "done"
    assert line == []


def test_a_diagnosis_in_a_notebook_shows_its_stages(line: list[str], tmp_path: Any) -> None:
    text = example.recordings()[example.NAMES[0]]
    (tmp_path / "run.csv").write_text(text[: len(text) // 2].rpartition("\n")[0], "utf-8")
    (tmp_path / "axis.toml").write_text(example.CARD, "utf-8")
    cosim.diagnose(tmp_path / "run.csv", card=tmp_path / "axis.toml")
    assert line[0].startswith("stage 1 of 3: ")
    assert any(one.startswith("stage 2 of 3: ") for one in line)
    assert line[-1] == ""


@pytest.mark.parametrize("verb", ["diagnose", "investigate", "sweep"])
def test_the_signature_stays_what_it_is(verb: str) -> None:
    assert signature(getattr(cosim, verb)).parameters["on_progress"].kind is Parameter.KEYWORD_ONLY
