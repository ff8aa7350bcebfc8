"""Pushes against an end stop are found where they are, and nothing else is taken for one."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.estimation.end_stops import pushes, without
from pyfmi_models.assembly import Axis
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Mount

STEP, STOP = 1e-3, 0.5
MOUNT = Mount(name="axis", axis=Axis(inertia=0.5), friction=Coulomb(Fc=2.0, sigma2=1.5))


def recorded(load, seconds=20.0):
    """A sine of .6 rad beside faster ones, its torque with a further load of the position."""
    t = np.arange(0, seconds, STEP)
    asked = 0.6 * np.sin(2 * np.pi * 0.23 * t) + 0.05 * np.sin(2 * np.pi * 1.1 * t)
    q = load.where(asked)
    v = np.gradient(q, STEP)
    tau = 0.5 * np.gradient(v, STEP) + 2.0 * np.tanh(v / 0.01) + 1.5 * v + load.torque(asked)
    noise = np.random.default_rng(3).normal(0, 1, (2, len(t)))
    return Recording("run", {"t": t, "tau": tau + 0.02 * noise[0], "q": q + 1e-6 * noise[1]})


class Stop:
    """A contact that gives way by .1 mm a newton: a loop pushes harder the further it asks beyond."""

    @staticmethod
    def where(asked):
        return np.where(asked > STOP, STOP + 0.01 * (asked - STOP), asked)

    @staticmethod
    def torque(asked):
        return np.where(asked > STOP, 100 * (asked - STOP) + 4, 0.0)


class Load:
    """Something that depends on the position, and stops nothing."""

    def __init__(self, torque):
        self.torque = torque

    @staticmethod
    def where(asked):
        return asked


def test_a_stop_is_found_where_it_is_and_its_rows_are_judged_no_more():
    run = recorded(Stop)
    found = pushes([run], MOUNT)
    assert len(found) == 1
    assert found[0].at == pytest.approx(STOP, abs=0.003)
    assert 4 < found[0].torque < 20
    freed = without([run], found)[0]
    beyond = run["q"] > STOP
    inside = (run.t > 3) & (run.t < 19.5)
    assert freed.is_masked(run.t, 0.0)[beyond & inside].mean() > 0.95
    assert freed.is_masked(run.t, 0.0)[~beyond & inside].mean() < 0.1


@pytest.mark.parametrize(
    "torque",
    [
        lambda q: 0.0 * q,
        lambda q: 8.0 * np.sin(q),
        lambda q: 15.0 * np.maximum(0, np.abs(q) - 0.3) * np.sign(q),
        lambda q: 40.0 * q**3,
    ],
    ids=["nothing", "an unbalance", "a cable that hangs loose in the middle", "a cable that hardens"],
)
def test_what_grows_with_the_position_is_no_stop(torque):
    assert pushes([recorded(Load(torque))], MOUNT) == ()


def test_without_a_position_nothing_is_said():
    run = recorded(Stop)
    speed = Recording("run", {"t": run.t, "tau": run["tau"], "v": np.gradient(run["q"], STEP)})
    assert pushes([speed], MOUNT) == ()


def test_an_axis_that_works_at_one_end_does_not_push_there():
    """It turns far away and back, then moves to and fro within the last hundredth of the travel."""
    t = np.arange(0, 30, STEP)
    far = np.where(t < 15, 30 * np.sin(np.pi * t / 15) ** 2, 0.0)
    near = np.where(t > 16, 0.3 * np.sin(2.1 * (t - 16)), 0.0)
    v = np.gradient(near - far, STEP)
    tau = 0.5 * np.gradient(v, STEP) + 2.0 * np.tanh(v / 0.01) + 1.5 * np.tanh(v) + 4.0 * np.tanh(near / 0.05)
    assert pushes([Recording("run", {"t": t, "tau": tau, "q": near - far})], MOUNT) == ()
