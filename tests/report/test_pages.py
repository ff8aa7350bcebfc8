"""Every page we write can be read by keyboard, by a screen reader, in the dark, on a phone and on paper."""

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsing import PATIENCE, VIEWS, browser, check_by_axe
from commands import call
from report_example import report_of

from cosim.data.recording import Recording
from cosim_investigation.page import write_page
from cosim_investigation.story import Answered, Moved, Story
from pyfmi_models.card import read_card
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.documentation import documentation

__all__ = ["browser"]


@cache
def of_fmu(part: str = "plant") -> str:
    card = read_card("paper_mount")
    model = card.plant().model() if part == "plant" else card.controller_model()
    return documentation(generate(model), ("x86_64-linux",))["documentation/index.html"].decode()


@pytest.fixture
def of_run(scenario: Path, tmp_path: Path) -> str:
    call("run", scenario, "--out", tmp_path / "out")
    return (tmp_path / "out" / "run.html").read_text("utf-8")


def of_story(folder: Path, linear: bool = False) -> str:
    """The page of an investigation of two motions and an answer."""
    t = np.arange(0.0, 10.0, 1e-2)
    steps: list[Moved | Answered] = []
    for number, role in enumerate(("train", "heldout")):
        Recording.of({"t": t, "tau": np.cos(t), "q": 0.3 * np.sin(t)}).write(folder / f"{role}.parquet", True)
        steps.append(Moved(number, f"{role}.parquet", role, "tone", "a sine of 0.16 Hz", 10.0, 4.0))
    steps.append(Answered(2, ("cogging",), ("whether it is cogging or friction",), ("set",), 0.8, 0.2, 0.1, 3.0))
    limits = dict.fromkeys(("low", "high", "speed", "acceleration", "torque", "frequency"), 1.0)
    story = Story(tuple(steps), "no motion tells", ("record two loads",), ("tone: speed 2 beyond 1",), limits)
    return write_page(folder / "story.html", story, folder, "cosim investigate x", linear).read_text("utf-8")


def test_the_page_of_a_run_has_plain_words(of_run: str) -> None:
    assert "one in 1 steps" not in of_run
    assert re.search(r"rows, one (each step|in \d+ steps)\.", of_run)


def test_the_page_of_an_investigation_has_units(tmp_path: Path) -> None:
    html = of_story(tmp_path)
    assert "<th></th>" not in html
    assert "held-out error [N·m]" in html
    assert "<td>rad/s²</td>" in html
    html = of_story(tmp_path, linear=True)
    assert "held-out error [N]" in html
    assert "<td>m/s²</td>" in html


def test_the_picture_of_an_investigation_keeps_12_px_on_a_phone(tmp_path: Path) -> None:
    html = of_story(tmp_path)
    width = float(re.findall(r'viewBox="0 0 (\d+) ', html)[0])
    size, least = (
        float(re.findall(rf"svg \{{[^}}]*{name}: ([\d.]+)px", html)[0]) for name in ("font-size", "min-width")
    )
    assert size * least / width >= 12


def test_texts_of_a_run_page_keep_12_px_on_a_phone(of_run: str) -> None:
    width = float(re.findall(r'viewBox="0 0 (\d+) ', of_run)[0])
    size = float(re.findall(r"svg \{[^}]*font-size: ([\d.]+)px", of_run)[0])
    assert size * (390 - 2 * 16) / width >= 12


def test_time_to_go_is_told_when_the_speed_is_known_and_not_before() -> None:
    from rich.console import Console

    from cosim.support.bar import Left, bar

    now = [0.0]
    shown = bar(console=Console(quiet=True), get_time=lambda: now[0], auto_refresh=False)
    task = shown.add_task("run", total=None)
    for at, done in ((0.3, 1), (2.0, 50)):
        now[0] = at
        shown.update(task, completed=done, total=100, counted=True)
        text = Left().render(shown.tasks[0]).plain
        assert bool(re.search(r"\d", text)) == (at > 1), text
    shown.update(task, counted=False)
    assert Left().render(shown.tasks[0]).plain == ""


REPORTS = {
    "two": ("two", "rotary", VIEWS),
    "none": ("none", "rotary", VIEWS[:1]),
    "unknown": ("unknown", "rotary", VIEWS[2:]),
    "linear": ("two", "linear", VIEWS[1:2]),
}
"""Styles and widths are those of one template: each way of looking at one report, each other report in one way."""


@pytest.mark.parametrize("kind", REPORTS)
def test_axe_finds_nothing_in_a_report_on_a_desk_on_a_phone_or_in_the_dark(
    browser: Any, kind: str, tmp_path: Path
) -> None:
    *which, views = REPORTS[kind]
    check_by_axe(browser, report_of(*which), tmp_path, views)


@pytest.mark.parametrize("part", ["plant", "controller"])
def test_axe_finds_nothing_in_the_page_of_an_fmu(browser: Any, part: str, tmp_path: Path) -> None:
    check_by_axe(browser, of_fmu(part), tmp_path)


def test_the_diagram_of_an_fmu_keeps_9_px_on_a_phone() -> None:
    width, least = re.findall(r'viewBox="\S+ 0 (\d+)[^"]*".*?min-width:min\(\S+px,(\d+)px\)', of_fmu("controller"))[0]
    assert 13 * min(1, int(least) / int(width)) >= 9


def test_axe_finds_nothing_in_the_page_of_a_run(browser: Any, of_run: str, tmp_path: Path) -> None:
    check_by_axe(browser, of_run, tmp_path)


def test_axe_finds_nothing_in_the_page_of_an_investigation(browser: Any, tmp_path: Path) -> None:
    check_by_axe(browser, of_story(tmp_path), tmp_path)


def test_the_explorer_has_at_least_three_ticks_on_each_side(browser: Any, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text(report_of("two"), "utf-8")
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.set_default_timeout(PATIENCE)
    page.add_init_script(
        "window.told = []; const fill = CanvasRenderingContext2D.prototype.fillText;"
        "CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {"
        "  window.told.push([text, this.textAlign, y]); return fill.call(this, text, x, y); };"
    )
    page.goto((tmp_path / "report.html").as_uri())
    page.wait_for_function("document.getElementById('explorer').dataset.ready === 'yes'")
    told = page.evaluate("(window.told = [], document.querySelector('[data-to=all]').click(), window.told)")
    titles = [at for at, (_, align, _) in enumerate(told) if align == "left"]
    before = [told[low:high] for low, high in zip([0, *(at + 1 for at in titles)], titles, strict=False)]
    assert [len(part) >= 3 for part in before] == [True, True, True]
    page.close()


def test_no_printed_page_holds_a_single_row(browser: Any, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text(report_of("two"), "utf-8")
    page = browser.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto((tmp_path / "report.html").as_uri())
    page.pdf(path=str(tmp_path / "report.pdf"), prefer_css_page_size=True)
    page.close()
    sheets = len(re.findall(rb"/Type\s*/Page\b", (tmp_path / "report.pdf").read_bytes()))
    assert 1 <= sheets <= 4
    if shutil.which("pdftotext"):
        command = ["pdftotext", "-layout", str(tmp_path / "report.pdf"), "-"]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert all(len(sheet.split()) > 25 for sheet in text.strip("\f\n").split("\f"))
