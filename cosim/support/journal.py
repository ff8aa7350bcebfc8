"""The folder of a sweep, proof, calibration or investigation: what it is, and a line for each run as it is done.

NAME.json     what the runs depend on, as hashes
runs.jsonl    one row a line, appended; a line cut short by a kill is dropped
"""

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

from cosim.support.errors import OutputError
from cosim.support.files import check_free, directory, replacing
from cosim.support.interrupts import uninterrupted
from cosim.support.plain import Parsed

RUNS = "runs.jsonl"
Row = Parsed
"""What is said of a run; its number is "run"."""


class Journal:
    """The rows done so far, by run; `append` adds one for good.

    Args:
        folder: made where it is not there.
        identity: what the runs depend on; a folder with another one is refused.
        force: start over, whatever is there.
        kind: what the folder holds, in messages: "sweep".
        made: files and folders that belong to it; the first is that of the identity.
        fits: whether a row that is found may be one of these runs.

    Raises:
        OutputError: the folder holds another one, one that is being written, or rows that another hand changed.
    """

    def __init__(
        self,
        folder: Path,
        identity: Mapping[str, str],
        force: bool,
        kind: str,
        made: Sequence[str],
        fits: Callable[[Row], bool] = lambda row: True,
    ) -> None:
        self._fits = fits
        self.folder, self.rows, self._kind, self._identity = folder, dict[int, Row](), kind, folder / made[0]
        if force:
            clear(folder, made)
        self._check(identity, made)
        self._file = directory(folder).joinpath(RUNS).open("a+b")
        try:
            _lock(self._file, folder, kind)
            self._read()
            with replacing(self._identity, force=True) as partial:
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

    def _check(self, identity: Mapping[str, str], made: Sequence[str]) -> None:
        if not self._identity.exists():
            _check_free(self.folder, made)
            return
        before = _object(self._identity.read_bytes())
        if before is None:
            rule = "give another --out, or --force to start over"
            raise OutputError(f"{self._identity} is damaged: it is no JSON; {rule}.", culprit=str(self._identity))
        changed = [name for name in {**before, **identity} if before.get(name) != identity.get(name)]
        if changed:
            rule = "give another --out, or --force to start over"
            message = f"{self.folder} holds another {self._kind}: its {' and '.join(changed)} changed since; {rule}."
            raise OutputError(message, culprit=str(self.folder), value=changed)

    def _read(self) -> None:
        """Read what is there and cut off a line that was not finished."""
        self._file.seek(0)
        whole = 0
        for number, line in enumerate(self._file, 1):
            if not line.endswith(b"\n"):
                break
            row = self._row(line, number)
            self.rows[row["run"]] = row
            whole += len(line)
        self._file.truncate(whole)

    def _row(self, line: bytes, number: int) -> Row:
        """Return the row of a line; one that is none was changed by another hand, and must not be lost unseen."""
        row = _object(line)
        if row is not None and type(row.get("run")) is int and self._fits(row):
            return row
        rule = "mend or remove that line and its run is made again, or give --force to start over"
        message = f"{self.folder / RUNS}: line {number:,} is no row of a {self._kind}; {rule}."
        raise OutputError(message, culprit=str(self.folder / RUNS), value=number)


def _object(text: bytes) -> Parsed | None:
    """Return a JSON object; None where it is none."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def _check_free(folder: Path, made: Sequence[str]) -> None:
    """Refuse a folder that was not begun here and holds a file with the name of a result."""
    for name in made:
        if name != RUNS and (folder / name).is_file():
            check_free(folder / name, force=False)


def clear(folder: Path, made: Sequence[str]) -> None:
    """Remove what was made here, and nothing else."""
    for name in made:
        path = folder / name
        if path.is_dir():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)


def _lock(file: IO[bytes], folder: Path, kind: str) -> None:
    """Refuse a second one at the same time; where the system has no such locks, the user must see to it."""
    with suppress(ImportError):
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise OutputError(
                f"Another {kind} is writing to {folder}; wait for it, or end it.", culprit=str(folder)
            ) from error
