"""A sweep is a table with a row for each run, whatever the runs do to it and however often it is interrupted."""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from math import inf, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from pyarrow import parquet
from test_cli_run import ENVIRONMENT, call
from tiny_fmu import tiny

import cosim.sweep.pool
from cosim.errors import FmuError, OutputError, SweepError, WiringError
from cosim.formats import ORIGIN_KEY, UNIT_KEY
from cosim.recording import Recording
from cosim.scenario import Scenario, read_scenario
from cosim.sweep import Summary, conduct, read_sweep
from cosim.sweep.statistics import KINDS, Statistic
from cosim.sweep.variation import Normal, Range, Values, Variation

__all__ = ["tiny"]

SCENARIO = """
step = 1e-3
stop = 0.5
[components.plant]
fmu = "{fmu}"
[signals.r]
kind = "constant"
value = 1.0
unit = "rad"
[[connections]]
from = "r"
to = "plant.a"
[[connections]]
from = "plant.y"
to = "plant.b"
[record]
signals = { q = "plant.y", r = "r" }
"""
SWEEP = """
scenario = "loop.toml"
[vary]
"plant.k" = [1.0, 2.0, 4.0]
"r.value" = { low = 0.5, high = 1.5, count = 3 }
[statistics]
end = { signal = "q", kind = "final" }
error = { signal = "r", minus = "q", kind = "rms", from = 0.1, to = 0.4, unit = "mrad" }
"""
K = '"plant.k" = [1.0, 2.0, 4.0]'
R = '"r.value" = { low = 0.5, high = 1.5, count = 3 }'


@pytest.fixture
def folder(tiny: dict[int, Path], tmp_path: Path) -> Path:
    (tmp_path / "loop.toml").write_text(SCENARIO.replace("{fmu}", str(tiny[3])))
    (tmp_path / "sweep.toml").write_text(SWEEP)
    return tmp_path


def written(folder: Path, *changes: tuple[str, str]) -> Path:
    """Write the sweep with changes and return its path."""
    text = SWEEP
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "sweep.toml"
    path.write_text(text)
    return path


def appended(path: Path, text: str) -> Path:
    path.write_text(path.read_text() + text)
    return path


def run(path: Path, **settings: Any) -> tuple[Summary, pd.DataFrame]:
    sweep = read_sweep(path)
    done = conduct(sweep, scenario_of(path), path.parent / "out", **({"workers": 1} | settings))
    return done, pd.read_parquet(done.table)


def scenario_of(path: Path) -> Scenario:
    return read_scenario(read_sweep(path).scenario)


def test_a_grid_is_every_combination_and_each_row_is_its_own_run(folder: Path) -> None:
    done, table = run(folder / "sweep.toml", workers=2)
    assert (done.runs, done.done, done.found, done.failed) == (9, 9, 0, 0)
    assert list(table) == ["run", "plant.k", "r.value", "end", "error", "seconds", "status", "reason"]
    assert table[["plant.k", "r.value"]].values.tolist() == [[k, r] for k in (1, 2, 4) for r in (0.5, 1.0, 1.5)]
    # y' = k (r - y) by Euler: y_n = r (1 - (1 - k h)^n), seen at the last row, n = 499
    np.testing.assert_allclose(table["end"], table["r.value"] * (1 - (1 - 1e-3 * table["plant.k"]) ** 499), rtol=1e-12)
    window = np.arange(100, 401)[:, np.newaxis]
    left = table["r.value"].to_numpy() * (1 - 1e-3 * table["plant.k"].to_numpy()) ** window
    np.testing.assert_allclose(table["error"], 1e3 * np.sqrt(np.mean(left**2, axis=0)), rtol=1e-12)
    assert set(table["status"]) == {"ok"}
    assert (table["seconds"] > 0).all()


def test_the_table_says_its_units_and_what_made_it(folder: Path) -> None:
    done, _ = run(written(folder, ('"rms"', '"ise"'), (R, '"plant.a.gain" = [1.0]')), command="cosim sweep x")
    schema = parquet.read_schema(done.table)
    units = {name: schema.field(name).metadata[UNIT_KEY].decode() for name in ("plant.k", "end", "error", "seconds")}
    assert units == {"plant.k": "1", "end": "rad", "error": "mrad2.s", "seconds": "s"}
    origin = json.loads(schema.metadata[ORIGIN_KEY])
    assert origin["command"] == "cosim sweep x"
    assert origin["scenario"] == (folder / "loop.toml").read_text()


def test_wires_signals_and_parameters_shared_by_name_are_varied(folder: Path) -> None:
    both = 'k = { of = ["plant.k", "plant.a.gain"], low = 1.0, high = 2.0, count = 2 }'
    _, table = run(written(folder, (K, both), (R, '"plant.b.offset" = [0.0, 0.25]')))
    assert list(table)[1:3] == ["k", "plant.b.offset"]
    k, offset = table["k"], table["plant.b.offset"]
    np.testing.assert_allclose(table["end"], (k - offset) * (1 - (1 - 1e-3 * k) ** 499), rtol=1e-12)


def test_a_number_of_workers_changes_nothing_but_time(folder: Path) -> None:
    path = written(folder, (K, '"plant.k" = { low = 1.0, high = 4.0 }'), (", count = 3", ""))
    path.write_text('method = "monte_carlo"\nruns = 12\nseed = 5\n' + path.read_text())
    tables = [run(path, workers=workers, force=True)[1].drop(columns="seconds") for workers in (1, 3)]
    pd.testing.assert_frame_equal(*tables)
    path.write_text(path.read_text().replace("seed = 5", "seed = 6"))
    assert not run(path, force=True)[1]["end"].equals(tables[0]["end"])


@pytest.mark.parametrize(
    ("parameters", "status", "reason"),
    [
        ("fail_at = 0.3", "failed", 'plant returned an error at tick 300 (0.3 s); it said "the shaft broke"; its last'),
        ("nan_at = 0.3", "failed", "plant gave an output that is not a finite number at tick 300 (0.3 s)"),
        (
            "fail_at = 0.3, status = 11",
            "crashed",
            "The process of this run crashed: it was ended by signal 11, SIGSEGV",
        ),
        ("fail_at = 0.3, status = 12", "timeout", "It was given up: no answer within 2 s."),
    ],
)
def test_a_run_that_goes_wrong_costs_its_row_and_no_other(
    folder: Path, parameters: str, status: str, reason: str
) -> None:
    # k = 1e9 is what starts the trouble: the others keep the start value, which is never reached
    name, _, rest = parameters.partition(" = ")
    value, _, more = rest.partition(", ")
    scenario = (folder / "loop.toml").read_text()
    kind = f"parameters = {{ {more} }}\n" if more else ""
    (folder / "loop.toml").write_text(scenario.replace("[signals.r]", f"{kind}[signals.r]"))
    path = written(folder, (K, f'"plant.{name}" = [1e9, {value}, 1e8]'), (R, '"plant.k" = [1.0, 2.0]'))
    path.write_text("timeout = 2.0\n" + path.read_text())
    done, table = run(path)
    assert done.failed == 2
    assert table["status"].tolist() == ["ok", "ok", status, status, "ok", "ok"]
    assert table["reason"][2].startswith(reason)
    assert table["end"].isna().tolist() == [False, False, True, True, False, False]
    assert (table["reason"].drop([2, 3]) == "").all()


def test_a_value_that_a_component_or_signal_refuses_is_a_row(folder: Path) -> None:
    path = written(folder, (K, '"plant.k" = [-1.0, 1.0]'), (R, '"plant.b.quantum" = [-1.0, 0.0]'))
    _, table = run(path)
    assert table["status"].tolist() == ["failed"] * 3 + ["ok"]
    assert table["reason"][1] == '"plant.k" is -1; it must lie in 0 .. inf 1.'
    assert table["reason"][2] == "The quantum of the wire to plant.b is -1; it must not be negative."


def test_a_finished_sweep_is_not_run_again_and_failures_only_when_asked(folder: Path) -> None:
    path = written(folder, (K, '"plant.k" = [-1.0, 1.0, 2.0]'))
    first, table = run(path)
    again, same = run(path)
    assert (first.done, again.done, again.found, again.failed) == (9, 0, 9, 3)
    pd.testing.assert_frame_equal(table, same)
    retried, _ = run(path, retry=True)
    assert (retried.done, retried.found, retried.failed) == (3, 6, 3)


def test_a_killed_sweep_goes_on_where_it_was(folder: Path) -> None:
    path = written(folder, (K, '"plant.k" = { low = 1.0, high = 9.0, count = 20 }'))
    whole, table = run(path)
    lines = (folder / "out" / "runs.jsonl").read_bytes().splitlines(keepends=True)
    (whole.table).unlink()
    # What a kill leaves: the lines before, and one that was being written.
    (folder / "out" / "runs.jsonl").write_bytes(b"".join(lines[:51]) + lines[51][:20])
    rest, same = run(path)
    assert (rest.found, rest.done) == (51, 9)
    pd.testing.assert_frame_equal(table.drop(columns="seconds"), same.drop(columns="seconds"))


@pytest.fixture
def started(folder: Path) -> Iterator[Callable[[], "subprocess.Popen[str]"]]:
    """Start a sweep that takes long, in a process that heeds SIGINT however the tests were started."""
    written(folder, (K, '"plant.k" = { low = 1.0, high = 9.0, count = 100000 }'))
    begin = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from cosim.cli import main; main()"
    )
    command = [sys.executable, "-c", begin, "sweep", "sweep.toml", "--out", "out", "--workers", "2"]
    processes = []

    def start() -> "subprocess.Popen[str]":
        process = subprocess.Popen(command, env=ENVIRONMENT, cwd=folder, stderr=subprocess.PIPE, text=True)
        processes.append(process)
        return process

    yield start
    for process in processes:
        if process.poll() is None:
            process.kill()
            process.communicate()


def wait_for(path: Path, lines: int) -> None:
    until = time.monotonic() + 60
    while time.monotonic() < until and (not path.exists() or path.read_bytes().count(b"\n") < lines):
        time.sleep(0.05)


def children(process: "subprocess.Popen[str]") -> list[int]:
    found = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(process.pid)], capture_output=True, text=True, check=False
    )
    return [int(line) for line in found.stdout.split()]


def gone(pids: list[int]) -> bool:
    until = time.monotonic() + 10
    while any(Path(f"/proc/{pid}").exists() for pid in pids) and time.monotonic() < until:
        time.sleep(0.05)
    return not any(Path(f"/proc/{pid}").exists() for pid in pids)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="it looks for processes as Linux shows them")
def test_kill_9_and_ctrl_c_lose_nothing_that_was_done(
    folder: Path, started: Callable[[], "subprocess.Popen[str]"]
) -> None:
    process, journal = started(), folder / "out" / "runs.jsonl"
    wait_for(journal, 5)
    with pytest.raises(OutputError, match=r"Another sweep is writing to .*out; wait for it, or end it"):
        run(folder / "sweep.toml")
    workers = children(process)
    process.kill()
    process.communicate()
    assert len(workers) == 2
    assert gone(workers)  # they see their parent's end
    before = journal.read_bytes().count(b"\n")
    process = started()
    wait_for(journal, before + 5)
    workers = children(process)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.endswith("the same command goes on from there\ncosim: interrupted\n")
    assert "Traceback" not in said
    assert gone(workers)
    table = pd.read_parquet(folder / "out" / "table.parquet")
    assert table["run"].is_unique
    assert len(table) >= before + 5
    assert set(table["status"]) == {"ok"}


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda folder: written(folder, ("low = 0.5", "low = 0.6")), "sweep file"),
        (
            lambda folder: (folder / "loop.toml").write_text((folder / "loop.toml").read_text() + "decimation = 2\n"),
            "scenario",
        ),
    ],
)
def test_a_folder_of_another_sweep_is_refused(folder: Path, change: Callable[[Path], object], named: str) -> None:
    run(folder / "sweep.toml")
    change(folder)
    rule = f"out holds another sweep: its {named} differ from now; give another --out, or --force to start over."
    with pytest.raises(OutputError, match=re.escape(rule)):
        run(folder / "sweep.toml")
    assert run(folder / "sweep.toml", force=True)[0].done == 9


def test_a_changed_fmu_makes_it_another_sweep(folder: Path, tiny: dict[int, Path]) -> None:
    path = folder / "tiny.fmu"
    path.write_bytes(tiny[3].read_bytes())
    (folder / "loop.toml").write_text(SCENARIO.replace("{fmu}", "tiny.fmu"))
    run(folder / "sweep.toml")
    path.write_bytes(tiny[2].read_bytes())
    with pytest.raises(OutputError, match=r"its file of components.plant differ from now"):
        run(folder / "sweep.toml")


def test_force_removes_what_a_sweep_made_and_nothing_else(folder: Path) -> None:
    (folder / "out").mkdir()
    (folder / "out" / "notes.txt").write_text("mine")
    run(written(folder, ("[vary]", "record = true\n[vary]")))
    assert len(list((folder / "out" / "recordings").iterdir())) == 9
    run(folder / "sweep.toml", force=True)
    assert (folder / "out" / "notes.txt").read_text() == "mine"
    (folder / "out" / "sweep.json").unlink()
    with pytest.raises(OutputError, match="exists already; give --force"):
        run(folder / "sweep.toml")


def test_recordings_are_kept_when_asked_for_and_agree_with_the_table(folder: Path) -> None:
    _, table = run(written(folder, ("[vary]", "record = true\ndecimation = 3\n[vary]")))
    kept = Recording.read(folder / "out" / "recordings" / "000004.parquet", required=())
    assert kept.columns == ("t", "q", "r")
    assert kept["q"][-1] == table["end"][4]
    assert kept.units["q"] == "rad"
    assert len(kept) == 167


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[vary]", "rums = 3\n[vary]", '"rums" is no key of a sweep; keys there are: scenario, method, runs, seed,'),
        (K + "\n" + R, "", "vary breaks a rule: dictionary should have at least 1 item"),
        (K, '"plant.k" = []', "vary.plant.k: values breaks a rule: tuple should have at least 1 item"),
        (
            K,
            '"plant.k" = { low = 1.0, high = 2.0 }',
            "vary.plant.k has no points: a grid needs a list of values, or low,",
        ),
        (
            K,
            '"plant.k" = { mean = 1.0, std = 0.1 }',
            "vary.plant.k has no points: a grid needs a list of values, or low,",
        ),
        (
            K,
            '"plant.k" = { mean = 1.0, std = -0.1 }',
            "vary.plant.k: std = -0.1 breaks a rule: input should be greater",
        ),
        (
            K,
            '"plant.k" = { low = 1.0, high = 2.0, count = 0 }',
            "vary.plant.k: count = 0 breaks a rule: input should be",
        ),
        (
            K,
            '"plant.k" = { low = 1.0, high = 2.0, cuont = 1 }',
            '"cuont" is no key of it; keys there are: of, low, high,',
        ),
        (K, '"plant.k" = { low = 2.0, high = 1.0, count = 2 }', "low = 2 must be below high = 1"),
        (K, '"plant.k" = { low = 0.0, high = 1.0, count = 2, scale = "log" }', 'scale = "log" needs low above 0'),
        (
            K + "\n" + R,
            '"plant.k" = { low = 1.0, high = 9.0, count = 3000 }\n' + R.replace("count = 3", "count = 1000"),
            "asks for 3,000,000 runs; 1,000,000 is the most of one sweep.",
        ),
        (K, '"plant.k" = [1.0]\nk = { of = "plant.k", values = [2.0] }', '"plant.k" is varied twice; once is enough'),
        (K, 'run = { of = "plant.k", values = [2.0] }', "vary.run: every table has a column of this name"),
        (
            "end =",
            '"plant.k" =',
            "statistics.plant.k: choose another name; the columns run, seconds, status, reason and",
        ),
        ('"final"', '"median"', "statistics.end.kind = 'median' breaks a rule: input should be 'mean', 'std', 'min',"),
        (
            'kind = "final"',
            'kind = "final", form = 1',
            '"statistics.end.form" is no key of a sweep; keys there are: signal,',
        ),
        ("from = 0.1", "from = 0.5", "statistics.error breaks a rule: from = 0.5 must be before to = 0.4."),
        (
            "[vary]",
            "runs = 5\n[vary]",
            'runs = 5 does not go with method = "grid", whose counts say how many there are',
        ),
        ("[vary]", "seed = -1\n[vary]", "seed = -1 breaks a rule: input should be greater than or equal to 0."),
        (
            "[vary]",
            'method = "latin_hypercube"\n[vary]',
            'method = "latin_hypercube" needs runs, how many points are drawn',
        ),
        (
            "[vary]",
            'method = "monte_carlo"\nruns = -3\n[vary]',
            "runs = -3 breaks a rule: input should be greater than or",
        ),
        ("[vary]", 'method = "monte_carlo"\nruns = 3\n[vary]', "vary.r.value.count belongs to a grid; method ="),
        ("[vary]", "timeout = 0\n[vary]", "timeout = 0 breaks a rule: input should be greater than 0."),
        ("[vary]", "[vary", "is not valid TOML: "),
    ],
)
def test_a_mistake_in_a_sweep_file_is_one_sentence(folder: Path, old: str, new: str, sentence: str) -> None:
    path = written(folder, (old, new))
    with pytest.raises(SweepError, match=re.escape(sentence)) as raised:
        read_sweep(path)
    assert str(raised.value).startswith(str(path))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("old", "new", "kind", "sentence"),
    [
        (
            '"plant.k"',
            '"plant.kk"',
            SweepError,
            'vary.plant.kk: "plant.kk" is nothing that can be varied; of plant can be',
        ),
        ('"plant.k"', '"plan.k"', SweepError, '"plan.k" is nothing that can be varied; there are: plant, r.'),
        ('"plant.k"', '"plant.a"', SweepError, "of plant can be varied: plant.k, plant.mode,"),
        ('"r.value"', '"r.size"', SweepError, '"r.size" is nothing that can be varied; of r can be varied: r.value.'),
        (
            '"q", kind',
            '"plant.z", kind',
            WiringError,
            '"plant.z" cannot be recorded: it does not exist; plant has: a, b, k',
        ),
        ('"mrad"', '"N"', SweepError, 'The statistic of "r" in N: "rad" cannot become "N"'),
        (
            "from = 0.1, to = 0.4",
            "from = 1.0",
            SweepError,
            'statistic of "r" begins at 1 s, but the run ends at 0.5 s.',
        ),
    ],
)
def test_what_does_not_fit_the_scenario_is_said_before_the_first_run(
    folder: Path, old: str, new: str, kind: type[Exception], sentence: str
) -> None:
    with pytest.raises(kind, match=re.escape(sentence)):
        run(written(folder, (old, new)))
    assert not (folder / "out").exists()


def test_an_fmu_that_is_none_is_said_before_the_first_run(folder: Path) -> None:
    (folder / "loop.toml").write_text(SCENARIO.replace("{fmu}", "loop.toml"))
    with pytest.raises(FmuError, match="is no FMU: it is not a zip archive"):
        run(folder / "sweep.toml")


def test_a_sweep_or_its_scenario_that_is_not_there(folder: Path) -> None:
    with pytest.raises(SweepError, match=r"none.toml: no such sweep; a sweep is a .toml file."):
        read_sweep(folder / "none.toml")
    assert call("sweep", written(folder, ("loop.toml", "none.toml")), "--out", folder / "out") == 2


VARIATIONS: list[Variation] = [
    Values(of=("x",), values=(3.0, 1.0, 2.0)),
    Range(of=("x",), low=-1.0, high=3.0),
    Range(of=("x",), low=0.1, high=30.0, scale="log"),
    Range(of=("x",), low=2.0, high=5.0, scale="integer"),
    Normal(of=("x",), mean=1.0, std=2.0),
    Normal(of=("x",), mean=1.0, std=2.0, low=0.0, high=1.5),
]


@pytest.mark.parametrize("variation", VARIATIONS[1:])
@settings(deadline=None)
@given(shares=some.lists(some.floats(0, 1, exclude_max=True), min_size=2))
def test_a_distribution_grows_with_its_share_and_keeps_its_limits(variation: Variation, shares: list[float]) -> None:
    values = [variation.at(u) for u in sorted(shares)]
    np.testing.assert_allclose(values, sorted(values), atol=1e-9)  # the standard library inverts to a few ulp
    low, high = getattr(variation, "low", -inf), getattr(variation, "high", inf)
    assert all(low <= value <= high for value in values)


@pytest.mark.parametrize(
    ("variation", "mean", "std"),
    [
        (VARIATIONS[0], 2.0, sqrt(2 / 3)),
        (VARIATIONS[1], 1.0, 4 / sqrt(12)),
        (VARIATIONS[3], 3.5, sqrt(5 / 4)),
        (VARIATIONS[4], 1.0, 2.0),
    ],
)
def test_a_distribution_has_the_mean_and_spread_of_its_kind(variation: Variation, mean: float, std: float) -> None:
    values = [variation.at((k + 0.5) / 6000) for k in range(6000)]
    np.testing.assert_allclose([np.mean(values), np.std(values)], [mean, std], rtol=2e-3)


def test_a_log_range_has_its_middle_at_the_geometric_mean_and_a_grid_ends_at_its_ends() -> None:
    assert VARIATIONS[2].at(0.5) == pytest.approx(sqrt(3.0))
    assert Range(of=("x",), low=0.1, high=30.0, scale="log", count=3).grid() == (0.1, pytest.approx(sqrt(3.0)), 30.0)
    assert Range(of=("x",), low=1.0, high=2.0, count=1).grid() == (1.0,)
    assert Range(of=("x",), low=1.0, high=4.0, scale="integer").grid() == (1.0, 2.0, 3.0, 4.0)


def test_a_latin_hypercube_meets_each_part_of_each_range_once(folder: Path) -> None:
    path = written(folder, (K, '"plant.k" = { low = 0.0, high = 20.0 }'), (", count = 3", ""))
    path.write_text('method = "latin_hypercube"\nruns = 20\nseed = 2\n' + path.read_text())
    points = np.array(list(read_sweep(path).design.points()))
    for column, (low, high) in zip(points.T, [(0.0, 20.0), (0.5, 1.5)], strict=True):
        assert sorted(np.floor(20 * (column - low) / (high - low)).astype(int)) == list(range(20))
    assert abs(np.corrcoef(points.T)[0, 1]) < 0.9


def test_statistics_are_what_their_names_say() -> None:
    t = np.arange(0, 1, 0.1)
    x = np.array([5.0, -3.0, 4.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0])
    recording = Recording("run", {"t": t, "x": x}, {"t": "s", "x": "rad"})
    found = {kind: Statistic(signal="x", kind=kind, **{"from": 0.1, "to": 0.3}).of(recording) for kind in KINDS}
    window = np.array([-3.0, 4.0, 0.0])
    expected = {"mean": 1 / 3, "std": float(np.std(window)), "min": -3.0, "max": 4.0, "rms": sqrt(25 / 3)}
    expected |= {"peak": 4.0, "ise": 2.5, "iae": 0.7, "final": 0.0}
    assert found == pytest.approx(expected)


def test_a_difference_of_temperatures_has_no_offset() -> None:
    table = {"t": np.arange(3.0), "a": np.full(3, 20.0), "b": np.full(3, 17.0)}
    recording = Recording("run", table, {"t": "s", "a": "degC", "b": "degC"})
    assert Statistic(signal="a", minus="b", kind="mean", unit="degF").of(recording) == pytest.approx(5.4)
    assert Statistic(signal="a", kind="mean", unit="K").of(recording) == pytest.approx(293.15)


def test_the_command_prints_the_table_and_draws_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("sweep", folder / "sweep.toml", "--out", folder / "out", "--json") == 0
    said = capsys.readouterr()
    told = json.loads(said.out)
    assert (told["runs"], told["done"], told["failed"]) == (9, 9, 0)
    assert pd.read_parquet(told["table"]).shape == (9, 8)
    assert Path(told["picture"]).read_text().count("<svg") == 1
    assert call("sweep", folder / "sweep.toml", "--out", folder / "out") == 0
    said = capsys.readouterr()
    assert said.out == f"{folder / 'out' / 'table.parquet'}\n"
    assert "9 runs, 9 of them done before" in said.err
    assert call("sweep", folder / "sweep.toml", "--out", folder / "out", "--workers", "0") == 2
    assert capsys.readouterr().err.endswith("cosim: --workers 0: there must be at least one.\n")


@pytest.mark.parametrize("varied", ["one", "map", "many"])
def test_every_shape_of_sweep_has_a_picture_with_its_failures(folder: Path, varied: str) -> None:
    from cosim.pictures.sweep import draw

    changes = {
        "one": [(R, ""), (K, '"plant.k" = { low = 0.1, high = 1.0, count = 4, scale = "log" }')],
        "map": [(K, '"plant.k" = [-1.0, 1.0, 2.0]')],
        "many": [(K, '"plant.k" = [-1.0, 1.0]\n"plant.b.gain" = [1.0, 1.1]')],
    }
    done, _ = run(written(folder, *changes[varied]))
    text = draw(done.table, folder / "picture.svg").read_text()
    assert draw(done.table, folder / "picture.png").stat().st_size > 5000
    assert ("without result" in text) == (varied != "one")
    assert "error [mrad]" in text


def test_a_sweep_of_a_python_function(folder: Path) -> None:
    (folder / "f.py").write_text("def f(t, x, gain):\n    return gain * x\n")
    component = '[components.f]\npython = "f.py:f"\ninputs = { x = "rad" }\noutputs = { y = "rad" }\n'
    text = (
        (folder / "loop.toml")
        .read_text()
        .replace("[signals.r]", component + "parameters = { gain = 1.0 }\n[signals.r]")
    )
    text = text.replace("[record]", '[[connections]]\nfrom = "plant.y"\nto = "f.x"\n[record]')
    (folder / "loop.toml").write_text(text.replace("q = ", 'z = "f.y", q = '))
    _, table = run(written(folder, (K, '"f.gain" = [1.0, 3.0]'), (R, ""), ('"q", kind', '"z", kind')))
    assert table["end"][1] == pytest.approx(3 * table["end"][0])


def test_a_cluster_gives_the_same_table_and_survives_a_crash(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip("distributed")
    scenario = (folder / "loop.toml").read_text()
    (folder / "loop.toml").write_text(scenario.replace("[signals.r]", "parameters = { status = 11 }\n[signals.r]"))
    path = written(folder, (K, '"plant.fail_at" = [1e9, 0.3]'))
    _, here = run(path)
    monkeypatch.setenv("MOUNT_COSIM_CACHE", str(folder / "cache"))
    settings = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**settings) as cluster:
        _, there = run(path, force=True, address=cluster.scheduler_address, workers=None)
    pd.testing.assert_frame_equal(here.drop(columns="seconds"), there.drop(columns="seconds"))
    assert there["status"].tolist() == ["ok"] * 3 + ["crashed"] * 3


def test_a_cluster_that_is_not_there_is_one_sentence(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(cosim.sweep.pool, "PATIENCE", 0.5)
    with pytest.raises(SweepError, match=r"No Dask scheduler answers at tcp://127.0.0.1:9; give its address as"):
        run(folder / "sweep.toml", address="tcp://127.0.0.1:9", workers=None)
    with pytest.raises(SweepError, match=r"record = true keeps files on this machine; it does not go with --cluster"):
        run(written(folder, ("[vary]", "record = true\n[vary]")), address="tcp://127.0.0.1:9", workers=None)
