"""Shares in the sentences of effects: 42 %, 189 %, 30 % lower."""


def percent(share: float) -> str:
    """Return a share in per cent with two digits, and all of those before the point: 0.42 becomes 42 %, 1.893 189 %."""
    value = 100 * share
    return f"{value:.0f} %" if abs(value) >= 99.5 else f"{value:.2g} %"


def higher(share: float) -> str:
    """Say how far something is off, to either side: 42 % higher, 30 % lower."""
    return f"{percent(abs(share))} {'higher' if share >= 0 else 'lower'}"
