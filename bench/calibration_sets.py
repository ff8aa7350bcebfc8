"""How much of a margin counts between members of a set, and what is left of a doubtful name beside something unknown.

python bench/calibration_sets.py COMMIT:results/proof/proof.json ... --out results/abroad

Each is the `proof.json` of `cosim prove` or the `abroad.json` of `abroad.py` of a commit of this project, of decks that
are not scored any more; `--played` is the part of a margin that counted in the package that played them (1 from
evidence 4 on, .5 before), `--kept` its `true_beside_unknown`. Of sets that hold the truth, the log-likelihood that it
is the member that it is, shares ~ (share printed for it)^part; of names with less than `LIKELY` beside `unknown`, how
many were true. Writes sets.md.
"""

import argparse
import json
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from calibration import share_of

from cosim.diagnosis.decide.calibration import LIKELY
from cosim.support.version import __version__
from cosim_studies.proof.score import share

PARTS = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
OFFERED = ("found", "ambiguous")


@dataclass(frozen=True)
class Case:
    """What was printed of each effect that was offered, whether it was true, and whether something stayed unknown."""

    printed: npt.NDArray[np.float64]
    true: npt.NDArray[np.bool_]
    named: int
    is_unknown: bool

    def log_likelihood(self, part: float) -> float:
        """Of the one that is true among the members of one set."""
        logs = part * np.log([share_of(min(max(one, 1e-4), 1 - 1e-4)) for one in self.printed])
        return float(logs[self.true][0] - np.log(np.exp(logs).sum()))

    @property
    def is_set(self) -> bool:
        """Whether this is one set, and holds the truth."""
        return self.named == 1 and len(self.printed) > 1 and int(self.true.sum()) == 1 and not self.is_unknown


def cases(deck: dict[str, Any]) -> Iterator[Case]:
    """Each case of a deck that has an answer, of either generator."""
    for row in deck["rows"]:
        truth, answer = row["effects"], row["answer"]
        if row.get("status", "ok") != "ok":
            continue
        offered = [one for one in answer["effects"] if one["answer"] in OFFERED]
        printed, true = ([one["probability"] for one in offered], [one["effect"] in truth for one in offered])
        named = [one for one in answer["verdict"] if one != "unknown"]
        yield Case(np.array(printed), np.array(true, bool), len(named), "unknown" in answer["verdict"])


def page(decks: dict[str, list[Case]], played: float, kept: float, command: str) -> str:
    """Both tables."""
    every = {**decks, "all": [one for deck in decks.values() for one in deck]}
    head = ["# Within a set, and beside something unknown", "", f"    {command}", "", f"mount-cosim {__version__}.", ""]
    head += ["Sets: log-likelihood of the true member where so much of a margin counts.", ""]
    return "\n".join([*head, *_within(every, played), "", *_beside(every, kept), ""])


def _within(every: dict[str, list[Case]], played: float) -> Iterator[str]:
    yield "| deck | sets with the truth | first is true | " + " | ".join(f"{one:g}" for one in PARTS) + " |"
    yield "|---" * (3 + len(PARTS)) + "|"
    for name, deck in every.items():
        sets = [one for one in deck if one.is_set]
        first = sum(bool(one.true[np.argmax(one.printed)]) for one in sets)
        told = [sum(one.log_likelihood(part / played) for one in sets) for part in PARTS]
        yield f"| {name} | {len(sets)} | {first} | " + " | ".join(f"{one:.1f}" for one in told) + " |"


def _beside(every: dict[str, list[Case]], kept: float) -> Iterator[str]:
    yield from ("| deck | doubtful names beside `unknown` | true | printed, with all of it |", "|---|---|---|---|")
    for name, deck in every.items():
        beside = [(p, t) for one in deck if one.is_unknown for p, t in zip(one.printed, one.true, strict=True)]
        weak = [(p / kept, bool(t)) for p, t in beside if p < LIKELY]
        if weak:
            true, printed = share([t for _, t in weak]), np.mean([p for p, _ in weak])
            yield f"| {name} | {len(weak)} | {true.value:.2f} [{true.low:.2f}, {true.high:.2f}] | {printed:.2f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("decks", nargs="+", metavar="COMMIT:FILE")
    parser.add_argument("--played", type=float, default=1.0)
    parser.add_argument("--kept", type=float, default=0.5)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    read = [json.loads(subprocess.check_output(["git", "show", one])) for one in given.decks]
    names = [f"{'home' if one.get('generator') == 'home' else 'abroad'} {one['seed']}" for one in read]
    decks = {name: list(cases(one)) for name, one in zip(names, read, strict=True)}
    words = [*given.decks, "--played", f"{given.played:g}", "--kept", f"{given.kept:g}", "--out", str(given.out)]
    command = " ".join(["python bench/calibration_sets.py", *words])
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "sets.md").write_text(page(decks, given.played, given.kept, command), "utf-8")


if __name__ == "__main__":
    main()
