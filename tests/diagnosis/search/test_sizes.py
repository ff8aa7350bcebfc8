"""The size of an effect is told by its 95 % range, and never at a bound."""

from dataclasses import replace

import pytest

from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.effects.tuning import ANY, at_bound
from cosim.diagnosis.search.sizes import Numbers, is_told, numbers_of
from pyfmi_models.effects import Cogging, Delay, Effect, FrictionAsymmetry, StribeckEffect, TorqueOffset
from pyfmi_models.effects.thermal_viscosity import ThermalViscosity, WarmingViscosity
from pyfmi_models.friction import Coulomb
from pyfmi_models.model import Recorded, parameters_of
from pyfmi_models.mount import Axis, Mount

MOUNT = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))
VISITED = Recorded(speed=2.0, torque=9.0)


@pytest.mark.parametrize(
    ("viscous", "level", "error", "told"),
    [
        (-0.03, 0.0, 0.01, True),
        (-0.03, 0.0, 0.02, False),  # the range holds none
        (0.0, 0.03, 0.01, True),  # one of two is enough
        (-1.0, 0.0, 0.01, False),  # at a bound, however narrow the range
        (-1.0, 0.03, 0.01, True),
        (-0.9, 0.9, 1.2, False),  # all that it may be
    ],
)
@pytest.mark.parametrize("form", [ThermalViscosity, WarmingViscosity])
def test_a_size_is_told_by_a_range_without_none_and_away_from_bounds(
    form: type[ThermalViscosity], viscous: float, level: float, error: float, told: bool
) -> None:
    more = {"warm_up_degC": 10.0} if form is WarmingViscosity else {}
    effect = form(viscous_per_degC=viscous, coulomb_per_degC=level, **more)
    names = ("viscous_per_degC", "coulomb_per_degC")
    numbers = Numbers({name: getattr(effect, name) for name in names}, dict.fromkeys(names, error))
    assert is_told(effect, numbers, MOUNT, VISITED) is told


# What a range, a bound or the wrong sign takes from a name: nothing is found whose size the recordings do not tell.

BARE = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=3.0))


def told(effect: Effect, **errors: float) -> bool:
    values = {variable.name: float(variable.start) for variable in parameters_of(effect)}
    return is_told(effect, Numbers(values, errors), replace(BARE, effects=(effect,)), ANY)


def test_a_range_that_holds_nothing_at_all_tells_no_size() -> None:
    offset = TorqueOffset(torque=1.0)
    assert told(offset, torque=1 / 1.97)
    assert not told(offset, torque=1 / 1.95), "none lies in the 95 % range"
    assert told(replace(offset, torque=-1.0), torque=1 / 1.97), "a negative one is as good"
    assert not told(replace(offset, torque=-1.0), torque=1 / 1.95)


def test_at_a_bound_no_size_is_told() -> None:
    known = {variable.name: variable for variable in parameters_of(Delay(delay_ms=1.0))}["delay_ms"]
    assert at_bound(Delay(delay_ms=known.high))
    assert at_bound(Delay(delay_ms=known.high * (1 - 2e-9))), "a fit goes on from 1e-9 of its scale inside"
    assert not at_bound(Delay(delay_ms=0.999 * known.high))
    assert not told(Delay(delay_ms=known.high), delay_ms=0.01 * known.high)
    assert told(Delay(delay_ms=0.999 * known.high), delay_ms=0.01 * known.high)


def test_of_several_sizes_one_inside_its_range_is_no_bound() -> None:
    """Another generator's friction of two directions has a viscous part beyond what a card may hold."""
    sizes = hypothesis_of(FrictionAsymmetry(level_asymmetry=0.1)).sizes
    for edge in (0.95, -0.95):
        assert not at_bound(FrictionAsymmetry(level_asymmetry=0.33, viscous_asymmetry=edge), sizes)
        assert at_bound(FrictionAsymmetry(level_asymmetry=0.33, viscous_asymmetry=edge))
        assert at_bound(FrictionAsymmetry(level_asymmetry=0.0, viscous_asymmetry=edge), sizes), "nothing is no size"
        assert at_bound(FrictionAsymmetry(level_asymmetry=edge, viscous_asymmetry=-edge), sizes)


def test_a_number_that_was_not_fitted_says_nothing_of_itself() -> None:
    assert told(Cogging(amplitude=0.1, cycles_per_rev=20.0))


def test_errors_go_to_the_numbers_of_their_own_effect() -> None:
    mount = replace(BARE, effects=(TorqueOffset(torque=1.0), Delay(delay_ms=2.0)))
    names = {part: name for name, part in mount.components().items() if isinstance(part, Effect)}
    errors = {f"{names[mount.effects[0]]}.torque": 0.1, f"{names[mount.effects[1]]}.delay_ms": 0.2}
    assert numbers_of(mount.effects[1], mount, errors).errors == {"delay_ms": 0.2}


@pytest.mark.parametrize(("level", "plausible"), [(2.1, True), (2.0, False), (1.5, False)])
def test_a_stribeck_curve_falls_from_a_break_away_above_the_level(level: float, plausible: bool) -> None:
    curve = StribeckEffect(Fs=level, Vs=0.1)
    assert hypothesis_of(curve).is_plausible(curve, BARE) is plausible


def test_a_range_that_holds_all_that_it_may_be_tells_no_size() -> None:
    known = {variable.name: variable for variable in parameters_of(Delay(delay_ms=1.0))}["delay_ms"]
    middle = 0.5 * (known.low + known.high)
    assert told(Delay(delay_ms=middle), delay_ms=0.2 * known.high)
    assert not told(Delay(delay_ms=middle), delay_ms=0.3 * known.high)
