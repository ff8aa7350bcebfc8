"""MuJoCo: the joint as an MJCF file.

Held as they are: LuGre's bristles and cogging (elements `dcmotor` without input), Coulomb friction (`frictionloss`),
viscous and quadratic drag (`damping`), an unbalance (a mass off the axis), a spring, a constant torque, dead time and
lag of the drive, and play or springs between bodies (a tendon that has the twist as its length).
Reference: MuJoCo documentation 4.0, "XML Reference" and "MuJoCo DC Motor Model".
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import pi
from xml.sax.saxutils import quoteattr

from cosim_simulators.bodies import Body, bodies_of, fastest
from cosim_simulators.format import Format, Written, on_rotary, whole
from cosim_simulators.weight import GRAVITY, off_axis
from pyfmi_models.effects import ActuatorLag, Cogging, Delay, Effect, GravityUnbalance, TorqueOffset
from pyfmi_models.effects.backlash import Backlash
from pyfmi_models.effects.cable_wrap import CableWrap
from pyfmi_models.effects.compliance import Compliance, LoadSideCompliance
from pyfmi_models.effects.constant_force import ConstantForce
from pyfmi_models.effects.quadratic_drag import QuadraticDrag
from pyfmi_models.friction import Coulomb, LuGre
from pyfmi_models.mount import Mount

STEP, STEPS_A_RADIAN = 1e-3, 20.0
"""Time step [s], and how many there are at least in a radian of the fastest oscillation."""
PASSIVE = 'motorconst="1e-9" resistance="1" input="none"'
"""A motor that does nothing but rub or cog: its back-EMF is 1e-18 N m s/rad."""


def mujoco_text(mount: Mount, card: Mount, title: str) -> str:
    """Write a mount that MuJoCo holds as a whole."""
    bodies, step = bodies_of(mount), time_step(mount)
    kind = "hinge" if mount.motion == "rotary" else "slide"
    lines = [
        f"<mujoco model={quoteattr(mount.name)}>",
        f"  <!-- {title.replace('--', '- -')} -->",
        "  <!-- MuJoCo 4.0 or newer, SI units. ctrl is the commanded torque or force, sensor q the position. -->",
        f'  <option timestep="{step:.9g}" integrator="RK4" gravity="{GRAVITY} 0 0"/>',
        '  <compiler angle="radian" inertiafromgeom="false"/>',
        "  <worldbody>",
        *(line for body in bodies for line in _body(mount, body, kind)),
        "  </worldbody>",
        *_tendons(mount, bodies),
        "  <actuator>",
        *(f"    {line}" for line in _actuators(mount, bodies, step)),
        "  </actuator>",
        "  <sensor>",
        '    <jointpos name="q" joint="axis"/>',
        '    <jointvel name="v" joint="axis"/>',
        "  </sensor>",
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n"


def time_step(mount: Mount) -> float:
    """1 ms, or a half, quarter, ... of it where bristles or springs ring faster than 20 steps a radian follow [s]."""
    omega, step = fastest(mount), STEP
    while step * omega * STEPS_A_RADIAN > 1:
        step /= 2
    return step


def _body(mount: Mount, body: Body, kind: str) -> Iterator[str]:
    """A body on a joint of its own; all joints are about the same axis z (along it on a linear axis)."""
    inertia, place, mass = body.inertia, (0.0, 0.0), 1.0 if kind == "hinge" else body.inertia
    if body.name == "axis":
        inertia, place, mass = off_axis(mount, inertia)
    # Only the turn about z matters; the other two are what a plate has, so that the tensor is physical.
    turn = f"{inertia / 2:.17g} {inertia / 2:.17g} {inertia:.17g}" if kind == "hinge" else "1 1 1"
    yield f'    <body name="{body.name}">'
    yield f'      <joint name="{body.name}" type="{kind}" axis="0 0 1" {_joint(mount, body)}/>'
    yield f'      <inertial pos="{place[0]:.17g} {place[1]:.17g} 0" mass="{mass:.17g}" diaginertia="{turn}"/>'
    yield "    </body>"


def _joint(mount: Mount, body: Body) -> str:
    """Attributes of a joint: what rubs and pulls there."""
    found: dict[str, str] = {}
    if body.name == "axis":
        law = mount.friction
        viscous = float(getattr(law, "sigma2", 0.0) or 0.0)
        drag = sum(float(one.coefficient) for one in mount.effects if isinstance(one, QuadraticDrag))
        if viscous or drag:
            found["damping"] = f"{viscous:.17g}" + (f" {drag:.17g}" if drag else "")
        if isinstance(law, Coulomb) and law.Fc:
            found["frictionloss"] = f"{float(law.Fc):.17g}"
        springs = [one for one in mount.effects if isinstance(one, CableWrap)]
        stiffness = sum(float(one.stiffness) for one in springs)
        if stiffness:
            home = sum(float(one.stiffness) * float(one.home) for one in springs) / stiffness
            found |= {"stiffness": f"{stiffness:.17g}", "springref": f"{home:.17g}"}
    if isinstance(body.coupling, Backlash):
        found |= {
            name: f"{value:.17g}"
            for name, value in (
                ("frictionloss", float(body.coupling.load_friction)),
                ("damping", float(body.coupling.load_viscous)),
            )
            if value
        }
    return " ".join(f'{name}="{value}"' for name, value in found.items())


def _tendons(mount: Mount, bodies: tuple[Body, ...]) -> Iterator[str]:
    """A tendon a coupling: its length is near minus far position."""
    pairs = list(pairwise(bodies))
    if pairs:
        yield "  <tendon>"
    for near, far in pairs:
        yield f'    <fixed name="twist_{far.name}" {_coupling(near, far)}>'
        yield f'      <joint joint="{near.name}" coef="1"/>'
        yield f'      <joint joint="{far.name}" coef="-1"/>'
        yield "    </fixed>"
    if pairs:
        yield "  </tendon>"


def _coupling(near: Body, far: Body) -> str:
    one = far.coupling
    if isinstance(one, Backlash):
        return _play(one, near, far)
    stiffness, damping = (float(one.torque(*at, far.inertia)) if one else 0.0 for at in ((1.0, 0.0), (0.0, 1.0)))
    return f'stiffness="{stiffness:.17g}" damping="{damping:.17g}" springlength="0"'


def _play(one: Backlash, near: Body, far: Body) -> str:
    """Limits at both ends of the play; their reference acceleration is that of the contact's spring and damper."""
    both = far.inertia * (1 / near.inertia + 1 / far.inertia)
    omega = 2 * pi * float(one.contact_hz)
    stiff, damped = omega**2 * both, 2 * float(one.damping_ratio) * omega * both
    half = float(one.gap_rad) / 2
    return f'limited="true" range="{-half:.17g} {half:.17g}" solreflimit="{-stiff:.17g} {-damped:.17g}"'


def _actuators(mount: Mount, bodies: tuple[Body, ...], step: float) -> Iterator[str]:
    limit = float(mount.axis.torque_limit)
    lags = [float(one.time_constant_ms) * 1e-3 for one in mount.effects if isinstance(one, ActuatorLag)]
    late = sum(float(one.delay_ms) * 1e-3 for one in mount.effects if isinstance(one, Delay))
    filtered = f'dyntype="filterexact" dynprm="{lags[0]:.17g}" actearly="true" ' if lags else ""
    waits = f'delay="{late:.17g}" nsample="{int(late / step) + 2}" interp="linear" ' if late else ""
    yield (
        f'<general name="tau" joint="{bodies[0].name}" {filtered}{waits}gainprm="1" '
        f'ctrlrange="{-limit:.17g} {limit:.17g}" ctrllimited="true"/>'
    )
    law = mount.friction
    if isinstance(law, LuGre):
        peak, speed = law.Fs or law.Fc, law.Vs or 1.0
        numbers = " ".join(f"{float(n):.17g}" for n in (law.sigma0, law.sigma1, law.Fc, peak, speed))
        yield f'<dcmotor name="friction" joint="axis" {PASSIVE} lugre="{numbers}"/>'
    for k, wave in enumerate((one for one in mount.effects if isinstance(one, Cogging)), 1):
        # It resists as amplitude cos(N q + phase); MuJoCo's drives as amplitude sin(N q + phase).
        cycles = float(wave.cycles_per_rev) * (1 if mount.motion == "rotary" else 2 * pi)
        numbers = f"{float(wave.amplitude):.17g} {cycles:.17g} {float(wave.phase) - pi / 2:.17g}"
        yield f'<dcmotor name="cogging_{k}" joint="axis" {PASSIVE} cogging="{numbers}"/>'
    constant = sum(float(one.torque) for one in mount.effects if isinstance(one, TorqueOffset))
    constant += sum(float(one.force) for one in mount.effects if isinstance(one, ConstantForce))
    if constant:
        yield (
            '<general name="torque_offset" joint="axis" gaintype="fixed" gainprm="0" biastype="affine" '
            f'biasprm="{-constant:.17g} 0 0"/>'
        )


def _cogging(effect: Effect, mount: Mount) -> Written:
    if isinstance(effect, Cogging) and effect.harmonics:
        return Written(replace(effect, harmonics=()), "dcmotor cogging", "its harmonics")
    return Written(effect, "dcmotor cogging")


def _spring(effect: Effect, mount: Mount) -> Written:
    if isinstance(effect, CableWrap) and effect.hardening:
        return Written(replace(effect, hardening=0.0), "joint stiffness", "its hardening")
    return Written(effect, "joint stiffness")


def _lag(effect: Effect, mount: Mount) -> Written | None:
    """One lag: an actuator has one activation."""
    first = next(one for one in mount.effects if isinstance(one, ActuatorLag))
    return Written(effect, "actuator dynprm") if effect is first else None


def _played(effect: Effect, mount: Mount) -> Written:
    return (
        Written(effect, "tendon range", "the bend of the far side's friction")
        if getattr(effect, "load_friction", 0)
        else Written(effect, "tendon range")
    )


MUJOCO = Format(
    key="mujoco",
    title="MuJoCo",
    suffix="_mujoco.xml",
    effects={
        GravityUnbalance: on_rotary("inertial pos"),
        TorqueOffset: whole("general biasprm"),
        ConstantForce: whole("general biasprm"),
        CableWrap: _spring,
        Cogging: _cogging,
        QuadraticDrag: whole("joint damping"),
        Delay: whole("actuator delay"),
        ActuatorLag: _lag,
        Backlash: _played,
        Compliance: whole("tendon stiffness"),
        LoadSideCompliance: whole("tendon stiffness"),
    },
    friction={"lugre": "dcmotor lugre, joint damping", "coulomb": "joint frictionloss, damping"},
    limit="actuator ctrlrange",
    bristle=True,
    text=mujoco_text,
)
