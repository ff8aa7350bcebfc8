"""The `[controller]` section of a card, and the controller it is composed into."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from pyfmi_models.adrc import (
    VELOCITIES,
    Adaptation,
    Adrc,
    Estimate,
    Gains,
    Learning,
    Observer,
    compensation_case,
)
from pyfmi_models.errors import CardError
from pyfmi_models.friction import FrictionLaw, LuGre
from pyfmi_models.numbers import FASTEST, LARGEST_GIVEN, SLOWEST, Table


class Section(BaseModel):
    """A section of a card: unknown keys and numbers that are none are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class LearningSection(Section):
    """`[controller.learning]`: iterative learning of a path that repeats every `period` seconds, to the tick."""

    period: float = Field(gt=0)
    knots: int = Field(default=100, ge=3, le=1000)
    gain: float = Field(default=0.5, gt=0, le=1)


class AdaptationSection(Section):
    """`[controller.adaptation]`: on-line identification of friction level, bristle stiffness and bias."""

    memory: float = Field(default=20.0, ge=0.1)
    slowest: float = Field(default=2e-5, ge=0)
    widest: float = Field(default=3.0, ge=1)
    doubt: float = Field(default=0.3, gt=0)
    noise: float = Field(default=0.5, gt=0)


class ControllerSection(Section):
    """`[controller]`: gains of the ADRC, loop and record rate [Hz], and what the controller is composed of.

    `velocity` is the speed in the error's derivative, `observer_order` 3 or 4, `compensation` the paper's case (C2a+C3a
    is half of each), `[controller.friction]` the friction it compensates (without it: the card's).
    """

    type: Literal["adrc"] = "adrc"
    kp: float = Field(gt=0, le=LARGEST_GIVEN)
    kd: float = Field(gt=0, le=LARGEST_GIVEN)
    loop_hz: float = Field(default=10_000.0, ge=SLOWEST, le=FASTEST)
    record_hz: float = Field(default=1_000.0, ge=SLOWEST, le=FASTEST)
    observer_bandwidth: float = Field(default=220.0, gt=0, le=FASTEST)
    observer_order: Literal[3, 4] = 3
    velocity: Literal["observer", "difference"] = "observer"
    compensation: Literal["C1", "C2a", "C2b", "C3a", "C3b", "C2a+C3a"] = "C1"
    friction: Table | None = None
    adaptation: AdaptationSection | None = None
    learning: LearningSection | None = None

    @property
    def period(self) -> float:
        """Time from tick to tick [s]."""
        return 1 / self.loop_hz


def compose(name: str, section: ControllerSection, inertia: float, limit: float, law: FrictionLaw, path: str) -> Adrc:
    """Make the controller of a section; `law` is the friction it believes in, `limit` the largest torque [N m].

    Raises:
        CardError: the parts do not go together; `path` is the card's name there.
    """
    gains = Gains(
        inertia=inertia,
        kp=section.kp,
        kd=section.kd,
        observer_bandwidth=section.observer_bandwidth,
        torque_limit=limit,
    )
    return Adrc(
        name=name,
        gains=gains,
        period=section.period,
        observer=Observer(order=section.observer_order),
        velocity=VELOCITIES[section.velocity],
        estimates=(*_compensation(section, law, path), *_learning(section, limit, path)),
    )


def _compensation(section: ControllerSection, law: FrictionLaw, path: str) -> tuple[Estimate, ...]:
    case, adaptation = section.compensation, section.adaptation
    if adaptation and case not in ("C2a", "C3a"):
        rule = 'goes with compensation = "C2a" or "C3a"'
        raise CardError(f'{path}: [controller.adaptation] {rule}; it is "{case}".')
    if case == "C1":
        return ()
    if not isinstance(law, LuGre):
        where = "controller.friction" if section.friction else "friction"
        rule = f'needs [{where}] model = "lugre"'
        raise CardError(f'{path}: [controller] compensation = "{case}" {rule}; it is "{law.key}".')
    if adaptation:
        return (Adaptation(law=law, source="observed" if case == "C2a" else "reference", **adaptation.model_dump()),)
    return compensation_case(case, law)


def _learning(section: ControllerSection, limit: float, path: str) -> tuple[Estimate, ...]:
    wanted = section.learning
    if wanted is None:
        return ()
    ticks = round(wanted.period / section.period)
    if abs(wanted.period / section.period - ticks) > 1e-6 or ticks < wanted.knots:
        rule = f"is not a whole number of ticks of {section.period:g} s, at least one a knot ({wanted.knots})"
        raise CardError(f"{path}: [controller.learning] period = {wanted.period:g} {rule}.")
    lag = 3 / section.observer_bandwidth if section.observer_order == 3 else 0.0
    return (Learning(ticks=ticks, knots=wanted.knots, gain=wanted.gain, lead=lag, limit=limit),)
