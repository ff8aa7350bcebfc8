"""`cosim.investigate`: a scenario, a card and a machine to one answer, by motions that decide what is open."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.api.diagnose import check_split
from cosim.api.recordings import Source, read_all
from cosim.data.recording import Recording
from cosim.delivery.deliver import deliver_quickly
from cosim.diagnosis.answer.result import Diagnosis
from cosim.hardware.machine import Machine as Hardware
from cosim.support.files import replacing
from cosim.support.html import text as html_text
from cosim.support.notebook import shows_progress
from cosim.support.plain import JsonObject
from cosim.support.threads import in_one_thread
from cosim_investigation.log import DIAGNOSIS, PAGE, STORY, Log
from cosim_investigation.loop import Investigation, Settings
from cosim_investigation.page import write_page
from cosim_investigation.prepare import given
from cosim_investigation.rounds import Rounds
from cosim_investigation.story import Answered, Moved, Story
from pyfmi_models.card import Card


@dataclass(frozen=True, repr=False)
class InvestigateResult:
    """What an investigation did, its last diagnosis, and the better card."""

    story: Story
    diagnosis: Diagnosis
    card: Card

    @property
    def missing(self) -> tuple[str, ...]:
        """As `DiagnosisResult.missing`: () nothing is missing; or ids of effects, or "unknown"."""
        return self.diagnosis.verdict

    def as_json(self) -> JsonObject:
        """Return the story as plain data, as story.json holds it."""
        return self.story.as_json()

    def __repr__(self) -> str:
        return f"InvestigateResult({', '.join(self.missing) or 'nothing missing'})"

    def __str__(self) -> str:
        return str(self.story)

    def _repr_html_(self) -> str:
        return html_text(str(self))


@shows_progress()
@in_one_thread
def investigate(
    scenario: str,
    card: str,
    out: str | Path,
    *,
    machine: str | Hardware = "",
    budget: float = 300.0,
    seconds: float = 15.0,
    limits: Mapping[str, str] | None = None,
    train: Source | Sequence[Source] = (),
    heldout: Source | Sequence[Source] = (),
    seed: int = 1,
    fast: bool = False,
    force: bool = False,
    on_progress: Callable[[str], None] = lambda text: None,
    on_step: Callable[[Moved | Answered], None] = lambda step: None,
    command: str = "cosim.investigate",
) -> InvestigateResult:
    """Ask the machine until one answer is left: record, diagnose, and run the motion that tells most of what is open.

    Args:
        scenario: plant, controller, set point and columns: its path, or the name of a shipped one.
        card: the model as believed: its path, or the name of a shipped one.
        out: folder for recordings, journal, story and the last diagnosis; one begun there is gone on with.
        machine: a card or plant FMU that stands in for the machine, in the place of the scenario's plant; or a drive,
            from `cosim.hardware.machine.read_machine`, which is moved inside its own limits too.
        budget: seconds of motion that may be spent, the first recordings and those of earlier calls included.
        seconds: length of one motion [s]; each is run twice, to be fitted and for validation.
        limits: {"position": "LOW:HIGH", "speed": ..., "acceleration": ..., "torque": ..., "frequency": ...,
            "forbidden": "FROM:TO"} in SI, the last a band [Hz] in which no tone lies;
            what is not given is what the scenario's own set point asks for.
        train: recordings to go on from, with `heldout` in the place of the first two.
        heldout: recordings for validation, to go on from.
        seed: of the phases of motions with many tones.
        fast: run a drive without a clock.
        force: start over, and remove what an investigation left there.
        on_progress: told in a line what is being done: the stage, of at most how many, the best answer so far, and the
            time that is left at most.
        on_step: told each recording and each answer.
        command: what the files shall name as what made them.

    Returns:
        `InvestigateResult`.

    Raises:
        ScenarioError, CardError, InputError: before anything moves.
        OutputError: the folder holds another investigation.
        HardwareError: the drive is not there, or a session ended in a fault.
        StepError: the machine failed; what was recorded before is kept.
    """
    settings = Settings(budget, seconds, seed)
    first, second = _read(train, "train"), _read(heldout, "heldout")
    check_split(first, second)
    ready = given(scenario, card, machine, limits or {}, settings, first, second, fast)
    with Log(Path(out), ready.identity(), force) as log:
        rounds = Rounds(on_progress, budget, seconds)
        heard = rounds.before(on_step)
        work = Investigation(ready.machine, ready.card, ready.limits, log, settings, rounds, heard)
        work.begin(ready.own, ready.train, ready.heldout)
        return _written(work, work.go_on(), Path(out), command)


def _read(source: Source | Sequence[Source], kind: str) -> list[Recording]:
    return read_all([] if isinstance(source, tuple) and not source else source, kind, None, None)


def _written(work: Investigation, story: Story, out: Path, command: str) -> InvestigateResult:
    """Write the last diagnosis, the story and its page."""
    assert work.outcome is not None
    train, heldout = work.recordings["train"], work.recordings["heldout"]
    found = deliver_quickly(work.outcome, train, heldout, work.card, out / DIAGNOSIS, command)
    with replacing(out / STORY, force=True) as partial:
        partial.write_text(json.dumps(story.as_json(), indent=2) + "\n", "utf-8")
    write_page(out / PAGE, story, out, command, work.card.mount.motion == "linear")
    return InvestigateResult(story, found, work.outcome.card)
