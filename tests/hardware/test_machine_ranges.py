"""What a machine file may hold, each number at its limits and beyond, and what it is where the file says nothing."""

from pathlib import Path

import pytest
from on_hardware import SIMULATED

from cosim.hardware.machine import Machine, changed, read_machine
from cosim.hardware.words import LIMITS
from cosim.support.errors import HardwareError

LARGE, LONG = 1e12, 1e9
"""Greatest number of anything with a unit of its own, and longest time [ms] or count."""
POSITIVE = 1e-300
RANGES = {
    "watchdog_ms": ((POSITIVE, LONG), (0, LONG * 1.001)),
    "black_box_seconds": ((POSITIVE, 86_400), (0, 86_401)),
    **{
        f"limits.{name}": ((POSITIVE, LARGE), (0, -1.0, LARGE * 1.001))
        for name in ("torque", "slew", "speed", "following_error", "jump", "torque_mismatch")
    },
    **{f"reactions.{name}": ((POSITIVE, LONG), (0, LONG * 1.001)) for name in ("ramp_ms", "patience_ms", "window_ms")},
    "reactions.heartbeat_ms": ((POSITIVE, LONG), (0, LONG * 1.001)),
    "reactions.stop_slew": ((POSITIVE, LARGE), (0, LARGE * 1.001)),
    **{
        f"reactions.{name}": ((0, 10**9), (-1, 10**9 + 1))
        for name in ("lost_cycles", "stale_cycles", "mismatch_cycles")
    },
    "reactions.late_in_a_row": ((1, 10**9), (0, 10**9 + 1)),
    "reactions.late_in_window": ((1, 64), (0, 65)),
    "clock.spin_us": ((0, 1000), (-1, 1001)),
    "clock.answer_us": ((POSITIVE, 1e6), (0, 1.001e6)),
    "clock.answer_spin_us": ((0, 1000), (-1, 1001)),
    "encoder.apart": ((POSITIVE, LARGE), (0, LARGE * 1.001)),
    "encoder.eccentricity": ((0, 1e-3), (-1e-9,)),
}
"""By key: numbers that it takes, and those that it does not."""


def with_number(key: str, value: float) -> Machine:
    """The simulated machine with one number changed, read anew."""
    section, _, name = key.rpartition(".")
    if not section:
        return changed(SIMULATED, "test", **{name: value})
    return changed(SIMULATED, "test", **{section: getattr(SIMULATED, section).model_dump() | {name: value}})


@pytest.mark.parametrize("key", RANGES)
def test_a_number_is_taken_up_to_its_limits(key: str) -> None:
    for value in RANGES[key][0]:
        machine: object = with_number(key, value)
        for name in key.split("."):
            machine = getattr(machine, name)
        assert machine == value


@pytest.mark.parametrize("key", RANGES)
def test_a_number_beyond_its_limits_is_refused_by_its_key(key: str) -> None:
    for value in RANGES[key][1]:
        with pytest.raises(HardwareError, match=key.replace(".", r"\.")):
            with_number(key, value)


def test_what_a_file_does_not_say_is_what_the_documentation_says() -> None:
    """docs/hardware.md; a machine in use must not change its reactions with the next version."""
    plain = Machine(name="plain", adapter="simulated", limits=SIMULATED.limits)
    assert (plain.watchdog_ms, plain.black_box_seconds, plain.inject) == (2.0, 120.0, ())
    assert plain.clock.model_dump() == {"spin_us": 20.0, "answer_us": 60.0, "answer_spin_us": 50.0}
    assert plain.encoder.model_dump() == {"heads": 0, "apart": 1e-4, "eccentricity": 0.0}
    assert plain.reactions.model_dump() == {
        "ramp_ms": 20.0,
        "stop_slew": 5000.0,
        "patience_ms": 100.0,
        "lost_cycles": 2,
        "stale_cycles": 2,
        "mismatch_cycles": 10,
        "late_in_a_row": 3,
        "late_in_window": 10,
        "window_ms": 1000.0,
        "heartbeat_ms": 500.0,
    }


LIMITED = "\n[limits]\n" + "\n".join(f"{name} = 1.0" for name in LIMITS)
BEGUN = 'name = "x"\nadapter = "simulated"\n'


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            f'name = "x"\nadapter = "udp://there:1"\nencoder.heads = 4{LIMITED}',
            "heads = 4, and only adapter = .simulated",
        ),
        (BEGUN, '"limits" is missing'),
        (f'name = "x"\nadapter = "wireless"{LIMITED}', "adapter = 'wireless' breaks a rule"),
        (f"{BEGUN}heat = 1{LIMITED}", '"heat" is no key of a machine; keys there are: name'),
        (f"{BEGUN}[limits]\ntorque = 50.0", '"limits.slew" is missing'),
        ("name = ", "not valid TOML"),
        ('name = "\udc98"', r"m\.toml is not text in UTF-8 \(at byte 8\)"),
    ],
)
def test_a_file_that_is_no_machine_is_refused_in_a_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "m.toml").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(HardwareError, match=sentence):
        read_machine(tmp_path / "m.toml")
