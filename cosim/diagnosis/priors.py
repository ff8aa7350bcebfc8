"""How far a fitted number may be from its fit: the priors of evidence."""

LINEAR = (".Fc", ".sigma2", ".positive", ".negative")
"""Endings of the parameters of friction whose tangents hold however far they move."""


def trust(name: str, value: float) -> float:
    """How far a parameter may move from its fit before its tangent says nothing more (one standard deviation)."""
    if name.endswith("phase"):
        return 1.0
    return (0.1 if name.startswith("friction.") and not name.endswith(LINEAR) else 1.0) * max(abs(value), 1e-12)
