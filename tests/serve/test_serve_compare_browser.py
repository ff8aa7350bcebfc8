"""The page of two diagnoses in a real browser: chosen in the history, on a phone, by axe, in the reader's time."""

from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
import serve_work
from browsing import DESK, PATIENCE, PHONE, axe_script, browser, opened, violations
from serving import CARD, TOKEN, _path, act, client_of, desk_at, id_of, listened, new, put, recording, until

__all__ = ["_path", "browser"]
SMALL = """[...document.querySelectorAll("figure text")].filter(
    (one) => one.getScreenCTM().a * parseFloat(getComputedStyle(one).fontSize) < 11.9).length"""


def test_two_diagnoses_are_chosen_in_the_history_and_compared(browser: Any, tmp_path: Path) -> None:
    with desk_at(tmp_path / "data", serve_work.comparing) as desk, listened(desk) as port:
        client = client_of(desk)
        for names in (("run1.csv", "heldout.csv"), ("run1.csv",)):
            job = new(client)
            for seed, name in enumerate(names):
                put(client, job, name, recording(seed=seed))
            put(client, job, "axis.toml", CARD.encode())
            act(client, job, "start")
            until(lambda job=job: not desk.store.get(id_of(job)).live)  # type: ignore[misc]
        with opened(browser, f"http://127.0.0.1:{port}/?token={TOKEN}", DESK) as page:
            for box in page.locator(".choose input").all():
                box.check()
            check(page)
            page.click("#compare-two")
            page.wait_for_selector("#pair")
            page.click("#neither-summary")
            assert page.locator("#pair thead th").count() == 2
            check(page)


def check(page: Any) -> None:
    """Axe finds nothing, nothing scrolls sideways, and text in charts has 12 pixels: desk, phone, dark."""
    page.wait_for_load_state("load")
    for size, scheme in ((DESK, "dark"), (DESK, "light"), (PHONE, "light")):
        page.set_viewport_size(size)
        page.emulate_media(color_scheme=scheme)
        assert page.evaluate("document.documentElement.scrollWidth") == size["width"]
        assert page.evaluate(SMALL) == 0
        assert violations(page, axe_script()) == []
    page.set_viewport_size(DESK)


@pytest.mark.parametrize("zone", ["America/New_York", "Asia/Tokyo"])
def test_times_are_those_of_the_readers_clock(browser: Any, tmp_path: Path, zone: str) -> None:
    with desk_at(tmp_path / "data", serve_work.quickly) as desk, listened(desk) as port:
        job = desk.store.new()
        made = datetime.fromisoformat("2026-01-02T03:04:05+00:00")
        desk.store.put(job.id, made=made.isoformat())
        context = browser.new_context(viewport=DESK, timezone_id=zone, locale="en-GB")
        context.set_default_timeout(PATIENCE)
        page = context.new_page()
        page.goto(f"http://127.0.0.1:{port}/?token={TOKEN}")
        page.wait_for_selector(".jobs time")
        told = page.inner_text(".jobs time")
        context.close()
    assert told == {"America/New_York": "1 Jan 2026, 22:04", "Asia/Tokyo": "2 Jan 2026, 12:04"}[zone]
