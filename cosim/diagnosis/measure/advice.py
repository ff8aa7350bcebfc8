"""What to do about an effect: its own advice, less what holds only where the improved model has the effect."""

import re

from pyfmi_models.effects import Effect

NAMES_MODEL = re.compile(r"(?:(?P<clause>[;,])|(?<=\.))[^.;,]*\buse the improved model\b[^.;,]*\.?$", re.IGNORECASE)


def advice(effect: Effect, in_model: bool) -> str:
    """Return the action of an effect; one that the improved model lacks is not sent to that model."""
    if in_model:
        return effect.action
    return NAMES_MODEL.sub(lambda found: "." if found["clause"] else "", effect.action)
