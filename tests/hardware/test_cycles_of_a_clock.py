"""What no clock goes by, and no encoder counts, is one sentence."""

import pytest
from commands import call

from cosim.hardware.loops import period_of
from cosim.support.errors import HardwareError


@pytest.mark.parametrize("step", [1e300, 11.0, 1e-9, float("nan"), float("inf")])
def test_a_step_of_no_clock_is_refused(step: float) -> None:
    with pytest.raises(HardwareError, match=r"has cycles of 1e-06 s to 10 s"):
        period_of(step)


def test_a_cycle_is_counted_in_nanoseconds() -> None:
    assert [period_of(step) for step in (1e-6, 1e-4, 10.0)] == [1_000, 100_000, 10_000_000_000]


@pytest.mark.parametrize(("option", "value"), [("--step", "1e300"), ("--counts-per-turn", "1e-320")])
def test_a_virtual_drive_says_what_it_cannot_be(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("hardware", "virtual-drive", "paper_mount", "--port", "0", option, value) == 2
    assert "Traceback" not in (said := capsys.readouterr().err)
    assert said.startswith("cosim: ")
