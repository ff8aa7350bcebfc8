"""The report: one file, no network, says the answer, survives hostile names."""

import base64
import io
import os
import re
import shutil
import subprocess
import sys
import time
import zlib
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.diagnosis.report import render, words, write_report
from cosim.diagnosis.report.derive import part, samples
from cosim.diagnosis.report.explorer import payload
from cosim.diagnosis.report.figures_dynamic import VIEWS
from cosim.diagnosis.report.figures_proof import relative
from cosim.diagnosis.report.quantities import Scales
from cosim.diagnosis.report.tables import limits, numbers
from cosim.diagnosis.result import Diagnosis, Finding, HeldOut, Region, Trace, Where
from cosim.diagnosis.terminal import summary
from cosim.pictures.quantities import minus, number, raised
from cosim.pictures.style import thin

RATE, SECONDS = 1000, 60
FLOOR = 0.16


def motion(seed: int, scale: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (t, q, v) of a machine that sweeps back and forth at several speeds, with stops."""
    rng = np.random.default_rng(seed)
    t = np.arange(SECONDS * RATE) / RATE
    level = np.repeat(rng.uniform(0.3, 1.6, SECONDS // 3) * np.tile([1, -1], SECONDS // 6), 3 * RATE)
    level[np.repeat(rng.random(SECONDS // 3) < 0.15, 3 * RATE)] = 0.0
    v = np.convolve(np.pad(level, 200, mode="edge"), np.hanning(401) / np.hanning(401).sum(), "valid") * scale
    return t, 2.0 + np.cumsum(v) / RATE, v


def trace(name: str, seed: int, heldout: bool, missing: str, scale: float = 1.0) -> Trace:
    t, q, v = motion(seed, scale)
    rng = np.random.default_rng(seed + 100)
    noise = np.convolve(rng.normal(0, 1, t.size + 32), np.hanning(33), "valid")[: t.size]
    noise *= FLOOR / noise.std()
    base = 0.8 * np.gradient(v, t) + 1.1 * np.tanh(v / 0.01 / scale) + 0.2 * v / scale
    extra = {
        "two": 0.42 * np.cos(24 * q + 0.4) + 0.13 * np.abs(np.tanh(v / 0.01)) + 0.1 * np.sin(q),
        "none": np.zeros_like(t),
        "unknown": 0.9 * np.exp(-(((np.mod(q, 2 * np.pi) - 3.7) / 0.2) ** 2)) * (v > 0),
    }[missing]
    after = base + (extra - 0.1 * np.sin(q) if missing == "two" else 0.0)
    gap = base + extra + noise - base
    return Trace(
        name=name, heldout=heldout, t=t, q=q, v=v, tau=base + extra + noise, before=base, after=after,
        missing=gap, band=np.full_like(t, 2 * FLOOR), intervals=((10.0, 12.5),) if missing != "none" else (),
    )  # fmt: skip


def region(axis: str, unit: str, traces: tuple[Trace, ...], after: bool) -> Region:
    x = np.concatenate(
        [np.sign(tr.v) if axis == "direction" else tr.q if axis == "position" else tr.v for tr in traces]
    )
    y = np.concatenate([tr.tau - tr.after if after else tr.missing for tr in traces])
    edges = np.array([-1.5, 0, 1.5]) if axis == "direction" else np.linspace(x.min() - 0.2, x.max() + 0.2, 41)
    count, total = np.histogram(x, edges)[0].astype(float), np.histogram(x, edges, weights=y)[0]
    mean = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
    centres = np.array([-1.0, 1.0]) if axis == "direction" else 0.5 * (edges[1:] + edges[:-1])
    band = np.where(count > 0, 1.96 * FLOOR / np.sqrt(np.maximum(count / 30, 1)), np.nan)
    return Region(axis=axis, unit=unit, centres=centres, mean=mean, band=band, count=count)


FOUND = (
    Finding(
        effect="cogging", title="Cogging", answer="found", probability=0.97, gain=0.62,
        parameters={"cycles_per_rev": 24.0, "amplitude": 0.42, "phase": 0.4, "harmonics": [
            {"cycles_per_rev": 48.0, "amplitude": 0.125, "phase": -0.3}]},
        units={"amplitude": "N·m", "phase": "rad"},
        standard_errors={"amplitude": 0.015, "phase": 0.03}, ranges={"amplitude": (0.39, 0.45), "phase": (0.34, 0.46)},
        size="0.42 N·m", size_range="0.39 to 0.45", visible_from=0.05,
        statement="The motor tugs 24 times per turn, 0.42 N·m; it has 24 slots, nothing needs repair",
        where=Where(axis="position", description="the whole turn, same phase at all six speeds"),
        ruled_out=("gear mesh (40 per turn)", "current-loop resonance (fixed in Hz)"),
        evidence="24 per turn equals the slot count in the model card", action="Use the improved FMU",
    ),
    Finding(
        effect="friction_asymmetry", title="Friction asymmetry", answer="found", probability=0.93, gain=0.2,
        parameters={"level_asymmetry": 0.118}, ranges={"level_asymmetry": (0.095, 0.14)}, size="0.26 N·m",
        size_range="0.21 to 0.31", statement="Turning forward takes 0.26 N·m more than backward.", visible_from=0.08,
        where=Where(axis="speed", description="every speed", regions=((0.35, 1.57),)),
        evidence="it follows the direction of motion and is absent at standstill",
        ruled_out=("torque sensor zero (would stay at standstill)",), action="Check clamp brake and lip seal",
    ),
)  # fmt: skip
RIVALS = (
    Finding(
        effect="gravity_unbalance", title="Gravity unbalance", answer="ambiguous", probability=0.5, gain=0.05,
        parameters={"mgl": 0.1}, size="0.10 N·m", size_range="0.04 to 0.15", visible_from=0.06,
        statement="Either the load or the encoder ring is off centre. One slow turn with stops will tell.",
        told_apart_by="an off-centre load needs holding torque at standstill, an off-centre ring does not",
    ),
    Finding(
        effect="encoder_eccentricity", title="Encoder eccentricity", answer="ambiguous", probability=0.4, gain=0.04,
        parameters={"amplitude_rad": 3e-5}, size="0.002 °", size_range="0.001 to 0.003", visible_from=0.0012,
    ),
)  # fmt: skip


def other(effect: str, title: str, answer: Any, **more: Any) -> Finding:
    return Finding(effect=effect, title=title, answer=answer, probability=0.01, gain=0.0, **more)


STRIBECK = {"size": "0.05 N·m", "size_range": "-0.01 to 0.11", "statement": "Starting takes a little more than turning"}
WARMED = {"evidence": "the motor warmed only 0.3 K", "action": "record 20 min from cold"}
STOPPED = {"evidence": "longest stop 0.3 s", "action": "stop for 1, 10 and 100 s"}
REST = (
    other("delay", "Delay", "not_seen", visible_from=0.4, units={"delay_ms": "ms"}),
    other("clock_skew", "Clock skew", "not_seen", visible_from=3.0, units={"drift_ppm": "ppm"}),
    other("stribeck", "Stribeck", "not_proven", visible_from=0.04, **STRIBECK),
    other("thermal_viscosity", "Thermal drift", "not_testable", **WARMED),
    other("dwell_breakaway", "Dwell break-away", "not_testable", **STOPPED),
)
PROVENANCE: dict[str, Any] = {
    "version": "0.1.0",
    "command": "cosim diagnose run1.parquet run2.parquet --heldout run3.parquet --card mount.toml --out result",
    "date": "2026-11-18",
    "seed": 0,
    "card": {"name": "mount.toml", "sha256": "77a0" * 16},
    "recordings": [
        {"name": f"run{i}.parquet", "sha256": f"4be{i}" * 16, "role": role, "seconds": 60.0, "rate_hz": 1000.0}
        for i, role in ((1, "fitted"), (2, "fitted"), (3, "held out"))
    ],
}


@cache
def diagnosis(kind: str = "two", motion: Any = "rotary", mount: str = "C1 rotary table") -> Diagnosis:
    linear = motion == "linear"
    scale = 0.05 if linear else 1.0
    traces = tuple(trace(f"run{i}", i, i == 3, kind, scale) for i in (1, 2, 3))
    units = ("m", "m/s") if linear else ("rad", "rad/s")
    axes = (("position", units[0]), ("speed", units[1]), ("direction", "1"))
    rms = {"two": (0.37, 0.18), "none": (0.17, 0.17), "unknown": (0.39, 0.39)}[kind]
    findings = {"two": FOUND + RIVALS + REST, "none": REST[:2] + REST[3:], "unknown": REST}[kind]
    return Diagnosis(
        verdict={"two": ("cogging", "friction_asymmetry"), "none": (), "unknown": ("unknown",)}[kind],
        findings=findings, traces=traces, mount=mount, motion=motion,
        heldout=HeldOut(
            name="run3", nominal_rms=0.52, before_rms=rms[0], after_rms=rms[1], floor_rms=FLOOR,
            confidence_interval=(0.15, 0.22) if kind == "two" else (-0.01, 0.01),
            sliding={"before_rms": 0.35, "after_rms": 0.17, "cutoff_hz": 30.0},
            position={"before": 1e-4, "after": 4e-5},
        ),
        regions=tuple(region(axis, unit, traces, False) for axis, unit in axes),
        regions_after=tuple(region(axis, unit, traces, True) for axis, unit in axes),
        ambiguous_with=(("gravity_unbalance", "encoder_eccentricity"),) if kind == "two" else (),
        next_experiment={
            "separates": ["gravity_unbalance", "encoder_eccentricity"], "scenario": "next_experiment.toml",
            "expected_difference": 0.08, "description": "Record one turn at 2°/s with a 3 s stop every 45°",
        } if kind == "two" else {},
        depends_on=("position", "direction of motion") if kind == "unknown" else (),
        data_quality=("3 gaps (0.2 s) left out", "offset of 12 ms removed"),
        friction_law={"base": "lugre", "proposed": "maxwell_slip", "gain": 0.08} if kind == "two" else {},
        base_parameters={"inertia": (0.8, 0.82, 0.801), "Fc": (1.0, 1.13, 1.10), "sigma2": (0.25, 0.21, 0.2)},
        provenance=PROVENANCE, seconds=12.3,
        improved={"card": "card.toml", "fmu": "mount_improved.fmu", "speed": [0.35, 1.57]} if kind == "two" else {},
    )  # fmt: skip


@cache
def page(kind: str = "two", motion: str = "rotary") -> str:
    return render(diagnosis(kind, motion))


CASES = [("two", "rotary"), ("none", "rotary"), ("unknown", "rotary"), ("two", "linear")]
KINDS = pytest.mark.parametrize(("kind", "motion"), CASES)
HEADINGS = """Findings|Next experiment|Everything that was looked for|What stays unexplained|When|Where|
Proof on unseen runs|The worst seconds|Look at the recordings|Parameters of the base|How this was made"""
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
    assert "Turning forward takes 0.26 N·m more than backward." in first
    for text in ("0.39 to 0.45", "Found", "Two possible causes", "Not proven", "mount_improved.fmu", "20 to 90°/s"):
        assert text in first
    assert "Not seen: delay, clock skew. These recordings cannot show: thermal drift, dwell break-away." in first


def test_nothing_missing_has_its_own_first_screen() -> None:
    html = page("none")
    assert "<h1>Nothing missing that these recordings can show</h1>" in html
    assert "0.4\N{NO-BREAK SPACE}ms" in html
    assert "No improved model was written" in html
    assert "Findings" not in re.sub(r"<style.*?</style>", "", html, flags=re.S)


def test_unknown_says_where_to_look_and_names_no_effect() -> None:
    html = page("unknown")
    assert "<h1>Something is missing, and it is none of the effects cosim knows</h1>" in html
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


def test_report_is_reproducible_and_quick(tmp_path: Path) -> None:
    start = time.process_time()
    path = write_report(diagnosis(), tmp_path / "report.html")
    assert time.process_time() - start <= 3.0
    assert path.read_text("utf-8") == page()
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize("effect", [*sorted(VIEWS), "unheard_of"])
def test_every_effect_has_a_figure(effect: str) -> None:
    import matplotlib

    from cosim.diagnosis.report.figures_dynamic import effect as draw
    from cosim.pictures.style import STYLE

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


def test_where_nothing_is_missing_no_effect_is_left_out_of_the_first_screen_and_no_gain_is_claimed() -> None:
    whole = diagnosis("none")
    cells = " ".join(row[0] for row in limits(whole).rows).lower()
    assert all(one.title.lower() in cells for one in whole.findings if one.answer in ("not_seen", "not_testable"))
    assert "so there is no gain to prove" in page("none")
    assert "so there is no gain to prove" not in page("two")


def test_beside_another_teams_fmu_its_correction_is_what_to_use() -> None:
    whole = diagnosis("two")
    improved = whole.improved | {"correction": "correction.fmu", "ssp": "improved.ssp", "not_in_correction": ["delay"]}
    beside = replace(whole, provenance=whole.provenance | {"base_fmu": "theirs.fmu (SHA-256 0)"}, improved=improved)
    html, said = render(beside), " ".join(summary(beside).split())
    assert "Model <b>theirs.fmu</b>" in html
    assert "<b>correction.fmu</b> in front of theirs.fmu is proven" in html
    assert "No torque can give delay: that is in the card only." in html
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


def test_units_are_printed_with_powers() -> None:
    assert raised("N.m.s2/rad2") == "N·m·s²/rad²"


def test_numbers_read_well() -> None:
    assert [number(x) for x in (0.4203, 0.0, -12.34, 1234.0, float("nan"))] == ["0.42", "0", "−12", "1,200", "–"]
    assert minus("-0.01 to 0.11, run-3") == "−0.01 to 0.11, run-3"
    assert relative(FOUND[0]) == pytest.approx((8.4, 7.8, 9.0))


@KINDS
def test_terminal_summary_fits_80_columns(kind: str, motion: str) -> None:
    from cosim.diagnosis.terminal import summary

    text = summary(diagnosis(kind, motion))
    assert max(map(len, text.splitlines())) <= 80
    assert "not seen" in text
    assert "\033" not in text
    assert ("EITHER    gravity unbalance" in text) == (kind == "two")


def test_terminal_is_bold_only_where_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    from cosim.diagnosis.terminal import print_summary, summary

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    for variable, value, bold in (("TERM", "xterm", True), ("TERM", "dumb", False), ("NO_COLOR", "1", False)):
        monkeypatch.delenv("NO_COLOR", raising=False)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv(variable, value)
        print_summary(diagnosis(), out := Terminal())
        assert ("\033[1m" in out.getvalue()) == bold
    assert "\033" not in summary(diagnosis(mount="\033[31mred"))


def test_importing_the_report_does_not_load_matplotlib() -> None:
    code = "import cosim.diagnosis.report, cosim.diagnosis.terminal, sys; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


PROBE = """<script>addEventListener("load", () => setTimeout(() => { const svg = [...document.querySelectorAll("svg")];
document.body.dataset.probe = [document.documentElement.scrollWidth <= innerWidth, explorer.dataset.ready,
Math.min(...svg.filter(s => s.clientWidth).map(s => 12.5 * s.clientWidth / s.viewBox.baseVal.width)) >= 12].join();
}, 300))</script>"""
FLAGS = """--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
--disable-component-update --disable-sync --enable-logging=stderr --virtual-time-budget=5000 --dump-dom"""


@pytest.mark.parametrize("width", [390, 1280])
@KINDS
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
    said = "Friction law: maxwell_slip in place of lugre would remove up to 8 % of the error energy"
    assert words.law(told).startswith(said)
    assert said in render(told)
    assert said in " ".join(summary(told).split())
    assert words.law(replace(told, friction_law={"base": "lugre", "proposed": "lugre", "gain": 0.0})) == ""


def test_something_unknown_stands_beside_what_is_named() -> None:
    both = replace(diagnosis("two"), verdict=("cogging", "friction_asymmetry", "unknown"), depends_on=("time",))
    assert words.heading(both).endswith("effects are missing from the model, and something unknown")
    lead = " ".join(words.lead(both, Scales.of(both)))
    assert "24 times per turn" in lead
    assert "other known effects" in lead
    assert "The rest goes with: time" in summary(both)
    rivals = tuple(finding for finding in both.findings if finding.answer != "found")
    open_question = replace(both, findings=rivals, verdict=("gravity_unbalance", "unknown"))
    assert "more than one possible cause, and something unknown" in words.heading(open_question)
