"""Standard errors over blocks of rows."""

import numpy as np

from cosim.estimation.blocks import Blocks, covariance


def test_a_number_that_acts_on_no_row_leaves_the_others_their_errors() -> None:
    """A derivative may be as small as the tail of a bell, and its square none."""
    rng = np.random.default_rng(1)
    slopes, left = rng.standard_normal((600, 2)), rng.standard_normal(600)
    blocks = Blocks(tuple(np.split(np.arange(600), 12)), np.zeros(600, int))
    alone = covariance(slopes, left, blocks)
    beside = covariance(np.column_stack([slopes, np.full(600, 1e-160)]), left, blocks)
    np.testing.assert_allclose(beside[:2, :2], alone, rtol=1e-9)
