"""Jobs as folders: what was dropped, how far it is, what was found.

    JOB/job.json      the job
    JOB/card.toml     the card as it was given
    JOB/recordings/   the recordings as they were dropped
    JOB/arriving/     recordings on their way, each in a folder of its own
    JOB/views/        what the files were seen to hold
    JOB/result/       what the diagnosis wrote

Every file is complete or absent, and a folder comes with its job, so a process that is killed leaves jobs that can be
read. A job that cannot be read, because it is damaged or another version wrote it, costs itself alone.
"""

import json
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from threading import RLock
from typing import Any

from pydantic import ValidationError

from cosim.support.errors import InputError, OutputError
from cosim.support.files import directory, replacing
from cosim.support.plain import Parsed
from cosim.support.system_errors import surroundings
from cosim_serve.folder import CLOSED, check_plain, read_plain
from cosim_serve.job import Job, job_of
from cosim_serve.views import CARD_NOT_SEEN, CARD_VIEW, NOT_SEEN, no_view, view_of

ID = re.compile(r"\d{8}-\d{6}-[0-9a-f]{6}")
JOB, CARD, RECORDINGS, ARRIVING, VIEWS, RESULT = "job.json", "card.toml", "recordings", "arriving", "views", "result"
LARGEST = 4_000_000
"""Bytes of a job.json or of a view: 24 recordings with all options of 200 characters have some 500 kB."""
SHOWN = 80
"""Characters of a key that a message repeats."""


class UnknownJobError(LookupError):
    """There is no such job, or it holds no such file."""


class UnreadableJobError(InputError):
    """The folder of a job holds none that this version can read; `id` is its name."""

    def __init__(self, folder: Path, reason: str) -> None:
        text = f"This diagnosis cannot be read: {reason}. It is damaged, or another version of cosim wrote it. "
        text += f"Open it with that version, or remove it; its files are in {folder}."
        super().__init__(text, culprit=str(folder))
        self.id = folder.name


class Store:
    """The jobs in a folder; may be used by several threads.

    Args:
        home: the folder; one that is there keeps its mode, one that is made is closed to others.
    """

    def __init__(self, home: Path) -> None:
        is_new = not home.exists()
        self.home = directory(home)
        if is_new:
            home.chmod(CLOSED)
        self.lock = RLock()
        self._unwritten: dict[str, Job] = {}
        """Jobs as they are, for which the disk had no room."""

    def tidy(self) -> None:
        """Remove what a server that was killed left half made; only while no other works here."""
        for path in self.home.glob(".*.new"):
            if ID.fullmatch(path.name[1:].removesuffix(".new")):
                _remove(path)
        for path in self._folders():
            with suppress(ValueError):
                check_plain((path,), ())
                _remove(path / ARRIVING)

    def new(self) -> Job:
        """Make a job without anything in it."""
        return self._made(lambda folder: None)

    def get(self, name: str) -> Job:
        """Return a job (UnknownJobError, UnreadableJobError)."""
        folder = self.folder(name)
        with self.lock:
            return self._unwritten.get(name) or _job_in(folder)

    def each(self) -> Iterator[Job | UnreadableJobError]:
        """Yield all jobs, the newest first, and why one cannot be read."""
        for folder in self._folders():
            try:
                yield self.get(folder.name)
            except UnreadableJobError as error:
                yield error
            except UnknownJobError:  # it is just being removed
                continue

    def all(self) -> list[Job]:
        """Return all jobs that can be read, the newest first."""
        return [one for one in self.each() if isinstance(one, Job)]

    def change(self, name: str, change: Callable[[Job], Job]) -> Job:
        """Change a job and keep it (as `keep`; UnknownJobError, UnreadableJobError)."""
        with self.lock:
            return self.keep(change(self.get(name)))

    def keep(self, job: Job, views: Mapping[str, Parsed] | None = None, card: str | None = None) -> Job:
        """Keep a job, views by their keys and the text of a card; on a disk without room (OSError) nothing of it."""
        folder = self.folder(job.id)
        texts = {folder / VIEWS / f"{key}.json": json.dumps(view) for key, view in (views or {}).items()}
        texts |= {} if card is None else {folder / CARD: card}
        texts |= {folder / JOB: json.dumps(job.as_json())}
        with self.lock, ExitStack() as stack:
            for path, text in texts.items():
                stack.enter_context(replacing(path, True)).write_text(text, "utf-8")
        self._unwritten.pop(job.id, None)
        return job

    def put(self, name: str, **values: Any) -> Job:
        """Give a job new values (as `change`)."""
        return self.change(name, lambda job: replace(job, **values))

    def settle(self, name: str, **values: Any) -> Job:
        """Give a job the values that it has in fact; on a disk without room they are kept in memory until there is.

        Raises:
            UnknownJobError, UnreadableJobError: as `get`.
        """
        with self.lock:
            try:
                return self.put(name, **values)
            except OSError:
                self._unwritten[name] = replace(self.get(name), **values)
                return self._unwritten[name]

    def folder(self, name: str) -> Path:
        """Return the folder of a job (UnknownJobError: there is none of this name)."""
        if not ID.fullmatch(name) or not os.path.lexists(self.home / name):
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
        source = self.folder(job.id)

        def fill(folder: Path) -> None:
            used = [source / CARD, *(source / RECORDINGS / one for one in {one.file for one in job.uploads})]
            for path in [*used, *(source / VIEWS).iterdir()]:
                if path.is_file() and not path.is_symlink():
                    _link(path, folder / path.relative_to(source))

        return self._made(fill, uploads=job.uploads, card=job.card, machine=job.machine)

    def remove(self, name: str) -> None:
        """Remove a job with all its files (OutputError: the system keeps some)."""
        with self.lock:
            folder = self.folder(name)
            self._unwritten.pop(name, None)
            _remove(folder)
            if os.path.lexists(folder):
                raise OutputError(f"Not all files of this diagnosis could be removed: {folder}.", culprit=str(folder))

    def clear_result(self, name: str) -> None:
        """Remove what a diagnosis wrote."""
        _remove(self.result(name))

    def view(self, name: str, key: str) -> Parsed:
        """Return what a file, or the card, was seen to hold; a problem if that is not known."""
        with suppress(OSError, ValueError):
            return view_of(read_plain(self.folder(name) / VIEWS / f"{key}.json", LARGEST), key)
        return no_view(key, CARD_NOT_SEEN if key == CARD_VIEW else NOT_SEEN)

    def _folders(self) -> list[Path]:
        return sorted((one for one in self.home.iterdir() if ID.fullmatch(one.name)), reverse=True)

    def _made(self, fill: Callable[[Path], None], **values: Any) -> Job:
        """Make a job; its folder gets its name when all is in it."""
        now = datetime.now(UTC)
        job = Job(id=f"{now:%Y%m%d-%H%M%S}-{secrets.token_hex(3)}", made=now.isoformat(timespec="seconds"), **values)
        folder = self.home / f".{job.id}.new"
        try:
            for path in (folder, folder / RECORDINGS, folder / VIEWS):
                path.mkdir(CLOSED)
            fill(folder)
            (folder / JOB).write_text(json.dumps(job.as_json()), "utf-8")
            folder.rename(self.home / job.id)
        finally:
            _remove(folder)
        return job


def _job_in(folder: Path) -> Job:
    try:
        check_plain((folder, *(folder / name for name in (RECORDINGS, ARRIVING, VIEWS, RESULT))), (folder / CARD,))
        job = job_of(read_plain(folder / JOB, LARGEST))
        _check(job, folder)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(map(str, first["loc"]))[:SHOWN]
        raise UnreadableJobError(folder, f"{JOB}: {place and f'{place}: '}{first['msg'].lower()}") from None
    except ValueError as error:
        raise UnreadableJobError(folder, str(error)) from None
    except OSError as error:
        if not os.path.lexists(folder):
            raise UnknownJobError(folder.name) from None
        raise UnreadableJobError(folder, surroundings(OSError(error.errno, f"{JOB}: {error.strerror}"))[:-1]) from None
    return job


def _check(job: Job, folder: Path) -> None:
    """Refuse a job that is another one's, or names what is not a file of its own (ValueError)."""
    if job.id != folder.name:
        raise ValueError(f'{JOB} is that of "{job.id[:SHOWN]}"')
    for one in job.uploads:
        if one.file != Path(one.file).name or one.file.startswith(".") or "\0" in one.name:
            raise ValueError(f'{JOB}: "{one.name[:SHOWN]}" is no name of a recording')
    if len({one.name for one in job.uploads}) < len(job.uploads):
        raise ValueError(f"{JOB} has two recordings of one name")
    check_plain((), (folder / RECORDINGS / one.file for one in job.uploads))


def _remove(path: Path) -> None:
    """Remove a folder with all in it, as far as the system lets; a file; of a link the link alone."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _link(source: Path, target: Path) -> None:
    try:
        target.hardlink_to(source)
    except OSError:
        shutil.copyfile(source, target)
