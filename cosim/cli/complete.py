"""What a shell offers when names are completed: shipped scenarios and cards; files come from the shell itself."""


def scenarios(incomplete: str) -> list[str]:
    """Return the shipped scenarios that begin so."""
    from cosim.system.scenario import shipped_scenarios

    return [name for name in shipped_scenarios() if name.startswith(incomplete)]


def cards(incomplete: str) -> list[str]:
    """Return the shipped cards that begin so."""
    from pyfmi_models.card import shipped_cards

    return [name for name in shipped_cards() if name.startswith(incomplete)]


def anything(incomplete: str) -> list[str]:
    """Return what is shipped and begins so."""
    from cosim.api.show_effect import effects

    return [*scenarios(incomplete), *cards(incomplete), *(one for one in effects() if one.startswith(incomplete))]
