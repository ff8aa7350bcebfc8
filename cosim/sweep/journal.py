"""The folder of a sweep: what it is, and a line for each run as soon as it is done, so that nothing done is lost.

sweep.json       what the runs depend on, as hashes, and the units of the columns
runs.jsonl       one row a line, appended; a line cut short by a kill is dropped
table.parquet    the rows in order, written when the sweep ends, well or not
recordings/      one file a run, where wanted
"""

import json
import shutil
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from cosim.errors import OutputError
from cosim.files import check_free, directory, replacing
from cosim.interrupts import uninterrupted
from cosim.sweep.job import Row

MADE = ("sweep.json", "runs.jsonl", "table.parquet", "sweep.svg", "recordings")


class Journal:
    """The rows done so far, by run; `append` adds one for good.

    Args:
        folder: of the sweep; made where it is not there.
        identity: what the runs depend on; a folder with another one is refused.
        force: start over, whatever is there.

    Raises:
        OutputError: the folder holds another sweep, or one that is being written.
    """

    def __init__(self, folder: Path, identity: Mapping[str, str], force: bool = False) -> None:
        self.folder, self.rows = folder, dict[int, Row]()
        if force:
            clear(folder)
        self._check(identity)
        self._file = directory(folder).joinpath("runs.jsonl").open("a+b")
        try:
            _lock(self._file, folder)
            self._read()
            with replacing(folder / "sweep.json", force=True) as partial:
                partial.write_text(json.dumps(dict(identity), indent=2) + "\n", "utf-8")
        except BaseException:
            self._file.close()
            raise

    def append(self, row: Row) -> None:
        """Write a row; it is there even if this process is killed at once."""
        with uninterrupted():
            self._file.write(json.dumps(row).encode() + b"\n")
            self._file.flush()
            self.rows[row["run"]] = row

    def close(self) -> None:
        """Let others write."""
        self._file.close()

    def __enter__(self) -> "Journal":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _check(self, identity: Mapping[str, str]) -> None:
        path = self.folder / "sweep.json"
        if not path.exists():
            check_free(self.folder / "table.parquet", force=False)
            return
        before: dict[str, Any] = json.loads(path.read_text("utf-8"))
        changed = [name for name in {**before, **identity} if before.get(name) != identity.get(name)]
        if changed:
            rule = "give another --out, or --force to start over"
            message = f"{self.folder} holds another sweep: its {' and '.join(changed)} differ from now; {rule}."
            raise OutputError(message, culprit=str(self.folder), value=changed)

    def _read(self) -> None:
        """Read what is there and cut off a line that was not finished."""
        self._file.seek(0)
        whole = 0
        for line in self._file:
            if not line.endswith(b"\n"):
                break
            row = json.loads(line)
            self.rows[row["run"]] = row
            whole += len(line)
        self._file.truncate(whole)


def clear(folder: Path) -> None:
    """Remove what a sweep made here, and nothing else."""
    for name in MADE:
        path = folder / name
        if path.is_dir():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)


def _lock(file: IO[bytes], folder: Path) -> None:
    """Refuse a second sweep at the same time; where the system has no such locks, the user must see to it."""
    with suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise OutputError(
                f"Another sweep is writing to {folder}; wait for it, or end it.", culprit=str(folder)
            ) from error
