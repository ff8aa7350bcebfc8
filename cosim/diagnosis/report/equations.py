"""What the catalogue of effects says to a reader of the report, by the id of a finding; empty for what is no effect."""

from pyfmi_models.effects import CATALOGUE, Effect


def equation(effect: str) -> str:
    """The equation; an effect torque resists."""
    return _form(effect).equation


def to_record(effect: str) -> str:
    """What to record where the effect cannot be tested and the diagnosis does not say."""
    return _form(effect).to_record


def _form(effect: str) -> type[Effect]:
    return CATALOGUE.get(effect, (Effect,))[0]
