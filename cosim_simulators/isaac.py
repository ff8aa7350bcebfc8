"""Isaac Sim: the joint of a PhysX articulation as USD text; static, dynamic and viscous friction.

Attributes of a rotary joint are per degree where they are per angle: the viscous coefficient is in N m s/deg.
Reference: Omniverse physics, "PhysxJointAxisAPI"; PhysX 5.6, "Articulation Joint Friction" (2025); UsdPhysics.
"""

from dataclasses import replace
from math import pi

import numpy as np

from cosim_simulators.format import Format, on_rotary
from cosim_simulators.friction import level_and_viscous
from cosim_simulators.weight import GRAVITY, off_axis
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.friction.base import each_way
from pyfmi_models.mount import Mount

_USD = """#usda 1.0
(
    doc = {title}
    defaultPrim = "joint"
    kilogramsPerUnit = 1
    metersPerUnit = 1
    upAxis = "Z"
)

def PhysicsScene "scene"
{{
    vector3f physics:gravityDirection = (0, 0, -1)
    float physics:gravityMagnitude = {gravity}
}}

def Xform "joint" (
    prepend apiSchemas = ["PhysicsArticulationRootAPI", "PhysxArticulationAPI"]
)
{{
    def Xform "base" (
        prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
    )
    {{
        float physics:mass = 1
        float3 physics:diagonalInertia = (1, 1, 1)
    }}

    def Xform "moving" (
        prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]
    )
    {{
        float physics:mass = {mass:.9g}
        point3f physics:centerOfMass = ({x:.9g}, 0, {z:.9g})
        float3 physics:diagonalInertia = ({plate:.9g}, {about:.9g}, {plate:.9g})
        quatf physics:principalAxes = (1, 0, 0, 0)
    }}

    def PhysicsFixedJoint "ground"
    {{
        rel physics:body1 = </joint/base>
    }}

    def {joint} "axis" (
        prepend apiSchemas = ["PhysicsDriveAPI:{way}", "PhysxJointAxisAPI:{way}"]
    )
    {{
        uniform token physics:axis = "{axis}"
        rel physics:body0 = </joint/base>
        rel physics:body1 = </joint/moving>
        uniform token drive:{way}:physics:type = "force"
        float drive:{way}:physics:stiffness = 0
        float drive:{way}:physics:damping = 0
        float drive:{way}:physics:maxForce = {limit:.9g}
        float physxJointAxis:{way}:armature = 0
        float physxJointAxis:{way}:staticFrictionEffort = {static:.9g}
        float physxJointAxis:{way}:dynamicFrictionEffort = {level:.9g}
        float physxJointAxis:{way}:viscousFrictionCoefficient = {viscous:.9g}
    }}
}}
"""


def isaac_text(mount: Mount, card: Mount, title: str) -> str:
    """Write a mount that PhysX holds as a whole; the break-away level is the card's."""
    rotary = mount.motion == "rotary"
    inertia, (along, across), mass = off_axis(mount, float(mount.axis.inertia))
    level, viscous = level_and_viscous(mount)
    return _USD.format(
        title=_text(title),
        gravity=GRAVITY,
        mass=mass,
        x=-across,
        z=-along,
        plate=inertia / 2 if rotary else 1.0,
        about=inertia if rotary else 1.0,
        joint="PhysicsRevoluteJoint" if rotary else "PhysicsPrismaticJoint",
        way="angular" if rotary else "linear",
        axis="Y" if rotary else "X",
        limit=float(mount.axis.torque_limit),
        static=max(level, break_away(card)),
        level=level,
        viscous=viscous * (pi / 180 if rotary else 1),
    )


def break_away(mount: Mount) -> float:
    """Friction level of a mount at rest, the larger of both directions [N m; N]."""
    at_rest = mount.at(0.0, 0.0, 0.0)
    levels = [replace(mount, friction=law).level(at_rest) for law in each_way(mount.friction)]
    return float(np.max([float(level) for level in levels]))


def _text(words: str) -> str:
    return '"' + words.replace("\\", "\\\\").replace('"', '\\"') + '"'


ISAAC = Format(
    key="isaac",
    title="Isaac Sim (PhysX)",
    suffix="_isaac.usda",
    effects={GravityUnbalance: on_rotary("centerOfMass")},
    friction={"coulomb": "staticFrictionEffort, dynamicFrictionEffort, viscousFrictionCoefficient"},
    limit="drive maxForce",
    bristle=False,
    text=isaac_text,
)
