"""The report: one file, no network, says the answer, survives hostile names."""

import base64
import os
import re
import shutil
import subprocess
import sys
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_example import FOUND, REST, RIVALS, diagnosis
from report_example import report_of as page

from cosim.diagnosis.effects import TRIED
from cosim.diagnosis.measure.breakdown import part, samples
from cosim.plots.style import thin
from cosim.report import lead, render, words, write_report
from cosim.report.page import payload
from cosim.report.quantities import Scales
from cosim.report.tables import numbers
from cosim.report.terminal import summary

CASES = [("two", "rotary"), ("none", "rotary"), ("unknown", "rotary"), ("two", "linear")]
KINDS = pytest.mark.parametrize(("kind", "motion"), CASES)
HEADINGS = """Findings|Next experiment|Everything that was looked for|What stays unexplained|When|Where|
Validation|The worst seconds|Look at the recordings|Parameters of the base|How this was made"""
SIGNALS = ("t", "q", "v", "tau", "before", "after", "missing", "band")
BARE: dict[str, Any] = {name: {} for name in ("provenance", "improved", "base_parameters", "next_experiment")}


@KINDS
def test_page_is_one_small_file_that_asks_for_nothing(kind: str, motion: str) -> None:
    html = page(kind, motion)
    assert len(html.encode()) <= 1_000_000
    assert not re.search(r"https?://|//cdn|@import|url\((?!#)", html)
    assert not re.search(r"<(link|img|iframe|object|base)\b|\ssrc=", html)
    assert all(target.startswith("#") for target in re.findall(r'href="([^"]*)"', html))
    assert "default-src 'none'" in html


@KINDS
def test_ids_are_unique_and_every_reference_has_its_target(kind: str, motion: str) -> None:
    html = page(kind, motion).split('<script type="application/json"')[0]
    ids = re.findall(r'\sid="([^"]*)"', html)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'(?:href="#|url\(#)([^")]+)', html)) <= set(ids)


@KINDS
def test_html_is_well_formed(kind: str, motion: str) -> None:
    etree = pytest.importorskip("lxml.etree")
    parser = etree.HTMLParser()
    etree.fromstring(page(kind, motion), parser)
    assert [e.message for e in parser.error_log if not re.search(r"Tag \w+ invalid", e.message)] == []


def test_two_effects_are_told_on_the_first_screen() -> None:
    first = re.sub(r"<[^>]+>", " ", page().split("<h2>Findings")[0].split("</style>")[1])
    assert "Two effects are missing from the model" in first
    assert "The model lacks cogging (0.42 N·m) and friction asymmetry (0.26 N·m); a further error has" in first
    for text in (
        "0.39 to 0.45",
        "Detected",
        "Two possible causes",
        "Not confirmed",
        "mount_improved.fmu",
        "20 to 90°/s",
    ):
        assert text in first
    assert "2 other effects: not detected, limits in the table below; 2 not testable here" in first
    assert "Not detected: delay, clock skew. Not testable here: thermal drift, dwell break-away." in first


def test_nothing_missing_has_its_own_first_screen() -> None:
    html = page("none")
    assert "<h1>Nothing missing that these recordings can show</h1>" in html
    assert "0.4\N{NO-BREAK SPACE}ms" in html
    assert "No improved model was written" in html
    assert "Findings" not in re.sub(r"<style.*?</style>", "", html, flags=re.S)


def test_unknown_says_where_to_look_and_names_no_effect() -> None:
    html = page("unknown")
    assert "<h1>Something is missing that no known effect explains on the validation runs</h1>" in html
    assert re.search(r"position .*20\d to 2\d\d°.*forward only", html)
    assert "position, direction of motion" in html


def test_linear_axis_has_forces_and_lengths() -> None:
    html = page("two", "linear")
    assert "RMS force error [N]" in html
    assert "mm/s" in html
    assert "°/s" not in re.sub("Record one turn at 2°/s", "", html)


def test_every_section_and_answer_is_there() -> None:
    for heading in HEADINGS.replace("\n", "").split("|"):
        assert re.search(rf"<h2[^>]*>{heading}</h2>", page())
    for finding in diagnosis().findings:
        assert finding.title in page()
    assert "4be1" * 16 in page()
    assert "77a0" * 16 in page()


def test_hostile_names_stay_text() -> None:
    evil = "<script>alert(1)</script><b>\"'$x_1$"
    base = diagnosis()
    traces = tuple(replace(trace, name=f"{evil}{trace.name}", t=trace.t) for trace in base.traces)
    findings = tuple(replace(finding, title=evil + finding.title, statement=evil) for finding in base.findings)
    html = render(replace(base, mount=evil, traces=traces, findings=findings, data_quality=(evil,)))
    assert html.count("<script") == 2
    assert "&lt;script&gt;alert(1)" in html
    assert "<b>&#34;" not in html


def test_letters_of_any_script_raise_no_warning() -> None:
    base = diagnosis("none")
    traces = tuple(replace(trace, name="测量 ½") for trace in base.traces)
    assert "测量" in render(replace(base, traces=traces, mount="台"))


def test_report_is_reproducible(tmp_path: Path) -> None:
    path = write_report(diagnosis(), tmp_path / "report.html")
    assert path.read_text("utf-8") == page()
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize("effect", [*sorted(TRIED), "unheard_of"])
def test_every_effect_has_a_figure(effect: str) -> None:
    import matplotlib

    from cosim.plots.style import STYLE
    from cosim.report.figures_dynamic import effect as draw

    finding = replace(FOUND[0], effect=effect, parameters={"delay_ms": 3.0, "cycles_per_rev": 24.0})
    with matplotlib.rc_context(STYLE):
        picture = draw(finding, samples(diagnosis().traces), Scales.of(diagnosis()))
    assert picture is not None
    assert picture.caption
    assert len(picture.svg) < 60_000


def test_bare_and_short_diagnosis_still_makes_a_page() -> None:
    base = diagnosis()
    cut = tuple(replace(tr, **{name: getattr(tr, name)[:4000] for name in SIGNALS}) for tr in base.traces[2:])
    html = render(replace(base, traces=cut, regions=(), regions_after=(), **BARE))
    assert "Two effects are missing" in html


def test_parts_that_got_worse_are_called_worse() -> None:
    heldout = samples(diagnosis().traces[2:])
    assert part("run3", heldout).change == "better"
    assert part("run3", replace(heldout, before=heldout.after, after=heldout.before)).change == "worse"
    assert part("run3", replace(heldout, after=-heldout.before)).change == "no clear change"


def test_thinning_keeps_extremes_and_ends() -> None:
    x = np.arange(10_007.0)
    y = np.zeros(10_007)
    y[[1234, 7777]] = 5.0, -3.0
    thin_x, thin_y = thin(x, y, 100)
    assert len(thin_x) <= 203
    assert (thin_y.max(), thin_y.min()) == (5.0, -3.0)
    assert thin_x[-1] == 10_006
    assert np.all(np.diff(thin_x) >= 0)


def test_explorer_data_comes_back_within_its_step() -> None:
    recording = payload(diagnosis(), Scales.of(diagnosis()))["recordings"][0]
    deltas = np.frombuffer(zlib.decompress(base64.b64decode(recording["data"])), "<u2").reshape(4, -1)
    name, low, step = recording["signals"][0]
    values = low + step * np.cumsum(deltas[0], dtype=np.uint16)
    tau = diagnosis().traces[0].tau
    assert name == "tau"
    assert np.allclose((values.min(), values.max()), (tau.min(), tau.max()), atol=2 * step)


def test_further_waves_of_a_ripple_stand_in_its_table() -> None:
    rows = {row[0]: row[1] for row in numbers(FOUND[0]).rows}
    assert (rows["amplitude"], rows["amplitude, wave 2"], rows["phase, wave 2"]) == ("0.4200", "0.1250", "−0.3000")


def test_beside_another_teams_fmu_its_correction_is_what_to_use() -> None:
    whole = diagnosis("two")
    improved = whole.improved | {"correction": "correction.fmu", "ssp": "improved.ssp", "not_in_correction": ["delay"]}
    beside = replace(whole, provenance=whole.provenance | {"base_fmu": "theirs.fmu (SHA-256 0)"}, improved=improved)
    html, said = render(beside), " ".join(summary(beside).split())
    assert "Model <b>theirs.fmu</b>" in html
    assert "<b>correction.fmu</b> in front of theirs.fmu is proven" in html
    assert "A torque cannot stand for delay: that is in the card only." in html
    assert "missing from theirs.fmu" in said
    assert "improved.ssp correction.fmu" in said


def test_of_possible_causes_one_is_true_and_the_next_experiment_can_be_done() -> None:
    point = {"kind": "sine", "frequency": 0.5, "amplitude": 0.35}
    whole = diagnosis("two")
    rivals = replace(whole, verdict=("gravity_unbalance",), findings=RIVALS + REST, improved={})
    html = render(replace(rivals, next_experiment=rivals.next_experiment | {"set_point": point}))
    assert "That is a sine of 0.5\N{NO-BREAK SPACE}Hz and 20° to each side, up to 63°/s" in html
    assert "run2.parquet new_recording.parquet --heldout run3.parquet" in html
    assert "with the likeliest cause" in html


@pytest.mark.parametrize(("difference", "said"), [(0.08, "differ by 0.08"), (0.002, "and hardly: they")])
def test_an_experiment_that_noise_would_hide_is_said_to_need_more_motion(difference: float, said: str) -> None:
    whole = diagnosis("two")
    html = render(replace(whole, next_experiment=whole.next_experiment | {"expected_difference": difference}))
    assert said in html
    assert ("Record motion that goes further or faster" in html) == (difference < 0.01)  # what the first table orders


def test_importing_the_report_does_not_load_matplotlib() -> None:
    code = "import cosim.report, cosim.report.terminal, sys; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


PROBE = """<script>addEventListener("load", () => setTimeout(() => { const svg = [...document.querySelectorAll("svg")];
document.body.dataset.probe = [document.documentElement.scrollWidth <= innerWidth, explorer.dataset.ready,
Math.min(...svg.filter(s => s.clientWidth).map(s => 12.5 * s.clientWidth / s.viewBox.baseVal.width)) >= 12].join();
}, 300))</script>"""
FLAGS = """--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
--disable-component-update --disable-sync --enable-logging=stderr --virtual-time-budget=5000 --dump-dom"""


@pytest.mark.parametrize(("kind", "motion", "width"), [(*CASES[0], 1280), (*CASES[2], 390), (*CASES[3], 390)])
def test_browser_shows_it_without_complaint(kind: str, motion: str, width: int, tmp_path: Path) -> None:
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("chromium is not installed")
    home = {**os.environ, "HOME": str(tmp_path)}
    (tmp_path / "report.html").write_text(page(kind, motion), "utf-8")
    (tmp_path / "probed.html").write_text(re.sub(r"<meta http-equiv.*", "", page(kind, motion)) + PROBE, "utf-8")
    for name, expected in (("report", 'data-ready="yes"'), ("probed", 'data-probe="true,yes,true"')):
        command = [chromium, *FLAGS.split(), f"--user-data-dir={tmp_path / name}", f"--window-size={width},844"]
        command.append((tmp_path / f"{name}.html").as_uri())
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=home)
        assert expected in done.stdout, re.findall(r'data-probe="[^"]*"', done.stdout)
        assert "CONSOLE" not in done.stderr


def test_a_proposed_friction_law_is_told_on_page_and_terminal_and_the_bases_own_is_not() -> None:
    told = diagnosis("two")
    said = "Friction law: maxwell_slip instead of lugre would reduce the residual variance by up to 8 %"
    assert words.law(told).startswith(said)
    assert said in render(told)
    assert said in " ".join(summary(told).split())
    assert words.law(replace(told, friction_law={"base": "lugre", "proposed": "lugre", "gain": 0.0})) == ""
    bent = words.law(replace(told, friction_law={"base": "lugre", "proposed": "lugre", "gain": 0.0, "curve": 0.87}))
    assert "a curve over speed that is not that of lugre would reduce the residual variance by up to 87 %" in bent


def test_something_unknown_stands_beside_what_is_named() -> None:
    both = replace(diagnosis("two"), verdict=("cogging", "friction_asymmetry", "unknown"), depends_on=("time",))
    assert lead.heading(both).endswith("effects are missing from the model; part of the error fits no known effect")
    said = " ".join(lead.lead(both, Scales.of(both)))
    assert "cogging (0.42 N·m)" in said
    assert len(lead.lead(both, Scales.of(both))) == 2
    assert "other known effects" in said
    assert "The remaining error correlates with: time" in summary(both)
    rivals = tuple(finding for finding in both.findings if finding.answer != "found")
    open_question = replace(both, findings=rivals, verdict=("gravity_unbalance", "unknown"))
    assert lead.heading(open_question).endswith("; part of the error fits no known effect")
