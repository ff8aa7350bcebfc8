"""Jobs as folders: what was dropped, how far it is, what was found.

    JOB/job.json      the job
    JOB/card.toml     the card as it was given
    JOB/recordings/   the recordings as they were dropped
    JOB/views/        what the files were seen to hold
    JOB/result/       what the diagnosis wrote

Every file is complete or absent, so a process that is killed leaves jobs that can be read.
"""

import json
import re
import secrets
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from threading import RLock
from typing import Any

from cosim.serve.job import Job, Upload, job_of
from cosim.support.files import directory, replacing
from cosim.support.plain import Parsed

ID = re.compile(r"\d{8}-\d{6}-[0-9a-f]{6}")
CARD, RECORDINGS, VIEWS, RESULT = "card.toml", "recordings", "views", "result"


class UnknownJobError(LookupError):
    """There is no such job, or it holds no such file."""


class Store:
    """The jobs in a folder; may be used by several threads."""

    def __init__(self, home: Path) -> None:
        self.home = directory(home)
        home.chmod(0o700)  # recordings are nobody else's business
        self._lock = RLock()

    def new(self) -> Job:
        """Make a job without anything in it."""
        now = datetime.now(UTC)
        job = Job(id=f"{now:%Y%m%d-%H%M%S}-{secrets.token_hex(3)}", made=now.isoformat(timespec="seconds"))
        for name in (RECORDINGS, VIEWS):
            directory(self.folder(job.id) / name)
        return self._save(job)

    def get(self, name: str) -> Job:
        """Return a job (UnknownJobError)."""
        with self._lock, suppress(OSError, ValueError, TypeError, KeyError):
            return job_of(json.loads((self.folder(name) / "job.json").read_text("utf-8")))
        raise UnknownJobError(name)

    def all(self) -> list[Job]:
        """Return all jobs that can be read, the newest first."""
        found = []
        for name in sorted((one.name for one in self.home.iterdir() if ID.fullmatch(one.name)), reverse=True):
            with suppress(UnknownJobError):
                found.append(self.get(name))
        return found

    def change(self, name: str, change: Callable[[Job], Job]) -> Job:
        """Change a job and keep it (UnknownJobError)."""
        with self._lock:
            return self._save(change(self.get(name)))

    def put(self, name: str, **values: Any) -> Job:
        """Give a job new values (UnknownJobError)."""
        return self.change(name, lambda job: replace(job, **values))

    def put_upload(self, name: str, file: str, **values: Any) -> Job:
        """Give one recording of a job new values (UnknownJobError)."""

        def changed(one: Upload) -> Upload:
            return replace(one, **values) if one.name == file else one

        return self.change(name, lambda job: replace(job, uploads=tuple(map(changed, job.uploads))))

    def folder(self, name: str) -> Path:
        """Return the folder of a job (UnknownJobError: no job can have this name)."""
        if not ID.fullmatch(name):
            raise UnknownJobError(name)
        return self.home / name

    def recording(self, job: Job, file: str) -> Path:
        """Return the path of a recording."""
        return self.folder(job.id) / RECORDINGS / file

    def card(self, job: Job) -> Path:
        """Return the path of the card."""
        return self.folder(job.id) / CARD

    def result(self, name: str) -> Path:
        """Return the folder of what was found."""
        return self.folder(name) / RESULT

    def copy(self, job: Job) -> Job:
        """Make a new draft with the same recordings and card; files are shared where the system can."""
        with self._lock:
            made = self.new()
            source, target = self.folder(job.id), self.folder(made.id)
            for path in [source / CARD, *(source / RECORDINGS).iterdir(), *(source / VIEWS).iterdir()]:
                if path.is_file():
                    _link(path, target / path.relative_to(source))
            return self._save(replace(made, uploads=job.uploads, card=job.card, machine=job.machine))

    def remove(self, name: str) -> None:
        """Remove a job with all its files."""
        with self._lock:
            shutil.rmtree(self.folder(name), ignore_errors=True)

    def view(self, name: str, key: str) -> Parsed:
        """Return what a file, or the card, was seen to hold; nothing if it was not looked at."""
        with suppress(OSError, ValueError):
            seen: Parsed = json.loads((self.folder(name) / VIEWS / f"{key}.json").read_text("utf-8"))
            return seen
        return {}

    def put_view(self, name: str, key: str, view: Parsed) -> None:
        """Keep what a file was seen to hold."""
        _write(self.folder(name) / VIEWS / f"{key}.json", view)

    def _save(self, job: Job) -> Job:
        _write(self.folder(job.id) / "job.json", job.as_json())
        return job


def _write(path: Path, data: Parsed) -> None:
    with replacing(path, True) as partial:
        partial.write_text(json.dumps(data), "utf-8")


def _link(source: Path, target: Path) -> None:
    try:
        target.hardlink_to(source)
    except OSError:
        shutil.copyfile(source, target)
