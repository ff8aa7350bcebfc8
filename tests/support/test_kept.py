"""What was found of an object goes with it: recordings of a diagnosis that has ended take no memory."""

import gc
from weakref import ref

import numpy as np
from wandering import recorded, wander

from cosim.diagnosis.effects.delay_and_lag import reading_lag
from cosim.estimation.discrepancy_basis import discrepancy_basis
from cosim.estimation.play import torques_of_grid
from cosim.estimation.prepare import prepare
from cosim.support.kept import kept_with


class Thing:
    """Something that may be forgotten."""


def test_only_what_was_asked_last_is_kept_and_all_of_it_goes_with_its_object() -> None:
    asked = []

    @kept_with(most=2)
    def find(of: Thing, number: int) -> Thing:
        asked.append(number)
        return Thing()

    one, other = Thing(), Thing()
    first = find(one, 1)
    assert find(one, 2) is not first
    assert find(one, 1) is first
    find(one, 3)
    assert find(one, 1) is first, "it was asked for last but one"
    find(one, 2)
    find(other, 2)
    assert find(other, number=3) is find(other, number=3) is not find(other, 2), "a name is asked for too"
    assert asked == [1, 2, 3, 2, 2, 3]
    there = ref(first)
    del one, first
    gc.collect()
    assert there() is None


def test_no_recording_outlives_its_diagnosis() -> None:
    t, q, _, a = wander(4.0)
    prepared = prepare([recorded(a, t, q)], 30.0)
    stops, _ = discrepancy_basis(prepared)
    assert discrepancy_basis(prepared)[0] is stops
    assert reading_lag(prepared) is None
    assert np.isfinite(torques_of_grid(prepared, ((1e-3, 0.1),), 0.0)).all()
    there = ref(prepared)
    del prepared
    gc.collect()
    assert there() is None
