"""From a recording to the rows of a fit: bands, pieces, holes, noise, how much each row counts, and end stops."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from wandering import recorded, wander

from cosim.data.recording import Recording
from cosim.diagnosis.effects import hypothesis_of
from cosim.estimation.blocks import Blocks, covariance
from cosim.estimation.end_stops import pushes, without
from cosim.estimation.filters import derivative, lowpass, noise_of
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import Prepared, choose_cutoff, prepare, quality
from cosim.estimation.row_weights import least_way, remembers, weights
from cosim.support.errors import RecordingError
from pyfmi_models.effects.presliding import Presliding
from pyfmi_models.friction import LAWS, Coulomb, LuGre
from pyfmi_models.mount import Axis, Mount


def test_differences_have_fourth_order() -> None:
    errors = []
    for count in (100, 200):
        x = np.linspace(0, 1, count + 1)
        errors.append(np.abs(derivative(np.sin(6 * x), 1 / count) - 6 * np.cos(6 * x))[3:-3].max())
    assert np.log2(errors[0] / errors[1]) > 3.8


@pytest.mark.parametrize("cutoff", [20.0, 40.0])
def test_linear_terms_leave_no_residual_at_any_band(cutoff: float) -> None:
    t, q, v, a = wander()
    tau = 7.0 * a + 3.0 * v
    mount = Mount(name="m", axis=Axis(inertia=7.0), friction=Coulomb(Fc=0.0, sigma2=3.0))
    piece = prepare([recorded(tau, t, q)], cutoff).pieces[0]
    left = piece.tau - Inverse(mount, ()).torque(piece, np.zeros(0))[0]
    # What is left is the filters' memory of the ends of the record, half a second away.
    assert np.abs(left[piece.inside]).max() < 1e-5 * np.abs(tau).max()


@pytest.mark.parametrize("share", [0.6, 0.75, 0.9, 1.0])
def test_a_line_near_the_cutoff_is_kept_at_its_place(share: float) -> None:
    t, q, _, _ = wander(rate=1000.0)
    line = share * 100.0
    prepared = prepare([recorded(np.sin(2 * np.pi * line * t), t, q)], 100.0)
    kept, power = prepared.stacked("t"), prepared.stacked("tau")
    spectrum = np.abs(np.fft.rfft(power * np.hanning(len(power))))
    found = np.fft.rfftfreq(len(power), float(kept[1] - kept[0]))[int(np.argmax(spectrum))]
    assert found == pytest.approx(line, abs=0.1)


def test_a_noisy_encoder_narrows_the_band_and_white_noise_is_measured_beside_a_smooth_motion() -> None:
    t, q, v, a = wander()
    noise = np.random.default_rng(1).standard_normal(len(q))
    bands = [choose_cutoff([recorded(5 * a + np.sign(v), t, q + size * noise)], 5.0) for size in (0.0, 1e-6, 1e-4)]
    assert bands[0] > bands[1] > bands[2]
    assert noise_of(q + 1e-4 * noise, t[1] - t[0]) == pytest.approx(1e-4, rel=0.05)


def test_a_gap_cuts_a_recording_a_short_hole_is_bridged_and_nothing_but_holes_is_refused() -> None:
    t, q, v, a = wander()

    def holed(kept: np.ndarray) -> list[Recording]:
        return [recorded((5 * a)[kept], t[kept], q[kept])]

    cut = prepare(holed((t < 8) | (t > 10)), 30.0).pieces
    assert [float(round(piece.t[0])) for piece in cut] == [0.0, 10.0], "nothing is filled in"
    short = holed(np.delete(np.arange(len(t)), [4000, 4001, 7000]))
    (piece,) = prepare(short, 20.0).pieces
    assert np.abs(piece.v - np.interp(piece.t, t, v))[piece.inside].max() < 1e-3
    assert any("short beside what the filter passes" in said for said in quality(short[0], 20.0))
    assert len(prepare(short, 100.0).pieces) == 3
    with pytest.raises(RecordingError, match=r"run has \d+ holes in time, and pieces without holes must be 2 s"):
        prepare(holed((t % 2.5) < 1.5), 30.0)


def test_where_polls_are_uneven_the_band_ends_where_lines_bridge_the_steps() -> None:
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


def test_speeds_are_right_where_time_steps_jitter_to_one_side() -> None:
    t, q, v, a = wander()
    late = t + 0.4 * (t[1] - t[0]) * (np.arange(len(t)) % 3 == 0)
    read = recorded(5 * a, late, np.interp(late, t, q))
    assert any("interpolated to an even grid" in said for said in quality(read, 20.0))
    piece = prepare([read], 20.0).pieces[0]
    moving = piece.inside & (np.abs(piece.v) > 0.05)
    assert np.median(piece.v[moving] / np.interp(piece.t[moving], t, v)) == pytest.approx(1, abs=2e-3)


@pytest.mark.parametrize("rate", [200.0, 1000.0, 5000.0])
def test_a_constant_speed_has_no_acceleration_at_the_ends_of_its_pieces(rate: float) -> None:
    t = np.arange(round(4 * rate)) / rate
    (piece,) = prepare([recorded(0 * t, t, 0.4 * t)], 10.0).pieces
    assert np.abs(piece.lowpass(piece.a)[piece.kept]).max() < 1e-5


def test_what_is_thinned_keeps_no_full_recording_alive() -> None:
    """A view of every tenth row holds all of them."""
    t = np.arange(0.0, 6.0, 1e-4)
    moving = {"t": t, "tau": np.sin(3 * t), "q": np.sin(t), "q_d": np.sin(t), "temperature": 20 + t}
    (piece,) = prepare([Recording.of(moving)], 10.0).pieces
    signals = (piece.t, piece.q, piece.v, piece.a, *piece.extras.values())
    assert len(piece.t) < len(t) / 10
    assert all(one.flags.owndata for one in signals)


def test_standard_errors_come_from_five_blocks_at_least_and_from_numbers_that_act_on_rows() -> None:
    """A derivative may be as small as the tail of a bell, and its square none."""
    t, rng = np.arange(3240) / 500, np.random.default_rng(1)
    assert len(Blocks.of(prepare([recorded(np.cos(t), t, np.sin(t))], 20.0)).rows) == 5
    slopes, left = rng.standard_normal((600, 2)), rng.standard_normal(600)
    blocks = Blocks(tuple(np.split(np.arange(600), 12)), np.zeros(600, int))
    beside = covariance(np.column_stack([slopes, np.full(600, 1e-160)]), left, blocks)
    np.testing.assert_allclose(beside[:2, :2], covariance(slopes, left, blocks), rtol=1e-9)


# How much a row counts: rows that repeat one operating point count together, what moves slowly is not at rest.

COULOMB, LUGRE = Coulomb(Fc=1.0), LuGre(Fc=1.0, Fs=1.2, Vs=0.01, sigma0=1e3)
SOFT, SECONDS = replace(LUGRE, sigma0=1e2), (3, 6, 12)


def at_speeds(*speeds: np.ndarray) -> Prepared:
    runs = [{"t": np.arange(len(v)) / 100, "v": v, "tau": np.sign(v)} for v in speeds]
    return prepare([Recording(f"run_{number}", one) for number, one in enumerate(runs)], 5.0)


def of_each(prepared: Prepared, law: Coulomb | LuGre) -> np.ndarray:
    """Sum of squared weights of each recording."""
    return np.bincount(prepared.recording_of, weights=weights(law, prepared) ** 2)


@pytest.mark.parametrize("law", [COULOMB, LUGRE])
def test_recordings_of_one_speed_count_alike_however_long_they_last(law: Coulomb | LuGre) -> None:
    prepared = at_speeds(*(np.full(100 * s, float(s)) for s in SECONDS))
    assert of_each(prepared, law) == pytest.approx(len(prepared.recording_of) / 3)


def test_rows_of_recordings_that_visit_all_speeds_count_alike() -> None:
    prepared = at_speeds(*(np.sin(np.arange(100 * s) * 2 * np.pi / 150) for s in SECONDS))
    weight = weights(SOFT, prepared)
    assert weight == pytest.approx(np.ones(len(weight)), abs=0.05)


def test_one_recording_or_one_speed_in_all_is_weighed_by_nothing_but_rest() -> None:
    prepared = at_speeds(np.repeat([1.0, 0.001], 600))
    assert set(np.unique(weights(COULOMB, prepared))) == {0.0, 1.0}
    assert set(np.unique(weights(SOFT, prepared))) == {1.0}
    assert weights(COULOMB, at_speeds(*[np.full(600, 1.0)] * 2)) == pytest.approx(1.0)


def test_a_recording_that_moves_slowly_counts_and_one_at_rest_does_not() -> None:
    noise = np.random.default_rng(1).standard_normal(600)
    prepared = at_speeds(np.full(600, 10.0), np.full(600, -10.0), np.full(600, 0.1), 1e-4 * noise)
    slow, still = of_each(prepared, COULOMB)[2:]
    assert slow > 0
    assert still == 0


@pytest.mark.parametrize(("step", "rests"), [(1e-6, 1.0), (6e-4, 0.0)])
def test_a_bristle_that_slides_within_the_encoders_step_says_nothing_at_rest(step: float, rests: float) -> None:
    t = np.arange(1200) / 100
    way = np.where(t < 6, t, 6.0 + 2 * step * np.sin(8 * t))
    read = step * np.rint(way / step)
    prepared = prepare([Recording("run", {"t": t, "q": read, "tau": np.ones_like(t)})], 5.0)
    assert rests == 1.0 or least_way(prepared) == pytest.approx(2 * step)
    assert remembers(LUGRE, prepared) is (rests == 1.0)
    still = prepared.stacked("t") > 7
    assert np.median(weights(LUGRE, prepared)[still]) == rests


def turning() -> Prepared:
    """Turns at 1 rad/s2 behind a filter of 5 Hz are smeared by 1 mrad; a quarter of it is the least way."""
    t = np.arange(1200) / 100
    return prepare([recorded(np.ones_like(t), t, np.sin(t))], 5.0)


@pytest.mark.parametrize(("reach", "remembered"), [(1e-2, True), (1e-4, False)])
def test_a_bristle_that_slides_within_what_the_filter_smears_is_not_remembered(reach: float, remembered: bool) -> None:
    prepared = turning()
    assert least_way(prepared) == pytest.approx(0.25 * np.sqrt(0.5) / (2 * np.pi * 5) ** 2, rel=0.05)
    assert remembers(replace(LUGRE, sigma0=LUGRE.Fc / reach), prepared) is remembered


def test_what_a_bristle_bends_goes_by_what_it_holds_at_rest() -> None:
    """A Coulomb level that a fit has lost is none: before it slides the bristle holds Fs."""
    assert remembers(LUGRE, at_speeds(np.full(600, 1.0)))
    assert not remembers(COULOMB, at_speeds(np.full(600, 1.0))), "a law without memory remembers nothing"
    prepared = turning()
    lost = replace(LUGRE, sigma0=LUGRE.Fs / (2 * least_way(prepared)), Fc=1e-3 * LUGRE.Fs)
    assert remembers(lost, prepared)
    assert not remembers(replace(lost, Fc=0.4 * LUGRE.Fs), prepared), "a level that is there counts"
    assert not remembers(replace(lost, Fs=0.4 * LUGRE.Fs), prepared)
    contact, still = Presliding(sigma0=lost.sigma0), replace(COULOMB, Fc=lost.Fc)
    for law, shown in ((LAWS["static"](Fc=lost.Fc, Fs=LUGRE.Fs, Vs=0.1, sigma2=0.0), True), (still, False)):
        mount = Mount(name="axis", axis=Axis(inertia=1.0), friction=law, effects=(contact,))
        assert hypothesis_of(contact).shows(contact, mount, prepared) is shown


# Pushes against an end stop are found where they are, and nothing else is taken for one.

STEP, STOP = 1e-3, 0.5
SLIDING = Mount(name="axis", axis=Axis(inertia=0.5), friction=Coulomb(Fc=2.0, sigma2=1.5))


def against(load: Callable[[np.ndarray], np.ndarray], stop: float = np.inf) -> Recording:
    """A sine of .6 rad beside faster ones; a contact at the stop gives way by .1 mm a newton: a loop pushes harder."""
    t = np.arange(0, 20, STEP)
    asked = 0.6 * np.sin(2 * np.pi * 0.23 * t) + 0.05 * np.sin(2 * np.pi * 1.1 * t)
    beyond = np.maximum(asked - stop, 0.0)
    q = asked - 0.99 * beyond
    v = np.gradient(q, STEP)
    tau = 0.5 * np.gradient(v, STEP) + 2.0 * np.tanh(v / 0.01) + 1.5 * v + 100 * beyond + 4 * (beyond > 0) + load(asked)
    noise = np.random.default_rng(3).normal(0, 1, (2, len(t)))
    return recorded(tau + 0.02 * noise[0], t, q + 1e-6 * noise[1])


def test_a_stop_is_found_where_it_is_and_its_rows_are_judged_no_more() -> None:
    run = against(np.zeros_like, STOP)
    (found,) = pushes([run], SLIDING)
    assert found.at == pytest.approx(STOP, abs=0.003)
    assert 4 < found.torque < 20
    freed = without([run], (found,))[0]
    beyond, inside = run["q"] > STOP, (run.t > 3) & (run.t < 19.5)
    assert freed.is_masked(run.t, 0.0)[beyond & inside].mean() > 0.95
    assert freed.is_masked(run.t, 0.0)[~beyond & inside].mean() < 0.1
    speed = Recording("run", {"t": run.t, "tau": run["tau"], "v": np.gradient(run["q"], STEP)})
    assert pushes([speed], SLIDING) == (), "without a position nothing is said"


@pytest.mark.parametrize(
    "load",
    [
        pytest.param(np.zeros_like, id="nothing"),
        pytest.param(lambda q: 8.0 * np.sin(q), id="an unbalance"),
        pytest.param(lambda q: 15.0 * np.maximum(0, np.abs(q) - 0.3) * np.sign(q), id="a cable loose in the middle"),
        pytest.param(lambda q: 40.0 * q**3, id="a cable that hardens"),
    ],
)
def test_what_grows_with_the_position_is_no_stop(load: Callable[[np.ndarray], np.ndarray]) -> None:
    assert pushes([against(load)], SLIDING) == ()


def test_an_axis_that_works_at_one_end_does_not_push_there() -> None:
    """It turns far away and back, then moves to and fro within the last hundredth of the travel."""
    t = np.arange(0, 30, STEP)
    far = np.where(t < 15, 30 * np.sin(np.pi * t / 15) ** 2, 0.0)
    near = np.where(t > 16, 0.3 * np.sin(2.1 * (t - 16)), 0.0)
    v = np.gradient(near - far, STEP)
    tau = 0.5 * np.gradient(v, STEP) + 2.0 * np.tanh(v / 0.01) + 1.5 * np.tanh(v) + 4.0 * np.tanh(near / 0.05)
    assert pushes([recorded(tau, t, near - far)], SLIDING) == ()
