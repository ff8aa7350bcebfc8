"""Units of what people read: each shown number is the SI value in the unit that stands behind it."""

import pytest

from cosim.plots.quantities import FAMILIES, Scale
from cosim.support.units import unit

SIGNS = {"°": "deg", "′": "arcmin", "″": "arcsec", "·": "."}
SHOWN = [(si, scale) for si, family in FAMILIES.items() for scale in family]


@pytest.mark.parametrize(("si", "scale"), SHOWN, ids=[f"{si} as {scale.unit}" for si, scale in SHOWN])
def test_a_scale_is_the_size_of_its_unit(si: str, scale: Scale) -> None:
    name = scale.unit
    for sign, word in SIGNS.items():
        name = name.replace(sign, word)
    assert unit(name).dimension == unit(si).dimension
    assert scale.factor * unit(name).factor == pytest.approx(1.0, rel=1e-12)


def test_the_scales_of_a_unit_begin_with_the_largest_and_each_is_smaller() -> None:
    for family in FAMILIES.values():
        factors = [scale.factor for scale in family]
        assert factors == sorted(factors)
        assert len(set(factors)) == 3
