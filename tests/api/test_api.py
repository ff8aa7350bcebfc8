"""What `import cosim` offers: names, weight, and that every kind of source gives the same answer."""

import inspect
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import cosim
from cosim.api.diagnose import check_split
from cosim.data.recording import Recording
from cosim.support.plugins import HANDLES, names

FUNCTIONS = ("diagnose", "export", "identify", "read", "run", "show")
CARD = """
[mount]
inertia = 30.0
[friction]
model = "coulomb"
Fc = 2.5
"""
SCENARIO = (files("cosim") / "scenarios" / "sidereal.toml").read_text("utf-8").replace("stop = 15.0", "stop = 0.2")


@pytest.fixture
def card(tmp_path: Path) -> Path:
    path = tmp_path / "axis.toml"
    path.write_text(CARD, "utf-8")
    return path


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
    text = inspect.getdoc(function) or ""
    described = {
        word.strip() for line in text.splitlines() if ":" in line for word in line.partition(":")[0].split(",")
    }
    assert set(inspect.signature(function).parameters) <= described
    assert {"Returns", "Raises"} <= described


def test_importing_cosim_loads_nothing_heavy_and_takes_no_time() -> None:
    code = (
        "import sys, time; before = time.process_time(); import cosim; spent = time.process_time() - before;"
        "print(spent, *(one for one in ('numpy', 'pydantic', 'casadi', 'typer') if one in sys.modules))"
    )
    command = [sys.executable, "-c", code]
    told = [subprocess.run(command, capture_output=True, text=True, check=True).stdout.split() for _ in range(3)]
    assert all(len(one) == 1 for one in told), told
    assert min(float(spent) for spent, *_ in told) <= 0.05  # of the processor: others may use this machine too


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


def test_numbers_are_identified_from_a_table_in_memory(card: Path) -> None:
    t = np.arange(2000) * 0.005
    v = 0.5 * np.sin(2 * np.pi * 0.3 * t)
    q = np.cumsum(v) * 0.005
    tau = 2.0 * np.sign(v) + 3.0 * v + 30.0 * np.gradient(v, t)
    card.write_text(CARD.replace("2.5", "2.5\nsigma2 = 1.0"), "utf-8")
    found = cosim.identify({"t": t, "tau": tau, "q": q}, card)
    assert found.identified.map.fits["both"].values[0] == pytest.approx(2.0, rel=0.1)  # type: ignore[union-attr]
    assert "Friction map" in str(found)
    assert "Friction map" in found._repr_html_()
    assert set(found.numbers) >= {"axis.inertia", "friction.Fc"}


def recorded(seconds: float, drag: float, seed: int) -> pd.DataFrame:
    """An axis of 30 kg m2 with 2.5 N m of friction under a swing, and drag [N m s2/rad2] that no card knows."""
    t = np.arange(0, seconds, 0.01)
    q = 1.2 * np.sin(2 * np.pi * 0.15 * t) + 0.3 * np.sin(2 * np.pi * 0.43 * t + seed)
    v = np.gradient(q, t)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(len(t))
    return pd.DataFrame({"t": t, "tau": 30 * np.gradient(v, t) + 2.5 * np.sign(v) + drag * v * abs(v) + noise, "q": q})


def test_a_diagnosis_of_data_frames_answers_in_python_on_a_terminal_and_in_a_notebook(card: Path) -> None:
    train, heldout = [recorded(30, 4.0, seed) for seed in (1, 2)], recorded(30, 4.0, 3)
    told: list[tuple[str, ...]] = []
    answer = cosim.diagnose(train, heldout, card, on_answer=lambda found: told.append(found.verdict))
    assert answer.missing == ("quadratic_drag",)
    assert told == [answer.missing]
    assert [effect.id for effect in answer.card.effects] == ["quadratic_drag"]
    assert not answer.refitted.effects
    assert "quadratic drag" in str(answer).lower()
    assert "quadratic drag" in answer._repr_html_().lower()
    assert answer.as_json()["verdict"]
    assert "Wrote" not in str(answer)


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
