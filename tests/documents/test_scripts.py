"""The scripts of the documentation do what they say."""

import importlib.util
from pathlib import Path
from types import ModuleType

SCRIPTS = Path(__file__).parents[2] / "docs" / "scripts"


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_your_own_axis_is_diagnosed() -> None:
    assert script("diagnose_your_axis").main() == ("cogging",)


def test_your_fmu_runs_beside_the_controller_of_a_card() -> None:
    assert script("cosimulate_your_fmu").main() <= 0.01  # arcsec; the encoder of the card has counts of 0.0003


def test_a_controller_is_designed_within_its_limits_and_proven_with_friction() -> None:
    design = script("design_a_controller")
    chosen, before, after = design.main()
    phase, noise = design.limits(design.tuned(design.read_card("paper_mount"), chosen))
    assert phase >= design.LEAST
    assert noise <= design.MOST
    assert design.BANDWIDTHS[0] < chosen < design.BANDWIDTHS[-1]
    assert after <= before / 2
