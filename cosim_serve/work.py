"""The diagnosis of a job; called in a process of its own, which tells how far it is."""

from dataclasses import dataclass
from pathlib import Path
from shlex import quote
from typing import Any

from cosim.support.errors import InputError
from cosim.support.plain import Parsed
from cosim_serve.job import Job, Upload
from pyfmi_models.errors import ModelError

MAIN = ("found", "ambiguous", "not_proven")
"""Answers that the first answer names; the report names all."""


@dataclass(frozen=True)
class Order:
    """What is to be diagnosed: recordings and card as paths, the folder for the result."""

    uploads: tuple[Upload, ...]
    recordings: Path
    card: Path
    called: str
    out: Path


def diagnose_order(order: Order) -> Parsed:
    """Diagnose, write everything into the folder and return the answer in words.

    Tells ("step", what is being tried) and, before FMU and report are made, ("answer", the answer in words).

    Raises:
        CosimError: one sentence for a person, which names files as the user knows them.
    """
    try:
        return _diagnosed(order)
    except ModelError as error:
        raise InputError(_named(str(error), order)) from None
    except InputError as error:
        raise InputError(_named(str(error), order), culprit=error.culprit) from None


def _diagnosed(order: Order) -> Parsed:
    from cosim.api.diagnose import diagnose
    from cosim.data.recording import Recording
    from cosim.reading import check_kind
    from cosim.support.child import tell
    from cosim.support.memory import keep_freed_memory
    from cosim_serve import comparison
    from pyfmi_models.card import read_card

    keep_freed_memory()
    tell("step", "reading the recordings")
    card = read_card(order.card)
    read: dict[str, list[Recording]] = {"train": [], "heldout": [], "out": []}
    for one in order.uploads:
        said = {key: one.options.get(key, {}) for key in ("columns", "units", "layout")}
        columns = dict(card.columns) | said["columns"]
        recording = Recording.read(order.recordings / one.name, columns, said["units"], layout=said["layout"])
        read[one.role].append(recording)
    check_kind([*read["train"], *read["heldout"]], card.mount.motion)
    done = diagnose(
        read["train"],
        read["heldout"],
        card,
        order.out,
        on_progress=lambda text: tell("step", text),
        on_answer=lambda found: tell("answer", in_words(found)),
        command=command(order),
    )
    comparison.write(done.diagnosis, order.out)
    return in_words(done.diagnosis)


def command(order: Order) -> str:
    """Return the command line that does the same with the files as they are called here."""
    train, held = ([one.name for one in order.uploads if one.role == role] for role in ("train", "heldout"))
    words = ["cosim diagnose", *map(quote, train)]
    words += [f"--heldout {quote(name)}" for name in held]
    words.append(f"--card {quote(order.called)}")
    for key in ("columns", "units", "layout"):
        pairs = dict.fromkeys(
            quote(f"{one.file}:{ours}={theirs}")
            for one in order.uploads
            for ours, theirs in one.options.get(key, {}).items()
            if one.role != "out"
        )
        words += [f"--{key} {' '.join(pairs)}"] if pairs else []
    return " ".join([*words, "--out result"])


def in_words(found: Any) -> Parsed:
    """Return the verdict as a heading and one row for each effect that has something to say."""
    from cosim.report.lead import heading
    from cosim.report.words import ANSWERS, sized, stated

    rows = [
        {
            "what": one.title,
            **dict(zip(("size", "range"), sized(one), strict=True)),
            "answer": ANSWERS.get(one.answer, one.answer),
            "kind": one.answer,
            "statement": stated(one),
            "action": one.action,
        }
        for one in found.findings
        if one.answer in MAIN
    ]
    said = {"heading": heading(found), "findings": rows, "verdict": list(found.verdict), "error": _error(found)}
    return said | {"check": [one.statement for one in found.sanity]}


def _error(found: Any) -> str:
    """Return the validation error before and after."""
    from cosim.report.quantities import Scales

    unit, held = Scales.of(found).torque, found.heldout
    return f"{unit.number(held.before_rms)} → {unit.text(held.after_rms)}"


def job_order(job: Job, folder: Path, card: Path, out: Path) -> Order:
    """Return what is to be done for a job whose recordings lie in a folder."""
    used = tuple(one for one in job.uploads if one.role != "out")
    return Order(used, folder, card, job.card, out)


def _named(text: str, order: Order) -> str:
    return text.replace(str(order.card), order.called).replace(f"{order.recordings}/", "")
