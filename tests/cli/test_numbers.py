"""Numbers that arithmetic, counting or memory cannot take are one sentence before anything runs."""

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from commands import Refused, call
from simulating import alone
from small_loop import TEXT

import cosim
from cosim.data.signals import Samples, Slews, Stream
from cosim.hardware.machine import read_machine
from cosim.master.simulate import run
from cosim.support.errors import CosimError, InputError, OutputError, ScenarioError, SignalError, SweepError
from cosim.support.files import check_free
from cosim.support.numbers import shown
from cosim.system.scenario import parse_scenario, read_scenario
from cosim_sweeps.file import read_sweep
from pyfmi_models.card import parse_card, read_card
from pyfmi_models.errors import CardError

SINE = 'kind = "sine"\nfrequency = 2.0\namplitude = 0.1'
SLEWS = 'kind = "slews"\nmax_velocity = 1.0\nmax_acceleration = 1.0'
ITERATED = '[algorithm]\nkind = "iterated"'
FAULT = '[[faults]]\non = "plant.a"\nkind = "offset"\nvalue = 1.0\n'
CARD = (Path(__file__).parents[2] / "pyfmi_models" / "cards" / "paper_mount.toml").read_text("utf-8")


@pytest.mark.parametrize(
    ("number", "rule"),
    [("1" + "0" * 5000, "a number in it has too many digits"), ("[" * 2000 + "]" * 2000, "its brackets are nested")],
    ids=["digits", "brackets"],
)
@pytest.mark.parametrize("kind", ["scenario", "card", "sweep", "machine"])
def test_no_file_has_a_number_that_reading_it_cannot_take(kind: str, number: str, rule: str) -> None:
    (path := Path("file.toml")).write_text(f"a = {number}")
    readers = {"scenario": read_scenario, "card": read_card, "sweep": read_sweep, "machine": read_machine}
    with pytest.raises((CardError, CosimError), match=f"is not valid TOML: {rule}"):
        readers[kind](path)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("decimation = 2", f"decimation = {2**64}", r"record\.decimation = 18446744073709551616 breaks a rule"),
        ('fmu = "tiny3.fmu"', f'fmu = "tiny3.fmu"\nevery = {10**30}', r"components\.plant\.every = 10+ breaks a rule"),
        ('fmu = "tiny3.fmu"', 'fmu = "tiny3.fmu"\nevery = 501', r"every 501 ticks; the run has 500 ticks, so it would"),
        ('fmu = "tiny3.fmu"', 'fmu = "tiny3.fmu"\nstep = 1e300', r"components\.plant\.step = 1e\+300 breaks a rule"),
        ("step = 1e-3", "step = 1e-308", r"step = 1e-308 breaks a rule: input should be greater than or equal"),
        ("stop = 0.5", "stop = 1e308", r"stop = 1e\+308 breaks a rule: input should be less than or equal"),
        ("step = 1e-3\nstop = 0.5", "step = 1e-9\nstop = 1e8", r"stop = 1e\+08 s is 1e\+17 steps of 1e-09 s; 9,007,1"),
        ("smooth_start = 0.1", "smooth_start = 1e308", r"smooth_start = 1e\+308 breaks a rule: input should be less"),
        ("[record]", f"{FAULT}from = 1e308\n[record]", r"from = 1e\+308 breaks a rule: input should be less"),
        ("[record]", f"{FAULT}from = 0.1\nuntil = 1e308\n[record]", r"until = 1e\+308 breaks a rule: input should be"),
        (SINE, f"{SLEWS}\npositions = [0.0, 1e300]\nmax_jerk = 1.0", r"a move would take more than 1e\+12 s"),
        ("[signals.r]", f"{ITERATED}\nmax_iterations = 10000000\n[signals.r]", r"max_iterations = 10"),
    ],
)
def test_a_scenario_with_such_a_number_is_refused(old: str, new: str, sentence: str) -> None:
    assert old in TEXT
    with pytest.raises(ScenarioError, match=sentence):
        parse_scenario(TEXT.replace(old, new, 1), "loop.toml", Path())


@pytest.mark.parametrize(
    ("kind", "named"),
    [
        ('kind = "sine"\nfrequency = 1e14\namplitude = 0.1', "1e+14"),
        ('kind = "sine"\nfrequency = 500.0\namplitude = 0.1', "500"),
        ('kind = "multisine"\nfrequencies = [1.0, 700.0]\namplitudes = 0.1', "700"),
        ('kind = "chirp"\nstart = 1.0\nstop = 1e300\nduration = 1.0\namplitude = 0.1', "1e+300"),
    ],
)
def test_a_frequency_that_the_ticks_cannot_show_is_refused(scenario: Path, refused: Any, kind: str, named: str) -> None:
    scenario.write_text(scenario.read_text().replace(SINE, kind))
    sentence = f'The signal "r" has {named} Hz; at a step of 0.001 s it must stay below 500 Hz.'
    assert sentence in refused("run", scenario, "--out", "out")
    assert not Path("out").exists()


def test_a_frequency_just_below_half_of_the_ticks_is_run(tiny: dict[int, Path]) -> None:
    text = TEXT.replace("frequency = 2.0", "frequency = 499.0").replace('"tiny', f'"{tiny[2].parent}/tiny')
    assert run(parse_scenario(text, "loop.toml", Path())).statistics["steps"] == 500


@pytest.mark.parametrize("isolate", ["--isolate", "--no-isolate"])
@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("k = 5.0", f"k = {10**400}", f'"controller.k" is 1{"0" * 59}... (401 characters); that is beyond a Float64.'),
        ("amplitude = 0.1", "amplitude = 1e308", 'The signal "r.velocity" is nan at tick 0 (0 s); it must be a finite'),
    ],
    ids=["parameter", "amplitude"],
)
def test_a_number_that_arithmetic_cannot_take_costs_a_sentence_and_no_warning(
    scenario: Path, capfd: pytest.CaptureFixture[str], old: str, new: str, sentence: str, isolate: str
) -> None:
    assert old in scenario.read_text()
    scenario.write_text(scenario.read_text().replace(old, new))
    assert call("run", scenario, "--out", "out", isolate) == 2
    said = capfd.readouterr().err.splitlines()
    assert said[0] == "loop: 500 steps of 0.001 s"
    assert said[-1].startswith(f"cosim: {sentence}")
    assert [one for one in said[1:-1] if not one.startswith("what was recorded until then is in ")] == []


class Overflowing:
    """A signal of a caller's own whose numbers Python refuses."""

    outputs: ClassVar[dict[str, str]] = {"value": ""}

    def stream(self, step: float) -> Stream:
        return lambda ticks: np.full((1, len(ticks)), 10.0**400)


NOT_FINITE = r'The signal "r\.value" is {} at tick 33 \(0\.033 s\); it must be a finite number\.'


@pytest.mark.parametrize(
    ("signal", "sentence"),
    [
        *((Samples(np.where(np.arange(40) == 33, bad, 0.0)), NOT_FINITE.format(bad)) for bad in (np.nan, np.inf)),
        (Overflowing(), r'The signal "r" cannot be computed: its numbers lead beyond what arithmetic has\.'),
    ],
)
def test_a_signal_that_is_no_number_is_named_with_its_time(tiny: dict[int, Path], signal: Any, sentence: str) -> None:
    with pytest.raises(SignalError, match=sentence):
        alone(tiny[3], [("r.value", "one.a")], {"y": "one.y"}, step=1e-3, ticks=40, signals={"r": signal})


@pytest.mark.parametrize("limit", [1e150, 1e200, 1e308])
def test_slews_without_limits_worth_the_name_are_steps(limit: float) -> None:
    limits = {"max_velocity": 1e11, "max_acceleration": limit, "max_jerk": limit}
    position, velocity, acceleration = Slews(kind="slews", positions=[0.0, 1.0], **limits).stream(1e-3)(np.arange(9))
    assert position.tolist() == [0.0] + [1.0] * 8
    assert not velocity.any()
    assert not acceleration[1:].any()


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("inertia = 30.0", f"inertia = {10**400}", r"inertia = 10+\.\.\. \(401 characters\) breaks the rule"),
        ("[mount]", f'[mount]\nname = "{"x" * 5000}"', r"name = 'x+\.\.\. \(5,002 characters\) breaks the rule"),
    ],
)
def test_a_card_with_such_a_number_is_refused(old: str, new: str, sentence: str) -> None:
    lines = [line for line in CARD.splitlines() if not (old == "[mount]" and line.startswith("name"))]
    text = "\n".join(new if line.startswith(old) else line for line in lines)
    assert new in text
    with pytest.raises(CardError, match=sentence):
        parse_card(text, "card.toml")


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("timeout = 2e101", r"timeout = 2e\+101 breaks a rule"),
        (f"decimation = {2**64}", r"decimation = 18446744073709551616 breaks a rule"),
        ('"a.b" = { low = 0.0, high = 1.0, count = 1000000000000 }', r"count = 1000000000000 breaks a rule"),
        ('"a.b" = { low = 0.0, high = 1e300, scale = "integer" }', r"asks for 1,000,001 runs; 1,000,000 is the most"),
        ('"a.b" = { low = -1e308, high = 1e308, count = 3 }', r"low = -1e\+308 and high = 1e\+308 are too far apart"),
    ],
)
def test_a_sweep_with_such_a_number_is_refused(line: str, sentence: str) -> None:
    head, varied = ("", line) if line.startswith('"') else (f"{line}\n", '"a.b" = [1.0]')
    rest = '[statistics]\nend = { signal = "q", kind = "final" }'
    (path := Path("sweep.toml")).write_text(f'scenario = "sidereal"\n{head}[vary]\n{varied}\n{rest}')
    with pytest.raises(SweepError, match=sentence):
        read_sweep(path)


@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
@pytest.mark.parametrize(
    "words",
    [
        "run loop.toml --out out --call-timeout",
        "hardware check loop.toml --seconds",
        "prove --out out --seconds",
        "identify loop.toml --card paper_mount --out out --cut",
    ],
)
@pytest.mark.usefixtures("scenario")
def test_a_number_of_the_command_line_that_is_none_is_refused(words: str, number: str, refused: Refused) -> None:
    said, option = refused(*words.split(), number), words.split()[-1]
    assert f"{option} {number}: it must be a finite number." in said or said.startswith("Usage: ")
    assert "Traceback" not in said
    assert not Path("out").exists()


def test_a_long_value_is_cut_short_in_a_message() -> None:
    assert shown(3.5) == "3.5"
    assert shown("x" * 100) == f"'{'x' * 59}... (102 characters)"
    assert shown(10**5000) == "a int"


@pytest.mark.parametrize(
    ("path", "why"), [("taken/card.toml", "taken is a file"), ("/dev/null/paper/README.md", "/dev/null is no folder")]
)
def test_what_is_no_folder_in_the_place_of_one_is_told_before_the_work(path: str, why: str) -> None:
    Path("taken").write_text("a file", "utf-8")
    with pytest.raises(OutputError, match=rf"The directory {Path(path).parent} cannot be made: {why}\."):
        check_free(Path(path), force=True)


IDENTIFY = "identify a.csv --card emps --out out"
OF_AN_FMU = ["--cluster host:1", "--window 3", "--heldout b.csv", "--set a=1", "--workers 2"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("serve --port 99999", "--port"),
        (f"{IDENTIFY} --cut -1", "--cut"),
        *(
            (f"{IDENTIFY} {option}", f"{option.split()[0]} goes with an FMU or a system alone; ")
            for option in OF_AN_FMU
        ),
        ("identify a.csv --fmu theirs.fmu --free k --cut 2", "--cut goes with a card alone; leave it out."),
    ],
)
def test_an_option_out_of_its_range_or_of_another_model_is_refused(words: str, sentence: str, refused: Refused) -> None:
    assert sentence in refused(*words.split())
    assert list(Path().iterdir()) == []


def test_so_is_an_argument_of_the_call() -> None:
    with pytest.raises(InputError, match="cluster: of an FMU or a system, not of a card"):
        cosim.identify("a.csv", "card.toml", cluster="tcp://host:8786")  # type: ignore[call-overload]
    with pytest.raises(TypeError, match="'clutser'"):
        cosim.identify("a.csv", "card.toml", clutser="tcp://host:8786")  # type: ignore[call-overload]
