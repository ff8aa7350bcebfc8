"""Pictures of the local page with its example, by headless Chromium: docs/serve.png, and more to look at.

    python bench/page_pictures.py --out docs/serve.png [--more FOLDER]

Starts `cosim serve`, presses "Try an example", takes the picture of the draft, diagnoses, and prints how much processor
the server and its processes had taken when the first answer stood on the page. FOLDER gets home, draft, answer and
report on a desk, on a phone of 390 px, in the dark and as a print.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parents[1] / "tests" / "tools"))
from browsing import DESK, PHONE, chromium, processor
from PIL import Image

PICTURE = {"width": 1000, "height": 980}
PATIENCE = 240.0
"""Seconds for a diagnosis on a busy computer."""
LOOKS = {"desk": (DESK, "light"), "phone": (PHONE, "light"), "dark": (DESK, "dark")}


def main() -> int:
    """Serve, try the example, take the pictures."""
    given = arguments()
    with tempfile.TemporaryDirectory() as data:
        command = [sys.executable, "-m", "cosim", "serve", "--no-browser", "--data", data]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        assert server.stdout is not None
        try:
            with chromium() as browser:
                taken(browser, server.stdout.readline().strip(), server.pid, given)
        finally:
            server.terminate()
            server.wait()
    return 0


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="the picture of the draft (.png)")
    parser.add_argument("--more", type=Path, default=None, help="folder of all pictures")
    return parser.parse_args()


def taken(browser: Any, address: str, server: int, given: argparse.Namespace) -> None:
    """Go from the first page to the report."""
    page = browser.new_context(viewport=PICTURE).new_page()
    page.set_default_timeout(1000 * PATIENCE)
    page.goto(address)
    looked(browser, page, "home", given.more)
    before = processor(server)
    page.click("#example")
    page.wait_for_selector("#start")
    page.screenshot(path=given.out)
    with Image.open(given.out) as drawn:
        drawn.convert("RGB").quantize(64).save(given.out, optimize=True)
    looked(browser, page, "draft", given.more)
    page.click("#start")
    until(lambda: page.locator("#first, #report").count() > 0)
    print(f"first answer after {processor(server) - before:.1f} s of processor")
    until(lambda: page.locator("#report").count() > 0)
    looked(browser, page, "answer", given.more)
    page.goto(page.locator("a[href*='report.html']").first.evaluate("one => one.href"))
    looked(browser, page, "report", given.more)


def until(holds: Any) -> None:
    """Wait until something holds."""
    ends = time.monotonic() + PATIENCE
    while not holds():
        if time.monotonic() > ends:
            raise TimeoutError("the page did not get there")
        time.sleep(0.2)


def looked(browser: Any, page: Any, name: str, folder: Path | None) -> None:
    """Take a page in every look, whole; say what is wider than the screen."""
    if folder is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    cookies = page.context.cookies()
    for look, (size, scheme) in LOOKS.items():
        context = browser.new_context(viewport=size, color_scheme=scheme)
        context.add_cookies(cookies)
        other = context.new_page()
        other.goto(page.url)
        other.screenshot(path=folder / f"{name}_{look}.png", full_page=True)
        if (wide := other.evaluate("document.documentElement.scrollWidth")) > size["width"]:
            print(f"{name} on {look}: {wide} px wide")
        if look == "desk":
            other.pdf(path=folder / f"{name}_print.pdf")
        context.close()


if __name__ == "__main__":
    sys.exit(main())
