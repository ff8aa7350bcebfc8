"""A job: recordings and a card that are to be diagnosed, or were; plain data, kept as JSON.

What is read back is checked against these types, because a job may come from another version of cosim or be damaged.
"""

from dataclasses import asdict, dataclass, field
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field, TypeAdapter

from cosim.support.plain import Parsed

State = Literal["draft", "queued", "running", "done", "failed", "cancelled", "interrupted"]
Role = Literal["train", "heldout", "out"]
Options = dict[str, dict[str, str]]
"""What a user says of a file: {"columns": {"tau": "force"}, "units": {"q": "deg"}, "layout": {"decimal": "comma"}}."""
ROLES: tuple[Role, ...] = ("train", "heldout", "out")
KEPT_BACK = ("heldout", "held_out", "held-out", "holdout", "validation", "proof", "test")
"""Parts of a file's name that say that it is kept for the proof."""
STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
"""A text is no number, and a key that is not known may matter to the version that wrote it."""
Size = Annotated[int, Field(ge=0, le=10**15)]
"""Bytes; more than a petabyte is no size of a file."""
Seconds = Annotated[float, Field(ge=0, le=1e12)]
"""Seconds, also those since 1970; more are 30,000 years."""


@dataclass(frozen=True, kw_only=True)
class Upload:
    """A recording that was dropped; one of a file of many is called as on a command line, "many.parquet:run=3"."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    name: str
    size: Size
    role: Role = "train"
    options: Options = field(default_factory=dict)

    @property
    def file(self) -> str:
        """The name of its file; a file that was dropped has no colon in its name."""
        return self.name.partition(":")[0]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """An effect that the first answer names, in words."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    what: str = ""
    size: str = ""
    range: str = ""
    answer: str = ""
    kind: str = ""
    statement: str = ""
    action: str = ""


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The verdict in words: heading, findings, what to check first; ids of effects; validation error in one line."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    heading: str = ""
    findings: tuple[Finding, ...] = ()
    check: tuple[str, ...] = ()
    verdict: tuple[str, ...] = ()
    error: str = ""


@dataclass(frozen=True, kw_only=True)
class Job:
    """A diagnosis and how far it is.

    Args:
        id: name of its folder.
        made: when it was made, UTC, as an ISO text.
        state: how far it is.
        uploads: its recordings.
        card: what its card is called, empty while there is none.
        machine: the name that the card gives to the machine.
        problem: why it failed, one sentence.
        answer: the verdict in words.
        begun: when the diagnosis began, in s since 1970.
        seconds: how long it took.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    id: str
    made: str
    state: State = "draft"
    uploads: tuple[Upload, ...] = ()
    card: str = ""
    machine: str = ""
    problem: str = ""
    answer: Answer = field(default_factory=Answer)
    begun: Seconds = 0.0
    seconds: Seconds = 0.0

    def upload(self, name: str) -> Upload:
        """Return a recording by its name (KeyError)."""
        return next((one for one in self.uploads if one.name == name), None) or _missing(name)

    @property
    def live(self) -> bool:
        """Whether something goes on with it."""
        return self.state in ("queued", "running")

    @property
    def called(self) -> str:
        """What it is called on the page: after its machine or its first recording."""
        return self.machine or (self.uploads[0].name if self.uploads else "New diagnosis")

    def as_json(self) -> Parsed:
        """Return it as plain data."""
        return asdict(self)


def job_of(text: bytes) -> Job:
    """Read a job from JSON (ValueError: it is damaged, or of another version)."""
    return _JOB.validate_json(text)


def answer_of(data: Parsed) -> Answer:
    """Read an answer from plain data (ValueError)."""
    return _ANSWER.validate_python(data, strict=False)


_JOB, _ANSWER = TypeAdapter(Job), TypeAdapter(Answer)


def role_of(name: str) -> Role:
    """Guess from its name what a recording is for."""
    return "heldout" if any(word in name.lower() for word in KEPT_BACK) else "train"


def _missing(name: str) -> Upload:
    raise KeyError(name)
