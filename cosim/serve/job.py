"""A job: recordings and a card that are to be diagnosed, or were; plain data, kept as JSON."""

from dataclasses import asdict, dataclass, field
from typing import Literal

from cosim.support.plain import Parsed

State = Literal["draft", "queued", "running", "done", "failed", "cancelled", "interrupted"]
Role = Literal["train", "heldout", "out"]
Options = dict[str, dict[str, str]]
"""What a user says of a file: {"columns": {"tau": "force"}, "units": {"q": "deg"}, "layout": {"decimal": "comma"}}."""
ROLES: tuple[Role, ...] = ("train", "heldout", "out")
KEPT_BACK = ("heldout", "held_out", "held-out", "holdout", "validation", "proof", "test")
"""Parts of a file's name that say that it is kept for the proof."""


@dataclass(frozen=True, kw_only=True)
class Upload:
    """A recording that was dropped; one of a file of many is called as on a command line, "many.parquet:run=3"."""

    name: str
    size: int
    role: Role = "train"
    options: Options = field(default_factory=dict)

    @property
    def file(self) -> str:
        """The name of its file; a file that was dropped has no colon in its name."""
        return self.name.partition(":")[0]


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
        answer: the verdict in words: heading, findings and sentences.
        begun: when the diagnosis began, in s since 1970.
        seconds: how long it took.
    """

    id: str
    made: str
    state: State = "draft"
    uploads: tuple[Upload, ...] = ()
    card: str = ""
    machine: str = ""
    problem: str = ""
    answer: Parsed = field(default_factory=dict)
    begun: float = 0.0
    seconds: float = 0.0

    def upload(self, name: str) -> Upload:
        """Return a recording by its name (KeyError)."""
        return next((one for one in self.uploads if one.name == name), None) or _missing(name)

    @property
    def live(self) -> bool:
        """Whether something goes on with it."""
        return self.state in ("queued", "running")

    def as_json(self) -> Parsed:
        """Return it as plain data."""
        return asdict(self)


def job_of(data: Parsed) -> Job:
    """Read a job from plain data (TypeError, KeyError)."""
    return Job(**{**data, "uploads": tuple(Upload(**one) for one in data["uploads"])})


def role_of(name: str) -> Role:
    """Guess from its name what a recording is for."""
    return "heldout" if any(word in name.lower() for word in KEPT_BACK) else "train"


def _missing(name: str) -> Upload:
    raise KeyError(name)
