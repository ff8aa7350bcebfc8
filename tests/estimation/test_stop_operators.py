"""Stop operators, row by row and all rows of one way at once."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cosim.estimation.discrepancy_basis import stop_operators

DISTANCES = np.geomspace(0.3, 30.0, 5)


@given(arrays(float, st.integers(2, 60), elements=st.integers(-9, 9).map(float)), st.sampled_from((-1.0, 0.0, 2.0)))
def test_a_stop_is_elastic_up_to_its_distance_and_then_slides(q: Any, speed: float) -> None:
    """Rests and turns of one row are among the positions."""
    piece: Any = SimpleNamespace(q=q, v=np.full(len(q), speed))
    state = np.sign(speed) * np.ones(len(DISTANCES))
    for row, found in enumerate(stop_operators(piece, DISTANCES)):
        state = np.clip(state + (q[row] - q[max(row - 1, 0)]) / DISTANCES, -1, 1)
        np.testing.assert_allclose(found, state, atol=1e-12)
