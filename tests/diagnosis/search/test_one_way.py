"""What recordings cannot tell: friction, where motion goes one way; a tone, where each recording is a few rows."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.search.admissibility import needs_turns
from cosim.diagnosis.search.stages import refitted
from cosim.estimation.prepare import Prepared, prepare
from cosim.estimation.problem import Problem
from pyfmi_models.effects import Cogging, Effect, LocalFriction, PeriodicFriction, TorqueOffset
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.periodic_disturbance import PeriodicDisturbance
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import Coulomb, LuGre
from pyfmi_models.mount import Axis, Mount

Array = npt.NDArray[np.float64]

MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=1.0))
T = np.arange(20_000) / 1000


def moved(q: Array) -> Prepared:
    return prepare([Recording("r", {"t": T, "q": q, "tau": np.sign(np.gradient(q))})], 10.0)


ONE_WAY = moved(0.6 * T + 0.03 * np.sin(30 * T))
BACKWARDS = moved(-0.6 * T)
SWING = moved(1.5 * np.sin(0.9 * T))


@pytest.mark.parametrize(
    "effect",
    [
        Presliding(sigma0=20.0),
        PeriodicFriction(cycles_per_rev=14.0, relative_amplitude=0.3),
        Backlash(gap_rad=0.2),
        Backlash(gap_rad=1e-4, load_deflection=0.09),
    ],
)
def test_what_needs_a_turn_is_not_believed_where_motion_goes_one_way(effect: Effect) -> None:
    assert needs_turns(effect, MOUNT, ONE_WAY)
    assert needs_turns(effect, MOUNT, BACKWARDS)
    assert not needs_turns(effect, MOUNT, SWING)


def test_a_contact_stiff_enough_to_slide_on_the_way_back_may_be_believed() -> None:
    assert not needs_turns(Presliding(sigma0=100.0), MOUNT, ONE_WAY)
    assert needs_turns(Presliding(sigma0=100.0), replace(MOUNT, friction=Coulomb(Fc=10.0)), ONE_WAY)


@pytest.mark.parametrize("effect", [Cogging(cycles_per_rev=14.0, amplitude=0.1), TorqueOffset(torque=0.1)])
def test_a_torque_over_position_needs_no_turn(effect: Effect) -> None:
    assert not needs_turns(effect, MOUNT, ONE_WAY)


@pytest.mark.parametrize(("width", "is_one"), [(1e-5, False), (5e-3, True)])
def test_a_spot_across_which_the_contact_bends_is_a_place_where_the_axis_rested(width: float, is_one: bool) -> None:
    spot = LocalFriction(q_center=0.3, width=width, relative_amplitude=0.4)
    bristle = replace(MOUNT, friction=LuGre(sigma0=1e4, sigma1=50.0, sigma2=0.0, Fc=1.0, Fs=1.0, Vs=0.01))
    assert hypothesis_of(spot).shows(spot, bristle, SWING) is is_one


def test_a_tone_is_not_found_in_the_noise_of_many_short_recordings_by_a_phase_in_each() -> None:
    noise, t = np.random.default_rng(3), np.arange(200) / 100
    runs = [{"t": t, "q": v * t, "tau": 1 + 0.1 * noise.standard_normal(200)} for v in np.linspace(1, 4, 16)]
    prepared = prepare([Recording(f"r{number}", one) for number, one in enumerate(runs)], 5.0)
    weight = np.ones(len(prepared.recording_of))
    problem = Problem(MOUNT, prepared, weight, 1e-2)
    base = problem.fit(MOUNT, 12)
    comparison = Comparison.of(problem, base, POLICY)
    one = refitted(comparison, base, PeriodicDisturbance(frequency_hz=3.0, amplitude=0.02), 1)
    assert one.plain_gain > 0.05
    assert one.evidence < POLICY.clear / 2
