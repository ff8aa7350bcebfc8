"""The page of a run shows what was recorded: nothing is lost by thinning, and nothing needs the network."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from commands import call
from hypothesis import given, settings
from hypothesis import strategies as some
from small_loop import TEXT

from cosim.data.recording import Recording
from cosim.data.writer import StreamWriter
from cosim.plots.chart import Chart, Ruler
from cosim.plots.digest import BUCKETS, DOTS, Digest, axes_of, condense
from cosim.plots.run_page import write_page
from cosim.system.scenario import parse_scenario

STATISTICS = {
    "simulated_seconds": 1.0,
    "steps": 1000,
    "seconds": 0.1,
    "ratio_to_real_time": 10.0,
    "microseconds_per_step": 1.0,
    "warnings": 0,
    "rows": 1000,
    "loop": "compiled",
    "algorithm": "jacobi",
    "unconnected": ["plant.b"],
    "notes": ["A note with <angles>."],
}


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
    np.testing.assert_allclose(
        [pieces.lines["x"].total, pieces.lines["x"].squares], [x.sum(), (x * x).sum()], atol=1e-9
    )


def test_each_piece_of_time_shows_its_own_extremes() -> None:
    rows = 4 * BUCKETS
    line = digest_of({"t": np.arange(rows), "x": np.arange(rows, dtype=float)}).lines["x"]
    np.testing.assert_array_equal(line.low, np.arange(0, rows, 4))
    np.testing.assert_array_equal(line.high, np.arange(3, rows, 4))


def test_the_error_is_the_set_point_minus_the_true_position_where_that_is_recorded() -> None:
    t = np.arange(100) * 0.1
    table = {"t": t, "q_d": t, "q": t - 1.0, "position": t - 2.0, "b_q_d": t, "b_q": t - 3.0}
    made = digest_of(table, {"q_d": "rad", "b_q_d": "rad"})
    assert [axis.name for axis in made.axes] == ["", "b"]
    assert made.lines["error"].span == (2.0, 2.0)
    assert made.lines["b_error"].span == pytest.approx((3.0, 3.0))
    assert made.lines["error"].unit == "rad"


def test_columns_are_sorted_into_axes_by_their_names() -> None:
    axes = axes_of(["t", "alt_q", "alt_tau", "q_d", "sky_error", "wind", "alt_q_d"])
    assert [(axis.name, sorted(axis.columns), axis.error) for axis in axes] == [
        ("", ["q_d"], ""),
        ("alt", ["q", "q_d", "tau"], "alt_error"),
        ("sky", ["error"], "sky_error"),
    ]


def test_white_noise_has_the_density_of_its_variance_over_its_band() -> None:
    rate, sigma, rows = 1e3, 0.3, 100_000
    x = sigma * np.random.default_rng(1).standard_normal(rows)
    frequency, density = digest_of({"t": np.arange(rows) / rate, "error": x}).spectra["error"]
    high = frequency > 10
    np.testing.assert_allclose(np.mean(density[high] ** 2), 2 * sigma**2 / rate, rtol=0.03)


def test_a_sine_stands_at_its_frequency() -> None:
    t = np.arange(20_000) * 1e-3
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


def test_logarithmic_ticks_are_powers_of_ten() -> None:
    ruler = Ruler(1e-7, 1e2, 0.0, 90.0, log=True)
    assert ruler.labels()[0] == (pytest.approx(0.0, abs=1e-9), "10⁻⁷")
    assert ruler.labels()[-1][1] in ("10", "100")
    assert float(ruler.at(np.array(1e-1))) == pytest.approx(60.0)


def test_a_chart_draws_what_it_is_given_where_it_belongs() -> None:
    chart = Chart.over("a < b", "x", (0.0, 10.0), (0.0, 1.0), (572, 250))
    chart.line(np.array([0.0, 10.0]), np.array([0.5, np.nan]))
    drawn = ElementTree.fromstring(chart.svg())
    points = next(drawn.iter("polyline")).get("points")
    assert points == "62.0,120.0"
    assert drawn.get("aria-label") == "a < b"


@pytest.fixture
def page(tmp_path: Path) -> str:
    t = np.arange(1000) * 1e-3
    v = 1e-3 * np.cos(t)
    table = {"t": t, "q_d": np.sin(t), "q": np.sin(t) - 1e-6, "v": v, "tau": v, "friction": np.sign(v), "a&b": t}
    units = {"t": "s", "q_d": "rad", "q": "rad", "v": "rad/s", "tau": "N.m", "friction": "N.m"}
    component = {"file": "x.fmu", "fmi": "3.0", "tool": "a tool", "sha256": "0123456789abcdef", "parameters": {"k": 2}}
    origin = {"version": "mount-cosim 1", "command": "cosim run x", "decimation": 1, "components": {"plant": component}}
    Recording("run", table, units, origin).write(tmp_path / "run.parquet")
    scenario = parse_scenario(TEXT, "loop.toml", Path())
    return write_page(tmp_path / "run.html", tmp_path / "run.parquet", scenario, STATISTICS).read_text("utf-8")


def test_a_page_has_every_picture_and_says_what_ran(page: str) -> None:
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


def test_a_page_leads_with_the_tracking_error_and_says_the_speed_in_a_line_below(page: str) -> None:
    facts = re.search(r'<div class="facts">(.*?)</div><p class="quiet">(.*?)</p>', page)
    assert facts is not None
    names = re.findall(r"</b>([^<]*)<", facts[1])
    assert names == ["RMS tracking error", "largest error", "largest torque", "simulated"]
    assert re.match(r"<span><b>[\d.]+\xa0arcsec</b>", facts[1])
    assert facts[2].endswith("10 times real time, 1 µs a step with recording; no warnings.")


def test_the_explorer_opens_with_the_error_and_names_its_lines(page: str) -> None:
    data = json.loads(re.findall(r'id="recordings">(.*?)</script>', page, re.S)[0])
    assert data["recordings"][data["open"]]["titles"] == ["error [arcsec]"]
    assert "its set point, dashed" in page


def test_a_page_is_sound_and_needs_nothing_from_outside(page: str) -> None:
    alone = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"(?:\bsrc|href)\s*=|url\(|@import", alone)
    assert page.count("<script") == 2  # the data, and the explorer, which the policy lets run and nothing else
    assert "default-src &#x27;none&#x27;" in page
    for svg in re.findall(r"<svg.*?</svg>", page, re.DOTALL):
        ElementTree.fromstring(svg)
    assert len(page) < 200_000


def test_a_run_writes_its_page_unless_told_not_to(
    scenario: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert call("run", scenario, "--out", out) == 0
    assert f"pictures: {out / 'run.html'}" in capsys.readouterr().err
    text = (out / "run.html").read_text("utf-8")
    assert "<h1>loop</h1>" in text
    assert "error" in re.findall(r'class="title">(\w+)', text)
    assert call("run", scenario, "--out", tmp_path / "bare", "--no-page") == 0
    assert sorted(one.name for one in (tmp_path / "bare").iterdir()) == ["recording.parquet", "run.json"]


@pytest.mark.parametrize("rows", [1, 2, 70])
def test_short_and_constant_recordings_have_a_page_too(tmp_path: Path, rows: int) -> None:
    table = {"t": np.arange(rows) * 1.0, "q_d": np.zeros(rows), "q": np.zeros(rows), "v": np.zeros(rows)}
    origin = {"version": "mount-cosim 1", "decimation": 1}
    Recording("run", table | {"friction": np.ones(rows)}, {}, origin).write(tmp_path / "run.parquet")
    scenario = parse_scenario(TEXT, "loop.toml", Path())
    text = write_page(tmp_path / "run.html", tmp_path / "run.parquet", scenario, STATISTICS).read_text("utf-8")
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
