"""A sweep is a table with a row for each run, whatever the runs do to it."""

import json
import re
from math import inf, sqrt
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import call
from hypothesis import given, settings
from hypothesis import strategies as some
from pyarrow import parquet
from sweeps import SCENARIO, K, R, folder, run, written

from cosim.data.columns import ORIGIN_KEY, UNIT_KEY
from cosim.data.recording import Recording
from cosim.support.cluster import ADDRESS, _client
from cosim.support.errors import FmuError, SweepError, WiringError
from cosim_sweeps.file import read_sweep
from cosim_sweeps.picture import draw
from cosim_sweeps.statistics import KINDS, Statistic
from cosim_sweeps.variation import Normal, Range, Values, Variation

__all__ = ["folder"]


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


def test_the_table_says_its_units_and_what_made_it_and_recordings_that_are_kept_agree_with_it(folder: Path) -> None:
    kept = ("[vary]", "record = true\ndecimation = 3\n[vary]")
    done, table = run(written(folder, kept, ('"rms"', '"ise"'), (R, '"plant.a.gain" = [1.0]')), command="cosim sweep x")
    schema = parquet.read_schema(done.table)
    units = {name: schema.field(name).metadata[UNIT_KEY].decode() for name in ("plant.k", "end", "error", "seconds")}
    assert units == {"plant.k": "1", "end": "rad", "error": "mrad2.s", "seconds": "s"}
    origin = json.loads(schema.metadata[ORIGIN_KEY])
    assert origin["command"] == "cosim sweep x"
    assert origin["scenario"] == (folder / "loop.toml").read_text()
    recording = Recording.read(folder / "out" / "recordings" / "000002.parquet", required=())
    assert recording.columns == ("t", "q", "r")
    assert recording["q"][-1] == table["end"][2]
    assert recording.units["q"] == "rad"
    assert len(recording) == 167


def test_wires_parameters_shared_by_name_and_those_of_a_python_function_are_varied(folder: Path) -> None:
    both = 'k = { of = ["plant.k", "plant.a.gain"], low = 1.0, high = 2.0, count = 2 }'
    _, table = run(written(folder, (K, both), (R, '"plant.b.offset" = [0.0, 0.25]')))
    assert list(table)[1:3] == ["k", "plant.b.offset"]
    k, offset = table["k"], table["plant.b.offset"]
    np.testing.assert_allclose(table["end"], (k - offset) * (1 - (1 - 1e-3 * k) ** 499), rtol=1e-12)
    (folder / "f.py").write_text("def f(t, x, gain):\n    return gain * x\n")
    component = '[components.f]\npython = "f.py:f"\ninputs = { x = "rad" }\noutputs = { y = "rad" }\n'
    wire = '[[connections]]\nfrom = "plant.y"\nto = "f.x"\n[record]'
    text = (folder / "loop.toml").read_text().replace("[record]", wire).replace("q = ", 'z = "f.y", q = ')
    text = text.replace("[signals.r]", component + "parameters = { gain = 1.0 }\n[signals.r]")
    (folder / "loop.toml").write_text(text)
    _, table = run(written(folder, (K, '"f.gain" = [1.0, 3.0]'), (R, ""), ('"q", kind', '"z", kind')), force=True)
    assert table["end"][1] == pytest.approx(3 * table["end"][0])


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
        ("fail_at = 0.3, status = 11", "crashed", "The process of this run crashed: it was ended by signal 11"),
        ("fail_at = 0.3, status = 12", "timeout", "It was given up: no answer within 8 s."),
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
    path.write_text("timeout = 8.0\n" + path.read_text())  # a busy machine starts a process in seconds
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
    for workers, words in ((0, "0: there must be at least one."), (2**64, "18446744073709551616: 1,024 are the most.")):
        assert call("sweep", folder / "sweep.toml", "--out", folder / "out", "--workers", str(workers)) == 2
        assert capsys.readouterr().err.endswith(f"cosim: --workers {words}\n")


@pytest.mark.parametrize(
    ("changes", "failures"),
    [
        pytest.param(
            [(R, ""), (K, '"plant.k" = { low = 0.1, high = 1.0, count = 4, scale = "log" }')], False, id="one"
        ),
        pytest.param([(K, '"plant.k" = [-1.0, 1.0, 2.0]')], True, id="map"),
        pytest.param([(K, '"plant.k" = [-1.0, 1.0]\n"plant.b.gain" = [1.0, 1.1]')], True, id="many"),
    ],
)
def test_every_shape_of_sweep_has_a_picture_with_its_failures(folder: Path, changes: list, failures: bool) -> None:
    done, _ = run(written(folder, *changes))
    text = draw(done.table, folder / "picture.svg").read_text()
    assert draw(done.table, folder / "picture.png").stat().st_size > 5000
    assert ("without result" in text) == failures
    assert "error [mrad]" in text


# How parameters are spread, and what is worked out of each run.

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
    assert Range(of=("x",), low=1.0, high=4.0, scale="integer", count=9).grid() == (1.0, 2.0, 3.0, 4.0)


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


# What is wrong in a sweep file, or does not fit its scenario, is one sentence before the first run.


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[vary]", "rums = 3\n[vary]", '"rums" is no key of a sweep; keys there are: scenario, method, runs, seed,'),
        (K + "\n" + R, "", "vary breaks a rule: it needs 1 or more entries, not 0."),
        (K, '"plant.k" = []', "vary.plant.k: values breaks a rule: it needs 1 or more entries, not 0."),
        (K, '"plant.k" = { low = 1.0, high = 2.0 }', "vary.plant.k has no points: a grid needs a list of values, or"),
        (K, '"plant.k" = { mean = 1.0, std = 0.1 }', "vary.plant.k has no points: a grid needs a list of values, or"),
        (K, '"plant.k" = { mean = 1.0, std = -0.1 }', "vary.plant.k: std = -0.1 breaks a rule: input should be"),
        (K, '"plant.k" = { low = 1.0, high = 2.0, count = 0 }', "vary.plant.k: count = 0 breaks a rule: input should"),
        (K, '"plant.k" = { low = 1.0, high = 2.0, cuont = 1 }', '"cuont" is no key of it; keys there are: of, low'),
        (K, '"plant.k" = { low = 2.0, high = 1.0, count = 2 }', "low = 2 must be below high = 1"),
        (K, '"plant.k" = { low = 0.0, high = 1.0, count = 2, scale = "log" }', 'scale = "log" needs low above 0'),
        (
            K + "\n" + R,
            '"plant.k" = { low = 1.0, high = 9.0, count = 3000 }\n' + R.replace("count = 3", "count = 1000"),
            "asks for 3,000,000 runs; 1,000,000 is the most of one sweep.",
        ),
        (K, '"plant.k" = [1.0]\nk = { of = "plant.k", values = [2.0] }', '"plant.k" is varied twice; once is enough'),
        (K, 'run = { of = "plant.k", values = [2.0] }', "vary.run: every table has a column of this name"),
        ("end =", '"plant.k" =', "statistics.plant.k: choose another name; the columns run, seconds, status, reason"),
        ('"final"', '"median"', "statistics.end.kind = 'median' breaks a rule: input should be 'mean', 'std', 'min',"),
        ('kind = "final"', 'kind = "final", form = 1', '"statistics.end.form" is no key of a sweep; keys there are'),
        ("from = 0.1", "from = 0.5", "statistics.error breaks a rule: from = 0.5 must be before to = 0.4."),
        ("[vary]", "runs = 5\n[vary]", 'runs = 5 does not go with method = "grid", whose counts say how many there'),
        ("[vary]", "seed = -1\n[vary]", "seed = -1 breaks a rule: input should be greater than or equal to 0."),
        ("[vary]", 'method = "latin_hypercube"\n[vary]', 'method = "latin_hypercube" needs runs, how many points are'),
        ("[vary]", 'method = "monte_carlo"\nruns = -3\n[vary]', "runs = -3 breaks a rule: input should be greater"),
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
        ('"plant.k"', '"plant.kk"', SweepError, 'vary.plant.kk: "plant.kk" is nothing that can be varied; of plant'),
        ('"plant.k"', '"plan.k"', SweepError, '"plan.k" is nothing that can be varied; there are: plant, r.'),
        ('"plant.k"', '"plant.a"', SweepError, "of plant can be varied: plant.k, plant.mode,"),
        ('"r.value"', '"r.size"', SweepError, '"r.size" is nothing that can be varied; of r can be varied: r.value.'),
        ('"q", kind', '"plant.z", kind', WiringError, '"plant.z" cannot be recorded: it does not exist; plant has: a'),
        ('"mrad"', '"N"', SweepError, 'The statistic of "r" in N: "rad" cannot become "N"'),
        ("from = 0.1, to = 0.4", "from = 1.0", SweepError, 'statistic of "r" begins at 1 s, but the run ends at 0.5'),
    ],
)
def test_what_does_not_fit_the_scenario_is_said_before_the_first_run(
    folder: Path, old: str, new: str, kind: type[Exception], sentence: str
) -> None:
    with pytest.raises(kind, match=re.escape(sentence)):
        run(written(folder, (old, new)))
    assert not (folder / "out").exists()


def test_a_file_that_is_not_there_or_no_fmu_is_said_before_the_first_run(folder: Path) -> None:
    with pytest.raises(SweepError, match=r"none.toml: no such sweep; a sweep is a .toml file."):
        read_sweep(folder / "none.toml")
    (folder / "loop.toml").write_text(SCENARIO.replace("{fmu}", "loop.toml"))
    with pytest.raises(FmuError, match="is no FMU: it is not a zip archive"):
        run(folder / "sweep.toml")
    assert call("sweep", written(folder, ("loop.toml", "none.toml")), "--out", folder / "out") == 2


@pytest.mark.parametrize("address", ["foo", "tcp://host", "tcp://", "host:", "a b:1", "127.0.0.1"])
def test_what_is_no_address_of_a_scheduler_is_refused_before_anybody_is_asked(address: str) -> None:
    with pytest.raises(SweepError, match="is no address of a Dask scheduler; write it as tcp://host:8786") as refused:
        _client(address)
    assert refused.value.culprit == address


@pytest.mark.parametrize(
    "address", ["tcp://host:8786", "tls://10.0.0.1:1", "host:8786", "tcp://[::1]:8786", "inproc://1/2/3"]
)
def test_addresses_are_known(address: str) -> None:
    assert ADDRESS.fullmatch(address)
