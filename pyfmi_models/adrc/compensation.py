"""Friction compensation: a friction law inside the controller, driven by the observed or by the reference speed."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import casadi as ca

from pyfmi_models.adrc.estimate import Estimate, Seen
from pyfmi_models.friction import FrictionLaw, LuGre, MemorylessLaw
from pyfmi_models.model import Chapter, Scalar, Variable, chapter_of, parameters_of, with_symbols

Source = Literal["observed", "reference"]
PREFIX = "compensation"
SIGN = 1e-9
"""Smoothing [rad/s] of a static map: the paper's sign of the speed, 3e-6 of its largest reference speed.

A plant needs a smooth sign for its solver; a sampled controller does not, and 1e-5 rad/s is worth 12 % of C2b's error.
"""


@dataclass(frozen=True, kw_only=True)
class Compensation(Estimate):
    """Friction of a law at the observed (C2) or the reference speed (C3).

    A law with memory is advanced over each period with the mean of the speeds at its ends. `share` scales its torque,
    `name` tells its states from those of another compensation by the same law.
    """

    law: FrictionLaw
    source: Source
    share: float = 1.0
    name: str = PREFIX

    def parameters(self) -> tuple[Variable, ...]:
        """The law's parameters."""
        return parameters_of(self.law, PREFIX)

    def states(self) -> tuple[Variable, ...]:
        """The law's states and, where it has any, the last speed."""
        speed = Variable(name="speed", unit="rad/s", description="Speed the friction model saw at the last tick")
        known = (*self.law.states(), speed) if self.law.states() else ()
        return tuple(replace(state, name=f"{self.name}.{state.name}") for state in known)

    def chapter(self, onto: str) -> Chapter:
        """Tell the law, and at which speed it is asked."""
        speed = {"observed": "observed", "reference": "desired"}[self.source]
        return chapter_of(self.law, PREFIX, f"Friction from the {speed} speed", onto)

    def advance(
        self, symbols: dict[str, Scalar], state: list[Any], seen: Seen, period: float
    ) -> tuple[list[Any], Scalar]:
        """Return the states after this tick and the friction torque now."""
        now = getattr(seen, self.source)
        law = with_symbols(self.law, symbols, now, PREFIX)
        *memory, before = state or [now]
        middle = (before + now) / 2
        memory = ca.vertsplit(law.advance(ca.vertcat(*memory), middle, law.level(middle), period)) if memory else []
        torque = law.contact(ca.vertcat(*memory), now, law.level(now)) + law.viscous(now)
        return [*memory, now] if memory else [], self.share * torque


def static(law: LuGre) -> MemorylessLaw:
    """Return the law's steady map with the sign of the speed as good as sharp."""
    return replace(law.steady(), smoothing=SIGN)


def compensation_case(case: str, law: LuGre) -> tuple[Compensation, ...]:
    """Return the compensations of a case.

    C1 none; C2 by observed, C3 by reference speed; a dynamic (LuGre), b its static map; C2a+C3a: half of each.
    """
    table: dict[str, tuple[Compensation, ...]] = {
        "C1": (),
        "C2a": (Compensation(law=law, source="observed"),),
        "C2b": (Compensation(law=static(law), source="observed"),),
        "C3a": (Compensation(law=law, source="reference"),),
        "C3b": (Compensation(law=static(law), source="reference"),),
        "C2a+C3a": (
            Compensation(law=law, source="observed", share=0.5, name=f"{PREFIX}.observed"),
            Compensation(law=law, source="reference", share=0.5, name=f"{PREFIX}.reference"),
        ),
    }
    return table[case]
