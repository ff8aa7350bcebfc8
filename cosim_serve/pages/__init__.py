"""The pages as text: templates, filled from jobs; everything that comes from a file is escaped."""

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from starlette.responses import HTMLResponse, Response

from cosim.plots.quantities import minus, raised
from cosim.reading import LAYOUT
from cosim.support.files import in_bytes
from cosim.support.plain import Parsed
from cosim.support.suffixes import recordings
from cosim_serve.chart import Chart, chart
from cosim_serve.desk import OURS, Desk
from cosim_serve.folder import plain_files
from cosim_serve.form import FIELDS, FRICTIONS, KINDS, MOTIONS
from cosim_serve.job import Job
from cosim_serve.store import UnreadableJobError

STATES = {
    "draft": "not started",
    "queued": "waiting",
    "running": "being diagnosed",
    "done": "done",
    "failed": "failed",
    "cancelled": "cancelled",
    "interrupted": "interrupted",
}
ROLES = {"train": "fit the model", "heldout": "use for validation (never fitted)", "out": "leave out"}
MEANINGS = {"t": "time", "tau": "torque", "q": "position", "v": "speed", "q_d": "set point"}
HINTS = {
    "separator": "comma, semicolon, tab, space",
    "decimal": "point, comma",
    "header": "line of the names, 0 for none",
    "encoding": "utf-8, latin-1",
    "period": "1ms",
    "nan": "gap: leave rows without a value out",
    "repeated": "first, last: which of the rows of one time is kept",
    "limit": "3: three times as much",
}
"""Examples of what a layout may say."""
SUFFIXES = ",".join(dict.fromkeys("." + one.rpartition(".")[2] for one in (*recordings(), ".toml")))
"""Kinds of files that a file dialogue offers first."""
CARD = """[mount]
name = "azimuth"
motion = "rotary"      # or "linear": then m, N, kg
inertia = 30.0         # kg m2
torque_limit = 50.0    # N m

[friction]
model = "coulomb"      # or "static", "dahl", "lugre", "maxwell_slip", "none"
Fc = 2.5               # N m
sigma2 = 30.0          # N m s/rad
"""
"""What a card that is to be written begins with."""
NAMED = 4
"""Recordings that the history names; of more it says how many."""
FILES = (
    ("report.html", "Report", "one page, alone"),
    ("card.toml", "Model card", ""),
    ("diagnosis.json", "JSON", "the same for programs"),
    ("missing_torque.parquet", "Missing torque", "one row a sample, with its band"),
    ("next_experiment.toml", "Next experiment", "a scenario"),
)
"""What a diagnosis writes, beside FMUs."""
CARDS = {True: "with the effects", False: "refitted, nothing added"}
"""What the card is that is written, by whether the model is improved."""


def home_page(desk: Desk, problem: str = "", status: int = 200) -> Response:
    """Show where to drop recordings, and what was diagnosed."""
    jobs = history(desk)
    values = {"title": "Diagnose an axis", "problem": problem, "jobs": jobs, "suffixes": SUFFIXES}
    return page("home.html.j2", status, comparable=sum(one["done"] for one in jobs) > 1, **values)


def job_page(
    desk: Desk, job: Job, problem: str = "", given: Mapping[str, str] | None = None, status: int = 200
) -> Response:
    """Show a job as far as it is; `problem` is why something was refused, `given` the form that was."""
    values = _draft(desk, job) | {"given": defaultdict(str, given or {})} if job.state == "draft" else _begun(desk, job)
    template = "draft.html.j2" if job.state == "draft" else "begun.html.j2"
    return page(template, status, title=job.called, job=job, problem=problem, **values)


def unreadable_page(error: UnreadableJobError, status: int) -> Response:
    """Say why a job cannot be read, and offer to remove it."""
    return page("unreadable.html.j2", status, title="Unreadable diagnosis", id=error.id, problem=str(error))


def moment(at: datetime) -> Parsed:
    """Return a time for `<time>`: in ISO form, and as this computer's clock shows it; the script asks the reader's."""
    return {"iso": at.isoformat(timespec="seconds"), "text": f"{at.astimezone():%Y-%m-%d %H:%M}"}


def history(desk: Desk) -> list[Parsed]:
    """Return what was diagnosed, one row a job, the newest first; of one that cannot be read why."""
    return [_unreadable(one) if isinstance(one, UnreadableJobError) else _row(one) for one in desk.store.each()]


def _row(job: Job) -> Parsed:
    return {
        "id": job.id,
        "when": moment(datetime.fromisoformat(job.made)),
        "name": job.called,
        "files": _files(job),
        "state": STATES[job.state],
        "done": job.state == "done",
        "outcome": _outcome(job) if job.state == "done" else job.problem,
    }


def _files(job: Job) -> str:
    """Name the recordings that are used, the first few of them."""
    names = [one.name for one in job.uploads if one.role != "out"]
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more if names else "no recording yet"


def _outcome(job: Job) -> str:
    """Return the verdict, the effects that it names, and the validation error before and after."""
    error = f"Validation RMS error {job.answer.error}." if job.answer.error else ""
    effects = ", ".join(one.what for one in job.answer.findings if one.kind == "found")
    return " ".join(filter(None, [f"{job.answer.heading}{f': {effects}' if effects else ''}.", error]))


def _unreadable(error: UnreadableJobError) -> Parsed:
    day, clock = error.id.split("-")[:2]
    when = moment(datetime.strptime(f"{day}{clock} +0000", "%Y%m%d%H%M%S %z"))
    row = {"id": error.id, "when": when, "name": "Unreadable diagnosis", "files": "its files are as they were"}
    return row | {"state": "not readable", "done": False, "outcome": str(error)}


def _draft(desk: Desk, job: Job) -> Parsed:
    views = desk.views(job)
    return {
        "recordings": [(one, views[one.name], number) for number, one in enumerate(job.uploads, 1)],
        "charts": charts,
        "card_view": desk.card_view(job),
        "start_card": CARD,
        "card_text": desk.card_text(job),
        "lacking": desk.lacking(job) if job.uploads or job.card else [],
        "with_proof": _proof(job),
        "shipped": _shipped(),
        "roles": ROLES,
        "fields": FIELDS,
        "motions": MOTIONS,
        "frictions": FRICTIONS,
        "kinds": KINDS,
        "ours": {name: MEANINGS.get(name, name) for name in OURS},
        "layout": {name: HINTS[name] for name in LAYOUT},
        "suffixes": SUFFIXES,
        "size": in_bytes,
    }


def charts(column: Mapping[str, Any]) -> Chart:
    """Return the axes of a column that is drawn; its line is there already."""
    ends = column["begins"], column["ends"]
    times = (0.0, 0.0) if None in ends else ends
    return chart({}, times, (float(column["least"]), float(column["greatest"])))


def _proof(job: Job) -> str:
    """Say what proves the result where no recording was chosen for it."""
    used = [one.name for one in job.uploads if one.role != "out"]
    if not used or any(one.role == "heldout" for one in job.uploads):
        return ""
    if used[1:]:
        return f"{used[-1]}, the last one, is for validation and not fitted; choose another one above."
    return "The end of the only recording is for validation and not fitted; a second recording would validate better."


def _begun(desk: Desk, job: Job) -> Parsed:
    progress = desk.queue.progress
    own, results = progress.id == job.id, list(_results(desk, job))
    return {
        "live": job.live,
        "waiting": desk.queue.before(job.id) if job.state == "queued" else 0,
        "steps": progress.steps if own else [],
        "answer": (own and progress.answer) or job.answer,
        "elapsed": round(max(time.time() - job.begun, 0.0) if job.state == "running" else job.seconds),
        "files": results,
        "has_report": any(one["name"] == FILES[0][0] for one in results),
        "state": STATES[job.state],
        "made": moment(datetime.fromisoformat(job.made)),
        "begun": moment(datetime.fromtimestamp(job.begun, UTC)) if job.begun else None,
    }


def _results(desk: Desk, job: Job) -> Iterator[dict[str, str]]:
    """Yield the files of a result that can be downloaded, the improved FMUs among them."""
    there = list(plain_files(desk.store.result(job.id)).values()) if job.state == "done" else []
    better = any(path.suffix == ".fmu" for path in there)
    told = {name: (title, text or CARDS[better]) for name, title, text in FILES}
    for path in sorted(there, key=lambda one: ([*told, one.name].index(one.name), one.name)):
        kind = "FMI 2" if "fmi2" in path.stem else "FMI 3"
        title, text = told.get(
            path.name, (f"FMU, {kind}", "the better model as an FMU") if path.suffix == ".fmu" else ("", "")
        )
        if title:
            yield {"name": path.name, "title": title, "text": text, "size": in_bytes(path.stat().st_size)}


@cache
def _shipped() -> list[str]:
    from importlib.resources import files

    return sorted(Path(one.name).stem for one in (files("pyfmi_models") / "cards").iterdir())


@cache
def _templates() -> Environment:
    loader = PackageLoader("cosim_serve", "pages")
    made = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.filters |= {"minus": minus, "raised": raised}
    return made


def page(template: str, status: int = 200, **values: Any) -> Response:
    """Return a page that a template draws."""
    return HTMLResponse(_templates().get_template(template).render(values), status)
