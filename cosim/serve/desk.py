"""What can be done with jobs: files dropped, seen and corrected, a card given, diagnosed, cancelled, removed."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

from cosim.reading import LAYOUT
from cosim.serve.job import ROLES, Job, Options, Role, Upload, role_of
from cosim.serve.looks import shipped_card
from cosim.serve.queue import Queue
from cosim.serve.reader import Reader
from cosim.serve.store import Store
from cosim.serve.uploads import Limits, safe_name
from cosim.serve.work import diagnose_order
from cosim.support.errors import InputError
from cosim.support.files import replacing
from cosim.support.plain import Parsed

OURS = ("t", "tau", "q", "v", "q_d", "temperature")
"""Columns that can be corrected."""
CARD_VIEW = "card"
"""Key of the view of a card."""
NOTHING_SEEN: Parsed = {
    **{"problem": "", "refused": "", "said": ""},
    **{"undecided": [], "columns": [], "names": [], "notes": []},
    **{"facts": {}, "sources": {}, "options": {}},
}
"""What is told of a file or a card as long as it was not looked at."""
LONGEST = 200
"""Characters of an answer in a form."""


class Desk:
    """Jobs, the process that looks at files, and the one that diagnoses.

    Args:
        home: folder of the jobs.
        limits: how much may be dropped.
        work: what diagnoses, a function of a module that takes an `Order` and returns the answer in words.
        reader: what looks at files.
    """

    def __init__(
        self,
        home: Path,
        limits: Limits | None = None,
        work: Callable[..., Parsed] = diagnose_order,
        reader: Reader | None = None,
    ) -> None:
        self.limits, self.reader = limits or Limits(), reader or Reader()
        self.store = Store(home)
        self.queue = Queue(self.store, work)

    def close(self) -> None:
        """End both processes."""
        self.queue.close()
        self.reader.close()

    def draft(self, name: str) -> Job:
        """Return a job that can be changed (InputError, UnknownJobError)."""
        job = self.store.get(name)
        if job.state != "draft":
            raise InputError(f"This diagnosis is {job.state}; it cannot be changed now.", culprit=name)
        return job

    def place(self, name: str, given: str) -> tuple[Path, int]:
        """Return where a recording of this name goes, and how many bytes it may have (InputError)."""
        job, file = self.draft(name), safe_name(given, self.limits.name)
        if any(one.file == file for one in job.uploads):
            raise InputError(f"There is a recording {file} already; remove it first, or rename this one.", culprit=file)
        if len(job.uploads) >= self.limits.files:
            raise InputError(f"A diagnosis takes at most {self.limits.files} recordings.", culprit=file)
        left = self.limits.job - sum(one.size for one in job.uploads)
        return self.store.recording(job, file), min(self.limits.file, left)

    def received(self, name: str, path: Path, size: int) -> None:
        """Add a recording that has been written, and look at it."""
        one = Upload(name=path.name, size=size, role=role_of(path.name))
        self.store.change(name, lambda job: replace(job, uploads=(*job.uploads, one)))
        self.look(name, one.name)

    def look(self, name: str, file: str) -> None:
        """Look at a recording as it is to be read now."""
        job = self.store.get(name)
        one = job.upload(file)
        columns = self.store.view(name, CARD_VIEW).get("columns", {}) | one.options.get("columns", {})
        seen = self.reader.look(str(self.store.recording(job, file)), one.options | {"columns": columns})
        self.store.put_view(name, view_key(file), seen)
        if parts := seen.get("parts", {}):
            self._spread(name, one, parts)

    def _spread(self, name: str, whole: Upload, parts: Mapping[str, float]) -> None:
        """Put the recordings of a file of many in its place, left out until somebody says what each is for."""
        job = self.store.get(name)
        room = self.limits.files - len(job.uploads) + 1
        if len(parts) > room:
            text = f"{whole.name} holds {len(parts):,} recordings; here is room for {room}."
            text += " cosim diagnose takes any of them."
            self.store.put_view(name, view_key(whole.name), {"problem": text})
            return
        made = tuple(
            replace(whole, name=f"{whole.name}:{which}", size=round(share * whole.size), role="out")
            for which, share in parts.items()
        )
        others = [one for one in job.uploads if one.name != whole.name]
        self.store.put(name, uploads=(*others, *made))
        for one in made:
            self.look(name, one.name)

    def correct(self, name: str, file: str, form: Mapping[str, str]) -> None:
        """Take what a form says of a recording: role; columns, units, layout of its file (InputError, KeyError)."""
        self.draft(name).upload(file)
        options: Options = {"columns": {}, "units": {}, "layout": {}}
        for key, names in (("columns", OURS), ("units", OURS), ("layout", LAYOUT)):
            for ours in names:
                value = form.get(f"{key}.{ours}", "").strip()[:LONGEST]
                if value:
                    options[key][ours] = value
        self.store.put_upload(name, file, role=_role(form.get("role", "train")))
        self._read_so(name, file, options)

    def _read_so(self, name: str, file: str, options: Options) -> None:
        """Read a recording, and all others of its file, with these options."""
        job = self.store.get(name)
        for one in job.uploads:
            if one.file == job.upload(file).file:
                self.store.put_upload(name, one.name, options=options)
                self.look(name, one.name)

    def set_role(self, name: str, file: str, role: str) -> None:
        """Say what a recording is for (InputError, KeyError)."""
        self.draft(name).upload(file)
        self.store.put_upload(name, file, role=_role(role))

    def accept(self, name: str, file: str) -> None:
        """Take the example with which an open question of a recording was answered to look at it."""
        self.draft(name).upload(file)
        options = self.store.view(name, view_key(file)).get("options", {})
        self._read_so(name, file, options)

    def drop(self, name: str, file: str) -> None:
        """Remove a recording from a draft."""
        job = self.draft(name)
        own = job.upload(file).file
        kept = self.store.change(
            name, lambda one: replace(one, uploads=tuple(u for u in one.uploads if u.name != file))
        )
        if not any(one.file == own for one in kept.uploads):
            self.store.recording(job, own).unlink(missing_ok=True)

    def give_card(self, name: str, text: str, called: str) -> None:
        """Take a card; one that is not good is kept too, with its problem."""
        job = self.draft(name)
        if len(text.encode("utf-8", "replace")) > self.limits.card:
            raise InputError(f"{called} is too large for a card: at most {self.limits.card:,} bytes.", culprit=called)
        with replacing(self.store.card(job), True) as partial:
            partial.write_text(text.replace("\r\n", "\n"), "utf-8")
        seen = self.reader.card(text, called)
        before = self.store.view(name, CARD_VIEW).get("columns", {})
        self.store.put_view(name, CARD_VIEW, seen)
        self.store.put(name, card=called, machine=seen.get("facts", {}).get("machine", ""))
        if seen.get("columns", {}) != before:
            for one in job.uploads:
                self.look(name, one.name)

    def give_shipped(self, name: str, card: str) -> None:
        """Take a card that comes with the package (InputError)."""
        self.give_card(name, shipped_card(card), f"{card}.toml")

    def lacking(self, job: Job) -> list[str]:
        """Say what is missing before a job can be diagnosed."""
        told = []
        for role, what in (("train", "to fit"), ("heldout", "to keep for the proof")):
            if not any(one.role == role for one in job.uploads):
                told.append(f"Choose at least one recording {what}.")
        for one in job.uploads:
            seen = self.store.view(job.id, view_key(one.name))
            if one.role != "out" and (seen.get("problem") or seen.get("refused")):
                told.append(f"{one.name} cannot be used as it is read now; correct it, or leave it out.")
            elif one.role != "out" and seen.get("undecided"):
                told.append(f"{one.name} can be read in more than one way; answer its question.")
        if not job.card:
            told.append("Give a model card.")
        elif self.store.view(job.id, CARD_VIEW).get("problem"):
            told.append("Correct the model card.")
        return told

    def start(self, name: str) -> list[str]:
        """Diagnose, or say what is missing."""
        job = self.draft(name)
        missing = self.lacking(job)
        if not missing:
            self.queue.submit(name)
        return missing

    def again(self, name: str) -> Job:
        """Return a draft like this job: itself if nothing was found, else a copy."""
        job = self.store.get(name)
        if job.live or job.state == "draft":
            return job
        return self.store.copy(job) if job.state == "done" else self.store.put(name, state="draft", problem="")

    def remove(self, name: str) -> None:
        """Remove a job, its files and its process (UnknownJobError)."""
        self.store.get(name)
        self.queue.cancel(name)
        self.store.remove(name)

    def card_text(self, job: Job) -> str:
        """Return the text of the card."""
        with suppress(OSError, UnicodeDecodeError):
            return self.store.card(job).read_text("utf-8")
        return ""

    def views(self, job: Job) -> dict[str, Parsed]:
        """Return what the recordings were seen to hold, by name."""
        return {one.name: NOTHING_SEEN | self.store.view(job.id, view_key(one.name)) for one in job.uploads}

    def card_view(self, job: Job) -> Parsed:
        """Return what the card says."""
        return NOTHING_SEEN | (self.store.view(job.id, CARD_VIEW) if job.card else {})


def view_key(file: str) -> str:
    """Return the name under which the view of a file is kept."""
    return sha256(file.encode()).hexdigest()[:16]


def _role(text: str) -> Role:
    found = next((one for one in ROLES if one == text), None)
    if found is None:
        raise InputError(f'"{text}" is nothing that a recording is for: {", ".join(ROLES)}.', culprit=text)
    return found
