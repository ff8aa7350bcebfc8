"""The inverse model's derivatives, the states of its friction along a recorded speed, and what a fit finds with it."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from friction_laws import EXAMPLES, WITH_MEMORY, numeric
from wandering import axis, recorded, wander

from cosim.estimation.equations import _late
from cosim.estimation.fit import fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Piece, prepare
from pyfmi_models.card import read_card
from pyfmi_models.effects import ActuatorLag, Delay, FrictionAsymmetry
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.friction import FrictionLaw


def walked(law: FrictionLaw, v: np.ndarray, dt: float) -> np.ndarray:
    """States at each row: the law's own step at the speed of its middle, at the level that a straight one amounts to.

    That level lies coth(x/2) - 2/x of the way from the middle to the end, x how often a step would build it up.
    """
    x, speed, level = ca.SX.sym("x", len(law.states())), ca.SX.sym("v"), ca.SX.sym("level")
    step = ca.Function("step", [x, speed, level], [law.advance(x, speed, level, dt), law.rate(0 * x, speed, level)])
    middle, states = (v[1:] + v[:-1]) / 2, [np.zeros(len(law.states()))]
    for now, end in zip(middle, v[1:], strict=True):
        here, there = float(law.level(now)), float(law.level(end))
        times = abs(step(states[-1], now, here)[1].full().sum()) * dt / here
        late = times / 6 if times < 1e-3 else 1 / np.tanh(times / 2) - 2 / times
        states.append(step(states[-1], now, here + (there - here) * late)[0].full().ravel())
    return np.array(states).T


def carried(law: FrictionLaw) -> tuple[Piece, np.ndarray]:
    """A recorded motion, and the states of the law that the inverse carries along it."""
    t, q, _v, a = wander()
    piece = prepare([recorded(a, t, q)], 20.0).pieces[0]
    inverse = Inverse(replace(read_card("paper_mount").plant(), friction=law), ())
    return piece, inverse._equations.states(inverse._equations.given(piece)[1], inverse.start)[0]


class TestInverse:
    @pytest.mark.parametrize("law", [law for law in EXAMPLES.values() if law.key != "none"], ids=lambda law: law.key)
    def test_derivatives_equal_finite_differences(self, law: FrictionLaw) -> None:
        t, q, _v, a = wander(10.0)
        mount = replace(read_card("paper_mount").plant(), friction=law)
        extra = (FrictionAsymmetry(level_asymmetry=0.1, viscous_asymmetry=0.1), Delay(delay_ms=2.0))
        mount = replace(mount, effects=(*extra, ActuatorLag(time_constant_ms=3.0)))
        free = tuple(v.name for v in mount.parameters() if not v.name.endswith(("limit", "smoothing", "delta")))
        inverse = Inverse(mount, free)
        pieces = prepare([recorded(a, t, q)], 20.0).pieces
        values = np.array([dict(zip(inverse.names, inverse.start, strict=True))[name] for name in free])
        _, slopes = stacked(inverse, pieces, values)
        for column in range(len(free)):
            step = np.zeros_like(values)
            step[column] = 1e-5 * abs(values[column])
            up, down = (stacked(inverse, pieces, values + s * step)[0] for s in (1, -1))
            change = (up - down) / (2 * step[column])
            assert np.abs(change - slopes[:, column]).max() < 5e-4 * np.abs(change).max() + 1e-9, free[column]

    @pytest.mark.parametrize("law", WITH_MEMORY.values(), ids=WITH_MEMORY.keys())
    def test_friction_states_follow_the_recorded_speed_by_the_laws_own_step(self, law: FrictionLaw) -> None:
        piece, states = carried(law)
        np.testing.assert_allclose(states, walked(law, piece.v, piece.dt), rtol=1e-9, atol=1e-9)

    @pytest.mark.parametrize("times", [1e-3, 0.0099, 0.0101, 0.3, 3.0, 40.0, 1e4])
    def test_a_level_that_goes_straight_counts_as_one_that_is_constant_but_later(self, times: float) -> None:
        """The exact solution of z' = times (level(t) - z) over one second, with a level from 1 to 3."""
        start, decay = -0.7, np.exp(-times)
        exact = 3 - 2 / times + (start - 1 + 2 / times) * decay
        assert (2 + float(_late(times))) * (1 - decay) + start * decay == pytest.approx(exact, abs=1e-10)

    @pytest.mark.parametrize("law", WITH_MEMORY.values(), ids=WITH_MEMORY.keys())
    def test_friction_states_are_as_near_to_those_of_fine_steps_as_with_the_level_of_the_middle(
        self, law: FrictionLaw
    ) -> None:
        piece, states = carried(law)
        rows = np.arange(len(piece.v) - 1)
        fine = np.interp((np.arange(50 * len(rows)) + 0.5) / 50, np.arange(len(piece.v)), piece.v)
        exact = numeric(law).along(fine, piece.dt / 50)[:, 49::50]
        middle = numeric(law).along((piece.v[1:] + piece.v[:-1]) / 2, piece.dt)
        wrong, rough = (float(np.sqrt(np.mean((one - exact) ** 2))) for one in (states[:, 1:], middle))
        assert wrong < min(0.06, 1.001 * rough)

    def test_a_mass_on_a_spring_follows_the_true_motion_of_the_encoder_that_is_tried(self) -> None:
        """What is kept of a recording is that of the read motion, never that of another eccentricity."""
        t, q, _v, a = wander(10.0)
        spring = Compliance(antiresonance_hz=3.0, resonance_hz=4.0)
        mount = axis(effects=(EncoderEccentricity(cycles_per_rev=9, amplitude_rad=0.01), spring))
        inverse = Inverse(mount, ("encoder_eccentricity.amplitude_rad",))

        def torque(amplitude: float, pieces: list[Piece]) -> np.ndarray:
            return stacked(inverse, pieces, np.array([amplitude]))[0]

        here, anew = (list(prepare([recorded(a, t, q)], 20.0).pieces) for _ in range(2))
        first = torque(0.05, here)
        np.testing.assert_array_equal(torque(0.01, here), torque(0.01, anew))
        assert not np.allclose(first, torque(0.01, here), rtol=1e-3)

    def test_a_fit_recovers_what_made_the_torque(self) -> None:
        t, q, v, a = wander()
        tau = 6.2 * a + 2.4 * np.sign(v) + 0.7 * v
        prepared = prepare([recorded(tau, t, q)], 30.0)
        moving = (np.abs(prepared.stacked("v")) > 0.05).astype(float)
        found = fit(axis(), prepared.pieces, moving).parameters()
        assert found["axis.inertia"] == pytest.approx(6.2, rel=2e-3)
        assert found["friction.Fc"] == pytest.approx(2.4, rel=2e-2)
        assert found["friction.sigma2"] == pytest.approx(0.7, rel=0.1)
