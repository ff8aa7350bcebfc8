"""What the catalogue of effects says to a reader of the report, by the id of a finding; empty for what is no effect."""

from pyfmi_models.effects import CATALOGUE, Effect


def equation(effect: str) -> str:
    """The equation; an effect torque resists."""
    return _form(effect).equation


def _form(effect: str) -> type[Effect]:
    return CATALOGUE.get(effect, (Effect,))[0]
