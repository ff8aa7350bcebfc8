"""From a recording to what the tests work on: bands, pieces, holes, noise, and what is refused before."""

import numpy as np
import pytest
from wandering import recorded, wander

from cosim.data.recording import Recording
from cosim.estimation.blocks import Blocks, covariance
from cosim.estimation.filters import derivative, lowpass, noise_of
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import choose_cutoff, prepare, quality
from cosim.support.errors import RecordingError
from pyfmi_models.friction import Coulomb
from pyfmi_models.mount import Axis, Mount


class TestPreparation:
    def test_differences_have_fourth_order(self) -> None:
        errors = []
        for count in (100, 200):
            x = np.linspace(0, 1, count + 1)
            errors.append(np.abs(derivative(np.sin(6 * x), 1 / count) - 6 * np.cos(6 * x))[3:-3].max())
        assert np.log2(errors[0] / errors[1]) > 3.8

    def test_linear_terms_leave_no_residual_at_any_band(self) -> None:
        t, q, v, a = wander()
        tau = 7.0 * a + 3.0 * v
        mount = Mount(name="m", axis=Axis(inertia=7.0), friction=Coulomb(Fc=0.0, sigma2=3.0))
        for cutoff in (20.0, 40.0):
            piece = prepare([recorded(tau, t, q)], cutoff).pieces[0]
            left = piece.tau - Inverse(mount, ()).torque(piece, np.zeros(0))[0]
            # What is left is the filters' memory of the ends of the record, half a second away.
            assert np.abs(left[piece.inside]).max() < 1e-5 * np.abs(tau).max()

    @pytest.mark.parametrize("share", [0.6, 0.75, 0.9, 1.0])
    def test_a_line_near_the_cutoff_is_kept_at_its_place(self, share: float) -> None:
        t, q, _, _ = wander(rate=1000.0)
        line = share * 100.0
        prepared = prepare([recorded(np.sin(2 * np.pi * line * t), t, q)], 100.0)
        kept, power = prepared.stacked("t"), prepared.stacked("tau")
        spectrum = np.abs(np.fft.rfft(power * np.hanning(len(power))))
        found = np.fft.rfftfreq(len(power), float(kept[1] - kept[0]))[int(np.argmax(spectrum))]
        assert found == pytest.approx(line, abs=0.1)

    def test_a_noisy_encoder_narrows_the_band(self) -> None:
        t, q, v, a = wander()
        rng = np.random.default_rng(1)
        tau = 5 * a + np.sign(v)
        bands = [
            choose_cutoff([recorded(tau, t, q + noise * rng.standard_normal(len(q)))], 5.0)
            for noise in (0.0, 1e-6, 1e-4)
        ]
        assert bands[0] > bands[1] > bands[2]

    def test_white_noise_is_measured_beside_a_smooth_motion(self) -> None:
        t, q, _, _ = wander()
        noise = 1e-4 * np.random.default_rng(2).standard_normal(len(q))
        assert noise_of(q + noise, t[1] - t[0]) == pytest.approx(1e-4, rel=0.05)

    def test_a_gap_cuts_a_recording_in_two_and_nothing_is_filled_in(self) -> None:
        t, q, _v, a = wander()
        keep = (t < 8) | (t > 10)
        pieces = prepare([recorded((5 * a)[keep], t[keep], q[keep])], 30.0).pieces
        assert [float(round(piece.t[0])) for piece in pieces] == [0.0, 10.0]

    def test_a_hole_that_is_short_beside_what_the_filter_passes_is_bridged_and_said(self) -> None:
        t, q, v, a = wander()
        keep = np.ones(len(t), bool)
        keep[[4000, 4001, 7000]] = False
        holed = recorded((5 * a)[keep], t[keep], q[keep])
        (piece,) = prepare([holed], 20.0).pieces
        assert np.abs(piece.v - np.interp(piece.t, t, v))[piece.inside].max() < 1e-3
        assert any("short beside what the filter passes" in said for said in quality(holed, 20.0))
        assert len(prepare([holed], 100.0).pieces) == 3

    def test_where_polls_are_uneven_the_band_ends_where_lines_bridge_the_steps(self) -> None:
        """A computer that polls a drive is late by one to four steps, time and again: no half second without."""
        t, q, _, a = wander()
        steps = np.random.default_rng(3).choice([1, 5], len(t), p=[0.9, 0.1])
        rows = np.cumsum(15 * steps)
        rows = rows[rows < len(t)]
        polled = recorded((5 * a)[rows], t[rows], q[rows])
        prepared = prepare([polled], 30.0)
        assert 0.5 < prepared.cutoff < 6.0
        (piece,) = prepared.pieces
        dt = float(t[1] - t[0])
        slow = derivative(lowpass(q, dt, prepared.cutoff), dt)  # what even rows say in that band
        assert np.abs(piece.v - np.interp(piece.t, t, slow))[piece.inside].max() < 0.05 * np.abs(slow).max()

    def test_a_recording_that_is_nothing_but_holes_is_refused(self) -> None:
        t, q, _, a = wander()
        short = (t % 2.5) < 1.5
        with pytest.raises(RecordingError, match=r"run has \d+ holes in time, and pieces without holes must be 2 s"):
            prepare([recorded((5 * a)[short], t[short], q[short])], 30.0)

    def test_speeds_are_right_where_time_steps_jitter_to_one_side(self) -> None:
        t, q, v, a = wander()
        late = t + 0.4 * (t[1] - t[0]) * (np.arange(len(t)) % 3 == 0)
        piece = prepare([recorded(5 * a, late, np.interp(late, t, q))], 20.0).pieces[0]
        moving = piece.inside & (np.abs(piece.v) > 0.05)
        assert np.median(piece.v[moving] / np.interp(piece.t[moving], t, v)) == pytest.approx(1, abs=2e-3)

    @pytest.mark.parametrize("rate", [200.0, 1000.0, 5000.0])
    def test_a_constant_speed_has_no_acceleration_at_the_ends_of_its_pieces(self, rate: float) -> None:
        t = np.arange(round(4 * rate)) / rate
        (piece,) = prepare([Recording("run", {"t": t, "tau": 0 * t, "q": 0.4 * t})], 10.0).pieces
        assert np.abs(piece.lowpass(piece.a)[piece.kept]).max() < 1e-5

    def test_standard_errors_come_from_five_blocks_at_least(self) -> None:
        t = np.arange(3240) / 500
        short = prepare([Recording("run", {"t": t, "tau": np.cos(t), "q": np.sin(t)})], 20.0)
        assert len(Blocks.of(short).rows) == 5


def test_what_is_thinned_keeps_no_full_recording_alive() -> None:
    """A view of every tenth row holds all of them."""
    t = np.arange(0.0, 6.0, 1e-4)
    moving = {"t": t, "tau": np.sin(3 * t), "q": np.sin(t), "q_d": np.sin(t), "temperature": 20 + t}
    (piece,) = prepare([Recording.of(moving)], 10.0).pieces
    signals = (piece.t, piece.q, piece.v, piece.a, *piece.extras.values())
    assert len(piece.t) < len(t) / 10
    assert all(one.flags.owndata for one in signals)


def test_a_number_that_acts_on_no_row_leaves_the_others_their_errors() -> None:
    """A derivative may be as small as the tail of a bell, and its square none."""
    rng = np.random.default_rng(1)
    slopes, left = rng.standard_normal((600, 2)), rng.standard_normal(600)
    blocks = Blocks(tuple(np.split(np.arange(600), 12)), np.zeros(600, int))
    alone = covariance(slopes, left, blocks)
    beside = covariance(np.column_stack([slopes, np.full(600, 1e-160)]), left, blocks)
    np.testing.assert_allclose(beside[:2, :2], alone, rtol=1e-9)
