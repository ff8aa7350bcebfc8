"""`cosim.diagnose`: recordings and a card to what the card lacks, and a better card."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.api.defaults import estimated, split
from cosim.api.progress import Staged, stages_of
from cosim.api.recordings import Source, Written, at_least_one, read_all
from cosim.api.why import frame
from cosim.data.recording import Recording
from cosim.delivery.deliver import DOCUMENT, FILES, QUICK, as_json, check_out, deliver, deliver_quickly, without_files
from cosim.delivery.proposal import Proposal, write_proposals
from cosim.diagnosis.answer.entries import Improved
from cosim.diagnosis.answer.result import Diagnosis, Finding, Trace
from cosim.diagnosis.diagnose import Outcome
from cosim.diagnosis.diagnose import diagnose as find
from cosim.diagnosis.search.side_by_side import side_by_side
from cosim.reading import check_kind
from cosim.report.answer_figure import answer_figure
from cosim.report.repairs import for_machine
from cosim.report.terminal import summary
from cosim.support.errors import InputError
from cosim.support.files import check_directory
from cosim.support.html import table as html_table
from cosim.support.html import text as html_text
from cosim.support.notebook import shows_progress
from cosim.support.plain import JsonObject
from cosim.support.threads import in_one_thread
from pyfmi_models.card import Card, read_card

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class DiagnosisResult:
    """The answer of a diagnosis, and the better card."""

    diagnosis: Diagnosis
    card: Card
    """The card refitted, with the effects that were found and stand."""
    refitted: Card
    """The card refitted, without any effect."""
    proposals: tuple[Proposal, ...] = ()
    """Effect files for a person to review, of formulas that are as good as what was learned outside the catalogue."""
    notes: tuple[str, ...] = ()
    """What was chosen where less was given: a card from the recordings, a recording that was kept out of the fit."""

    @property
    def missing(self) -> tuple[str, ...]:
        """() nothing is missing; ("unknown",) something outside the catalogue is; or ids of effects, largest first."""
        return self.diagnosis.verdict

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All effects that were looked for, each with its answer, size, 95 % range and sentences."""
        return self.diagnosis.findings

    @property
    def ledger(self) -> "pd.DataFrame":
        """Every structure that was fitted, a row each: evidence, held-out gain, and the rule that refuses it."""
        return frame(self.diagnosis.ledger)

    def frame(self) -> "pd.DataFrame":
        """Return the findings as a table, a row an effect, with answer, probability, size and its range."""
        import pandas as pd

        names = ("effect", "title", "answer", "probability", "size", "size_range", "action")
        rows = [[getattr(one, name) for name in names] for one in self.findings]
        return pd.DataFrame(rows, columns=names).rename(columns={"size_range": "range"})

    @property
    def missing_torque(self) -> "pd.DataFrame":
        """What the refitted card leaves (`missing`, `band`) and what the effects leave (`after`), a row a sample.

        Torques in N.m (N on a linear axis); `band` is the half width of the 95 % band.
        """
        return missing_frame(self.diagnosis.traces)

    def plot(self) -> Any:
        """Return a matplotlib figure: the error on the validation run, and its missing torque before and after."""
        return answer_figure(self.diagnosis)

    def as_json(self) -> JsonObject:
        """Return everything as plain data, as diagnosis.json holds it."""
        return as_json(self.diagnosis)

    def propose(self, folder: str | Path, force: bool = False) -> tuple[Path, ...]:
        """Write each proposal as the file of an effect, in the form of docs/adding_physics.md; nothing loads it.

        Returns:
            The files; none, and no folder is made, where there is nothing to propose.

        Raises:
            OutputError: the folder holds a proposal and `force` is not set, or effects are loaded from it.
        """
        return write_proposals(self.proposals, Path(folder), force)

    def __repr__(self) -> str:
        said = ", ".join(self.missing) or "nothing missing"
        held = self.diagnosis.heldout
        return f"DiagnosisResult({said}; validation RMS {held.before_rms:.3g} -> {held.after_rms:.3g})"

    def __str__(self) -> str:
        return summary(self.diagnosis)

    def _repr_html_(self) -> str:
        rows = [
            {"effect": one.title, "answer": one.answer.replace("_", " "), "size": one.size, "95 %": one.size_range}
            for one in self.findings
            if one.answer in ("found", "ambiguous", "not_proven")
        ]
        return html_table("Missing physics", rows) + html_text(str(self))


def missing_frame(traces: Sequence[Trace]) -> "pd.DataFrame":
    """Return the missing torque of all recordings, a row a sample that was judged."""
    import pandas as pd

    signals = ("t", "q", "v", "missing", "band")
    parts = [
        pd.DataFrame(
            {"recording": one.name, "heldout": one.heldout}
            | {name: getattr(one, name) for name in signals}
            | {"after": one.tau - one.after}
        )
        for one in traces
    ]
    columns = ["recording", "heldout", *signals, "after"]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


@shows_progress()
@in_one_thread
def diagnose(
    train: Source | Sequence[Source],
    heldout: Source | Sequence[Source] = (),
    card: str | Path | Card | None = None,
    out: str | Path | None = None,
    *,
    motion: str = "",
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    layout: Mapping[str, str] | None = None,
    fmu: str | Path | None = None,
    variables: Mapping[str, str] | None = None,
    quick: bool = False,
    with_possible: bool = False,
    force: bool = False,
    on_progress: Callable[[str], None] = lambda text: None,
    on_answer: Callable[[Diagnosis], None] = lambda found: None,
    command: str = "cosim.diagnose",
) -> DiagnosisResult:
    """Say which physics a card lacks, and prove it on a recording that was never fitted.

    Args:
        train: recordings that may be fitted, one or several, each a path, data frame, mapping of arrays or `Recording`
            (see `cosim.read`).
        heldout: recordings that prove the result and may veto an effect; nothing is fitted to them. () keeps the last
            of several, or the end of a single one.
        card: the model as delivered: its path, the name of a shipped one, or a `Card`; None estimates one from the
            recordings, as `cosim.card` does.
        out: folder for diagnosis.json, card.toml, the improved FMUs, missing_torque.parquet and report.html; None
            writes nothing and closes no loop.
        motion: "rotary" or "linear", where there is neither a card nor a unit that says it.
        columns: our name to the source's, as in `cosim.read`; they come before the card's.
        units: our name to the unit in the source, as in `cosim.read`.
        layout: CSV format, as in `cosim.read`.
        fmu: a third-party plant FMU as the base; the card then says roughly what it is.
        variables: our name to the FMU's, where they differ: {"tau": "Motor.torque"}.
        quick: write diagnosis.json and card.toml alone, and close no loop.
        with_possible: let the card hold effects that are only possible too.
        force: overwrite what is there.
        on_progress: told in a line what is being done, the stage of how many, and about how long it takes still.
        on_answer: told the answer as soon as it stands, before FMUs and report are made from it.
        command: what the files shall name as what made them.

    Returns:
        `DiagnosisResult`. Torques are in N.m (N on a linear axis), positions in rad (m), times in s.

    Raises:
        InputError: recordings or card do not go together. RecordingError, UnitError: as `cosim.read`, or too short.
        CardError: the card is not good. WiringError, FmuError: the FMU has no such variables, or cannot be run.
        OutputError: a file is there already; nothing was diagnosed then.
    """
    folder = _checked(out, quick, force)
    on_progress = Staged(on_progress, stages_of(card is not None, folder is not None and not quick))
    given = _read(train, heldout, card, Written(columns, units, layout), motion, on_progress)
    given = replace(given, with_possible=with_possible, command=command, on_answer=on_answer)
    if fmu is not None:
        given = _with_base(Path(fmu), variables or {}, given, on_progress)
    way = _delivered if folder and not quick else _diagnosed
    with _anew(folder if force else None):
        return way(given, folder, on_progress)


def _checked(out: str | Path | None, quick: bool, force: bool) -> Path | None:
    """The folder for the files, if any: refused before anything is computed (OutputError)."""
    folder = None if out is None else Path(out)
    if folder:
        check_out(folder, force, QUICK if quick else FILES)
        check_directory(folder)
    return folder


def _written(folder: Path) -> dict[Path, int]:
    """Files of the diagnosis that a folder holds, and when they were written: those of FMUs it names itself."""
    try:
        said = dict(json.loads((folder / DOCUMENT).read_text("utf-8"))["improved"])
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    named = {one for one in said.values() if isinstance(one, str) and Path(one).name == one}
    paths = [folder / name for name in {*FILES, *named}]
    return {path: path.stat().st_mtime_ns for path in paths if path.is_file()}


@contextmanager
def _anew(folder: Path | None) -> Iterator[None]:
    """Remove in the end what was there and was not written over: it belongs to another answer."""
    before = _written(folder) if folder else {}
    yield
    for path, written in before.items():
        if path.is_file() and path.stat().st_mtime_ns == written:
            path.unlink()


@dataclass(frozen=True)
class _Given:
    """What is diagnosed; beside somebody's FMU its name, and what writes the correction for it."""

    train: Sequence[Recording]
    heldout: Sequence[Recording]
    card: Card
    more: Callable[[Card, Path], Improved] = lambda *_: Improved()
    base: str = ""
    notes: tuple[str, ...] = ()
    """What was chosen where less was given."""
    with_possible: bool = False
    command: str = ""
    on_answer: Callable[[Diagnosis], None] = lambda found: None


def _read(
    train: Source | Sequence[Source],
    heldout: Source | Sequence[Source],
    card: str | Path | Card | None,
    written: Written,
    motion: str,
    on_progress: Callable[[str], None],
) -> _Given:
    """Read the card, and the recordings as it calls their columns; check that they belong together."""
    believed, notes = card if isinstance(card, Card) or card is None else read_card(card), []
    written = written.with_columns_of(believed.columns if believed else {})
    fitted, held = (read_all(some, kind, *written) for some, kind in ((train, "train"), (heldout, "heldout")))
    check_split(at_least_one(fitted), held)
    if not held:
        fitted, held, said = split(fitted)
        notes.append(said)
    if believed is None:
        believed, said = estimated(fitted, motion, on_progress)
        notes.append(said)
    check_kind([*fitted, *held], believed.mount.motion)
    return _Given(fitted, held, believed, notes=tuple(notes))


def _with_base(fmu: Path, variables: Mapping[str, str], given: _Given, on_progress: Callable[[str], None]) -> _Given:
    """Put the card that is most like an FMU in its place."""
    from cosim.delivery.correction_fmu import Correction, motion_of  # the master: a third of all that is imported
    from cosim.diagnosis.black_box import BlackBox, as_base
    from cosim.fmi.alias import Alias

    box = BlackBox(fmu, {name: Alias(own) for name, own in variables.items()})
    base = as_base(box, given.train, given.heldout, given.card, on_progress)
    correction = Correction(box, base.card, *motion_of(given.train[0]))
    given = replace(given, train=base.train, heldout=base.heldout, card=base.card)
    return replace(given, more=correction.deliver, base=box.label)


def _diagnosed(given: _Given, out: Path | None, on_progress: Callable[[str], None]) -> DiagnosisResult:
    """Diagnose, and write the answer and the card where there is a folder."""
    found = find(given.train, given.heldout, given.card, on_progress, with_possible=given.with_possible)
    outcome = _answered(found, given)
    done = without_files(outcome.diagnosis)
    if out:
        done = deliver_quickly(outcome, given.train, given.heldout, given.card, out, given.command, given.base)
    return _result(done, outcome, given)


def _delivered(given: _Given, out: Path | None, on_progress: Callable[[str], None]) -> DiagnosisResult:
    """Diagnose with the loops closed beside it, and write all files."""
    from cosim.delivery.closed_loop import Loops  # the master: a third of all that is imported

    assert out is not None  # files need a folder
    train, heldout, card = given.train, given.heldout, given.card
    with Loops(card, heldout) as loops, side_by_side(on_progress) as refits:
        loops.close("nominal", card.plant())
        found = find(train, heldout, card, on_progress, loops.close, refits, given.with_possible)
        outcome = _answered(found, given)
        done = deliver(outcome, train, heldout, card, out, given.command, loops, on_progress, given.more, given.base)
    return _result(done, outcome, given)


def _answered(outcome: Outcome, given: _Given) -> Outcome:
    """Add what was said while reading, and what to do on the kind of machine that the card names; tell the answer."""
    found = for_machine(outcome.diagnosis, given.card.mount.machine or "")
    found = replace(found, data_quality=(*given.notes, *found.data_quality))
    given.on_answer(found)
    return replace(outcome, diagnosis=found)


def _result(done: Diagnosis, outcome: Outcome, given: _Given) -> DiagnosisResult:
    proposals = tuple(Proposal(formula, statement) for formula, statement in outcome.formulas)
    return DiagnosisResult(done, outcome.card, outcome.refitted, proposals, given.notes)


def check_split(train: Sequence[Recording], heldout: Sequence[Recording]) -> None:
    """Refuse a recording that is fitted and held out, or given twice (raises InputError)."""
    for one in heldout:
        if _is_among(one, train):
            text = f"{one.name} is held out and among the training recordings; a proof needs a recording of its own."
            raise InputError(text, culprit=one.name)
    for several in (train, heldout):
        for number, one in enumerate(several):
            if _is_among(one, several[:number]):
                text = f"{one.name} is given twice, and would count as two recordings; give each recording once."
                raise InputError(text, culprit=one.name)


def _is_among(one: Recording, others: Sequence[Recording]) -> bool:
    """Whether a recording is one of some: the same object, or the same rows of a file."""
    return any(one is other or (bool(one.sha256) and one.identity == other.identity) for other in others)
