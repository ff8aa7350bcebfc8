"""The folder of an investigation: a line for each step as soon as it is done, and every recording.

investigation.json   what it depends on, as hashes
runs.jsonl           one step a line: a recording, or an answer
recordings/          one file a recording; none is ever removed or written over
"""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from cosim.data.recording import Recording
from cosim.support.errors import OutputError
from cosim.support.files import sha256
from cosim.support.journal import RUNS, Journal, clear
from cosim_investigation.story import Answered, Moved, answered_of, moved_of

KIND, RECORDINGS, DIAGNOSIS = "investigation", "recordings", "diagnosis"
STORY, PAGE = "story.json", "story.html"
MADE = ("investigation.json", RUNS, STORY, PAGE, DIAGNOSIS, RECORDINGS)


class Log:
    """Steps that were done, by number; a step that is there is not done again.

    Raises:
        OutputError: the folder holds another investigation, or one that is being written.
    """

    def __init__(self, folder: Path, identity: Mapping[str, str], force: bool = False) -> None:
        self.folder = folder
        self._journal = Journal(folder, identity, force, kind=KIND, made=MADE)

    def moved(self, number: int) -> Moved | None:
        """The recording that is step `number`; its file is checked to be the one that was recorded."""
        row = self._journal.rows.get(number)
        if row is None or row["what"] != "moved":
            return None
        path = self.folder / str(row["file"])
        if not path.is_file() or sha256(path) != row["sha256"]:
            rule = "put it back as it was, or give --force to start over"
            raise OutputError(f"{path} is not the recording that was made; {rule}.", culprit=str(path))
        return moved_of(row)

    def answered(self, number: int) -> Answered | None:
        """The answer that is step `number`."""
        row = self._journal.rows.get(number)
        return None if row is None or row["what"] != "answered" else answered_of(row)

    def append(self, step: Moved | Answered) -> None:
        """Write a step; it is there even if this process is killed at once."""
        file = {"sha256": sha256(self.folder / step.file)} if isinstance(step, Moved) else {}
        self._journal.append({"run": step.number, "what": type(step).__name__.lower(), **asdict(step), **file})

    def path(self, number: int, family: str) -> Path:
        """A free name for a recording: one that was cut short by a kill stays beside it."""
        stem = f"{number:02d}_{family.replace(' ', '_')}"
        names = (f"{stem}{more}.parquet" for more in ("", *(f"_{k}" for k in range(2, 1000))))
        return next(path for name in names if not (path := self.folder / RECORDINGS / name).exists())

    def read(self, step: Moved) -> Recording:
        """Read the recording of a step."""
        return Recording.read(self.folder / step.file)

    def close(self) -> None:
        """Let others write."""
        self._journal.close()

    def __enter__(self) -> "Log":
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        """Let others write; where nothing was done before an error the folder is free for another investigation."""
        self.close()
        if error and not self._journal.rows:
            clear(self.folder, MADE[:2])
