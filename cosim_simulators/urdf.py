"""URDF: the joint as a robot description; friction is a level and a viscous coefficient.

Reference: ROS wiki, "URDF XML specification, joint": `damping` [N m s/rad; N s/m], `friction` [N m; N].
"""

from xml.sax.saxutils import quoteattr

from cosim_simulators.format import Format, on_rotary
from cosim_simulators.friction import level_and_viscous
from cosim_simulators.weight import off_axis
from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.mount import Mount

NO_LIMIT = 1e3
"""Speed [rad/s; m/s] and way [m] that a file must name and a card does not have."""


def urdf_text(mount: Mount, card: Mount, title: str) -> str:
    """Write a mount that URDF holds as a whole."""
    rotary = mount.motion == "rotary"
    inertia, (along, across), mass = off_axis(mount, float(mount.axis.inertia))
    across_axis, about_axis = (inertia / 2, inertia) if rotary else (1.0, 1.0)
    # Gravity is along -z and the axis is y: the mass is opposite to where it would hang at q + phase = 0.
    place = f"{-across:.17g} 0 {-along:.17g}"
    travel = "" if rotary else f'lower="{-NO_LIMIT:g}" upper="{NO_LIMIT:g}" '
    level, viscous = level_and_viscous(mount)
    return f"""<?xml version="1.0"?>
<!-- {title.replace("--", "- -")} -->
<!-- SI units. Gravity is along -z. A card has no limits of position and speed: {NO_LIMIT:g} stands for none. -->
<robot name={quoteattr(mount.name)}>
  <link name="base"/>
  <link name="moving">
    <inertial>
      <origin xyz="{place}" rpy="0 0 0"/>
      <mass value="{mass:.17g}"/>
      <inertia ixx="{across_axis:.17g}" iyy="{about_axis:.17g}" izz="{across_axis:.17g}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="axis" type="{"continuous" if rotary else "prismatic"}">
    <parent link="base"/>
    <child link="moving"/>
    <origin xyz="0 0 0" rpy="0 0 0"/>
    <axis xyz="{"0 1 0" if rotary else "1 0 0"}"/>
    <limit {travel}effort="{float(mount.axis.torque_limit):.17g}" velocity="{NO_LIMIT:g}"/>
    <dynamics damping="{viscous:.17g}" friction="{level:.17g}"/>
  </joint>
</robot>
"""


URDF = Format(
    key="urdf",
    title="URDF",
    suffix=".urdf",
    effects={GravityUnbalance: on_rotary("inertial origin")},
    friction={"coulomb": "dynamics friction, damping"},
    limit="limit effort",
    bristle=False,
    text=urdf_text,
)
