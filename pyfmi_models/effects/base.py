"""The contract of an effect: one kind of physics that a model may lack.

An effect is written once and used everywhere: the mount adds its equations to the plant, and the diagnosis asks how the
torque a recording needs would change with it. It acts in one of these places, in the order in which torque becomes
a reading:

    DriveEffect      torque path: between commanded and applied torque
    FrictionEffect   on the contact, the level or the viscous part of friction
    LoadEffect       a torque that resists, beside friction; a PayloadEffect also presses on the bearings,
                     a TonalEffect is a wave in time
    InertiaEffect    on the inertia
    Coupling         splits the inertia in two, with something between that is not rigid
    Transmission     a coupling in front of the axis: only the drive is on its other side
    SensorEffect     sensor path: between true position and encoder reading
    ClockEffect      on the time stamps of a recording

Signs: an effect torque resists, J q'' = tau - tau_f - loads - effects. Effects of one place act in the card's order.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Self

import casadi as ca
import numpy as np
import numpy.typing as npt

from pyfmi_models.friction.base import FrictionLaw
from pyfmi_models.model import Part, Scalar, Variable

NOTHING: Mapping[str, Any] = MappingProxyType({})


class Balance(NamedTuple):
    """Torques of a moment [N m], the friction level not known yet: what accelerates the axis is push - taken level.

    A recording tells that, so `taken` is 0 there; under a torque a sliding contact takes the level, with the sign of
    the speed. `others` is all else that resists but the weights, of which `payload` tells.
    """

    push: Scalar = 0.0
    taken: Scalar = 0.0
    others: Scalar = 0.0


class Motion(NamedTuple):
    """Where the axis is, and whatever else the effect that is asked may look at.

    Time [s], position [rad or m], speed, and position as an angle that repeats once per turn of a rotary axis and once
    per metre of a linear one; values of the inputs that effects declare, by name; torque of the weights on the axis
    [N m]; the states of the effect that is asked, a column in the order of its `states()`; what accelerates the axis.
    """

    t: Scalar
    q: Scalar
    v: Scalar
    angle: Scalar
    inputs: Mapping[str, Scalar] = NOTHING
    payload: Scalar = 0.0
    state: Any = ()
    balance: Balance = Balance()


ROTARY = {"way": "rad", "speed": "rad/s", "turn": "turn", "inertia": "inertia"}
LINEAR = {"way": "m", "speed": "m/s", "turn": "metre", "inertia": "moving mass"}
"""How sentences call the units and things of either kind of axis."""


def words(unit: str) -> dict[str, str]:
    """The words of the kind of axis whose torque or force has this unit."""
    return LINEAR if unit == "N" else ROTARY


def percent(share: float) -> str:
    """Return a share in per cent with two digits, and all of those before the point: 0.42 becomes 42 %, 1.893 189 %."""
    value = 100 * share
    return f"{value:.0f} %" if abs(value) >= 99.5 else f"{value:.2g} %"


def higher(share: float) -> str:
    """Say how far something is off, to either side: 42 % higher, 30 % lower."""
    return f"{percent(abs(share))} {'higher' if share >= 0 else 'lower'}"


def times(count: float) -> str:
    """How often, in words: "once", "24 times"."""
    return "once" if count == 1 else f"{count:.4g} times"


class Main(NamedTuple):
    """The number of an effect that texts give: its parameter, and the factor to and the unit of the text.

    `is_size` says whether it grows with the effect. A speed, a frequency or a knee says where the effect sets in: of
    that no smallest size can be told.
    """

    parameter: str
    factor: float = 1.0
    unit: str = "N.m"
    is_size: bool = True


@dataclass(frozen=True, kw_only=True)
class Effect(Part):
    """One kind of missing physics: what a mechanic would call it, and what tells it from its rivals."""

    place: ClassVar[str] = "Mechanics"
    is_torque: ClassVar[bool] = True
    """Whether a torque added to the command can do what the effect does to the axis."""
    at_once: ClassVar[bool] = False
    """Whether it changes what the motion of each moment needs, not only what drive, springs and clocks make of that."""
    feels_inertia: ClassVar[bool] = False
    """Whether it depends on what accelerates the axis, which the balance of a motion tells."""
    id: ClassVar[str]
    title: ClassVar[str]
    equation: ClassVar[str] = ""
    """The equation as a reader of a report knows it."""
    main: ClassVar[Main]
    rivals: ClassVar[tuple[str, ...]] = ()
    told_apart_by: ClassVar[str] = ""
    action: ClassVar[str] = ""
    action_linear: ClassVar[str] = ""
    """The same for an axis that moves along, where the parts that a mechanic looks at are others."""
    to_record: ClassVar[str] = ""
    """What to record where recordings cannot test the effect."""
    special_case_of: ClassVar[tuple[str, ...]] = ()
    """Effects that include this one: what both explain, the special one predicts alike."""
    is_determined: ClassVar[bool] = True
    """Whether the torque of a recorded motion can be told with it: not of what is drawn by chance, and not yet of what
    reads an input in the torque path or has a memory that is not linear in its states."""
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = ()
    """Parameters of which the second is above the first, and the least factor between them that a fit keeps."""
    reads: ClassVar[tuple[Variable, ...]] = ()
    """`inputs`, where they are the same with all numbers."""
    remembers: ClassVar[tuple[Variable, ...]] = ()
    """`states`, where they are the same with all numbers."""
    says: ClassVar[str] = ""
    """`statement` where it has one form: `{0.mgl:.3g} {unit}`, with words of `ROTARY` and `LINEAR`."""

    def states(self) -> tuple[Variable, ...]:
        """Name the effect's own states."""
        return self.remembers

    def inputs(self) -> tuple[Variable, ...]:
        """Name the plant inputs that the effect reads; effects that name the same input of one source share it."""
        return self.reads

    def recorded_as(self) -> Mapping[str, str]:
        """Inputs that a recording holds under another name, by their own."""
        return {}

    @property
    def source(self) -> str:
        """What an effect's inputs are of, where others of its id may read the same of something else."""
        return ""

    @property
    def name(self) -> str:
        """Its id, and its source where it has one: "axis_coupling:q2"."""
        return f"{self.id}:{self.source}" if self.source else self.id

    def broken_rule(self) -> str:
        """Say which rule between the parameters these numbers break; empty if none."""
        return ""

    def learned_in(self, linear: bool = False) -> str:
        """Say over which range of what the effect was learned from data; empty for an effect with an equation."""
        return ""

    def told_at(self, level: float) -> Self:
        """Return the same effect, with numbers that are relative to a Coulomb level made relative to this one [N m]."""
        return self

    def leading(self) -> Main:
        """The number that says how large the effect with these numbers is."""
        return self.main

    def statement(self, unit: str = "N·m") -> str:
        """Say what the effect with these numbers is, in one plain sentence; `unit` is the torque or force unit."""
        if not self.says:
            raise TypeError(f"{type(self).__name__} has no statement")
        return self.says.format(self, unit=unit, **words(unit))


@dataclass(frozen=True, kw_only=True)
class DriveEffect(Effect):
    """Dynamics or limits between the commanded and the applied torque."""

    place: ClassVar[str] = "Torque path"

    def given(self, motion: Motion) -> Self:
        """Return the effect at a motion and the inputs that it names; `rate` and `applied` are then of that moment."""
        return self

    def rate(self, state: Any, command: Scalar) -> Any:
        """Time derivative of the states under a command [N m], a column."""
        return ca.SX(0, 1)

    def applied(self, state: Any, command: Scalar) -> Scalar:
        """Torque applied to the axis [N m]."""
        return command

    def response(self, omega: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
        """Frequency response from a small command to applied torque at angular frequencies omega [rad/s]."""
        return np.ones_like(omega, dtype=np.complex128)


@dataclass(frozen=True, kw_only=True)
class MotionEffect(Effect):
    """An effect that depends on the motion of the axis, and may remember it in states of its own."""

    at_once: ClassVar[bool] = True

    def rate(self, motion: Motion) -> Any:
        """Time derivative of the states, a column."""
        return ca.SX(0, 1)


@dataclass(frozen=True, kw_only=True)
class FrictionEffect(MotionEffect):
    """A change of the contact, of the friction level or of the viscous torque."""

    place: ClassVar[str] = "Friction"

    def law(self, law: FrictionLaw) -> FrictionLaw:
        """Return the law that replaces `law`."""
        return law

    def level(self, level: Scalar, motion: Motion) -> Scalar:
        """Return the friction level [N m] that replaces `level`."""
        return level

    def viscous(self, viscous: Scalar, motion: Motion) -> Scalar:
        """Return the viscous torque [N m] that replaces `viscous`."""
        return viscous


@dataclass(frozen=True, kw_only=True)
class LoadEffect(MotionEffect):
    """A torque beside friction that resists."""

    place: ClassVar[str] = "Loads"

    def load(self, motion: Motion) -> Scalar:
        """Resisting torque [N m]."""
        raise TypeError(f"{type(self).__name__} has no load")


@dataclass(frozen=True, kw_only=True)
class PayloadEffect(LoadEffect):
    """A weight on the axis: beside its torque it presses on the bearings, which friction may feel."""


@dataclass(frozen=True, kw_only=True)
class TonalEffect(LoadEffect):
    """A wave in time that knows nothing of the axis: each recording begins at another moment of it."""

    own_phase: ClassVar[str]
    """The parameter [rad] that is each recording's own, where the others are the mount's."""

    def wave(self) -> tuple[Any, Any]:
        """Frequency [Hz] and half the peak-to-peak torque [N m]."""
        raise TypeError(f"{type(self).__name__} has no wave")


@dataclass(frozen=True, kw_only=True)
class InertiaEffect(MotionEffect):
    """An inertia that changes with the position or with an input, on the side of the encoder."""

    is_torque: ClassVar[bool] = False

    def inertia(self, inertia: Scalar, motion: Motion) -> Scalar:
        """Return the inertia [kg m2] that replaces `inertia`; its slopes are the plant's business."""
        return inertia

    def followed(self) -> Mapping[str, str]:
        """Inputs that the inertia follows, each with the input that is its rate."""
        return {}


@dataclass(frozen=True, kw_only=True)
class Coupling(Effect):
    """A place where the axis is not rigid: part of the inertia hangs behind a spring or a play.

    Drive torque, friction, loads and encoder stay on the near side. Several couplings stand in a row, each splitting
    what is behind the one before. The twist is near minus far position; its start is 0, so both sides start together.
    """

    is_torque: ClassVar[bool] = False

    def states(self) -> tuple[Variable, ...]:
        """Twist and its rate."""
        return (
            Variable(name="twist", unit="rad", description="Near side minus far side", nominal=1e-3),
            Variable(name="twist_rate", unit="rad/s", description="Rate of the twist", nominal=0.01),
        )

    def share(self) -> Scalar:
        """Share of the inertia it carries that is on the far side, between 0 and 1."""
        raise TypeError(f"{type(self).__name__} has no share")

    def torque(self, twist: Scalar, rate: Scalar, far: Scalar) -> Scalar:
        """Torque passed on to the far side [N m], whose inertia is `far` [kg m2]."""
        raise TypeError(f"{type(self).__name__} has no torque")

    def drag(self, speed: Scalar, state: Any) -> Scalar:
        """Friction torque on the far side [N m] at its speed, resists; `state` as `states` lists it."""
        return 0 * speed

    def further_rates(self, speed: Scalar, state: Any) -> tuple[Scalar, ...]:
        """Rates of the states beyond the twist and its rate, the far side moving at `speed`."""
        return ()

    def carried(self, omega: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128] | None:
        """Acceleration of the far mass per near acceleration at angular frequencies omega [rad/s]; 1 where it is rigid.

        None where a coupling is not linear: then `advance` follows it in time.
        """
        return None

    def advance(
        self, twist: Scalar, far_speed: Scalar, further: Sequence[Scalar], speed: Scalar, dt: Scalar, far: Scalar
    ) -> tuple[Scalar, ...]:
        """Twist, speed of the far side, further states, torque passed on [N m] after dt, the near at `speed`."""
        raise TypeError(f"{type(self).__name__} has no advance")


@dataclass(frozen=True, kw_only=True)
class Transmission(Coupling):
    """A coupling in front of the axis: the drive turns a motor that passes its torque on to the axis.

    The near side is the motor, on which the torque of the drive acts and nothing else; the far side is the axis with
    friction, loads and encoder. `share()` is that of the axis, so the motor has 1 - `share()` of the inertia.
    """

    def demand(self, omega: npt.NDArray[np.float64]) -> npt.NDArray[np.complex128]:
        """Torque on the motor per torque on the axis, which is held still, at angular frequencies omega [rad/s]."""
        raise TypeError(f"{type(self).__name__} has no demand")


@dataclass(frozen=True, kw_only=True)
class SensorEffect(MotionEffect):
    """An error between the true position and what the encoder reads."""

    place: ClassVar[str] = "Sensor path"
    is_torque: ClassVar[bool] = False

    def reading(self, reading: Scalar, motion: Motion) -> Scalar:
        """Return the reading [rad or m] that replaces `reading`."""
        return reading


@dataclass(frozen=True, kw_only=True)
class ClockEffect(MotionEffect):
    """Two clocks: the reading in a row of a recording was taken later or earlier than its torque."""

    place: ClassVar[str] = "Sensor path"
    at_once: ClassVar[bool] = False
    is_torque: ClassVar[bool] = False

    def ahead(self, motion: Motion) -> Scalar:
        """Seconds by which the reading runs ahead of the torque beside it."""
        return 0 * motion.t
