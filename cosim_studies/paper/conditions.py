"""Under which conditions the paper's experiment is simulated: plant, controller's tuning, noise."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from pyfmi_models.card import Card, read_card
from pyfmi_models.effects import ActuatorLag, Effect, FrictionWander
from pyfmi_models.friction import FrictionLaw, LuGre
from pyfmi_models.model import Pair

CASES = ("C1", "C2a", "C2b", "C3a", "C3b")
NO_LIMIT = 1e6


@dataclass(frozen=True, kw_only=True)
class Condition:
    """One condition: `plant` is what the axis is, `controller` what the controller is and believes.

    `changes` are parameters of the controller set where it has them; `smooth_start` and the `run_in` after it, which do
    not count, are in s; `encoder_noise` [rad] and `torque_noise` [N m] are RMS values of white noise, a fresh sample
    each period of the controller.
    """

    key: str
    title: str
    plant: Card
    controller: Card
    changes: Mapping[str, float] = field(default_factory=dict)
    smooth_start: float = 2.5
    run_in: float = 0.0
    encoder_noise: float = 0.0
    torque_noise: float = 0.0

    @property
    def random(self) -> bool:
        """Whether another seed gives another run."""
        return bool(self.encoder_noise or self.torque_noise)

    @property
    def period(self) -> float:
        """Period of the controller [s]."""
        assert self.controller.controller is not None
        return 1 / self.controller.controller.loop_hz

    def seeded(self, seed: int) -> dict[str, float]:
        """Return the parameters of the plant that the seed sets."""
        wanders = any(isinstance(effect, FrictionWander) for effect in self.plant.effects)
        return {f"{FrictionWander.id}.seed": float(seed)} if wanders else {}

    def controlled(self, case: str) -> Card:
        """Return the controller's card with this compensation."""
        return tuned(self.controller, compensation=case)


def tuned(card: Card, **changes: Any) -> Card:
    """Return the card with other keys in its `[controller]`."""
    assert card.controller is not None
    return replace(card, controller=card.controller.model_copy(update=changes))


def scaled(law: FrictionLaw, level: float, stiffness: float) -> FrictionLaw:
    """Return LuGre friction with all torques times `level` and sigma0 times `stiffness`."""
    assert isinstance(law, LuGre)
    torques = {name: times(getattr(law, name), level) for name in ("Fc", "Fs", "sigma2")}
    return replace(law, sigma0=times(law.sigma0, stiffness), **torques)


def times(value: Any, factor: float) -> Any:
    """Return a parameter times a factor, a pair in both directions."""
    return Pair(*(factor * side for side in value)) if isinstance(value, Pair) else factor * value


def conditions() -> tuple[Condition, ...]:
    """Return the conditions of the errata: ideal, base, base with kp 255, realistic; and two that explain them."""
    nominal, directional = read_card("paper_mount"), read_card("paper_mount_directional")
    refitted = replace(directional, believed=None)
    limit = directional.mount.model_copy(update={"torque_limit": NO_LIMIT})
    unlimited = replace(directional, mount=limit)
    return (
        Condition(key="ideal", title="ideal: matched nominal parameters", plant=nominal, controller=nominal),
        Condition(
            key="ideal_directional",
            title="ideal: matched directional parameters",
            plant=directional,
            controller=refitted,
        ),
        Condition(
            key="base",
            title="base: directional plant, nominal model, kp 225",
            plant=directional,
            controller=directional,
        ),
        Condition(
            key="base_kp255",
            title="base with kp 255",
            plant=directional,
            controller=tuned(directional, kp=255.0),
        ),
        _realistic("realistic", "realistic A: e' from the raw difference", unlimited, velocity="difference"),
        _realistic("realistic_observer", "realistic B: e' from the observer, 50 N m limit", directional),
    )


def definitions() -> tuple[Condition, ...]:
    """Return conditions with one thing defined otherwise: what the paper leaves open, and what it is worth."""
    base = condition("base")
    smooth = {"compensation.smoothing": 1e-5}
    return (
        base,
        replace(base, key="smooth_sign", title="static map with its sign smoothed over 1e-5 rad/s", changes=smooth),
        replace(
            base,
            key="difference",
            title="e' from the difference",
            controller=tuned(base.controller, velocity="difference"),
        ),
        replace(base, key="slow_start", title="smooth start of 5 s", smooth_start=5.0),
        replace(base, key="fast_loop", title="sampled at 50 kHz", controller=tuned(base.controller, loop_hz=50e3)),
        _realistic("limited", "realistic A with the drive's limit of 50 N m", base.controller, velocity="difference"),
    )


def condition(key: str) -> Condition:
    """Return the condition with this key."""
    return {one.key: one for one in conditions()}[key]


def _realistic(key: str, title: str, card: Card, velocity: str = "observer") -> Condition:
    """Condition A of the errata, or the same with another source of the speed."""
    # 16.5 % Ornstein-Uhlenbeck with 0.3 s, 15 % jumps each half period of the reference, 0.5 ms current loop.
    effects: tuple[Effect, ...] = (FrictionWander(std=0.165, jump_std=0.15), ActuatorLag(time_constant_ms=0.5))
    return Condition(
        key=key,
        title=title,
        plant=replace(card, friction=scaled(card.friction, 1.322, 0.815), effects=effects),
        controller=tuned(card, kp=255.0, velocity=velocity),
        encoder_noise=2.18e-6,
        torque_noise=2.33,
    )
