"""What the guides to scenarios and investigations show is what happens."""

import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import call

from cosim.master.simulate import run
from cosim.models.cache import with_fmus
from cosim.sweeps.conduct import conduct
from cosim.sweeps.file import read_sweep
from cosim.system.diagram import draw
from cosim.system.scenario import read_scenario

DOCS = Path(__file__).parents[2] / "docs"
GUIDE = (DOCS / "scenarios.md").read_text("utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", GUIDE, re.DOTALL)


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    """The files of the guide, where each begins with its name."""
    for _, text in BLOCKS:
        named = re.match(r"# (\S+)\n", text)
        if named:
            (tmp_path / named[1]).write_text(text)
    return tmp_path / "guided.toml"


def test_the_drawing_in_the_guide_is_the_one_of_its_scenario(scenario: Path) -> None:
    drawn = next(text for kind, text in BLOCKS if kind == "text")
    assert "\n".join(draw(read_scenario(scenario))) == drawn.rstrip("\n")


def test_what_is_built_from_a_card_is_drawn_as_that_whether_it_is_built_or_not(scenario: Path) -> None:
    text = "\n".join(draw(with_fmus(read_scenario(scenario))))
    assert text == "\n".join(draw(read_scenario(scenario)))


def test_the_investigation_of_the_guide_puts_its_first_name_right(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    blocks = re.findall(r"```(\w+)\n(.*?)```", (DOCS / "investigate.md").read_text("utf-8"), re.DOTALL)
    for _, text in blocks:
        if named := re.match(r"# (\w+\.toml)", text):
            (tmp_path / named[1]).write_text(text, "utf-8")
    command = next(text for _, text in blocks if text.startswith("cosim investigate loop.toml"))
    told = next(text for kind, text in blocks if kind == "text")
    monkeypatch.chdir(tmp_path)
    assert call(*shlex.split(command.replace("\\\n", " "))[1:]) == 0
    said = capsys.readouterr().out
    without_numbers = [re.sub(r"held-out.*| [\d.]+ .*", "", text).splitlines() for text in (told, said)]
    assert without_numbers[0] == without_numbers[1]


def test_the_scenario_of_the_guide_tracks_and_its_encoder_hangs(scenario: Path) -> None:
    done = run(with_fmus(read_scenario(scenario)))
    t, seen, reading = (done.recording[name] for name in ("t", "seen", "reading"))
    hangs = (t >= 1.5) & (t < 1.6)
    assert np.ptp(reading[hangs]) == 0 < np.ptp(done.recording["q"][hangs])
    assert done.recording.units["seen"] == "arcsec"
    assert (np.diff(np.flatnonzero(np.diff(seen))) == 50).all()  # rows, 20 Hz
    looked = (np.arange(len(t)) // 50 - 1) * 50  # rows; a look is shown one step of the camera later
    noise = seen - 206264.806 * done.recording["q"][looked]
    assert 0.02 < noise[t >= 0.05].std() < 0.1
    assert np.abs(done.recording["q"] - done.recording["q_d"])[(t > 1.0) & (t < 1.5)].max() < 1e-6
    assert "camera is a Python function: each of its steps costs microseconds." in done.statistics["notes"]


def test_the_sweep_of_the_guide_runs(scenario: Path) -> None:
    path = scenario.parent / "many.toml"
    sweep = read_sweep(path)
    done = conduct(sweep, with_fmus(read_scenario(sweep.scenario)), path.parent / "many", workers=2)
    table = pd.read_parquet(done.table)
    assert list(table["status"]) == ["ok"] * 8
    assert table["reference.frequency"].isin([0.1, 0.2]).all()
    assert table["rms_error"].between(0.001, 10.0).all()
