"""A list of checks: each can be called alone; together they give a table and, where one fails, one error."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import NamedTuple
from unittest import SkipTest

import pandas as pd

from cosim.support.errors import CheckError
from cosim.support.html import table as html_table

Check = Callable[[], None]


class NotApplicable(SkipTest):
    """A check has nothing to check here; pytest counts it as skipped."""


class Outcome(NamedTuple):
    """What a check said: "passed", "failed" or "not applicable", and why."""

    check: str
    outcome: str
    reason: str


@dataclass(frozen=True)
class Checks:
    """Checks of one class, in the order in which they tell most: `for name, check in checks: check()`.

    A check raises `CheckError` where the class fails it, and `unittest.SkipTest` where it does not apply. `run()`, or a
    call of the whole, runs all of them.
    """

    subject: str
    checks: Sequence[tuple[str, Check]]

    def __iter__(self) -> Iterator[tuple[str, Check]]:
        return iter(self.checks)

    def __len__(self) -> int:
        return len(self.checks)

    def outcomes(self) -> list[Outcome]:
        """Run all checks and return what each says; raises nothing."""
        return [_outcome(name, check) for name, check in self.checks]

    def frame(self) -> pd.DataFrame:
        """Run all checks; a row each with `check`, `outcome`, `reason`."""
        return pd.DataFrame(self.outcomes(), columns=list(Outcome._fields))

    def run(self) -> pd.DataFrame:
        """Run all checks and return their table.

        Raises:
            CheckError: one or several fail; the sentence gives each with its reason.
        """
        found = self.outcomes()
        failed = [f"{one.check}: {one.reason}" for one in found if one.outcome == "failed"]
        if failed:
            rule = f"{len(failed)} of {len(found)} checks of {self.subject} failed"
            raise CheckError(f"{rule}.\n" + "\n".join(failed))
        return pd.DataFrame(found, columns=list(Outcome._fields))

    __call__ = run

    def __repr__(self) -> str:
        return f"<{len(self)} checks of {self.subject}; .run() runs them>"

    def _repr_html_(self) -> str:
        return html_table(f"Checks of {self.subject}", [one._asdict() for one in self.outcomes()])


def _outcome(name: str, check: Check) -> Outcome:
    try:
        check()
    except SkipTest as reason:
        return Outcome(name, "not applicable", str(reason))
    except Exception as error:
        return Outcome(name, "failed", str(error) or type(error).__name__)
    return Outcome(name, "passed", "")


def require(holds: object, sentence: str) -> None:
    """Fail a check with a sentence unless something holds (raises CheckError)."""
    if not holds:
        raise CheckError(sentence)


def reported(check: Check) -> Check:
    """Let an error inside the class that is checked fail the check, in one sentence that names the error."""

    @wraps(check)
    def call() -> None:
        try:
            check()
        except (SkipTest, CheckError):
            raise
        except Exception as error:
            raise CheckError(f"{type(error).__name__}: {error}") from error

    return call
