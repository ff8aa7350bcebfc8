"""The torque that a motion needs is that of the plant: every effect, put into both, leaves nothing of it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from closed_loop import recorded as recorded_in_loop
from effect_examples import EXAMPLES
from friction_laws import EXAMPLES as LAWS
from friction_laws import WITH_MEMORY, numeric
from wandering import axis, recorded, swing, wander

from cosim.estimation.equations import _late
from cosim.estimation.fit import fit
from cosim.estimation.inverse import Inverse, stacked
from cosim.estimation.prepare import Piece, Prepared, prepare
from pyfmi_models.card import read_card
from pyfmi_models.effects import (
    ActuatorLag,
    ClockEffect,
    Delay,
    Effect,
    FrictionAsymmetry,
    GravityUnbalance,
    LocalFriction,
    PeriodicFriction,
)
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.effects.encoder_eccentricity import EncoderEccentricity
from pyfmi_models.effects.torque_droop import TorqueDroop
from pyfmi_models.effects.torque_saturation import TorqueSaturation
from pyfmi_models.friction import FrictionLaw, LuGre, Stribeck
from pyfmi_models.friction.lugre_passive import PassiveLuGre
from pyfmi_models.mount import Mount

HELD = [one for one in EXAMPLES if one.is_determined]
EXACT = [one for one in HELD if not isinstance(one, Backlash)]


def fitting(effect: Effect) -> tuple[Effect, ...]:
    """The effect so that this motion meets it, with what it needs beside it."""
    if isinstance(effect, LocalFriction):
        return (replace(effect, q_center=0.3),)
    if isinstance(effect, TorqueSaturation):
        return (replace(effect, knee_torque=5.0),)
    if isinstance(effect, TorqueDroop):
        return (replace(effect, rated_torque=60.0),)
    loaded = effect.id in ("load_dependent_friction", "gear_friction")
    known = (GravityUnbalance(mgl=3.0, phase=0.3),) if loaded else ()
    return (*known, effect)


def on_two_clocks(prepared: Prepared, effect: ClockEffect, mount: Mount) -> Prepared:
    """Readings taken `ahead` of the torque beside them."""
    piece = prepared.pieces[0]
    at = piece.t + effect.ahead(mount.at(piece.t, piece.q, piece.v))
    moved = {name: np.interp(at, piece.t, getattr(piece, name)) for name in ("q", "v", "a")}
    return replace(prepared, pieces=(replace(piece, **moved),))


def left(prepared: Prepared, mount: Mount) -> np.ndarray:
    """What a mount leaves of the torque."""
    return np.asarray(prepared.stacked("tau") - stacked(Inverse(mount, ()), prepared.pieces, np.zeros(0))[0])


@pytest.mark.parametrize("effect", EXACT, ids=lambda one: type(one).__name__)
def test_the_plant_with_an_effect_needs_the_torque_that_the_inverse_says(effect: Effect) -> None:
    base = read_card("paper_mount").plant()
    if effect.id == "presliding":
        base = replace(base, friction=Stribeck(Fc=2.3, Fs=3.3, Vs=0.04, sigma2=30.0))
    mount = replace(base, effects=fitting(effect))
    prepared = recorded_in_loop(replace(mount, effects=[e for e in mount.effects if not isinstance(e, ClockEffect)]))
    if isinstance(effect, ClockEffect):
        prepared = on_two_clocks(prepared, effect, mount)
    rest, without = (
        float(np.sqrt(np.mean(left(prepared, one) ** 2))) for one in (mount, replace(mount, effects=mount.effects[:-1]))
    )
    silent = bool(effect.inputs()) and not effect.states()  # its input is at its start, where it does nothing
    assert rest < 0.15
    assert silent or rest < 0.5 * without


def test_bristles_whose_damping_fades_are_a_base_like_any() -> None:
    """A plant with this law needs the torque that its inverse says, and less well the one that LuGre's says."""
    numbers = {"sigma0": 9.23e4, "sigma1": 3e3, "sigma2": 32.77, "Fc": 2.322, "Fs": 3.322, "Vs": 0.04129}
    fading, plain = (
        replace(read_card("paper_mount").plant(), friction=law)
        for law in (PassiveLuGre(**numbers, Vd=1e-3), LuGre(**numbers))
    )
    prepared = recorded_in_loop(fading)
    assert np.std(left(prepared, fading)) < 0.15
    assert np.std(left(prepared, plain)) > 1.2 * np.std(left(prepared, fading))


@pytest.mark.parametrize("gap", [1e-3, 1e-2])
def test_behind_a_play_most_of_the_torque_is_told(gap: float) -> None:
    """How the far side is caught within a row is not told; when it is caught, and with how much momentum, is."""
    play = Backlash(gap_rad=gap, load_share=0.3, load_friction=0.5, load_viscous=5.0)
    mount = replace(read_card("paper_mount").plant(), effects=(play,))
    prepared = recorded_in_loop(mount)

    def size(*effects: Effect) -> float:
        return float(np.std(left(prepared, replace(mount, effects=effects))))

    assert size(play) < 0.23 * size()  # .215 over all rows; every tenth row, as were kept once, showed .16 by chance
    assert size(replace(play, gap_rad=1.5 * gap)) > 2 * size(play)
    assert size(replace(play, load_friction=0.0, load_viscous=0.0)) > 2 * size(play)


def assert_differences(mount: Mount, free: tuple[str, ...], pieces: Sequence[Piece], share: float) -> None:
    """Derivatives by the numbers are finite differences, but for a share of the largest."""
    inverse = Inverse(mount, free)
    values = np.array([dict(zip(inverse.names, inverse.start, strict=True))[name] for name in free])
    slopes = stacked(inverse, pieces, values)[1]
    for column, value in enumerate(values):
        step = np.eye(len(free))[column] * 1e-5 * (abs(value) or 1.0)
        up, down = (stacked(inverse, pieces, values + s * step)[0] for s in (1, -1))
        change = (up - down) / (2 * step[column])
        assert np.abs(change - slopes[:, column]).max() <= share * np.abs(change).max() + 1e-9, free[column]


@pytest.mark.parametrize("effect", HELD, ids=lambda one: type(one).__name__)
def test_derivatives_by_the_numbers_of_an_effect_are_finite_differences(effect: Effect) -> None:
    mount = replace(read_card("paper_mount").plant(), effects=fitting(effect))
    t = np.arange(6000) / 1000
    q, _, acceleration = swing(t, [(0.4, 2.0, 0.0), (0.01, 11.0, 0.0)], per=1)
    prefix = list(mount.components())[-1]
    free = tuple(one.name for one in mount.parameters() if one.name.startswith(prefix))
    assert_differences(mount, free, prepare([recorded(30.0 * acceleration, t, q)], 40.0).pieces, 1e-3)


@pytest.mark.parametrize("law", [law for law in LAWS.values() if law.key != "none"], ids=lambda law: law.key)
def test_derivatives_by_the_numbers_of_a_law_are_finite_differences(law: FrictionLaw) -> None:
    t, q, _v, a = wander(10.0)
    late = (Delay(delay_ms=2.0), ActuatorLag(time_constant_ms=3.0))
    effects = (FrictionAsymmetry(level_asymmetry=0.1, viscous_asymmetry=0.1), *late)
    mount = replace(read_card("paper_mount").plant(), friction=law, effects=effects)
    free = tuple(v.name for v in mount.parameters() if not v.name.endswith(("limit", "smoothing", "delta")))
    assert_differences(mount, free, prepare([recorded(a, t, q)], 20.0).pieces, 5e-4)


def test_a_drive_that_gives_nothing_past_its_knee_still_has_a_finite_need() -> None:
    bare = read_card("paper_mount").plant()
    stuck = replace(bare, effects=(TorqueSaturation(knee_torque=1.0, slope=0.0),))
    inverse = Inverse(stuck, ("axis.inertia", "torque_saturation.slope"))
    torque, slopes = stacked(inverse, recorded_in_loop(bare).pieces, inverse.present)
    assert np.isfinite(torque).all()
    assert np.isfinite(slopes).all()


def test_sliding_over_a_rough_track_costs_no_damping_of_the_bristles() -> None:
    """In fast sliding the bristles follow the level; rows that lie far apart must not make them lag behind it."""
    law = LuGre(sigma0=4e4, sigma1=600.0, sigma2=0.0, Fc=4.0)
    rough = PeriodicFriction(cycles_per_rev=2.0, relative_amplitude=0.3, phase=0.0)
    t = np.arange(20_000) / 1000
    q = 1.5 * np.sin(2 * np.pi * 0.15 * t)
    prepared = prepare([recorded(np.zeros_like(t), t, q)], 15.0)
    base = read_card("paper_mount").plant()
    mount = replace(base, axis=replace(base.axis, inertia=1e-9), friction=law, effects=(rough,))
    torque, _ = stacked(Inverse(mount, ()), prepared.pieces, np.zeros(0))
    v, at = prepared.stacked("v"), prepared.stacked("q")
    fast = np.abs(v) > 0.7
    level = 4.0 * (1 + 0.3 * np.cos(2 * at[fast]))
    assert prepared.pieces[0].dt > 5e-3
    assert np.abs(torque[fast] - level * np.sign(v[fast])).max() < 0.1


# The states of friction along a recorded speed, and what a fit finds with it.


def carried(law: FrictionLaw) -> tuple[Piece, np.ndarray]:
    """A recorded motion, and the states of the law that the inverse carries along it."""
    t, q, _v, a = wander()
    piece = prepare([recorded(a, t, q)], 20.0).pieces[0]
    inverse = Inverse(replace(read_card("paper_mount").plant(), friction=law), ())
    return piece, inverse._equations.states(inverse._equations.given(piece)[1], inverse.start)[0]


@pytest.mark.parametrize("times", [1e-3, 0.0099, 0.0101, 0.3, 3.0, 40.0, 1e4])
def test_a_level_that_goes_straight_counts_as_one_that_is_constant_but_later(times: float) -> None:
    """The exact solution of z' = times (level(t) - z) over one second, with a level from 1 to 3."""
    start, decay = -0.7, np.exp(-times)
    exact = 3 - 2 / times + (start - 1 + 2 / times) * decay
    assert (2 + float(_late(times))) * (1 - decay) + start * decay == pytest.approx(exact, abs=1e-10)


@pytest.mark.parametrize("law", WITH_MEMORY.values(), ids=WITH_MEMORY.keys())
def test_friction_states_are_as_near_to_those_of_fine_steps_as_with_the_level_of_the_middle(law: FrictionLaw) -> None:
    piece, states = carried(law)
    rows = np.arange(len(piece.v) - 1)
    fine = np.interp((np.arange(50 * len(rows)) + 0.5) / 50, np.arange(len(piece.v)), piece.v)
    exact = numeric(law).along(fine, piece.dt / 50)[:, 49::50]
    middle = numeric(law).along((piece.v[1:] + piece.v[:-1]) / 2, piece.dt)
    wrong, rough = (float(np.sqrt(np.mean((one - exact) ** 2))) for one in (states[:, 1:], middle))
    assert wrong < min(0.06, 1.001 * rough)


def test_a_mass_on_a_spring_follows_the_true_motion_of_the_encoder_that_is_tried() -> None:
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


def test_a_fit_recovers_what_made_the_torque() -> None:
    t, q, v, a = wander()
    tau = 6.2 * a + 2.4 * np.sign(v) + 0.7 * v
    prepared = prepare([recorded(tau, t, q)], 30.0)
    moving = (np.abs(prepared.stacked("v")) > 0.05).astype(float)
    found = fit(axis(), prepared.pieces, moving).parameters()
    assert found["axis.inertia"] == pytest.approx(6.2, rel=2e-3)
    assert found["friction.Fc"] == pytest.approx(2.4, rel=2e-2)
    assert found["friction.sigma2"] == pytest.approx(0.7, rel=0.1)
