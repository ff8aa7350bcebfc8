"""What a recording or a card was seen to hold, as the page shows it; read back only if it is of this form."""

from dataclasses import asdict, dataclass, field
from hashlib import sha256
from typing import ClassVar

from pydantic import ConfigDict, TypeAdapter

from cosim.support.plain import Parsed
from cosim_serve.job import STRICT, Options

CARD_VIEW = "card"
"""Key of the view of a card."""
NOT_SEEN = "What this file holds is not known here any more: read it again with the button below."
"""Problem of a recording whose view is missing or damaged."""
CARD_NOT_SEEN = "What this card says is not known here any more: use it again as text, or drop it again."
"""The same for a card."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column as it is drawn: name, what it serves as, unit, range, and the corners of its line."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: str
    serves: str
    unit: str
    least: str
    greatest: str
    line: str
    begins: float | None = None
    ends: float | None = None
    """Time at the ends of the line [s]; None in a view that an older version kept."""


@dataclass(frozen=True, kw_only=True)
class View:
    """A recording: why it cannot be read or used, what is to be decided, its columns, and how it was read."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    problem: str = ""
    refused: str = ""
    said: str = ""
    undecided: tuple[str, ...] = ()
    columns: tuple[Column, ...] = ()
    names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    facts: dict[str, str] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    options: Options = field(default_factory=dict)
    parts: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CardView:
    """A card: its problem, or what it says of the machine, the columns that it renames, and remarks."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    problem: str = ""
    facts: dict[str, str] = field(default_factory=dict)
    columns: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def view_of(text: bytes, key: str) -> Parsed:
    """Read the view that is kept under a key, with all its fields (ValueError: it is damaged or of another version)."""
    return asdict(_CARD.validate_json(text) if key == CARD_VIEW else _VIEW.validate_json(text))


def no_view(key: str, problem: str = "") -> Parsed:
    """Return the view of a file of which nothing but a problem is known."""
    return asdict(CardView(problem=problem) if key == CARD_VIEW else View(problem=problem))


def view_key(file: str) -> str:
    """Return the name under which the view of a file is kept."""
    return sha256(file.encode()).hexdigest()[:16]


_VIEW, _CARD = TypeAdapter(View), TypeAdapter(CardView)
