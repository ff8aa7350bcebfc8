"""Two measured machines, where their recordings lie beside the checkout: what their READMEs say is what is found."""

from pathlib import Path
from typing import Any

import measured
import measured_later
import pytest

DATA = Path(__file__).resolve().parents[3] / "shared" / "recordings"
pytestmark = pytest.mark.skipif(not DATA.exists(), reason="the measured recordings are not beside this checkout")


def answer(machine: measured.Machine) -> tuple[dict[str, Any], list[str]]:
    """The row of its page, and the names of its verdict."""
    row = next(measured.rows(machine))
    return row, row["verdict"].split(" + ")


@pytest.mark.parametrize("choice", [0, 1])
def test_a_pendulum_is_a_weight_on_an_arm_of_half_a_metre_whichever_runs_are_fitted(choice: int) -> None:
    row, names = answer(list(measured_later.pendulum(DATA / "quasi_direct_pendulum"))[choice])
    assert names[0] == "gravity_unbalance"
    assert not {"presliding", "backlash", "thermal_viscosity"} & set(names)
    ratio = float(row["asked besides"].split(" = ")[1].split()[0])
    assert ratio == pytest.approx(measured_later.LENGTH, rel=0.05)
    assert float(row["with what is learned"]) < 0.3 < float(row["refitted"])


def test_a_motor_has_its_72_waves_a_turn_first() -> None:
    row, names = answer(list(measured_later.anticogging(DATA / "anticogging_motor"))[1])
    assert names == ["cogging"]
    assert row["asked besides"].split("orders ")[1].split(",")[0] == "72"
