"""What is wrong in a sweep file, or does not fit its scenario, is one sentence before the first run."""

import re
from pathlib import Path

import pytest
from commands import call
from sweeps import SCENARIO, K, R, folder, run, written

from cosim.support.errors import FmuError, SweepError, WiringError
from cosim.sweeps.cluster import ADDRESS, _client
from cosim.sweeps.file import read_sweep

__all__ = ["folder"]


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


def test_an_fmu_that_is_none_is_said_before_the_first_run(folder: Path) -> None:
    (folder / "loop.toml").write_text(SCENARIO.replace("{fmu}", "loop.toml"))
    with pytest.raises(FmuError, match="is no FMU: it is not a zip archive"):
        run(folder / "sweep.toml")


def test_a_sweep_or_its_scenario_that_is_not_there(folder: Path) -> None:
    with pytest.raises(SweepError, match=r"none.toml: no such sweep; a sweep is a .toml file."):
        read_sweep(folder / "none.toml")
    assert call("sweep", written(folder, ("loop.toml", "none.toml")), "--out", folder / "out") == 2


# What is no address of a scheduler is one sentence, before anybody is asked.


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
