"""An FMU's own derivatives in a calibration: taken where they agree with differences, said where not."""

from pathlib import Path

import numpy as np
import pytest
from motor_fmu import driven, motor, recorded

import cosim
from cosim_calibration.calibrate import Options, calibrate
from cosim_calibration.residuals import Residuals
from cosim_calibration.subject import of_fmu

FREE = ("axis.inertia", "friction.Fc", "friction.sigma2")


@pytest.fixture(scope="module")
def plant(tmp_path_factory) -> Path:
    """An FMU that gives derivatives by its parameters: an axis with LuGre friction."""
    done = cosim.export("paper_mount", tmp_path_factory.mktemp("plant"), fmi=3)
    return next(one for one in done.fmus if "plant" in one.name)


@pytest.fixture(scope="module")
def table(plant) -> dict:
    t = 5e-4 * np.arange(1600)
    tau = 20 * np.sin(2 * np.pi * 1.5 * t) + 8 * np.sin(2 * np.pi * 4.1 * t)
    truth = {"axis.inertia": 36.0, "friction.Fc": 1.3}
    v = driven(plant, tau, truth, into="tau", outputs=["v"], step=5e-4)["v"]
    noise = 1e-3 * np.std(v) * np.random.default_rng(1).standard_normal(1600)
    return {"t": t, "tau": tau, "v": v + noise}


def test_both_kinds_of_derivatives_agree_and_give_the_same_numbers(plant, table, monkeypatch):
    seen: list[tuple[np.ndarray, np.ndarray]] = []
    use = Residuals.use_directional

    def compared(self, x):
        shared = list(range(len(self.free)))
        seen.append((self._directional(x, shared), self._differences(x, 1e-3 * np.ones(len(x)))[0]))
        return use(self, x)

    monkeypatch.setattr(Residuals, "use_directional", compared)
    found = {}
    for kind in ("differences", "directional"):
        given = {"free": list(FREE), "starts": 1, "workers": 1, "derivatives": kind}
        found[kind] = cosim.identify(table, fmu=plant, **given)
    own, difference = seen[0]
    for k in range(len(FREE)):
        assert np.linalg.norm(own[:, k] - difference[:, k]) < 0.02 * np.linalg.norm(difference[:, k]), FREE[k]
    for name in FREE:
        a, b = (found[kind].numbers[name] for kind in found)
        assert abs(a - b) < 0.1 * found["differences"].standard_errors[name]
        errors = [found[kind].standard_errors[name] for kind in found]
        assert errors[0] == pytest.approx(errors[1], rel=0.05)
    assert not any("differences" in note for note in found["directional"].calibrated.notes)
    assert found["directional"].calibrated.evaluations < found["differences"].calibrated.evaluations


def test_an_fmu_without_derivatives_is_fitted_by_differences_and_that_is_said(tmp_path):
    fmu = motor(tmp_path, 3)
    given = {"fmu": fmu, "free": ["J"], "starts": 1, "workers": 1}
    done = cosim.identify(recorded(fmu, {"J": 0.013}), derivatives="directional", **given)
    assert "The FMU gives no directional derivatives by J: differences are used." in done.calibrated.notes
    assert abs(done.numbers["J"] - 0.013) < 4 * done.standard_errors["J"]


def test_derivatives_that_are_wrong_are_not_used(plant, table, monkeypatch):
    right = Residuals._directional

    def wrong(self, x, numbers):
        found = right(self, x, numbers)
        return found * np.where(np.array(numbers) == 1, -1.0, 1.0)

    monkeypatch.setattr(Residuals, "_directional", wrong)
    subject = of_fmu(plant)
    recording = cosim.read(table, required=())
    done = calibrate(subject, [recording], [], Options(FREE, starts=1, workers=1, derivatives="directional"))
    assert ["friction.Fc" in one and "200 % from differences" in one for one in done.notes if "FMU's" in one] == [True]
    assert abs(done.values["friction.Fc"] - 1.3) < 4 * done.uncertainty.standard_errors[1]


def test_another_kind_and_a_system_are_refused(plant, table):
    with pytest.raises(cosim.InputError, match="there are: differences, directional"):
        cosim.identify(table, fmu=plant, free=["friction.Fc"], derivatives="adjoint")
    with pytest.raises(cosim.InputError, match="is a system"):
        cosim.identify(table, system="sidereal", free=["mount.friction.Fc"], derivatives="directional")
