"""Every page can be read by keyboard, a screen reader, in the dark, on a phone and on paper; a run's loses nothing."""

import json
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from browsing import DESK, VIEWS, check_by_axe, opened, unfolded
from commands import call
from hypothesis import given, settings
from hypothesis import strategies as some
from report_example import report_of
from rich.console import Console
from small_loop import TEXT

from cosim.data.recording import Recording
from cosim.data.writer import StreamWriter
from cosim.plots.chart import Chart, Ruler
from cosim.plots.digest import BUCKETS, DOTS, Digest, axes_of, condense
from cosim.plots.run_page import write_page as write_run
from cosim.support.bar import Left, bar
from cosim.system.scenario import parse_scenario
from cosim_investigation.page import write_page
from cosim_investigation.story import Answered, Moved, Story
from pyfmi_models.card import read_card
from pyfmi_models.export.codegen import generate
from pyfmi_models.export.documentation import documentation


@cache
def of_fmu(part: str = "plant") -> str:
    card = read_card("paper_mount")
    model = card.plant().model() if part == "plant" else card.controller_model()
    return documentation(generate(model), ("x86_64-linux",))["documentation/index.html"].decode()


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


def test_the_page_of_an_investigation_has_units_and_12_px_on_a_phone_a_diagram_9_px(tmp_path: Path) -> None:
    html = of_story(tmp_path)
    assert "<th></th>" not in html
    assert "held-out error [N·m]" in html
    assert "<td>rad/s²</td>" in html
    width = float(re.findall(r'viewBox="0 0 (\d+) ', html)[0])
    size, least = (float(re.findall(rf"svg \{{[^}}]*{one}: ([\d.]+)px", html)[0]) for one in ("font-size", "min-width"))
    assert size * least / width >= 12
    html = of_story(tmp_path, linear=True)
    assert "held-out error [N]" in html
    assert "<td>m/s²</td>" in html
    width, least = re.findall(r'viewBox="\S+ 0 (\d+)[^"]*".*?min-width:min\(\S+px,(\d+)px\)', of_fmu("controller"))[0]
    assert 13 * min(1, int(least) / int(width)) >= 9


def test_time_to_go_is_told_when_the_speed_is_known_and_not_before() -> None:
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


LEAST = """Math.min(...[...document.querySelectorAll("svg")].filter((one) => one.clientWidth).map(
    (one) => (12.5 * one.clientWidth) / one.viewBox.baseVal.width))"""
"""Pixels of the smallest text of a picture."""
DRAWN = """window.told = []; const fill = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  window.told.push([text, this.textAlign, y]); return fill.call(this, text, x, y); }; 0"""


@pytest.mark.parametrize(
    ("kind", "motion", "views"),
    [
        ("two", "rotary", VIEWS),
        ("none", "rotary", VIEWS[:1]),
        ("unknown", "rotary", VIEWS[1:]),
        ("two", "linear", VIEWS[1:2]),
    ],
)  # styles and widths are those of one template: each way of looking at one report, others in one way
def test_a_report_is_shown_without_complaint(browser: Any, kind: str, motion: str, views: Any, tmp_path: Path) -> None:
    """It fits the screen, texts have 12 px, the explorer has three ticks on each side, axe finds nothing."""
    (tmp_path / "report.html").write_text(report_of(kind, motion), "utf-8")
    with opened(browser, (tmp_path / "report.html").as_uri(), views[0][0]) as page:
        page.wait_for_function("document.getElementById('explorer').dataset.ready === 'yes'")
        for size, _ in views:
            page.set_viewport_size(size)
            assert page.evaluate(LEAST) >= 12
        page.evaluate(DRAWN)
        told = page.evaluate("(document.querySelector('[data-to=all]').click(), window.told)")
        unfolded(page, views)
    titles = [at for at, (_, align, _) in enumerate(told) if align == "left"]
    before = [told[low:high] for low, high in zip([0, *(at + 1 for at in titles)], titles, strict=False)]
    assert [len(part) >= 3 for part in before] == [True, True, True]


@pytest.mark.parametrize("what", ["plant", "controller", "run", "investigation"])
def test_axe_finds_nothing_in_other_pages(browser: Any, what: str, scenario: Path, tmp_path: Path) -> None:
    if what == "run":
        call("run", scenario, "--out", tmp_path)
        html = (tmp_path / "run.html").read_text("utf-8")
    else:
        html = of_story(tmp_path) if what == "investigation" else of_fmu(what)
    check_by_axe(browser, html, tmp_path)


def test_no_printed_page_holds_a_single_row(browser: Any, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text(report_of("two"), "utf-8")
    with opened(browser, (tmp_path / "report.html").as_uri(), DESK) as page:
        page.pdf(path=str(tmp_path / "report.pdf"), prefer_css_page_size=True)
    sheets = len(re.findall(rb"/Type\s*/Page\b", (tmp_path / "report.pdf").read_bytes()))
    assert 1 <= sheets <= 4
    if shutil.which("pdftotext"):
        command = ["pdftotext", "-layout", str(tmp_path / "report.pdf"), "-"]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert all(len(sheet.split()) > 25 for sheet in text.strip("\f\n").split("\f"))


# The page of a run shows what was recorded: nothing is lost by thinning, and nothing needs the network.

TIMES = {"simulated_seconds": 1.0, "seconds": 0.1, "ratio_to_real_time": 10.0, "microseconds_per_step": 1.0}
COUNTS = {"steps": 1000, "rows": 1000, "warnings": 0}
NOTED = {"loop": "compiled", "algorithm": "jacobi", "unconnected": ["plant.b"], "notes": ["A note with <angles>."]}


def digest_of(table: dict[str, np.ndarray], units: dict[str, str] | None = None, chunk: int = 1 << 16) -> Digest:
    rows = len(table["t"])
    pieces = ({name: x[k : k + chunk] for name, x in table.items()} for k in range(0, rows, chunk))
    return condense(pieces, dict.fromkeys(table, "") | (units or {}), rows)


@settings(deadline=None, max_examples=40)
@given(rows=some.integers(1, 5000), chunk=some.integers(1, 700))
def test_no_extreme_is_lost_and_pieces_do_not_matter(rows: int, chunk: int) -> None:
    x = np.random.default_rng(rows).standard_normal(rows)
    table = {"t": np.arange(rows) * 0.1, "x": x}
    whole, pieces = digest_of(table), digest_of(table, chunk=chunk)
    assert whole.lines["x"].span == (x.min(), x.max())
    assert (whole.start, whole.end) == (0.0, table["t"][-1])
    for name in ("low", "high", "dots"):
        np.testing.assert_array_equal(getattr(whole.lines["x"], name), getattr(pieces.lines["x"], name))
    assert len(whole.lines["x"].low) == min(rows, BUCKETS)
    assert len(whole.lines["x"].dots) <= DOTS
    sums = [pieces.lines["x"].total, pieces.lines["x"].squares]
    np.testing.assert_allclose(sums, [x.sum(), (x * x).sum()], atol=1e-9)
    line = digest_of({"t": np.arange(4 * BUCKETS), "x": np.arange(4.0 * BUCKETS)}, chunk=chunk).lines["x"]
    np.testing.assert_array_equal(line.low, np.arange(0, 4 * BUCKETS, 4))  # each piece of time its own extremes
    np.testing.assert_array_equal(line.high, np.arange(3, 4 * BUCKETS, 4))


def test_columns_are_sorted_into_axes_and_the_error_is_the_set_point_minus_the_true_position() -> None:
    axes = axes_of(["t", "alt_q", "alt_tau", "q_d", "sky_error", "wind", "alt_q_d"])
    assert [(axis.name, sorted(axis.columns), axis.error) for axis in axes] == [
        ("", ["q_d"], ""),
        ("alt", ["q", "q_d", "tau"], "alt_error"),
        ("sky", ["error"], "sky_error"),
    ]
    t = np.arange(100) * 0.1
    table = {"t": t, "q_d": t, "q": t - 1.0, "position": t - 2.0, "b_q_d": t, "b_q": t - 3.0}
    made = digest_of(table, {"q_d": "rad", "b_q_d": "rad"})
    assert [axis.name for axis in made.axes] == ["", "b"]
    assert made.lines["error"].span == (2.0, 2.0)
    assert made.lines["b_error"].span == pytest.approx((3.0, 3.0))
    assert made.lines["error"].unit == "rad"


def test_white_noise_has_the_density_of_its_variance_over_its_band_and_a_sine_stands_at_its_frequency() -> None:
    rate, sigma, rows = 1e3, 0.3, 100_000
    t, x = np.arange(rows) / rate, sigma * np.random.default_rng(1).standard_normal(rows)
    frequency, density = digest_of({"t": t, "error": x}).spectra["error"]
    np.testing.assert_allclose(np.mean(density[frequency > 10] ** 2), 2 * sigma**2 / rate, rtol=0.03)
    frequency, density = digest_of({"t": t, "error": np.sin(2 * np.pi * 12.0 * t)}).spectra["error"]
    assert frequency[density.argmax()] == pytest.approx(12.0, rel=0.03)


@given(low=some.floats(-1e6, 1e6), size=some.floats(1e-6, 1e6).filter(lambda x: x > 0), length=some.floats(-1000, 1000))
@settings(deadline=None)
def test_ticks_are_few_round_and_inside(low: float, size: float, length: float) -> None:
    ruler = Ruler(low, low + size, 0.0, length)
    ticks = ruler.ticks()
    assert 2 <= len(ticks) <= 7
    slack = 1e-9 * size + 1e-9  # a range may be narrower than the last digit of its ends
    assert all(low - slack <= tick <= low + size + slack for tick in ticks)
    texts = [text for _, text in ruler.labels()]
    assert len(set(texts)) == len(texts)


def test_a_chart_draws_what_it_is_given_where_it_belongs_and_logarithmic_ticks_are_powers_of_ten() -> None:
    ruler = Ruler(1e-7, 1e2, 0.0, 90.0, log=True)
    assert ruler.labels()[0] == (pytest.approx(0.0, abs=1e-9), "10⁻⁷")
    assert ruler.labels()[-1][1] in ("10", "100")
    assert float(ruler.at(np.array(1e-1))) == pytest.approx(60.0)
    chart = Chart.over("a < b", "x", (0.0, 10.0), (0.0, 1.0), (572, 250))
    chart.line(np.array([0.0, 10.0]), np.array([0.5, np.nan]))
    drawn = ElementTree.fromstring(chart.svg())
    points = next(drawn.iter("polyline")).get("points")
    assert points == "62.0,120.0"
    assert drawn.get("aria-label") == "a < b"


def page_of(folder: Path, *recorded: Any) -> str:
    """The page of a run of which a table, units and an origin were recorded."""
    Recording("run", *recorded).write(folder / "run.parquet")
    scenario = parse_scenario(TEXT, "loop.toml", Path())
    return write_run(folder / "run.html", folder / "run.parquet", scenario, TIMES | COUNTS | NOTED).read_text("utf-8")


@pytest.fixture
def page(tmp_path: Path) -> str:
    t = np.arange(1000) * 1e-3
    v = 1e-3 * np.cos(t)
    table = {"t": t, "q_d": np.sin(t), "q": np.sin(t) - 1e-6, "v": v, "tau": v, "friction": np.sign(v), "a&b": t}
    units = {"t": "s", "q_d": "rad", "q": "rad", "v": "rad/s", "tau": "N.m", "friction": "N.m"}
    component = {"file": "x.fmu", "fmi": "3.0", "tool": "a tool", "sha256": "0123456789abcdef", "parameters": {"k": 2}}
    origin = {"version": "mount-cosim 1", "command": "cosim run x", "decimation": 1, "components": {"plant": component}}
    return page_of(tmp_path, table, units, origin)


def test_a_page_has_every_picture_says_what_ran_leads_with_the_error_and_needs_nothing_from_outside(page: str) -> None:
    titles = re.findall(r'class="title">([^<]*)<', page)
    assert titles == [
        "set point [deg]",
        "error [arcsec]",
        "torque [mN·m]",
        "speed [arcmin/s]",
        "friction [N·m]",
        "friction over speed [N·m]",
        "spectrum of the error [arcsec/√Hz]",
        "a&amp;b",
    ]
    for said in ("x.fmu (FMI 3.0, a tool), sha256 0123456789ab", "k = 2", "cosim run x", "1,000 rows", "plant.b"):
        assert said in page
    assert "A note with &lt;angles&gt;." in page
    assert "kind = &quot;sine&quot;" in page
    assert "controller.y" in page or "controller" in page
    facts = re.search(r'<div class="facts">(.*?)</div><p class="quiet">(.*?)</p>', page)
    names = re.findall(r"</b>([^<]*)<", facts[1])
    assert names == ["RMS tracking error", "largest error", "largest torque", "simulated"]
    assert re.match(r"<span><b>[\d.]+\xa0arcsec</b>", facts[1])
    assert facts[2].endswith("10 times real time, 1 µs a step with recording; no warnings.")
    data = json.loads(re.findall(r'id="recordings">(.*?)</script>', page, re.S)[0])
    assert data["recordings"][data["open"]]["titles"] == ["error [arcsec]"]
    assert "its set point, dashed" in page
    alone = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"(?:\bsrc|href)\s*=|url\(|@import", alone)
    assert page.count("<script") == 2  # the data, and the explorer, which the policy lets run and nothing else
    assert "default-src &#x27;none&#x27;" in page
    for svg in re.findall(r"<svg.*?</svg>", page, re.DOTALL):
        ElementTree.fromstring(svg)
    assert len(page) < 200_000


def test_a_run_writes_its_page_with_texts_of_12_px_on_a_phone_unless_told_not_to(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert call("run", scenario, "--out", out) == 0
    assert f"pictures: {out / 'run.html'}" in capsys.readouterr().err
    text = (out / "run.html").read_text("utf-8")
    assert "<h1>loop</h1>" in text
    assert "error" in re.findall(r'class="title">(\w+)', text)
    assert re.search(r"rows, one (each step|in [2-9]\d* steps)\.", text)
    width = float(re.findall(r'viewBox="0 0 (\d+) ', text)[0])
    size = float(re.findall(r"svg \{[^}]*font-size: ([\d.]+)px", text)[0])
    assert size * (390 - 2 * 16) / width >= 12
    assert call("run", scenario, "--out", tmp_path / "bare", "--no-page") == 0
    assert sorted(one.name for one in (tmp_path / "bare").iterdir()) == ["recording.parquet", "run.json"]


@pytest.mark.parametrize("rows", [1, 2, 70])
def test_short_and_constant_recordings_have_a_page_too(tmp_path: Path, rows: int) -> None:
    table = dict.fromkeys(("q_d", "q", "v"), np.zeros(rows)) | {"t": np.arange(rows) * 1.0, "friction": np.ones(rows)}
    text = page_of(tmp_path, table, {}, {"version": "mount-cosim 1", "decimation": 1})
    assert "nan" not in "".join(re.findall(r'points="([^"]*)"', text))


def test_a_recording_is_looked_at_piece_by_piece(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pyarrow

    from cosim.plots import digest as module

    rows, held = 1 << 20, []
    with StreamWriter(tmp_path / "long.parquet", {"t": "s", "a": "", "b": ""}, {}) as writer:
        for first in range(0, rows, 1 << 16):
            t = np.arange(first, first + (1 << 16)) * 1e-4
            writer.write({"t": t, "a": np.sin(t), "b": t})
    add, before = module._add, pyarrow.total_allocated_bytes()
    monkeypatch.setattr(
        module, "_add", lambda *args: (held.append(pyarrow.total_allocated_bytes() - before), add(*args))
    )
    module.digest(tmp_path / "long.parquet")
    assert max(held) < 8 * 3 * rows / 4
