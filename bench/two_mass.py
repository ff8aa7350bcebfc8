"""The two-mass mount, whole and split: near side (drive, friction, encoder) and far side (spring and far mass).

Whole: the plant with the effect `compliance`. Split: the plant without it, of the near inertia, whose input
`disturbance` is the torque of the far side; the far side is the effect's own equation with the speed as its input.
"""

from dataclasses import replace
from pathlib import Path

import casadi as ca

from pyfmi_models.card import read_card
from pyfmi_models.effects.compliance import Compliance
from pyfmi_models.export import export_fmu
from pyfmi_models.model import Model, Variable
from pyfmi_models.mount import Mount

SPRING = Compliance(antiresonance_hz=20.0, resonance_hz=30.0, damping_ratio=0.02)
START = 0.02
"""Speed of both sides at the start, in rad/s: sliding, so that friction does not reverse."""


def whole() -> Mount:
    """The paper's mount with the spring."""
    return replace(read_card("paper_mount").plant(), effects=(SPRING,))


def near_side() -> Mount:
    """What the spring leaves on the drive's side."""
    mount = whole()
    near = mount.axis.inertia * (1 - SPRING.share())
    return replace(mount, name="near", axis=replace(mount.axis, inertia=near), effects=())


def far_side() -> Model:
    """Spring and far mass: twist' = v - w, far w' = torque(twist, v - w); the torque follows the speed at once."""
    far = whole().axis.inertia * SPRING.share()
    t, x, u, p = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("u", 1), ca.SX.sym("p", 0)
    rate = u - x[1]
    torque = SPRING.torque(x[0], rate, far)
    return Model(
        name="far",
        description="Spring and far mass",
        inputs=(Variable(name="v", unit="rad/s", description="Speed of the near side"),),
        parameters=(),
        states=(
            Variable(name="twist", unit="rad", description="Near minus far position", nominal=1e-3),
            Variable(name="speed", unit="rad/s", description="Speed of the far mass", nominal=0.01),
        ),
        outputs=(
            Variable(name="torque", unit="N.m", description="Torque of the spring, resists the near side"),
            Variable(name="w", unit="rad/s", description="Speed of the far mass"),
        ),
        equations=ca.Function("equations", [t, x, u, p], [ca.vertcat(rate, torque / far), ca.vertcat(torque, x[1])]),
    )


def export(folder: Path, fmi: int = 3) -> dict[str, Path]:
    """Write the FMUs `near`, `far` and `whole`."""
    models = {"near": near_side().model(), "far": far_side(), "whole": whole().model()}
    return {
        name: export_fmu(replace(model, name=name), folder / f"{name}.fmu", fmi=fmi) for name, model in models.items()
    }
