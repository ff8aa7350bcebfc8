"""What to do about an effect: its own advice, less what holds only where the improved model has the effect."""

import re

from pyfmi_models.effects import Effect

NAMES_MODEL = re.compile(r"(?:(?P<clause>[;,])|(?<=\.))[^.;,]*\buse the improved model\b[^.;,]*\.?$", re.IGNORECASE)


def advice(effect: Effect, in_model: bool, motion: str) -> str:
    """Return the action on a "rotary" or "linear" axis; an effect that the improved model lacks is not sent to it."""
    linear = motion == "linear" and effect.action_linear
    action = effect.action_linear if linear else effect.action
    return action if in_model else without_model(action)


def without_model(action: str) -> str:
    """Return an action that does not send to the improved model."""
    return NAMES_MODEL.sub(lambda found: "." if found["clause"] else "", action)
