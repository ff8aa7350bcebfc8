"""The page in a real browser: dropped files to the report, by mouse, on a phone's width, by keyboard, read aloud."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
import serve_work
from browsing import DESK, PATIENCE, PHONE, check_page, dropped, opened, processor
from mortal import mortal
from serving import CARD, HERE, TOKEN, client_of, desk_at, done, listened, ready, recording  # skips without [serve]
from waiting import until

from cosim_serve.desk import Desk
from cosim_studies.demo import SECONDS, SEED, demo_case, write_case

Page = Any
FIRST = 3.0
"""Processor until the first answer for the demo's files, in units of the time that the diagnosis itself takes: it works
in two processes, and what the page adds is small. A ratio of one run: computers differ, and so do their busy hours."""
LARGEST = 1_000_000
"""Bytes of a report."""
TOUCH, TOUCHED = 44, "button, select, input:not([type=hidden], [type=checkbox]), .choose, textarea, summary, li a"
"""Least height of what is touched, in CSS pixels (WCAG 2.2, 2.5.5); a box is touched at its label."""


@contextmanager
def serving(home: Path, work: Any) -> Iterator[tuple[Desk, str]]:
    """A server in this process whose diagnosis is replaced."""
    with desk_at(home, work) as desk, listened(desk) as port:
        yield desk, f"http://127.0.0.1:{port}/?token={TOKEN}"


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Two recordings and a card."""
    made = {"run1.csv": recording(), "heldout.csv": recording(seed=1), "axis.toml": CARD.encode()}
    for name, content in made.items():
        (tmp_path / name).write_bytes(content)
    return [tmp_path / name for name in made]


def holds(page: Page, code: str, seconds: float = 60.0) -> None:
    """Wait until an expression is true; the page's policy forbids the browser to be told to wait for it."""
    until(lambda: page.evaluate(f"Boolean({code})"), seconds)


@pytest.mark.skipif(not Path("/proc").exists(), reason="the time of a process is looked up in /proc")
def test_the_demo_is_diagnosed_from_the_drop_to_the_report(browser: Any, tmp_path: Path) -> None:
    """Through a reload of the page and the end of the browser."""
    write_case(demo_case(SEED, SECONDS), night := tmp_path / "night")
    command = mortal(sys.executable, "-m", "cosim", "serve", "--no-browser", "--data", str(tmp_path / "data"))
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=HERE.parent)
    try:
        address = server.stdout.readline().strip()
        paths = [night / name for name in ("train_1.parquet", "train_2.parquet", "heldout.parquet", "card.toml")]
        with opened(browser, address, DESK) as page:
            began = processor(server.pid), time.monotonic()
            dropped(page, paths)
            page.wait_for_selector("#start")
            assert page.locator("figure").count() == 9
            assert page.locator("#role-3").input_value() == "heldout"
            page.click("#start")
            page.wait_for_selector("#cancel")
            page.reload()
            place = page.url
        with opened(browser, address, DESK) as page:  # the browser before is gone; the diagnosis is not
            page.goto(place)
            page.wait_for_selector("#first, #report", timeout=PATIENCE)
            spent, passed = processor(server.pid) - began[0], time.monotonic() - began[1]
            print(f"first answer after {passed:.1f} s, {spent:.1f} s of processor")
            assert page.inner_text("h1") == "Two effects are missing from the model"
            page.wait_for_selector("#report", timeout=PATIENCE)
            page.frame_locator("#report").locator("h1").wait_for()
            assert "Two effects" in page.frame_locator("#report").locator("h1").inner_text()
            holds(page, "document.getElementById('report').clientHeight > 2000")
            with page.expect_download() as download:
                page.click("text=Model card")
            assert "[[effects]]" in Path(download.value.path()).read_text("utf-8")
            names = page.eval_on_selector_all(".downloads a", "all => all.map(one => one.href.split('/').pop())")
            assert {"report.html", "card.toml", "diagnosis.json", "missing_torque.parquet"} <= set(names)
            assert sum(name.endswith(".fmu") for name in names) == 2
        (report,) = (tmp_path / "data").rglob("report.html")
        assert report.stat().st_size <= LARGEST
        assert spent <= FIRST * json.loads((report.parent / "diagnosis.json").read_text("utf-8"))["seconds"]
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(20)
        server.stdout.close()


def test_dropped_files_are_shown_corrected_and_diagnosed(browser: Any, files: list[Path], tmp_path: Path) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_bytes(b"\x00\x01nothing")
    with serving(tmp_path / "data", serve_work.quickly) as (desk, address), opened(browser, address, DESK) as page:
        dropped(page, [*files, bad])
        page.wait_for_selector("#start")
        for role in ("out", "train"):
            page.evaluate("document.getElementById('main').dataset.before = 'yes'")
            page.select_option("#role-1", role)
            holds(page, "!document.getElementById('main').dataset.before")
            assert desk.store.all()[0].upload("run1.csv").role == role
        page.click("#start")
        page.wait_for_selector("#problem")
        assert "bad.csv cannot be used" in page.inner_text("#problem")
        page.click("#drop-3")
        page.wait_for_selector("#role-3", state="detached")
        page.click("#correct-summary-2")
        page.fill("#u-2-q", "deg")
        page.click("#read-2")
        holds(page, "document.getElementById('u-2-q').value === 'deg'")
        assert page.locator("#correct-2").get_attribute("open") is not None
        page.click("#start")
        page.wait_for_selector("#report")
        assert page.inner_text("h1") == serve_work.ANSWER["heading"]
        (job,) = desk.store.all()
        assert job.upload("heldout.csv").options["units"] == {"q": "deg"}


LATE = """() => { const real = window.fetch; let first = true; window.fetch = async (...asked) => {
  const late = first; first = false; const answer = await real(...asked);
  if (late) await new Promise((done) => setTimeout(done, 500)); return answer; } }"""


def test_a_late_answer_does_not_undo_what_was_asked_after_it(browser: Any, files: list[Path], tmp_path: Path) -> None:
    with serving(tmp_path / "data", serve_work.quickly) as (_, address), opened(browser, address, DESK) as page:
        dropped(page, files)
        page.wait_for_selector("#start")
        page.evaluate(LATE)
        page.select_option("#role-1", "out")
        page.evaluate("document.getElementById('start').click()")
        page.wait_for_selector("#problem", timeout=20_000)
        time.sleep(1.0)
        assert page.locator("#problem").count() == 1


def test_it_is_used_by_keyboard_alone(browser: Any, files: list[Path], tmp_path: Path) -> None:
    with serving(tmp_path / "data", serve_work.for_ever) as (_, address), opened(browser, address, DESK) as page:
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.textContent") == "To the content"
        to(page, "files")
        page.set_input_files("#files", files)  # Space opens the browser's own window: headless, it cannot be closed
        page.wait_for_selector("#start")
        to(page, "role-1")
        page.keyboard.press("ArrowDown")
        holds(page, "document.querySelector('.lacking')")
        assert page.evaluate("document.activeElement.id") == "role-1"
        page.keyboard.press("ArrowUp")
        holds(page, "!document.querySelector('.lacking')")
        to(page, "start")
        page.keyboard.press("Enter")
        page.wait_for_selector("#cancel")
        holds(page, "document.querySelector('#progress').textContent.includes('Friction asymmetry')")
        holds(page, "document.getElementById('status').textContent.includes('Friction asymmetry')")
        to(page, "cancel")
        page.keyboard.press("Enter")
        page.wait_for_selector("#again")
        assert page.evaluate("document.activeElement.tagName") == "H1"
        to(page, "to-all")
        page.keyboard.press("Enter")
        page.wait_for_selector("#history")


def to(page: Page, name: str) -> None:
    """Press Tab until an element has the focus, which must then be visible."""
    for _ in range(120):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == name:
            box = page.locator(f"#{name}").bounding_box()
            assert box["y"] >= 0
            return
    raise AssertionError(f"{name} is not reached by Tab")


LOW = """([least, what]) => [...document.querySelectorAll(what)]
    .filter((one) => one.checkVisibility() && one.getBoundingClientRect().height < least)
    .map((one) => one.outerHTML)"""


def check(page: Page) -> None:
    """Axe finds nothing, nothing scrolls sideways, the dark is dark, and on a phone everything can be touched."""
    check_page(page)
    red = int(page.evaluate("getComputedStyle(document.body).backgroundColor").partition("(")[2].partition(",")[0])
    assert red < 60
    page.set_viewport_size(PHONE)
    assert page.evaluate(LOW, [TOUCH, TOUCHED]) == []
    page.set_viewport_size(DESK)


def test_every_page_is_read_and_used_by_everybody(browser: Any, files: list[Path], tmp_path: Path) -> None:
    (tmp_path / "open.csv").write_bytes((HERE / "samples" / "odrive.csv").read_bytes())
    with serving(tmp_path / "data", serve_work.for_ever) as (_, address), opened(browser, address, DESK) as page:
        check(page)
        page.set_input_files("#files", [*files, tmp_path / "open.csv"])
        page.wait_for_selector("#accept-3")
        for one in page.locator("summary").all():
            if one.is_visible():
                one.click()
        check(page)
        page.click("#start")
        page.wait_for_selector("#problem")
        check(page)
        page.click("#drop-3")
        page.wait_for_selector("#drop-3", state="detached")
        for button, there in (("#start", "#first"), ("#cancel", "#again"), ("#to-all", ".jobs")):
            page.click(button)
            page.wait_for_selector(there)
            check(page)


def test_a_server_that_is_gone_is_said(browser: Any, files: list[Path], tmp_path: Path) -> None:
    context = browser.new_context(viewport=DESK)
    page = context.new_page()
    with serving(tmp_path / "data", serve_work.quickly) as (_, address):
        page.goto(address)
        page.set_input_files("#files", files)
        page.wait_for_selector("#start")
        assert page.locator(".lacking").count() == 0
    page.click("#start")
    page.wait_for_selector("#status.box")
    assert "start cosim serve again" in page.inner_text("#status")
    context.close()


SMALL = """[...document.querySelectorAll("figure text")].filter(
    (one) => one.getScreenCTM().a * parseFloat(getComputedStyle(one).fontSize) < 11.9).length"""


def test_two_diagnoses_are_chosen_in_the_history_and_compared(browser: Any, tmp_path: Path) -> None:
    with serving(tmp_path / "data", serve_work.comparing) as (desk, address), opened(browser, address, DESK) as page:
        client = client_of(desk)
        for names in (("run1.csv", "heldout.csv"), ("run1.csv",)):
            done(client, desk, job := ready(client, *names))
        page.goto(address.partition("/?")[0] + job)
        page.wait_for_selector("#report")
        check(page)
        page.click("#to-all")
        page.wait_for_selector(".jobs")
        for box in page.locator(".choose input").all():
            box.check()
        check(page)
        page.click("#compare-two")
        page.wait_for_selector("#pair")
        page.click("#neither-summary")
        assert page.locator("#pair thead th").count() == 2
        check(page)
        for size in (PHONE, DESK):
            page.set_viewport_size(size)
            assert page.evaluate(SMALL) == 0, "text in charts has 12 pixels"


@pytest.mark.parametrize("zone", ["America/New_York", "Asia/Tokyo"])
def test_times_are_those_of_the_readers_clock(browser: Any, tmp_path: Path, zone: str) -> None:
    with serving(tmp_path / "data", serve_work.quickly) as (desk, address):
        job = desk.store.new()
        made = datetime.fromisoformat("2026-01-02T03:04:05+00:00")
        desk.store.put(job.id, made=made.isoformat())
        with opened(browser, address, DESK, timezone_id=zone, locale="en-GB") as page:
            page.wait_for_selector(".jobs time")
            told = page.inner_text(".jobs time")
    assert told == {"America/New_York": "1 Jan 2026, 22:04", "Asia/Tokyo": "2 Jan 2026, 12:04"}[zone]
