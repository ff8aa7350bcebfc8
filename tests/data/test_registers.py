"""Registers that begin again are put together, and what only looks like one is left as it is."""

import numpy as np
import pytest

from cosim.data.recording import Recording
from cosim.data.registers import continued

T = np.arange(4000) / 500
Q = 3.0 * np.sin(0.9 * T) + 2.5 * T
"""Three turns and a half, forth and back."""
TAU = np.rint(400 * np.sin(1.3 * T))


@pytest.mark.parametrize(
    ("unit", "turn"), [("", 2 * np.pi), ("", 360.0), ("rad", 2 * np.pi), ("deg", 360.0), ("turn", 1)]
)
@pytest.mark.parametrize("low", [0.0, -0.5])
def test_the_turns_of_a_position_are_counted(unit: str, turn: float, low: float) -> None:
    """An encoder of one turn counts from 0 to it, or from half a turn on either side."""
    q = Q * turn / (2 * np.pi)
    read = np.mod(q - low * turn, turn) + low * turn
    table, (note,) = continued("run", {"t": T, "q": read}, {"q": unit} if unit else {})
    np.testing.assert_allclose(table["q"] - table["q"][0], q - q[0], atol=1e-9 * turn)
    assert note.startswith('run: "q" begins again at ')


def test_a_set_point_stays_on_the_turn_of_the_position() -> None:
    q = np.mod(Q, 2 * np.pi)
    ahead = np.mod(Q + 0.05, 2 * np.pi)
    table, notes = continued("run", {"q": q, "q_d": ahead}, {})
    assert len(notes) == 1
    np.testing.assert_allclose(table["q_d"] - table["q"], 0.05, atol=1e-9)


def test_a_set_point_that_goes_on_is_brought_to_the_turn_of_the_position() -> None:
    table, _ = continued("run", {"q": np.mod(Q + 1.0, 2 * np.pi), "q_d": Q + 4 * np.pi + 1.05}, {})
    np.testing.assert_allclose(table["q_d"] - table["q"], 0.05, atol=1e-9)


def test_a_set_point_that_steps_by_a_turn_is_no_register() -> None:
    table, notes = continued("run", {"q": 0.1 * Q, "q_d": np.where(T > 4, 2 * np.pi, 0.0)}, {})
    assert notes == ()
    assert set(table["q_d"]) == {0.0, 2 * np.pi}


@pytest.mark.parametrize(
    "read",
    [
        Q,
        np.mod(Q, 5.0),
        np.where(np.arange(len(T)) == 50, -np.pi, Q),
        np.mod(1e3 * Q, 2 * np.pi),
        np.mod(Q, 2 * np.pi) + 1.5 * (T > 4),
    ],
    ids=["whole", "no turn", "one false reading", "too fast to tell", "more than a turn"],
)
def test_a_position_that_does_not_begin_again_at_a_turn_stays(read: np.ndarray) -> None:
    table, notes = continued("run", {"q": read}, {})
    assert table["q"] is read
    assert notes == ()


@pytest.mark.parametrize(("bits", "step"), [(16, 1.0), (16, 0.00045), (32, 1.0), (16, 2.5)])
def test_a_number_that_lost_its_sign_gets_it_back(bits: int, step: float) -> None:
    read = np.round(np.where(TAU < 0, TAU + 2.0**bits, TAU) * step, 6)
    table, (note,) = continued("run", {"tau": read}, {})
    np.testing.assert_allclose(table["tau"], step * TAU, atol=0.01 * step)
    assert note.startswith('run: "tau" was written without its sign; ')


@pytest.mark.parametrize(
    "read",
    [
        TAU,
        TAU + 400,
        np.where(TAU > 0, 65.0, 0.0),
        np.where(TAU > 0, 65535.0, 0.0) * (T > 1),
        np.where(TAU < 0, TAU + 65536, TAU) + 0.3 * np.sin(7 * T),
        np.where(TAU < 0, TAU + 40000, TAU),
        np.zeros(len(T)),
    ],
    ids=["signed", "never negative", "on and off", "two values", "no steps", "no register", "nothing"],
)
def test_a_torque_that_is_no_register_stays(read: np.ndarray) -> None:
    table, notes = continued("run", {"tau": read}, {})
    assert table["tau"] is read
    assert notes == ()


def test_a_converter_of_coarse_steps_fills_a_register_in_threes_and_twos() -> None:
    """A current in steps of 2.69 mA, written as whole mA."""
    coarse = np.rint(2.69 * np.rint(TAU / 2.69))
    table, _ = continued("run", {"tau": np.where(coarse < 0, coarse + 65536, coarse)}, {})
    np.testing.assert_array_equal(table["tau"], coarse)


def test_a_recording_is_read_so_and_says_it() -> None:
    read = np.where(TAU < 0, TAU + 65536, TAU)
    made = Recording.of({"t": T, "tau": read, "q": np.rad2deg(np.mod(Q, 2 * np.pi))}, units={"q": "deg", "tau": "mN.m"})
    np.testing.assert_allclose(made["tau"], 1e-3 * TAU, atol=1e-12)
    np.testing.assert_allclose(made["q"] - made["q"][0], Q - Q[0], atol=1e-9)
    assert len(made.notes) == 2
