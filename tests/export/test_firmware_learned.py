"""What was learned is the same equation on a board: friction and a drive's curve, sampled, against the FMU's bits."""

import casadi as ca
import firmware_tools as tools
import numpy as np
import pytest
from firmware_tools import INPUT, OUTPUT, PERIOD

from pyfmi_models.effects.base import Motion
from pyfmi_models.effects.learned import LearnedFriction
from pyfmi_models.effects.learned_drive import LearnedDrive
from pyfmi_models.export.platforms import host
from pyfmi_models.model import Model, Variable

pytestmark = pytest.mark.skipif(not host().endswith("-linux"), reason="firmware for the host is for Linux")
FRICTION = LearnedFriction(over="position", seen=(-0.02, 0.02), level_change=(0.1, 0.3, -0.2, 0.05))
DRIVE = LearnedDrive(command_seen=(-20.0, 20.0), missing=(0.0, 0.4, 0.1, -0.05))
QUANTUM, LEVEL, STEPS = 1e-8, 3.0, 4000


def ahead() -> Model:
    """The torque that a drive gives of what friction takes at a set point: both as they were learned."""
    names = (INPUT, "position_d", "velocity_d", "acceleration_d")
    t, x, u, p = (ca.SX.sym(name, size) for name, size in (("t", 1), ("x", 0), ("u", len(names)), ("p", 0)))
    level = FRICTION.level(LEVEL, Motion(t, u[0], u[2], u[0])) * ca.tanh(u[2] / 0.01)
    given = ca.vertcat(DRIVE.applied((), level), level)
    return Model(
        name="ahead",
        description="Friction ahead",
        inputs=tuple(Variable(name=name, unit="1", description=name) for name in names),
        parameters=(),
        states=(),
        outputs=tuple(Variable(name=name, unit="N.m", description=name) for name in (OUTPUT, "level")),
        equations=ca.Function("equations", [t, x, u, p], [ca.SX(0, 1), given], ["t", "x", "u", "p"], ["next", "y"]),
        period=PERIOD,
    )


def rows() -> np.ndarray:
    """A reset, a start, then a sine over half as much again as what was seen."""
    t = PERIOD * np.arange(STEPS)
    q, v = 0.03 * np.sin(20 * t), 0.6 * np.cos(20 * t)
    counts, request = np.round(q / QUANTUM), np.full(STEPS, tools.ENABLE)
    request[0], request[1] = 0, tools.RESET
    columns = (np.mod(counts, 2**32), request, np.zeros(STEPS), counts, q, v, -20 * v)
    return np.ascontiguousarray(np.column_stack(columns), float)


@pytest.mark.parametrize("target", ["host", "cortex-a9"])
def test_what_was_learned_gives_the_bits_of_the_fmu_on_a_board(target: str) -> None:
    tools.need(target)
    model, fed = ahead(), rows()
    program = tools.program_of(tools.project_of_model(model, QUANTUM, target), target)
    found = tools.answers(program, target, fed, 2)[2:, 2:]
    expected = tools.model_answers(model, QUANTUM, fed)
    assert np.array_equal(found, expected)
    assert np.ptp(np.abs(expected[:, 1])) > 1.0, "the table is seen"
    q = QUANTUM * np.round(fed[2:, 4] / QUANTUM)
    waves = np.cos(np.pi * np.outer(np.arange(4), (np.clip(q, -0.02, 0.02) + 0.02) / 0.04))
    told = LEVEL * np.exp(FRICTION.level_change @ waves) * np.tanh(fed[2:, 5] / 0.01)
    np.testing.assert_allclose(expected[:, 1], told, rtol=1e-12, atol=1e-12)
