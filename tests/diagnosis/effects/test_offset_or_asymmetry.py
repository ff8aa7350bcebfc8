"""A constant torque and friction of two directions: two numbers of an axis that moves, not three."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.effects import candidates
from cosim.estimation.prepare import Prepared, prepare
from pyfmi_models.effects import Effect, FrictionAsymmetry, TorqueOffset
from pyfmi_models.friction import Coulomb, FrictionLaw, LuGre
from pyfmi_models.mount import Axis, Mount

COULOMB = Coulomb(Fc=2.0, sigma2=1.0)
LUGRE = LuGre(sigma0=1e5, sigma1=300.0, sigma2=1.0, Fc=2.0, Fs=2.5, Vs=0.01)
OFFSET, ASYMMETRY = TorqueOffset(torque=0.3), FrictionAsymmetry(level_asymmetry=0.1, viscous_asymmetry=0.0)


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    t = np.arange(4_000) / 200
    v = 0.2 * np.cos(0.9 * t)
    return prepare([Recording("run", {"t": t, "tau": 2 * np.sign(v) + v, "q": np.cumsum(v) / 200})], 10.0)


def offered(prepared: Prepared, law: FrictionLaw, *effects: Effect) -> set[str]:
    mount = Mount(name="axis", axis=Axis(inertia=5.0), friction=law, effects=effects)
    rows = len(prepared.recording_of)
    return {one.effect for one in candidates(mount, prepared, np.ones(rows), np.ones(rows))}


@pytest.mark.parametrize(("law", "both"), [(COULOMB, False), (LUGRE, True)])
def test_one_is_offered_beside_the_other_only_where_rest_tells_them_apart(
    prepared: Prepared, law: FrictionLaw, both: bool
) -> None:
    assert {"torque_offset", "friction_asymmetry"} <= offered(prepared, law)
    assert ("friction_asymmetry" in offered(prepared, law, OFFSET)) is both
    assert ("torque_offset" in offered(prepared, law, ASYMMETRY)) is both
