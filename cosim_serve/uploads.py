"""What is dropped: a name that is only a name, and no more bytes than there may be."""

import re
from dataclasses import dataclass
from pathlib import Path

from cosim.support.errors import InputError
from cosim.support.files import check_room, in_bytes

CONTROL = re.compile(r"[\x00-\x1f\x7f\u2028\u2029\u202a-\u202e\u2066-\u2069]")
"""Characters that steer a terminal, or turn the direction of writing."""
FORBIDDEN = re.compile(r'[<>:"|?*]')
"""Characters that some file system does not take."""

ADVICE = "remove older diagnoses, or use a disk with more room"
"""What is to be done where the disk is full."""


@dataclass(frozen=True)
class Limits:
    """How much may be dropped.

    Args:
        file: bytes of a recording: an hour of ten columns of text at 1 kHz is 300 MB.
        job: bytes of all recordings of a job.
        files: recordings of a job.
        card: bytes of a card; the longest that is shipped has 2 kB.
        form: bytes of a form.
        name: characters of a name; a file system takes 255 bytes, of which a character has up to 4.
    """

    file: int = 500_000_000
    job: int = 2_000_000_000
    files: int = 24
    card: int = 100_000
    form: int = 200_000
    name: int = 60


def safe_name(given: str, longest: int) -> str:
    """Return the last part of a name as something that stays in its folder (InputError)."""
    last = re.split(r"[/\\]", CONTROL.sub("", given))[-1]
    name = FORBIDDEN.sub("_", last).strip().lstrip(".")
    if not name or not Path(name).suffix:
        text = f'"{last[:longest]}" is no name of a recording or a card: it needs a name and a suffix, like run1.csv.'
        raise InputError(text, culprit=last)
    stem, suffixes = name.partition(".")[0], "".join(Path(name).suffixes[-2:])
    return name if len(name) <= longest else stem[: max(1, longest - len(suffixes))] + suffixes[-longest + 1 :]


def check_disk(path: Path, size: int) -> None:
    """Refuse a file that the disk has no room for (OutputError)."""
    check_room(path, size, ADVICE)


def check_size(name: str, size: int, most: int) -> None:
    """Refuse what is too large (InputError)."""
    if size > most:
        rule = f"at most {in_bytes(most)} are taken here"
        raise InputError(f"{name} is too large: {rule}. Cut it in pieces, or use cosim diagnose.", culprit=name)
