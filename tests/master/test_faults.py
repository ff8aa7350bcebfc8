"""A fault breaks a wire or a signal from its tick on, in C and in Python with the same bits."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oscillators import BOTH, Tiny
from pydantic import TypeAdapter, ValidationError
from simulating import alone
from small_loop import text_of

from cosim.data.recording import Recording
from cosim.master.simulate import run as run_scenario
from cosim.support.errors import ScenarioError, WiringError
from cosim.system.faults import Fault
from cosim.system.scenario import parse_scenario
from cosim.system.wire import Wire

RAMP = np.arange(50.0)
INSIDE = (RAMP >= 10) & (RAMP < 30)


def fault(**what: Any) -> Any:
    return TypeAdapter(Fault).validate_python({"from": 0.01, "until": 0.03} | what)


def run(fmu: Path, *faults: Any, **options: Any) -> Recording:
    wires, record = [Wire("r", "one.a", gain=2.0), ("r", "one.b")], {"a": "one.a", "b": "one.b", "r": "r"}
    return alone(fmu, wires, record, step=1e-3, ticks=50, signals={"r": RAMP}, faults=faults, **options).recording


KINDS = [
    ({"kind": "override", "value": -1.0}, lambda x: 0 * x - 1),
    ({"kind": "scale", "factor": 0.5}, lambda x: x / 2),
    ({"kind": "offset", "value": 3.0}, lambda x: x + 3),
    ({"kind": "freeze"}, lambda x: 0 * x + x[10]),
]


@BOTH
@pytest.mark.parametrize(("what", "does"), KINDS)
def test_a_fault_on_an_input_breaks_its_wire_only(tiny: Tiny, what: Any, does: Any, compiled: bool) -> None:
    seen = run(tiny[3], fault(on="one.a", **what), compiled=compiled)
    np.testing.assert_array_equal(seen["a"], np.where(INSIDE, does(2 * RAMP), 2 * RAMP))
    np.testing.assert_array_equal(seen["b"], RAMP)


@pytest.mark.parametrize(("what", "does"), KINDS)
def test_a_fault_on_a_signal_breaks_all_that_it_feeds(tiny: Tiny, what: Any, does: Any) -> None:
    wrong = np.where(INSIDE, does(RAMP), RAMP)
    seen = run(tiny[2], fault(on="r", **what))
    for name, gain in (("r", 1), ("a", 2), ("b", 1)):
        np.testing.assert_array_equal(seen[name], gain * wrong)


@pytest.mark.parametrize("on", ["one.b", "r"])
def test_noise_is_seeded_and_the_same_in_c_and_python(tiny: Tiny, on: str) -> None:
    noisy = fault(on=on, kind="noise", rms=0.1, seed=4)
    runs = [run(tiny[3], noisy, compiled=compiled)["b"] for compiled in (True, False)]
    np.testing.assert_array_equal(*runs)
    error = runs[0] - RAMP
    assert not error[~INSIDE].any()
    # Twenty numbers: their RMS is known to 16 %, so the draw itself is compared, and its RMS over many.
    expected = fault(on=on, kind="noise", rms=0.1, seed=4).noise().stream(0.01)(np.arange(20_000))[0]
    np.testing.assert_allclose(error[INSIDE], expected[:50][INSIDE], rtol=1e-12, atol=1e-14)
    assert expected.std() == pytest.approx(0.1, rel=0.02)


def test_faults_act_in_their_order_and_without_an_end_they_stay(tiny: Tiny) -> None:
    stays = TypeAdapter(Fault).validate_python({"on": "one.b", "kind": "offset", "value": 1.0, "from": 0.02})
    seen = run(tiny[3], stays, fault(on="one.b", kind="scale", factor=2.0))["b"]
    expected = np.where(RAMP >= 20, RAMP + 1, RAMP)
    np.testing.assert_array_equal(seen, np.where(INSIDE, 2 * expected, expected))


def test_a_slow_component_meets_the_fault_at_its_own_ticks(tiny: Tiny) -> None:
    seen = run(tiny[3], fault(on="one.b", kind="freeze"), every={"one": 4})["b"]
    looked = RAMP - RAMP % 4
    np.testing.assert_array_equal(seen, np.where((looked >= 12) & (looked < 30), 12, looked))


def test_a_fault_on_nothing_or_with_its_end_before_its_begin_is_refused(tiny: Tiny) -> None:
    with pytest.raises(WiringError, match=r'on "one\.k", which is no signal and no input that a wire feeds'):
        run(tiny[3], fault(on="one.k", kind="freeze"))
    with pytest.raises(WiringError, match=r'"r.velocity", which is not one output; outputs are: r.value'):
        run(tiny[3], fault(on="r.velocity", kind="freeze"))
    with pytest.raises(ValidationError, match=r"until = 0.005 must lie after from = 0.01"):
        fault(on="r", kind="freeze", until=0.005)


def test_faults_are_read_from_a_scenario_and_kept_in_the_recording(tiny: Tiny) -> None:
    tables: dict[str, Any] = {"stop": 0.05, "step": 1e-3, "record": {"signals": ["one.a"]}}
    tables |= {"components": {"one": {"fmu": tiny[3]}}, "signals": {"r": {"kind": "ramp", "velocity": 1.0}}}
    hangs: dict[str, Any] = {"on": "one.a", "kind": "override", "value": 7.0, "from": 0.02}
    text = text_of({"one.a": "r.position"}, faults=[hangs], **tables)
    done = run_scenario(parse_scenario(text, "x.toml", Path())).recording
    np.testing.assert_allclose(done["one.a"], np.where(RAMP < 20, RAMP * 1e-3, 7.0), atol=1e-15)
    assert done.origin["faults"] == [{"on": "one.a", "start": 0.02, "until": None, "kind": "override", "value": 7.0}]
    with pytest.raises(
        ScenarioError, match=r'"faults.0.override.factor" is no key of a scenario; keys there are: on, from'
    ):
        parse_scenario(text_of({}, faults=[hangs | {"factor": 7.0}], **tables), "x.toml", Path())
