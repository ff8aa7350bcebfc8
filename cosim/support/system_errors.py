"""What the system refuses, as one sentence: a full disk, a folder that is read-only, a name that is too long."""

LONGEST = 300
"""Characters of a name or a reason that a sentence repeats."""


def surroundings(error: OSError | MemoryError) -> str:
    """Say what the system refused: a full disk, a folder that is read-only, a name that is too long."""
    if isinstance(error, MemoryError):
        return "There is not enough memory for this."
    reason = error.strerror or " ".join(str(error).split()) or type(error).__name__
    if len(reason) > LONGEST:
        reason = f"{reason[:LONGEST]}..."
    place = f"{str(error.filename)[:LONGEST]}: " if error.filename else ""
    return f"{place}{reason[0].lower()}{reason[1:].rstrip('.')}."
