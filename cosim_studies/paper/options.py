"""Ways to compose the controller: what a person may choose instead of the paper's C3a."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from cosim_studies.paper.conditions import Condition, tuned
from pyfmi_models.card import Card, read_card
from pyfmi_models.controller_section import AdaptationSection, LearningSection
from pyfmi_models.effects import FrictionWander
from pyfmi_models.friction import FrictionLaw

Knowledge = Literal["nominal", "directional", "plant"]
RUN_IN = 30.0
"""Time given to controllers that learn before errors count [s]: six passes of the reference."""
PASS = 5.0
"""Period of the reference [s]."""


@dataclass(frozen=True, kw_only=True)
class Option:
    """A controller: compensation, the friction it believes in, and keys of `[controller]` that differ.

    `knows` is the friction believed: "nominal" (the paper's nominal column), "directional" (its Tables 2 and 3),
    "plant" (the mean law of the simulated plant: what an identification without error would give).
    """

    key: str
    title: str
    compensation: str = "C3a"
    knows: Knowledge = "nominal"
    changes: Mapping[str, Any] = field(default_factory=dict)

    def under(self, condition: Condition) -> Condition:
        """Return the condition with this controller in it."""
        card = tuned(condition.controller, compensation=self.compensation, **self.changes)
        return replace(condition, controller=replace(card, believed=self._law(condition)))

    @property
    def keys(self) -> dict[str, Any]:
        """Return the keys of a card's `[controller]` that make it, but for the friction it believes in."""
        sections = (AdaptationSection, LearningSection)
        tables = {key: one.model_dump() if isinstance(one, sections) else one for key, one in self.changes.items()}
        return {"compensation": self.compensation, **tables}

    def _law(self, condition: Condition) -> FrictionLaw:
        card: Card = condition.plant if self.knows == "plant" else read_card(_CARDS[self.knows])
        return card.friction


_CARDS = {"nominal": "paper_mount", "directional": "paper_mount_directional"}


def loop(bandwidth: float) -> dict[str, float]:
    """Return gains that put both poles of the loop at a bandwidth [rad/s]."""
    return {"kp": bandwidth**2, "kd": 2 * bandwidth}


REFERENCE = Option(key="C3a", title="C3a, nominal friction: the paper's best")
"""What all others are compared with."""


def options() -> tuple[Option, ...]:
    """Return the controllers that the page compares, in its order; the first is the reference."""
    return (
        REFERENCE,
        Option(key="C2a", title="C2a, nominal friction", compensation="C2a"),
        Option(key="directional", title="C3a, friction by direction (Tables 2, 3)", knows="directional"),
        Option(key="refitted", title="C3a, refitted by direction", knows="plant"),
        Option(key="blend", title="half C2a, half C3a", compensation="C2a+C3a"),
        Option(key="blend_refitted", title="half C2a, half C3a, refitted", compensation="C2a+C3a", knows="plant"),
        _fourth(120.0),
        _fourth(220.0),
        Option(
            key="third_400_30",
            title="C3a, order 3 at 400 rad/s, loop at 30 rad/s",
            changes={"observer_bandwidth": 400.0, **loop(30.0)},
        ),
        ADAPTING,
        LEARNING,
    )


def _fourth(bandwidth: float) -> Option:
    changes = {"observer_order": 4, "observer_bandwidth": bandwidth}
    return Option(
        key=f"fourth_{bandwidth:.0f}", title=f"C3a, observer of order 4 at {bandwidth:.0f} rad/s", changes=changes
    )


ADAPTING = Option(key="adapting", title="C3a, identified on line", changes={"adaptation": AdaptationSection()})
LEARNING = Option(
    key="learning", title="C3a, learning from pass to pass", changes={"learning": LearningSection(period=PASS)}
)


def settled(condition: Condition) -> Condition:
    """Return the condition with time to learn in it."""
    return replace(
        condition, key=f"{condition.key}_settled", title=f"{condition.title}, after {RUN_IN:.0f} s", run_in=RUN_IN
    )


def repeating(condition: Condition) -> Condition:
    """Return the condition with friction that does not wander: every pass meets the same."""
    effects = tuple(one for one in condition.plant.effects if not isinstance(one, FrictionWander))
    plant = replace(condition.plant, effects=effects)
    return replace(
        condition, key=f"{condition.key}_repeating", title=f"{condition.title}, friction repeats", plant=plant
    )
