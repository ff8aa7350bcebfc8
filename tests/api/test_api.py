"""What `import cosim` offers: names, weight, the same answer from every kind of source, and a line in a notebook."""

import inspect
import sys
from collections.abc import Callable
from importlib.resources import files
from inspect import Parameter, signature
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import pytest
from commands import python
from matplotlib.figure import Figure
from report_example import diagnosis

import cosim
from cosim.api.diagnose import DiagnosisResult, check_split, missing_frame
from cosim.cli.verbs import module_of
from cosim.data.recording import Recording
from cosim.support.notebook import shows_progress
from cosim.support.plugins import HANDLES, names

FUNCTIONS = ("diagnose", "export", "identify", "read", "run", "show")
CARD = '[mount]\nname = "axis"\ninertia = 3.0\n[friction]\nmodel = "coulomb"\nFc = 2.0\nsigma2 = 1.0\n'
SCENARIO = (files("cosim") / "scenarios" / "sidereal.toml").read_text("utf-8").replace("stop = 15.0", "stop = 0.2")


@pytest.fixture
def card(tmp_path: Path) -> Path:
    path = tmp_path / "axis.toml"
    path.write_text(CARD, "utf-8")
    return path


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


def test_who_is_told_himself_sees_no_line_nor_who_has_no_notebook(line: list[str], monkeypatch: Any) -> None:
    told: list[str] = []
    work(on_progress=told.append)
    monkeypatch.setattr(sys.modules["IPython"], "get_ipython", lambda: None)
    work()
    monkeypatch.delitem(sys.modules, "IPython")
    assert work() == "done"
    assert (told, line) == (["first", "at once after it"], [])


def table(rows: int = 400) -> dict[str, np.ndarray]:
    t = np.arange(rows) * 0.01
    return {"t": t, "tau": np.sin(t), "q": 0.1 * np.cos(t)}


def test_all_names_exist_and_every_function_and_class_says_what_it_is() -> None:
    assert sorted(cosim.__all__) == cosim.__all__
    assert dir(cosim) == sorted({*cosim.__all__, *names(HANDLES)})  # some are plugged in
    assert {"investigate", "check_effect", "check_law"} <= set(dir(cosim))
    for name in dir(cosim):
        assert hasattr(cosim, name), name
        assert inspect.getdoc(getattr(cosim, name)), name


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_describes_each_argument_what_it_returns_and_what_it_raises(name: str) -> None:
    function = getattr(cosim, name)
    heads = [line.partition(":")[0] for line in (inspect.getdoc(function) or "").splitlines() if ":" in line]
    described = {word.strip() for head in heads for word in head.split(",")}
    assert set(inspect.signature(function).parameters) <= described
    assert {"Returns", "Raises"} <= described


def test_importing_cosim_takes_no_time() -> None:
    code = "import time; before = time.process_time(); import cosim; print(time.process_time() - before)"
    assert min(float(python("-c", code).stdout) for _ in range(3)) <= 0.05  # others may use this machine too


def test_a_name_that_is_not_offered_is_refused_with_those_that_are() -> None:
    with pytest.raises(AttributeError, match="no attribute 'diagnos'; it offers: CalibrateResult, Card"):
        cosim.diagnos  # noqa: B018


def test_a_file_a_data_frame_and_arrays_are_the_same_recording(tmp_path: Path) -> None:
    frame = pd.DataFrame(table())
    frame.to_csv(tmp_path / "run.csv", index=False)
    found = [cosim.read(one) for one in (tmp_path / "run.csv", frame, table(), frame.set_index("t"))]
    for other in found[1:]:
        assert other.columns == found[0].columns
        assert all(np.array_equal(other[name], found[0][name]) for name in other)
    assert cosim.read(found[0]) is found[0]


def test_columns_and_units_of_a_table_are_mapped_as_those_of_a_file() -> None:
    given = {"time": table()["t"], "force": table()["tau"], "enc": np.rad2deg(table()["q"])}
    read = cosim.read(given, columns={"t": "time", "tau": "force", "q": "enc"}, units={"q": "deg"})
    assert np.allclose(read["q"], table()["q"])
    assert read.units["q"] == "rad"


BAD = {
    r'recording: column "q" has the shape \(3,\), as "t" has \(400,\)': {"q": np.arange(3.0)},
    r'recording: column "tau" holds nan at row 2': {"tau": np.r_[0.0, np.nan, np.arange(398.0)]},
    r'recording: column "q" holds "2024-01-01': {"q": np.full(400, np.datetime64("2024-01-01T00:00:00"))},
    r'recording: column "q" holds "\(1\+2j\)" at row 1': {"q": np.full(400, 1 + 2j)},
    r"recording: time stands still at row 2": {"t": np.r_[0.0, np.arange(399.0)]},
}


@pytest.mark.parametrize("sentence", BAD)
def test_a_bad_table_is_refused_in_the_words_of_a_bad_file(sentence: str) -> None:
    with pytest.raises(cosim.CosimError, match=sentence):
        cosim.read(table() | BAD[sentence])


def test_the_same_table_may_not_be_fitted_and_held_out_but_others_may() -> None:
    one, other = cosim.read(table()), cosim.read(table(500))
    check_split([one], [other])
    check_split([Recording("a", table())], [Recording("b", table())])
    with pytest.raises(cosim.InputError, match="held out and among the training recordings"):
        check_split([one], [cosim.read(table())])


def test_a_run_gives_its_recording_and_tells_itself(tmp_path: Path) -> None:
    path = tmp_path / "short.toml"
    path.write_text(SCENARIO, "utf-8")
    kept, written = cosim.run(path), cosim.run(path, tmp_path / "out", page=False)
    assert list(kept.frame()) == list(kept.recording.columns)
    assert all(np.array_equal(kept.recording[name], written.recording[name]) for name in kept.recording)
    assert sorted(one.name for one in (tmp_path / "out").iterdir()) == ["recording.parquet", "run.json"]
    assert str(kept).startswith(f"{kept.name}: 2,000 steps")
    assert "2,000 steps" in kept._repr_html_()
    with pytest.raises(cosim.CosimError, match="exists"):
        cosim.run(path, tmp_path / "out", page=False)


def test_a_card_is_exported_from_a_file_or_as_it_is(card: Path, tmp_path: Path) -> None:
    one = cosim.export(card, tmp_path / "a", fmi=3)
    other = cosim.export(cosim.read_card(card), tmp_path / "b", fmi=3)
    assert [one.fmus[0].name] == [other.fmus[0].name] == ["axis_plant_fmi3.fmu"]
    assert one.fmus[0].read_bytes() == other.fmus[0].read_bytes()
    assert "axis_plant_fmi3.fmu" in str(one)
    assert "axis_plant_fmi3.fmu" in one._repr_html_()


def recorded(seconds: float, drag: float, seed: int) -> pd.DataFrame:
    """An axis of 3 kg m2 with 2.5 N m of friction under a swing, and drag [N m s2/rad2] that no card knows."""
    t = np.arange(0, seconds, 0.01)
    q = 1.2 * np.sin(2 * np.pi * 0.15 * t) + 0.3 * np.sin(2 * np.pi * 0.43 * t + seed)
    v = np.gradient(q, t)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(len(t))
    return pd.DataFrame({"t": t, "tau": 3 * np.gradient(v, t) + 2.5 * np.sign(v) + drag * v * abs(v) + noise, "q": q})


def test_a_diagnosis_of_data_frames_answers_in_python_and_in_a_notebook(card: Path, line: list[str]) -> None:
    told: list[tuple[str, ...]] = []
    runs = [recorded(30, 4.0, seed) for seed in (1, 2, 3)]  # the last one is kept for validation
    answer = cosim.diagnose(runs, card=card, on_answer=lambda found: told.append(found.verdict))
    assert answer.diagnosis.heldout.name == "train 3"
    assert answer.missing == ("quadratic_drag",)
    assert told == [answer.missing]
    assert [effect.id for effect in answer.card.effects] == ["quadratic_drag"]
    assert not answer.refitted.effects
    assert "quadratic drag" in str(answer).lower()
    assert "quadratic drag" in answer._repr_html_().lower()
    assert answer.as_json()["verdict"]
    assert "Wrote" not in str(answer)
    assert line[0].startswith("stage 1 of 3: ")
    assert any(one.startswith("stage 2 of 3: ") for one in line)
    assert line[-1] == ""


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="asks a folder in which no one can make another")
def test_a_folder_that_cannot_be_made_is_said_before_the_work(card: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.api.diagnose.find", lambda *_: pytest.fail("the work began"))
    with pytest.raises(cosim.CosimError, match="/proc/none/out cannot be made"):
        cosim.diagnose(recorded(30, 4.0, 1), recorded(30, 4.0, 2), card, "/proc/none/out")


def test_what_is_shown_is_text_and_a_page_and_a_recording_as_its_file(tmp_path: Path) -> None:
    for shown in (cosim.show("sidereal"), cosim.show("paper_mount")):
        assert all(str(value) in str(shown) for value in shown.facts.values())
        assert "<table>" in shown._repr_html_()
    recording = cosim.read(table())
    path = recording.write(tmp_path / "one.parquet")
    assert cosim.show(recording).tables == cosim.show(path).tables
    assert "400 rows" in str(recording)
    assert "<table>" in recording._repr_html_()


@pytest.mark.parametrize("call", [cosim.diagnose, cosim.card])
def test_a_call_without_a_recording_is_refused_in_a_sentence(call: Callable[[list[Recording]], object]) -> None:
    with pytest.raises(cosim.InputError, match="No recording was given: give one at least"):
        call([])


# Results in a notebook: one line each, tables, figures; and Python calls that offer what the command line does.


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


def test_a_diagnosis_is_one_line_tables_and_a_figure(card: Path, tmp_path: Path) -> None:
    answer = DiagnosisResult(diagnosis("two"), cosim.read_card(card), cosim.read_card(card))
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


def test_an_identification_and_a_run_are_one_line_a_table_and_a_figure(recording: Recording, card: Path) -> None:
    found = cosim.identify(recording.table, card)
    table = found.frame().set_index("parameter")
    assert table.loc["friction.Fc", "value"] == pytest.approx(2.4, rel=0.1)
    assert table.loc["friction.Fc", "given"] == 2.0
    assert found.identified.map.fits["both"].values[0] == pytest.approx(2.4, rel=0.1)
    assert "Friction map" in str(found)
    assert "Friction map" in found._repr_html_()
    assert set(found.numbers) >= {"axis.inertia", "friction.Fc"}
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
