"""How far training leaves the numbers of a structure open."""

import numpy as np

from cosim.diagnosis.evidence.structure import Structure
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

MOUNT = Mount(name="axis", axis=Axis(inertia=1.0), friction=Coulomb(Fc=1.0))


def test_changes_of_one_standard_error_make_up_the_covariance() -> None:
    spread = np.array([[4.0, 1.0], [1.0, 9.0]])
    found = Structure(MOUNT, ("a", "b"), np.zeros(2), spread).directions((0, 1))
    np.testing.assert_allclose(found @ found.T, spread, rtol=1e-12)


def test_a_number_of_which_training_says_nothing_leaves_the_others_as_they_are() -> None:
    """A rough spot that a fit had sent away, to 3e77, ended a diagnosis: its variance is no number."""
    spread = np.array([[4.0, np.nan, 0.0], [np.nan, np.inf, np.nan], [0.0, np.nan, 1e308]])
    found = Structure(MOUNT, ("a", "b", "c"), np.zeros(3), spread).directions((0, 1, 2))
    assert np.isfinite(found).all()
    np.testing.assert_allclose((found @ found.T)[0, 0], 4.0)
