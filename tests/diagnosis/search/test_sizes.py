"""The size of an effect is told by its 95 % range, and never at a bound."""

import pytest

from cosim.diagnosis.search.sizes import Numbers, is_told
from pyfmi_models.effects.thermal_viscosity import ThermalViscosity, WarmingViscosity
from pyfmi_models.friction import Coulomb
from pyfmi_models.model import Recorded
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
