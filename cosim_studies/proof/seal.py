"""Sealed truth: its SHA-256 is written and told before the tool runs; afterwards the truth is opened and must fit.

    seal = SHA-256(salt, newline, truth as JSON with sorted keys and no spaces), the salt 16 bytes in hexadecimal

Without the salt the few possible truths could be tried; it is drawn from the seed of the benchmark, so that the same
command gives the same seals. A row is sealed when its case was answered, and compared before it is scored.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from threading import Lock
from typing import Any

from cosim.support.errors import ProofError
from cosim.support.interrupts import uninterrupted
from cosim.support.plain import Parsed
from cosim_studies.proof.simulated_axis import stream

Row = Parsed


def salt_of(seed: int, number: int) -> str:
    """The salt of a case of the benchmark of a seed."""
    return stream(seed, f"salt {number}").bytes(16).hex()


def canonical(truth: Mapping[str, Any]) -> str:
    """The one text of a truth that is hashed."""
    return json.dumps(truth, sort_keys=True, separators=(",", ":"), allow_nan=False)


def seal(truth: Mapping[str, Any], salt: str) -> str:
    """SHA-256 of salt and truth, hexadecimal."""
    return hashlib.sha256(f"{salt}\n{canonical(truth)}".encode()).hexdigest()


def seal_of_row(row: Row) -> str:
    """SHA-256 of a row as it is read from its file, hexadecimal; there is nothing to guess, so no salt."""
    text = json.dumps(json.loads(json.dumps(row)), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


class Seals:
    """The file of seals, `seals.jsonl`, a line a case; one that stands there is never changed."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, Lock()
        lines = path.read_text("utf-8").splitlines(keepends=True) if path.exists() else []
        whole = [json.loads(line) for line in lines if line.endswith("\n")]
        if len(whole) < len(lines):  # a line cut short by a kill
            path.write_text("".join(lines[: len(whole)]), "utf-8")
        self.known: dict[int, str] = {line["run"]: line["seal"] for line in whole if "seal" in line}
        self._answers: dict[int, str] = {line["run"]: line["answer"] for line in whole if "answer" in line}

    def write(self, number: int, sealed: str) -> None:
        """Write the seal of a case before its tool runs.

        Raises:
            ProofError: the case was sealed before, with another truth.
        """
        with self._lock, uninterrupted():
            if number not in self.known:
                self.known[number] = sealed
                with self._path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"run": number, "seal": sealed}) + "\n")
        if self.known[number] != sealed:
            rule = "the generator has changed since; start over with --force"
            raise ProofError(f"Case {number} was sealed before with another truth: {rule}.", culprit=str(self._path))

    def write_answer(self, row: Row) -> None:
        """Seal the row of a case that was answered; a case that is answered again is sealed again."""
        sealed = seal_of_row(row)
        with self._lock, uninterrupted():
            self._answers[row["run"]] = sealed
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"run": row["run"], "answer": sealed}) + "\n")

    def check_answers(self, rows: Iterable[Row]) -> None:
        """Compare every row with its seal.

        Raises:
            ProofError: a row is not the one that was sealed when its case was answered.
        """
        for row in rows:
            sealed = self._answers.get(row["run"])
            if seal_of_row(row) != sealed:
                found = "has no seal" if sealed is None else "is not the answer that was sealed"
                rule = "remove its line from runs.jsonl and the case is answered again, or start over with --force"
                raise ProofError(f"Case {row['run']}: its answer {found}; {rule}.", culprit=str(self._path))

    def check(self, rows: Iterable[Row]) -> None:
        """Open every truth and compare it with its seal.

        Raises:
            ProofError: a truth is not the one that was sealed.
        """
        for row in rows:
            sealed = self.known.get(row["run"])
            if seal(row["truth"], row["salt"]) != sealed:
                found = "has no seal" if sealed is None else "is not the truth that was sealed"
                raise ProofError(f"Case {row['run']}: what stands as its truth {found}.", culprit=str(self._path))
