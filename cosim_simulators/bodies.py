"""The bodies of a mount in a row, as the plant has them: motors, the axis, what hangs behind it."""

from dataclasses import dataclass
from math import pi

from pyfmi_models.effects.base import Coupling, Transmission
from pyfmi_models.mount import Mount


@dataclass(frozen=True)
class Body:
    """A body of the row: its inertia [kg m2; kg], and the coupling from the body in front of it (None: the first)."""

    name: str
    inertia: float
    coupling: Coupling | None


def bodies_of(mount: Mount) -> tuple[Body, ...]:
    """Share the inertia out among motors, axis and far masses, from the drive on."""
    left = float(mount.axis.inertia)
    found: list[Body] = []
    coupling: Coupling | None = None
    for _, motor in mount.of_kind(Transmission):
        far = left * float(motor.share())
        found.append(Body("motor" if not found else f"motor_{len(found) + 1}", left - far, coupling))
        left, coupling = far, motor
    names = ["axis"]
    for _, one in mount.trailing():
        far = left * float(one.share())
        found.append(Body(names[-1], left - far, coupling))
        left, coupling = far, one
        names.append("load" if len(names) == 1 else f"load_{len(names)}")
    return (*found, Body(names[-1], left, coupling))


def fastest(mount: Mount) -> float:
    """Highest rate of bristles, of viscous friction and of couplings [rad/s]; 0 where there is none."""
    bodies = bodies_of(mount)
    axis = next(one for one in bodies if one.name == "axis")
    stiff, damped, viscous = (float(getattr(mount.friction, name, 0.0)) for name in ("sigma0", "sigma1", "sigma2"))
    found = [(stiff / axis.inertia) ** 0.5, (damped + viscous) / axis.inertia]
    for _, one in mount.of_kind(Coupling):
        found += [2 * pi * float(getattr(one, name, 0.0)) for name in ("resonance_hz", "contact_hz")]
    return float(max(found))
