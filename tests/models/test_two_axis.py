"""Two axes on one sky: what the axes do to each other, and where the mount then points."""

from dataclasses import replace
from functools import partial
from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from effect_examples import evaluate
from hypothesis import given, settings
from hypothesis import strategies as some

import cosim.models.cache
from cosim.data.star import SIDEREAL_RATE
from cosim.master.simulate import run
from cosim.support.errors import FmuError, ScenarioError
from cosim.system.scenario import parse_scenario, read_scenario
from pyfmi_models.effects.alt_az import AltitudeInertia, AzimuthCentrifugal
from pyfmi_models.friction.coulomb import Frictionless
from pyfmi_models.model import Model
from pyfmi_models.mount import Axis, Mount

ARCSEC = pi / 648000
TUBE, ZENITH_INERTIA, TUBE_INERTIA = 12.0, 24.0, 20.0


# The star


def direction(azimuth: np.ndarray, altitude: np.ndarray) -> np.ndarray:
    """North, east, up."""
    return np.stack([np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude)])


# What the axes do to each other


def axes(friction: type[Frictionless] = Frictionless) -> tuple[Model, Model]:
    azimuth = Mount(
        name="azimuth",
        axis=Axis(inertia=ZENITH_INERTIA),
        friction=friction(),
        effects=(AltitudeInertia(tube_inertia=TUBE),),
    )
    altitude = Mount(
        name="altitude",
        axis=Axis(inertia=TUBE_INERTIA),
        friction=friction(),
        effects=(AzimuthCentrifugal(tube_inertia=TUBE),),
    )
    return azimuth.model(), altitude.model()


def energy(altitude: np.ndarray, turning: np.ndarray, swinging: np.ndarray) -> np.ndarray:
    whole = ZENITH_INERTIA + TUBE * np.cos(altitude) ** 2
    return whole * turning**2 / 2 + TUBE_INERTIA * swinging**2 / 2


def accelerations(altitude: float, turning: float, swinging: float, torques: tuple[float, float]) -> tuple[float, ...]:
    azimuth, tube = axes()
    rates = {"speed": turning, "altitude": altitude, "altitude_rate": swinging, "tau": torques[0]}
    one = evaluate(azimuth, **rates)["der(speed)"]
    other = evaluate(tube, position=altitude, speed=swinging, azimuth_rate=turning, tau=torques[1])["der(speed)"]
    return one, other


@settings(deadline=None, max_examples=30)
@given(
    altitude=some.floats(-1.5, 1.5),
    speeds=some.tuples(some.floats(-2, 2), some.floats(-2, 2)),
    torques=some.tuples(some.floats(-9, 9), some.floats(-9, 9)),
)
def test_energy_changes_by_the_work_of_the_torques_alone(
    altitude: float, speeds: tuple[float, float], torques: tuple[float, float]
) -> None:
    turning, swinging = speeds
    found = accelerations(altitude, turning, swinging, torques)
    h = 1e-6
    ends = [energy(altitude + s * swinging, turning + s * found[0], swinging + s * found[1]) for s in (-h, h)]
    power = torques[0] * turning + torques[1] * swinging
    assert (ends[1] - ends[0]) / (2 * h) == pytest.approx(power, abs=1e-6)


# The scenario


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


def test_the_shipped_scenario_keeps_the_star_within_four_arcsec_of_gusts(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cosim.models.cache, "_home", lambda: cache)
    scenario = replace(cosim.models.cache.with_fmus(read_scenario("two_axis")), ticks=50_000, decimation=1)
    done = run(scenario)
    table, begun = done.recording, slice(10_000, None)
    assert done.statistics["unconnected"] == []
    # The sky sees the angles of the tick before: the same formula on the recorded ones, one row apart.
    wanted, real = (direction(table[f"azimuth_{of}"], table[f"altitude_{of}"]) for of in ("q_d", "position"))
    apart = np.linalg.norm(wanted - real, axis=0)
    np.testing.assert_allclose(table["sky_error"][1:], apart[:-1], atol=1e-4 * ARCSEC)
    shrunk = cos(np.radians(86)) * (table["azimuth_q_d"] - table["azimuth_position"])
    np.testing.assert_allclose(table["cross_elevation"][1:][begun], shrunk[:-1][begun], atol=1e-3 * ARCSEC)
    error = table["sky_error"][begun] / ARCSEC
    assert 0.1 < np.sqrt(np.mean(error**2)) < 2
    assert error.max() < 4
    assert table["azimuth_position"][0] == table["azimuth_q_d"][0]
    assert table["azimuth_v"][0] == pytest.approx(SIDEREAL_RATE * cos(pi / 4) / sin(np.radians(4)), rel=1e-3)


# Start values from signals, models without a card

TEXT = """
step = 0.1
stop = 1.0
[components.one]
fmu = "tiny3.fmu"
parameters = { k = "r.velocity", mode = 2.0 }
[signals.r]
kind = "ramp"
start = 5.0
velocity = 0.25
[[connections]]
from = "r.position"
to = "one.a"
[record]
signals = { y = "one.y" }
"""


def test_a_component_may_start_at_the_value_of_a_signal(tiny: dict[int, Path]) -> None:
    done = run(parse_scenario(TEXT, "start.toml", tiny[3].parent)).recording
    assert done.origin["components"]["one"]["parameters"] == {"k": 0.25, "mode": 2.0}
    np.testing.assert_allclose(done["y"][2], 0.25 * 5.025)  # k a, seen a tick later
    with pytest.raises(FmuError, match=r'"one.k" is "r.speed"; it must be a number, or an output of a signal'):
        run(parse_scenario(TEXT.replace("r.velocity", "r.speed"), "start.toml", tiny[3].parent))


def test_a_component_has_one_source_and_a_model_that_exists() -> None:
    wrong = partial(TEXT.replace, 'fmu = "tiny3.fmu"')
    with pytest.raises(ScenarioError, match=r'components.one breaks a rule: give fmu = "...", or card ='):
        parse_scenario(wrong('fmu = "tiny3.fmu"\nmodel = "pointing_error"'), "x.toml", Path())
    with pytest.raises(ScenarioError, match=r"components.one.model = 'pointing' breaks a rule: input should be"):
        parse_scenario(wrong('model = "pointing"'), "x.toml", Path())
    with pytest.raises(ScenarioError, match='the component "one" has no FMU yet'):
        run(parse_scenario(wrong('model = "pointing_error"'), "x.toml", Path()))
