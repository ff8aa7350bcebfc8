"""Help for tests in a real browser: Debian's Chromium by playwright, pages that may say nothing, files that fall."""

import base64
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
"""Chromium shall talk to nobody but the page."""
PHONE, DESK = {"width": 390, "height": 844}, {"width": 1280, "height": 800}
VIEWS = ((DESK, "light"), (PHONE, "light"), (DESK, "dark"))
PATIENCE = 300_000
"""Milliseconds for a browser or a diagnosis that has a busy processor."""
REFUSED = "400 (Bad Request)"
"""Part of what the browser itself says when the server refuses a form; the page says why."""
RULES = ["wcag2a", "wcag2aa", "wcag21aa", "wcag22aa", "best-practice"]
Browser = Page = Any


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser; whoever calls it looks first whether there is one."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as tool:
        started = tool.chromium.launch(executable_path=CHROMIUM, args=FLAGS, timeout=PATIENCE)
        yield started
        started.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser for the tests of a module; skips where there is none."""
    pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("there is no Chromium on this machine")
    with chromium() as started:
        yield started


@contextmanager
def opened(browser: Browser, address: str, size: dict[str, int], **more: Any) -> Iterator[Page]:
    """A page in a browser of its own; every message, error and request elsewhere fails the test."""
    context = browser.new_context(viewport=size, **more)
    context.set_default_timeout(PATIENCE)
    page, said = context.new_page(), []
    home = address.partition("?")[0]
    page.on("console", lambda message: REFUSED in message.text or said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: request.url.startswith((home, "blob:")) or said.append(request.url))
    page.on("dialog", lambda dialog: dialog.accept())
    page.goto(address)
    try:
        yield page
    finally:
        context.close()
    assert said == []


def dropped(page: Page, paths: Sequence[Path]) -> None:
    """Drop files on the page as a mouse does."""
    content = [[path.name, base64.b64encode(path.read_bytes()).decode()] for path in paths]
    code = """(files) => {
      const data = new DataTransfer();
      for (const [name, text] of files)
        data.items.add(new File([Uint8Array.from(atob(text), (one) => one.charCodeAt(0))], name));
      const zone = document.querySelector("[data-drop]");
      for (const kind of ["dragenter", "dragover", "drop"])
        zone.dispatchEvent(new DragEvent(kind, { bubbles: true, cancelable: true, dataTransfer: data }));
    }"""
    page.evaluate(code, content)


def violations(page: Page) -> list[tuple[str, str, list[str]]]:
    """What axe-core finds: rule, impact, and the elements; skips where it is not installed."""
    axe = pytest.importorskip("axe_core_python", reason="axe-core-python is not installed")
    page.evaluate((Path(axe.__file__).parent / "axe.min.js").read_text("utf-8"))
    call = "(rules) => axe.run(document, { runOnly: rules, resultTypes: ['violations'], preload: false })"
    found = page.evaluate(call, RULES)["violations"]
    return [(one["id"], one["impact"], [node["html"][:120] for node in one["nodes"]]) for one in found]


def check_page(page: Page, views: Sequence[tuple[dict[str, int], str]] = VIEWS) -> None:
    """Nothing is found, and nothing is wider than the screen."""
    page.wait_for_load_state("load")  # a selector may be there before the style sheet of a new page is
    for size, scheme in views:
        page.set_viewport_size(size)
        page.emulate_media(color_scheme=scheme)
        assert violations(page) == [], (size, scheme)
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]


def unfolded(page: Page, views: Sequence[tuple[dict[str, int], str]] = VIEWS) -> None:
    """A page is checked with everything unfolded."""
    page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    check_page(page, views)


def check_by_axe(browser: Any, html: str, folder: Path) -> None:
    """A page that is a text is checked."""
    (folder / "page.html").write_text(html, "utf-8")
    with opened(browser, (folder / "page.html").as_uri(), DESK) as page:
        unfolded(page)


def processor(pid: int) -> float:
    """Seconds of processor of a process and of all that it started."""
    total = 0.0
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if path.parent.name == str(pid) or words[1] == str(pid):
            total += sum(map(int, words[11:15])) / os.sysconf("SC_CLK_TCK")
    return total
