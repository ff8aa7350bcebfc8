"""Nuisances of a comparison: how many there are, and that holes in time do not make more of them."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.evidence.discrepancy import WAVES, Discrepancy, discrepancy
from cosim.estimation.prepare import Prepared, prepare
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount

AXIS = Mount(name="axis", axis=Axis(inertia=5.0), friction=Coulomb(Fc=2.0, sigma2=1.0))


def recorded(name: str, holes: tuple[float, ...] = ()) -> Recording:
    """A minute of motion at 200 Hz, half a second left out at each of `holes` [s]."""
    t = np.arange(12_000) / 200
    t = t[[not any(hole <= one < hole + 0.5 for hole in holes) for one in t]]
    q, v = 0.3 * np.sin(0.9 * t), 0.27 * np.cos(0.9 * t)
    return Recording(name, {"t": t, "tau": 2 * np.sign(v) + v - 5 * 0.81 * q, "q": q})


def made(*recordings: Recording) -> tuple[Prepared, Discrepancy]:
    prepared = prepare(recordings, 10.0)
    return prepared, discrepancy(AXIS, prepared, POLICY)


@pytest.mark.parametrize("holes", [(), (20.0,), (11.0, 23.0, 37.0, 51.0)])
def test_a_level_wanders_over_a_recording_whatever_holes_it_has(holes: tuple[float, ...]) -> None:
    prepared, found = made(recorded("a", holes), recorded("b"))
    assert len(prepared.pieces) == len(holes) + 2
    groups = {one.name: len(one.columns) for one in found.groups}
    assert groups["wander"] == 2 * WAVES


def test_a_level_is_one_before_a_hole_and_after_it() -> None:
    whole, cut = (made(recorded("a", holes)) for holes in ((), (20.0, 40.0)))
    rows = [
        np.flatnonzero(np.isin(np.round(w.stacked("t"), 6), np.round(o.stacked("t"), 6)))
        for w, o in ((whole[0], cut[0]), (cut[0], whole[0]))
    ]
    columns = [one.columns[:, one.groups[-1].columns] for _, one in (whole, cut)]
    smooth = np.abs(whole[0].stacked("v")[rows[0]]) > 0.1  # filters remember the ends of a piece where friction turns
    assert columns[0][rows[0]][smooth] == pytest.approx(columns[1][rows[1]][smooth], abs=0.05)
    assert np.abs(columns[0]).max() > 1


def test_a_recording_has_no_share_in_the_wander_of_another() -> None:
    prepared, found = made(recorded("a"), recorded("b", (30.0,)))
    wander = found.columns[:, found.groups[-1].columns]
    assert not wander[prepared.recording_of == 1, :WAVES].any()
    assert not wander[prepared.recording_of == 0, WAVES:].any()
