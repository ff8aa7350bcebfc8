"""An unbalance as a mass off the axis, which keeps the inertia of the whole."""

from math import cos, sin

from pyfmi_models.effects import GravityUnbalance
from pyfmi_models.mount import Mount

GRAVITY = 9.81
"""Acceleration of gravity in the files [m/s2]; only mass times lever arm times it counts."""
SHARE = 0.01
"""Share of the inertia that the mass off the axis makes."""


def off_axis(mount: Mount, inertia: float) -> tuple[float, tuple[float, float], float]:
    """Inertia about the centre of mass [kg m2], its place (along, across) [m] and the mass [kg].

    A mass hanging at radius r resists with m g r sin(q + phase): it is at the angle `phase`, counted from the direction
    of gravity (along) in that of q (across), so place = r (cos phase, sin phase). r is such that m r^2 is `SHARE` of
    the inertia. Without an unbalance the mass is on the axis: 1 kg, or the moving mass of a linear axis.
    """
    parts = [(float(one.mgl), float(one.phase)) for one in mount.effects if isinstance(one, GravityUnbalance)]
    along, across = (sum(mgl * part(phase) for mgl, phase in parts) for part in (cos, sin))
    mgl = (along**2 + across**2) ** 0.5
    if not mgl or mount.motion != "rotary":
        return inertia, (0.0, 0.0), 1.0 if mount.motion == "rotary" else inertia
    radius = SHARE * inertia * GRAVITY / mgl
    return inertia * (1 - SHARE), (radius * along / mgl, radius * across / mgl), mgl / (GRAVITY * radius)
