"""Margins of the sampled loop are those of the textbook, and say when a loop really becomes unstable."""

from dataclasses import replace

import numpy as np
import pytest

from cosim_studies.paper.conditions import condition, tuned
from cosim_studies.paper.margins import Linear, feedback, held, margins
from cosim_studies.paper.options import ADAPTING, REFERENCE, options
from cosim_studies.paper.price import loops, price
from pyfmi_models.card import read_card
from pyfmi_models.effects import ActuatorLag
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.friction import Frictionless

H = 1e-4
FREE = replace(read_card("paper_mount"), friction=Frictionless())


def loop(**changes: object) -> tuple[Linear, Linear]:
    card = tuned(FREE, compensation="C1", **changes)
    return held(card.plant().model(), H, {}), feedback(card.controller_model(), {"started": 1.0})


def integrator(gain: float, period: float = H) -> Linear:
    """An integrator, x' = gain u, sampled."""
    return Linear(np.eye(1), np.array([gain * period]), np.ones(1), 0.0, period)


def gain(value: float, period: float = H) -> Linear:
    return Linear(np.zeros((0, 0)), np.zeros(0), np.zeros(0), value, period)


@pytest.mark.parametrize("rate", [10.0, 200.0])
@pytest.mark.parametrize("ticks", [1, 20])
def test_an_integrator_with_dead_time_has_the_margins_of_the_textbook(rate: float, ticks: int) -> None:
    """L = rate/s exp(-s T): crossover at rate, phase margin 90 deg - rate T; holding adds half a tick."""
    found = margins(integrator(rate), gain(1.0), ticks)
    late = (ticks + 0.5) * H
    assert found.stable
    assert found.crossover == pytest.approx(rate, rel=1e-3)
    assert found.phase == pytest.approx(90 - np.degrees(rate * late), abs=0.1)
    assert found.delay == pytest.approx(np.pi / 2 / rate - late, rel=1e-3)


def test_a_loop_is_unstable_just_beyond_its_delay_margin() -> None:
    plant, controller = loop()
    found = margins(plant, controller)
    ticks = int(found.delay / H)
    assert margins(plant, controller, 1 + ticks).stable
    assert not margins(plant, controller, 2 + ticks).stable


def test_the_papers_loop_has_the_margins_of_the_errata() -> None:
    """Errata: 54 deg, 10.3 ms, Ms 1.41; fourth order at 120 to 220 rad/s: 35 to 38 deg, 6.4 to 4.1 ms, 1.82 to 1.73."""
    found = margins(*loop())
    assert found.phase == pytest.approx(54, abs=1)
    assert found.delay == pytest.approx(10.3e-3, abs=0.1e-3)
    assert found.Ms == pytest.approx(1.41, abs=0.02)
    fourth = [margins(*loop(observer_order=4, observer_bandwidth=w)) for w in (120.0, 220.0)]
    assert [round(one.phase) for one in fourth] == pytest.approx([35, 38], abs=1)
    assert [1e3 * one.delay for one in fourth] == pytest.approx([6.4, 4.1], abs=0.1)
    assert [one.Ms for one in fourth] == pytest.approx([1.82, 1.73], abs=0.02)


def test_a_lag_of_the_drive_costs_its_angle_at_the_crossover() -> None:
    plant, controller = loop()
    slow = held(replace(FREE, effects=(ActuatorLag(time_constant_ms=0.5),)).plant().model(), H, {})
    with_lag, without = margins(slow, controller), margins(plant, controller)
    assert without.phase - with_lag.phase == pytest.approx(np.degrees(without.crossover * 0.5e-3), abs=0.3)


def test_ms_is_the_largest_sensitivity_on_the_unit_circle() -> None:
    found = margins(integrator(1.0), gain(1.0), 1)
    assert found.Ms == pytest.approx(1.0, abs=2e-4)  # L = 1/s: |1/(1+L)| < 1, and 1 at the end
    assert margins(integrator(3000.0), gain(1.0), 1).Ms > 1.3


def test_noise_of_the_command_is_that_of_a_simulation() -> None:
    """White noise of the reading through controller and loop, in time, against the integral over frequency."""
    plant, controller = loop()
    expected = margins(plant, controller).noise
    rng = np.random.default_rng(1)
    x, xc, command, seen = np.zeros(len(plant.A)), np.zeros(len(controller.A)), 0.0, []
    for n in rng.standard_normal(100_000):
        reading = plant.C @ x + n
        out = -(controller.C @ xc + controller.D * reading)
        x = plant.A @ x + plant.B * command
        xc = controller.A @ xc + controller.B * reading
        command = out
        seen.append(out)
    assert np.std(seen[5000:]) == pytest.approx(expected, rel=0.05)


def test_what_the_reading_does_not_reach_plays_no_part_in_a_loop() -> None:
    """A state that only the reference drives is neutral by itself; the loop's margins are those without it."""
    plant, controller = integrator(10.0), gain(1.0)
    idle = Linear(np.diag([1.0, 2.0]), np.array([0.0, 1.0]), np.array([1.0, 0.0]), 1.0, H)
    assert idle.reduced().A.shape == (0, 0)
    assert margins(plant, idle.reduced()) == margins(plant, controller)
    assert not margins(plant, idle).stable


def test_the_price_of_an_option_is_that_of_its_worst_point() -> None:
    """C2a's loop has its least phase at rest, where bristles it expects and does not meet push it."""
    option = next(one for one in options() if one.key == "C2a")
    where = option.under(condition("realistic_observer"))
    at = {name: margins(*pair) for name, pair in loops(where).items()}
    assert price(where).phase == at["at rest"].phase < at["sliding"].phase - 1
    assert price(where).Ms == at["sliding"].Ms


def test_a_flexible_mode_in_the_plant_is_part_of_the_loop() -> None:
    """Poorly damped and with the encoder on the motor, 20 Hz costs phase; friction that is taken away does not."""
    where = REFERENCE.under(condition("realistic_observer"))
    mode = Compliance(antiresonance_hz=18.0, resonance_hz=20.0, damping_ratio=0.01)
    flexible = replace(where, plant=replace(where.plant, effects=(*where.plant.effects, mode)))
    assert price(flexible).Ms > price(where).Ms
    assert price(flexible).phase < price(where).phase


def test_learning_on_line_is_part_of_the_loop_while_it_slides() -> None:
    adapting = ADAPTING.under(condition("realistic_observer"))
    plain, found = price(REFERENCE.under(condition("realistic_observer"))), price(adapting)
    assert found.stable
    assert plain.phase - 5 < found.phase < plain.phase - 1
