"""A column that is the axis' own torque, commanded or read elsewhere, is no cause; that of a cause stays one."""

import numpy as np
from learned_cases import FC, night

from cosim.data.recording import Recording
from cosim.diagnosis.terms.dictionary import torque_again, user_columns
from cosim.diagnosis.trust.limits import own_torque
from cosim.estimation.prepare import Prepared, prepare


def recorded(seed: int = 1, pull: float = 0.0, coupling: float = 0.0) -> Prepared:
    """An axis whose torque was commanded, too, by a drive that follows badly; a neighbour, and a pull that was read."""
    now = night(seed)
    rng = np.random.default_rng(seed)
    t = now["t"]
    neighbour, force = 3.0 * np.sin(1.3 * t), np.sin(0.7 * t)
    own = 5.0 * now["a"] + FC * np.sign(now["v"]) + now["v"]
    tau = own + pull * force + coupling * neighbour
    slow = np.convolve(rng.standard_normal(len(t)), np.ones(50) / 50**0.5, "same")
    command = 1.3 * tau + 0.3 * float(np.std(tau)) * slow
    columns = {"command": command, "neighbour": neighbour, "force": force}
    return prepare([Recording("one", {"t": t, "q": now["q"], "tau": tau} | columns)], 10.0)


def test_a_command_that_the_torque_follows_badly_is_no_cause() -> None:
    prepared = recorded()
    column = np.concatenate([piece.extras["command"][piece.kept] for piece in prepared.pieces])
    assert np.corrcoef(column, prepared.stacked("tau"))[0, 1] ** 2 < 0.98, "a plain copy would be told without the rule"
    assert torque_again(prepared) == ("command",)
    assert set(user_columns(prepared)) == {"neighbour", "force"}
    assert "command" in own_torque(prepared)[0].statement


def test_a_cause_stays_one_even_where_it_is_most_of_the_torque() -> None:
    for case in (recorded(pull=5.0), recorded(coupling=2.0)):
        assert torque_again(case) == ("command",)
        assert {"neighbour", "force"} <= set(user_columns(case))


def test_nothing_is_told_of_an_axis_whose_motion_asks_for_no_torque() -> None:
    now = night(2)
    tau = np.random.default_rng(2).standard_normal(len(now["t"]))
    columns = {"t": now["t"], "q": now["q"], "tau": tau, "half": tau + np.sin(now["t"])}
    assert torque_again(prepare([Recording("still", columns)], 10.0)) == ()
