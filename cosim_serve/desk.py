"""What can be done with jobs: files dropped, seen and corrected, a card given, diagnosed, cancelled, removed.

Looking at a file takes seconds, so nothing is locked meanwhile. What was seen is kept afterwards under the lock of the
jobs, and only if the job can still be changed: what goes on at once does not mix, and no job changes that was started.
"""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from cosim.reading import LAYOUT
from cosim.support.errors import InputError
from cosim.support.plain import Parsed
from cosim_serve import example
from cosim_serve.arrivals import Arrival, Arrivals
from cosim_serve.folder import read_plain
from cosim_serve.job import ROLES, Job, Options, Role, Upload, role_of
from cosim_serve.looks import shipped_card
from cosim_serve.queue import Queue
from cosim_serve.reader import Reader
from cosim_serve.store import RECORDINGS, Store
from cosim_serve.uploads import Limits
from cosim_serve.views import CARD_VIEW, no_view, view_key
from cosim_serve.work import diagnose_order

OURS = ("t", "tau", "q", "v", "q_d", "temperature")
"""Columns that can be corrected."""
LONGEST = 200
"""Characters of an answer in a form, or of it in a message."""
Seen = tuple[Upload, Parsed]
"""A recording, and what it was seen to hold."""


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
        self.store.tidy()
        self._arrivals = Arrivals(self.limits)
        self.queue = Queue(self.store, work)

    def close(self) -> None:
        """End both processes."""
        self.queue.close()
        self.reader.close()

    def draft(self, name: str) -> Job:
        """Return a job that can be changed (InputError, UnknownJobError)."""
        return _open(self.store.get(name))

    # Recordings

    @contextmanager
    def arriving(self, name: str, given: str, stated: int) -> Iterator[Arrival]:
        """Reserve a place for a recording of `stated` bytes (0: not stated) while the block lasts (InputError)."""
        with self.store.lock:
            arrival = self._arrivals.begin(self.draft(name), self.store.folder(name), given, stated)
        try:
            yield arrival
        finally:
            with self.store.lock:
                self._arrivals.end(arrival)
            shutil.rmtree(arrival.path.parent, ignore_errors=True)

    def grow(self, arrival: Arrival, size: int) -> None:
        """Reserve more bytes for a recording on its way (InputError: there may be no more)."""
        with self.store.lock:
            self._arrivals.grow(self.draft(arrival.job), arrival, size)

    def received(self, arrival: Arrival, size: int) -> None:
        """Look at a recording that has come, and add it (InputError: its job was started meanwhile)."""
        one = Upload(name=arrival.file, size=size, role=role_of(arrival.file))
        seen = self._seen(arrival.path.parent, one, self._renamed(arrival.job))
        with self.store.lock:
            job = self.draft(arrival.job)
            self._arrivals.end(arrival)
            place = arrival.path.replace(self.store.recording(job, arrival.file))
            try:
                self._keep(replace(job, uploads=(*job.uploads, one)), {one.name: seen})
            except BaseException:
                place.unlink(missing_ok=True)
                raise

    def correct(self, name: str, file: str, form: Mapping[str, str]) -> None:
        """Take what a form says of a recording: role; columns, units, layout of its file (InputError, KeyError)."""
        options: Options = {"columns": {}, "units": {}, "layout": {}}
        for key, names in (("columns", OURS), ("units", OURS), ("layout", LAYOUT)):
            for ours in names:
                value = form.get(f"{key}.{ours}", "").strip()[:LONGEST]
                if value:
                    options[key][ours] = value
        self.set_role(name, file, form.get("role", "train"))
        self._read_so(name, file, options)

    def accept(self, name: str, file: str) -> None:
        """Take the example with which an open question of a recording was answered to look at it (KeyError)."""
        self.draft(name).upload(file)
        self._read_so(name, file, self.store.view(name, view_key(file))["options"])

    def set_role(self, name: str, file: str, role: str) -> None:
        """Say what a recording is for (InputError, KeyError)."""
        chosen = _role(role)

        def changed(job: Job) -> Job:
            _open(job).upload(file)
            return replace(job, uploads=tuple(replace(u, role=chosen) if u.name == file else u for u in job.uploads))

        self.store.change(name, changed)

    def drop(self, name: str, file: str) -> None:
        """Remove a recording from a draft (InputError, KeyError)."""
        with self.store.lock:
            job = self.draft(name)
            own = job.upload(file).file
            kept = self.store.keep(replace(job, uploads=tuple(one for one in job.uploads if one.name != file)))
            if not any(one.file == own for one in kept.uploads):
                self.store.recording(job, own).unlink(missing_ok=True)

    def _read_so(self, name: str, file: str, options: Options) -> None:
        """Read a recording, and all others of its file, with these options (InputError, KeyError)."""
        job, renamed = self.draft(name), self._renamed(name)
        folder, own = self.store.folder(name) / RECORDINGS, job.upload(file).file
        found = {
            one.name: self._seen(folder, replace(one, options=options), renamed)
            for one in job.uploads
            if one.file == own
        }
        with self.store.lock:
            self.draft(name).upload(file)
            self._keep(self.draft(name), found)

    def _renamed(self, name: str) -> dict[str, str]:
        """Columns that the card of a job renames."""
        columns: dict[str, str] = self.card_view(self.store.get(name))["columns"]
        return columns

    def _seen(self, folder: Path, one: Upload, renamed: Mapping[str, str]) -> list[Seen]:
        """Look at a recording; of a file of many at each, left out until somebody says what it is for."""
        options: Options = one.options | {"columns": {**renamed, **one.options.get("columns", {})}}
        seen = self.reader.look(str(folder / one.name), options)
        parts: Mapping[str, float] = seen.get("parts", {})
        if not parts or len(parts) > self.limits.files:
            return [(one, seen)]
        made = [
            replace(one, name=f"{one.name}:{which}", size=round(share * one.size), role="out")
            for which, share in parts.items()
        ]
        return [(part, self.reader.look(str(folder / part.name), options)) for part in made]

    def _keep(
        self, job: Job, found: Mapping[str, Sequence[Seen]], card_view: Parsed | None = None, card: str | None = None
    ) -> None:
        """Keep a job with recordings as they were seen, each by the name that it had before, and its card."""
        uploads = list[Upload]()
        views = {} if card_view is None else {CARD_VIEW: card_view}
        room = self.limits.files - len(self._arrivals.of(job.id)) - len(job.uploads) + 1
        for one in job.uploads:
            fitting = _fitting(one, found.get(one.name, ()), room)
            uploads += [new for new, _ in fitting] or [one]
            views |= {view_key(new.name): seen for new, seen in fitting}
        self.store.keep(replace(job, uploads=tuple(uploads)), views, card)

    def views(self, job: Job) -> dict[str, Parsed]:
        """Return what the recordings were seen to hold, by name."""
        return {one.name: self.store.view(job.id, view_key(one.name)) for one in job.uploads}

    # The card

    def give_card(self, name: str, text: str, called: str) -> None:
        """Take a card; one that is not good is kept too, with its problem."""
        job = self.draft(name)
        if len(text.encode("utf-8", "replace")) > self.limits.card:
            raise InputError(f"{called} is too large for a card: at most {self.limits.card:,} bytes.", culprit=called)
        seen = self.reader.card(text, called)
        renamed: Mapping[str, str] = seen.get("columns", {})
        found = dict[str, list[Seen]]()
        if renamed != self._renamed(name):
            folder = self.store.folder(name) / RECORDINGS
            found = {one.name: self._seen(folder, one, renamed) for one in job.uploads}
        with self.store.lock:
            job = replace(self.draft(name), card=called, machine=seen.get("facts", {}).get("machine", ""))
            self._keep(job, found, seen, text.replace("\r\n", "\n"))

    def give_shipped(self, name: str, card: str) -> None:
        """Take a card that comes with the package (InputError)."""
        self.give_card(name, shipped_card(card), f"{card}.toml")

    def estimate_card(self, name: str) -> None:
        """Take a card that is estimated from the recordings that may be fitted (InputError: they do not tell it)."""
        job, renamed = self.draft(name), self._renamed(name)
        fitted = [one for one in job.uploads if one.role == "train"]
        if not fitted:
            raise InputError("A card is estimated from recordings to fit; there is none yet.", culprit=name)
        folder = self.store.folder(name) / RECORDINGS
        given = [
            (str(folder / one.name), one.options | {"columns": {**renamed, **one.options.get("columns", {})}})
            for one in fitted
        ]
        told = self.reader.estimate(given)
        if problem := told.get("problem"):
            raise InputError(f"No card can be estimated: {problem}", culprit=name)
        self.give_card(name, told["text"], "estimated.toml")

    def example(self) -> Job:
        """Make a job of the example's recordings and card."""
        job = self.store.new()
        for file, text in example.recordings().items():
            data = text.encode()
            with self.arriving(job.id, file, len(data)) as arrival:
                arrival.path.write_bytes(data)
                self.received(arrival, len(data))
        self.give_card(job.id, example.CARD, example.CARD_NAME)
        return self.store.get(job.id)

    def card_text(self, job: Job) -> str:
        """Return the text of the card."""
        with suppress(OSError, ValueError):
            return read_plain(self.store.card(job), self.limits.card).decode("utf-8")
        return ""

    def card_view(self, job: Job) -> Parsed:
        """Return what the card says."""
        return self.store.view(job.id, CARD_VIEW) if job.card else no_view(CARD_VIEW)

    # The diagnosis

    def lacking(self, job: Job) -> list[str]:
        """Say what is missing before a job can be diagnosed."""
        told = []
        if not any(one.role == "train" for one in job.uploads):
            told.append("Choose at least one recording to fit.")
        for one in job.uploads:
            seen = self.store.view(job.id, view_key(one.name))
            if one.role != "out" and (seen["problem"] or seen["refused"]):
                told.append(f"{one.name} cannot be used as it is read now; correct it, or leave it out.")
            elif one.role != "out" and seen["undecided"]:
                told.append(f"{one.name} can be read in more than one way; answer its question.")
        if not job.card:
            told.append("Give a model card, or let it be estimated from the recordings.")
        elif self.card_view(job)["problem"]:
            told.append("Correct the model card.")
        return told

    def start(self, name: str) -> None:
        """Diagnose; what is still on its way is not taken any more (InputError: something is missing)."""

        def checked(job: Job) -> Job:
            if missing := self.lacking(_open(job)):
                raise InputError(" ".join(missing), culprit=name)
            return job

        self.queue.submit(name, checked)
        self._give_up(name, "The diagnosis was started before this file had come: it is not part of it.")

    def again(self, name: str) -> Job:
        """Return a draft like this job: itself if nothing was found, else a copy."""

        def opened(job: Job) -> Job:
            is_open = job.live or job.state in ("draft", "done")
            return job if is_open else replace(job, state="draft", problem="")

        job = self.store.get(name)
        return self.store.copy(job) if job.state == "done" else self.store.change(name, opened)

    def remove(self, name: str) -> None:
        """Remove a job, its files and its process (UnknownJobError)."""
        self.store.folder(name)
        self.queue.cancel(name)
        self._give_up(name, "The diagnosis was removed before this file had come.")
        self.store.remove(name)

    def _give_up(self, name: str, reason: str) -> None:
        with self.store.lock:
            self._arrivals.refuse(name, reason)


def _open(job: Job) -> Job:
    """Return a job that can be changed (InputError: it cannot)."""
    if job.state != "draft":
        raise InputError(f"This diagnosis is {job.state}; it cannot be changed now.", culprit=job.id)
    return job


def _fitting(one: Upload, seen: Sequence[Seen], room: int) -> Sequence[Seen]:
    """What comes in the place of a recording: itself as it was read, or all of its file, if there is room."""
    number = max(len(seen), *(len(view.get("parts", {})) for _, view in seen), 0)
    if number > room:
        text = f"{one.name} holds {number:,} recordings; here is room for {room}. cosim diagnose takes any of them."
        return [(one, {"problem": text})]
    return [(replace(one, options=new.options) if new.name == one.name else new, view) for new, view in seen]


def _role(text: str) -> Role:
    found = next((one for one in ROLES if one == text), None)
    if found is None:
        given = f"{text[:LONGEST]}..." if len(text) > LONGEST else text
        raise InputError(f'"{given}" is nothing that a recording is for: {", ".join(ROLES)}.', culprit=given)
    return found
