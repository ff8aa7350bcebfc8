"""Near misses: the name that somebody may have meant; `cosim.support.near` is the same for the runner."""

from collections.abc import Iterable

LIKE = 0.6
"""Share of letters in common from which two names are alike (difflib's own default)."""
MEANT = "Did you mean"
"""Words that a message has that suggests a name."""
LONGEST = 100
"""Letters of a name that are compared: comparing takes the square of their number."""


def near(name: str, choices: Iterable[str]) -> str:
    """Return the choice that is most like a name, whatever its capitals; an empty text if none is like it."""
    from difflib import get_close_matches  # not needed until something went wrong

    lower = {choice.lower()[:LONGEST]: choice for choice in choices}
    given = name.lower()[:LONGEST]
    found = get_close_matches(given, lower, n=3, cutoff=LIKE)
    swapped = (one for one in found if sorted(one) == sorted(given))  # stpe is step rather than stop
    return lower[next(swapped, found[0])] if found else ""


def did_you_mean(name: str, choices: Iterable[str]) -> str:
    """Return ` Did you mean "sidereal"?`, or an empty text if no choice is like the name."""
    found = near(name, choices)
    return f' {MEANT} "{found}"?' if found and found != name else ""
