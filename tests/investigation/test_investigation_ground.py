"""What counts as new ground: each kind of motion that no recording held, not only places and speeds."""

from collections.abc import Callable

import numpy as np
import pytest

from cosim.estimation.prepare import Piece, Prepared
from cosim.investigation.design import piece_of
from cosim.investigation.families import fast_tone, reversal_ladder, slow_sweep, stop_and_go, tone
from cosim.investigation.ground import new_ground, visited
from cosim.investigation.limits import Limits
from cosim.investigation.motions import Motion, Room, room_of

LIMITS = Limits(-1.5, 1.5, 1.0, 3.0, 60.0, 2.4)
CUTOFF = 30.0


def piece(family: Callable[[Room], Motion]) -> Piece:
    found, left = piece_of(family(room_of(LIMITS, 0.0, 12.0, 1, False)), 0.0, CUTOFF, LIMITS)
    assert not left
    return found


def ground(family: Callable[[Room], Motion], *known: Callable[[Room], Motion]) -> float:
    before = Prepared(tuple(map(str, known)), tuple(map(piece, known)), CUTOFF, True)
    return new_ground(piece(family), visited(before, LIMITS), LIMITS)


@pytest.mark.parametrize("family", [tone, stop_and_go, slow_sweep, reversal_ladder])
def test_the_same_motion_again_is_no_new_ground(family: Callable[[Room], Motion]) -> None:
    assert ground(family, family) == 0.0


def test_rests_are_new_ground_where_nothing_rested() -> None:
    assert ground(stop_and_go, tone, fast_tone) > 0.3
    assert ground(stop_and_go, tone, fast_tone) > ground(fast_tone, tone) + 0.1


def test_smaller_strokes_are_new_ground_where_all_were_long() -> None:
    seen = ground(reversal_ladder, slow_sweep, stop_and_go)
    assert seen > ground(reversal_ladder, slow_sweep, stop_and_go, reversal_ladder) == 0.0
    assert np.isclose(ground(reversal_ladder, reversal_ladder, tone), 0.0)
