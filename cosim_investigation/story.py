"""What an investigation did: what was open, what was moved, what it decided, and the seconds of motion it took."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Literal

from cosim.diagnosis.answer.result import Diagnosis
from cosim.report.words import lowered
from cosim.support.plain import JsonObject, Parsed
from cosim_investigation.questions import Question
from pyfmi_models.effects import CATALOGUE

End = Literal["answered", "budget spent", "no motion tells", "limit left"]
SENTENCES: dict[End, str] = {
    "answered": "One answer is left.",
    "budget spent": "The budget of motion is spent.",
    "no motion tells": "No motion inside the limits tells more.",
    "limit left": "A limit was left, so nothing more was moved.",
}


@dataclass(frozen=True)
class Moved:
    """One recording: its number, file, role, the family and the words of its motion, its seconds."""

    number: int
    file: str
    role: str
    family: str
    title: str
    seconds: float
    nats: float = 0.0
    """Expected log-odds between the structures that were open; 0 where new ground was sought."""
    ground: float = 0.0
    """Share of it that no recording had visited."""
    random_nats: float | None = None
    """What many tones at random of as many seconds promised in its place; None where they would leave a limit."""
    random_ground: float | None = None
    left: str = ""
    """The limit that the recorded motion left."""


@dataclass(frozen=True)
class Answered:
    """One diagnosis: what it names, what it leaves open, the held-out error and its noise [N m, N]."""

    number: int
    verdict: tuple[str, ...]
    open: tuple[str, ...]
    kinds: tuple[str, ...]
    before: float
    after: float
    floor: float
    seconds: float
    """Computing time of diagnosis and design."""

    @classmethod
    def of(cls, number: int, found: Diagnosis, asked: Sequence[Question], seconds: float) -> "Answered":
        """Take it from a diagnosis and the questions that it leaves."""
        held = found.heldout
        said, kinds = (tuple(getattr(one, name) for one in asked) for name in ("statement", "kind"))
        errors = held.before_rms, held.after_rms, held.floor_rms
        return cls(number, found.verdict, said, kinds, *errors, seconds)

    @property
    def words(self) -> str:
        """The verdict as one reads it."""
        titles = (CATALOGUE[one][0].title if one in CATALOGUE else one.replace("_", " ") for one in self.verdict)
        return ", ".join(map(lowered, titles)) or "nothing is missing"


@dataclass(frozen=True)
class Story:
    """All of it, in the order in which it happened."""

    steps: tuple[Moved | Answered, ...]
    ended: End
    otherwise: tuple[str, ...] = ()
    """What else than a motion would tell what is still open."""
    refused: tuple[str, ...] = ()
    limits: Mapping[str, float] = field(default_factory=dict)

    @property
    def first(self) -> Answered:
        """The first answer."""
        return next(one for one in self.steps if isinstance(one, Answered))

    @property
    def last(self) -> Answered:
        """The last answer."""
        return next(one for one in reversed(self.steps) if isinstance(one, Answered))

    @property
    def answer(self) -> str:
        """The last answer as a heading, with the set that it is one of: a name among others is none."""
        words, questions = self.last.words, zip(self.last.open, self.last.kinds, strict=True)
        sets = "; ".join(statement for statement, kind in questions if kind == "set")
        return words[0].upper() + words[1:] + (f" (open: {sets})" if sets else "")

    @property
    def further(self) -> float:
        """Seconds of motion after the first answer."""
        return sum(one.seconds for one in self.steps[self.steps.index(self.first) :] if isinstance(one, Moved))

    @property
    def seconds(self) -> float:
        """Seconds of motion in all."""
        return sum(one.seconds for one in self.steps if isinstance(one, Moved))

    def as_json(self) -> JsonObject:
        """Everything as plain data."""
        steps = [{"what": type(one).__name__.lower(), **asdict(one)} for one in self.steps]
        return {
            "ended": self.ended,
            "verdict": list(self.last.verdict),
            "open": list(self.last.open),
            "motion_seconds": self.seconds,
            "further_motion_seconds": self.further,
            "otherwise": list(self.otherwise),
            "refused": list(self.refused),
            "limits": dict(self.limits),
            "steps": steps,
        }

    def __str__(self) -> str:
        lines = [line_of(one) for one in self.steps]
        more = [f"Instead  {one}" for one in self.otherwise]
        refused = [f"Refused  {one}" for one in self.refused]
        return "\n".join([*lines, *refused, SENTENCES[self.ended], *more, self._total()])

    def _total(self) -> str:
        motion = f"{self.seconds:.0f} s of motion, {self.further:.0f} s after the first answer"
        return f"{self.answer}; {motion}"


def line_of(one: Moved | Answered) -> str:
    """Return a step in one line."""
    if isinstance(one, Moved):
        hope = f", {one.nats:.0f} nats expected" if one.nats else ""
        left = f"; LEFT {one.left}" if one.left else ""
        role = "to fit" if one.role == "train" else "for validation"
        return f"Moved    {one.title}, {one.seconds:.0f} s ({role}{hope}){left}"
    open_ = f"; open: {'; '.join(one.open)}" if one.open else ""
    return f"Answer   {one.words}, held-out error {one.after:.3g} (noise {one.floor:.3g}){open_}"


def moved_of(row: Parsed) -> Moved:
    """A recording as the journal tells it."""
    return Moved(**{name: row[name] for name in Moved.__dataclass_fields__ if name in row})


def answered_of(row: Parsed) -> Answered:
    """An answer as the journal tells it."""
    lists = {name: tuple(row[name]) for name in ("verdict", "open", "kinds")}
    return Answered(**({name: row[name] for name in Answered.__dataclass_fields__} | lists))
