"""The search for a better controller: composed designs, what each gains and costs, and the frontier between.

Nothing here looks at the seeds on which the result is reported.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

from cosim_studies.paper.margins import Margins
from cosim_studies.paper.options import Knowledge, Option, loop

MODELS: dict[str, tuple[str, Knowledge]] = {
    "none": ("C1", "nominal"),
    "nominal": ("C3a", "nominal"),
    "refitted": ("C3a", "plant"),
}
OBSERVERS = {3: (220.0, 300.0, 400.0, 600.0, 800.0), 4: (90.0, 120.0, 160.0, 220.0, 300.0)}
"""Bandwidths tried [rad/s], by the observer's order."""
LOOPS = {3: (15.0, 20.0, 30.0), 4: (15.0, 30.0)}
"""Bandwidths of the loop tried [rad/s], by the observer's order."""
PHASE = 45.0
"""Least phase margin asked for [deg]."""
GAIN = 0.1
"""Largest ISE asked for, as a share of C3a's."""
GUARD = 0.8
"""A design is chosen for this share of what is asked, since other seeds will give other numbers."""
NOISE = 5.0
"""Largest torque for the encoder's noise [N m RMS]: a tenth of what the drive has."""


@dataclass(frozen=True, kw_only=True)
class Design:
    """A controller with its gain (ISE as a share of C3a's, mean over the design seeds), torque [N m] and price."""

    option: Option
    ratio: float
    torque: float
    price: Margins
    noise: float


def designs() -> tuple[Option, ...]:
    """Return all designs that are tried: order and bandwidth of the observer, bandwidth of the loop, friction model.

    Their e' is the observer's: the raw difference commands 28 N m RMS of noise with a loop at 15 rad/s, 56 with 30.
    """
    return tuple(
        _design(order, wide, narrow, model)
        for order in OBSERVERS
        for wide, narrow, model in product(OBSERVERS[order], LOOPS[order], MODELS)
    )


def _design(order: int, wide: float, narrow: float, model: str) -> Option:
    compensation, knows = MODELS[model]
    changes = {"observer_order": order, "observer_bandwidth": wide, "velocity": "observer", **loop(narrow)}
    friction = {"none": "no friction model", "nominal": "C3a, nominal friction", "refitted": "C3a, refitted friction"}
    return Option(
        key=f"order{order}_{wide:.0f}_loop{narrow:.0f}_{model}",
        title=f"order {order} at {wide:.0f} rad/s, loop at {narrow:.0f} rad/s, {friction[model]}",
        compensation=compensation,
        knows=knows,
        changes=changes,
    )


def frontier(found: Iterable[Design], price: str = "phase") -> list[Design]:
    """Return the designs that no other beats in both ISE and a margin ("phase" or "delay"), by falling margin."""
    best: list[Design] = []
    for design in sorted(found, key=lambda one: (-getattr(one.price, price), one.ratio)):
        if design.price.stable and (not best or design.ratio < best[-1].ratio):
            best.append(design)
    return best


def choice(found: Sequence[Design]) -> Design:
    """Return the design with the largest delay margin among those that are asked for; without any, the best in ISE.

    Asked for: ISE at most `GUARD` `GAIN` of C3a's, a phase margin of at least `PHASE`, torque for noise of at most
    `NOISE`, and no friction model that was fitted to the very plant.
    """
    honest = [one for one in found if one.option.knows == "nominal" and one.price.stable]
    allowed = [one for one in honest if one.price.phase >= PHASE and one.noise <= NOISE]
    asked = [one for one in allowed if one.ratio <= GUARD * GAIN]
    if asked:
        return max(asked, key=lambda one: one.price.delay)
    return min(allowed or honest, key=lambda one: one.ratio)


def chosen_option(design: Design) -> Option:
    """Return the chosen design under a name of its own."""
    return replace(design.option, key="chosen")
