"""The local page in a real browser: how soon it answers, how soon a report is ready, and what damaged files do to it.

    python bench/serve.py --drops 100 --rounds 3 --seed 17 --out results/robustness

Everything is done as a user does it: `cosim serve` in a process of its own, Debian's Chromium, files that are dropped.
An answer counts from the drop of the demo's files (3 recordings of 30 s at 1 kHz, a card) over looking at them and
pressing Diagnose; a report is ready when its own mark says so, from the start of its navigation. The machine's load
stands beside the times.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS / "tools"), str(TESTS.parent)]

import numpy as np  # noqa: E402
from browsing import DESK, PATIENCE, PHONE, chromium, dropped, opened, processor, violations  # noqa: E402
from damages import damaged  # noqa: E402
from report_example import text_of  # noqa: E402
from serving import until  # noqa: E402

from cosim.support.version import __version__  # noqa: E402

OPENINGS = 9
"""Times that a report is opened; the median counts."""
KINDS = ("", ".csv.gz", ".parquet", ".mat", ".toml")
"""Suffixes under which every fifth damaged text falls."""
WATCH = """new MutationObserver(() => {
  const box = document.getElementById("explorer");
  if (box && box.dataset.ready && !window.readyAt) window.readyAt = performance.now();
}).observe(document, { attributes: true, subtree: true });"""
"""Notes when a report's own mark says that it is ready, in ms from the start of the navigation."""
OUTCOME = """() => {
  const told = [...document.querySelectorAll("#uploads .bad, #main .box, #main [role=alert]")];
  if (told.some((one) => one.textContent.trim().length > 10)) return "told";
  return document.querySelector("#main figure, #main .facts") ? "drawn" : "nothing";
}"""
Page = Any
Numbers = dict[str, Any]


@contextmanager
def served(home: Path) -> Iterator[tuple["subprocess.Popen[str]", str]]:
    """`cosim serve` and its address."""
    command = [sys.executable, "-m", "cosim", "serve", "--no-browser", "--data", str(home)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=TESTS.parent)
    assert server.stdout is not None
    try:
        yield server, server.stdout.readline().strip()
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(20)
        server.stdout.close()


def night(folder: Path) -> list[Path]:
    """The files of `cosim demo`."""
    from cosim_studies.demo import SECONDS, SEED, demo_case, write_case

    write_case(demo_case(SEED, SECONDS), folder)
    return [folder / name for name in ("train_1.parquet", "train_2.parquet", "heldout.parquet", "card.toml")]


def answered(page: Page, paths: list[Path], pid: int) -> Numbers:
    """Drop files, press Diagnose, and wait for the answer and for the report; seconds from the drop."""
    spent, began = processor(pid), time.monotonic()
    dropped(page, paths)
    page.wait_for_selector("#start")
    page.click("#start")
    page.wait_for_selector("#first, #report", timeout=PATIENCE)
    first, cost = time.monotonic() - began, processor(pid) - spent
    page.wait_for_selector("#report", timeout=PATIENCE)
    return {"first": first, "processor": cost, "report": time.monotonic() - began, "load": os.getloadavg()[0]}


def openings(browser: Any, report: Path) -> list[float]:
    """Seconds from the start of a navigation to the report's own mark, each in a page of its own."""
    found = []
    for _ in range(OPENINGS):
        page = browser.new_page(viewport=DESK)
        page.add_init_script(WATCH)
        page.goto(report.as_uri())
        until(lambda page=page: page.evaluate("window.readyAt"), PATIENCE / 1e3)
        found.append(1e-3 * float(page.evaluate("window.readyAt")))
        page.close()
    return sorted(found)


def axe(browser: Any, report: Path) -> int:
    """Findings in a report, everything unfolded, on a desk and on a phone, light and dark."""
    count = 0
    for size, scheme in ((DESK, "light"), (DESK, "dark"), (PHONE, "light")):
        page = browser.new_page(viewport=size, color_scheme=scheme, bypass_csp=True)
        page.goto(report.as_uri())
        page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
        count += len(violations(page))
        page.close()
    return count


def spoilt(folder: Path, count: int, seed: int) -> Iterator[Path]:
    """Damaged copies of the samples, some under another suffix."""
    draw = np.random.default_rng(seed)
    samples = sorted(one for one in (TESTS / "samples").glob("*.*") if not one.suffix.startswith(".py"))
    for number in range(count):
        source = samples[number % len(samples)]
        suffix = KINDS[number // 5 % len(KINDS)] if number % 5 == 0 else ""
        path = folder / f"{number}{suffix or source.suffix}"
        path.write_bytes(damaged(source.read_bytes(), draw))
        yield path


def stormed(page: Page, paths: Iterator[Path], server: "subprocess.Popen[str]") -> Numbers:
    """Drop damaged files one after the other; each must be drawn, or told in a sentence, by the same server."""
    told: Numbers = {"drawn": 0, "told": 0, "nothing": 0, "ended": 0, "longest": 0.0}
    for path in paths:
        page.evaluate("document.getElementById('main').dataset.old = 'yes'")
        began = time.monotonic()
        dropped(page, [path])
        until(lambda: page.evaluate("!document.getElementById('main').dataset.old"))
        told["longest"] = max(told["longest"], time.monotonic() - began)
        told[page.evaluate(OUTCOME)] += 1
        told["ended"] += server.poll() is not None
        for left in range(page.locator("[id^='drop-']").count() - 1, -1, -1):  # a file of many recordings has several
            page.click("#drop-1")
            until(lambda left=left: page.locator("[id^='drop-']").count() == left)  # type: ignore[misc]
    return told


def played(given: argparse.Namespace, folder: Path) -> Numbers:
    """All that is measured."""
    home, answers, paths = folder / "data", [], night(folder / "night")
    with served(home) as (server, address), chromium() as browser:
        for _ in range(given.rounds):
            with opened(browser, address, DESK) as page:
                answers.append(answered(page, paths, server.pid))
        with opened(browser, address, DESK) as page:
            storm = stormed(page, spoilt(folder, given.drops, given.seed), server)
        report = sorted(home.rglob("report.html"))[0]
        return {
            "answers": answers,
            "damaged": storm,
            "report": {
                "bytes": report.stat().st_size,
                "words": len(text_of(report.read_text("utf-8")).split()),
                "ready": openings(browser, report),
                "axe": axe(browser, report),
            },
        }


def page_of(found: Numbers, command: str) -> str:
    """The page of results."""
    answers, report, storm = found["answers"], found["report"], found["damaged"]
    drops = sum(storm[key] for key in ("drawn", "told", "nothing"))

    def spread(values: list[float]) -> str:
        return f"{statistics.median(values):.3g} ({min(values):.3g} to {max(values):.3g})"

    rows = [
        ("first answer after the drop [s]", "30", spread([one["first"] for one in answers])),
        ("processor until then [s]", "", spread([one["processor"] for one in answers])),
        ("report after the drop [s]", "", spread([one["report"] for one in answers])),
        ("load of the machine at the end of each", "", spread([one["load"] for one in answers])),
        ("report [MB]", "1", f"{report['bytes'] / 1e6:.2f}"),
        ("words before anything is unfolded", "900", f"{report['words']}"),
        ("report ready [s]", "0.5", spread(report["ready"])),
        ("axe-core on the report: findings", "0", f"{report['axe']}"),
        ("damaged files dropped", "100", f"{drops}: {storm['drawn']} drawn, {storm['told']} told in a sentence"),
        ("answered by nothing; server ended", "0; 0", f"{storm['nothing']}; {storm['ended']}"),
        ("longest time of a damaged file [s]", "", f"{storm['longest']:.2g}"),
    ]
    lines = ["# The local page in a real browser", "", f"    {command}", ""]
    lines += [f"mount-cosim {__version__}, headless Chromium, {os.cpu_count()} cores. Median (least to greatest)", ""]
    lines[-2] += f" of {len(answers)} diagnoses of the demo's files and of {len(report['ready'])} openings of a report."
    lines += ["| | asked | measured |", "|---|--:|--:|", *(f"| {' | '.join(row)} |" for row in rows)]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drops", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seed", type=int, default=17)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = played(given, Path(folder))
    given.out.mkdir(parents=True, exist_ok=True)
    command = f"python bench/serve.py --drops {given.drops} --rounds {given.rounds} --seed {given.seed}"
    (given.out / "serve.md").write_text(page_of(found, f"{command} --out {given.out}"), "utf-8")
    (given.out / "serve.json").write_text(json.dumps(found, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
