"""What depends on each constant of the decision: halved and doubled, one at a time, how many answers change?

    python bench/sensitivity.py --cases 6 --seed 5 --out results/proof

Fresh cases of the home generator, mixed as `cosim prove` mixes them. Each is diagnosed with the policy as it is, then
once for each constant at half and at twice its value; pairs and triples of numbers are scaled together. Fits do not
depend on the policy and are made once. Writes a page and a table (answers as the policy is, and those that
change).

Two readers are beyond it: `dwell_breakaway` takes the least rise of a dwell from the policy as it is,
`encoder_eccentricity` the margin of a disc with half the turns.
"""

import argparse
import csv
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from cosim.data.recording import Recording
from cosim.data.single_readings import cleaned
from cosim.diagnosis import diagnose as whole
from cosim.diagnosis.decide.policy import POLICY, Policy
from cosim.diagnosis.evidence.comparison import Comparison, Screened
from cosim.diagnosis.measure.protocol import Structures, traces
from cosim.diagnosis.search.rivals import examine
from cosim.diagnosis.search.stages import InTurn, search
from cosim.diagnosis.trust.doubts import doubts, of_base, without_denied
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Band, Prepared, prepare
from cosim.estimation.problem import Problem
from cosim.support.version import __version__
from cosim_studies.proof.cases import CaseSpec, cases_of
from cosim_studies.proof.conduct import code
from cosim_studies.proof.generator import OUTSIDE
from cosim_studies.proof.make import make
from cosim_studies.proof.tool import given
from pyfmi_models.card import Card
from pyfmi_models.mount import Mount

FACTORS = (0.5, 2.0)
OF_EVIDENCE = {
    "bands_hz",
    "coarsening",
    "form_ways",
    "accuracy",
    "misfit",
    "wander",
    "wander_seconds",
    "phase_price",
}
"""Constants that evidence itself depends on: for these it is computed anew."""
WITHHELD = ("unknown",)
"""What a diagnosis says where something is wrong with the recordings."""


@dataclass(frozen=True)
class Remembering(Problem):
    """A problem that makes each fit once."""

    made: dict[tuple[str, int, tuple[str, ...]], Fit] = field(default_factory=dict, compare=False, repr=False)

    def fit(self, mount: Mount, evaluations: int, freed: Sequence[str] = ()) -> Fit:
        key = repr(mount), evaluations, tuple(freed)
        if key not in self.made:
            self.made[key] = super().fit(mount, evaluations, freed)
        return self.made[key]


@dataclass(frozen=True, eq=False)
class Screening(Comparison):
    """A comparison that screens beside each fit once."""

    before: dict[Fit, list[Screened]] = field(default_factory=dict)

    def screen(self, found: Fit) -> list[Screened]:
        if found not in self.before:
            self.before[found] = super().screen(found)
        return self.before[found]


class Replay:
    """One case, and its answer by any policy."""

    def __init__(self, train: Sequence[Recording], held: Recording, card: Card) -> None:
        self.train, self.held = [*map(cleaned, train)], [cleaned(held)]
        problem = whole._problem(self.train, card)
        self.problem = Remembering(problem.mount, problem.prepared, problem.weight, problem.sample_time)
        self.base = self.problem.fit(problem.mount, 75)
        self.sanity = (
            *doubts(self.train, self.held, card),
            *of_base(card, self.problem, self.base.mount, self.train, self.held),
        )
        self.usual = self._comparison(POLICY)
        self.ready: dict[Band | float, Prepared] = {}

    def answer(self, policy: Policy, changed: str = "") -> tuple[str, ...]:
        """The verdict by a policy of which one constant is `changed`."""
        with self._remembered():
            comparison = self._comparison(policy) if changed in OF_EVIDENCE else self.usual
            object.__setattr__(comparison, "policy", policy)
            examined = examine(comparison, search(comparison, self.base, InTurn()), InTurn())
            if any(one.blocks_naming for one in without_denied(self.sanity, examined.chosen, examined.last)):
                return WITHHELD
            found = whole._learned(whole._answer(comparison, examined, self.held), self.held)[0]
            models = Structures(self.problem.mount, self.base.mount, found.chosen.mount)
            said = whole._findings(found, traces(self.train, self.held, models))
            return whole._verdict(said, found.decision)

    def _comparison(self, policy: Policy) -> Screening:
        own = Comparison.of(self.problem, self.base, policy)
        return Screening(**{one.name: getattr(own, one.name) for one in fields(Comparison)})

    @contextmanager
    def _remembered(self) -> Iterator[None]:
        """Prepare the held-out recording once for each band, and say nothing of what was not seen."""
        with ExitStack() as stack:
            stack.enter_context(patch.object(whole, "prepare", self._prepared))
            stack.enter_context(patch.object(whole, "not_found", lambda *_: []))
            yield

    def _prepared(self, recordings: Sequence[Recording], band: Band | float) -> Prepared:
        if band not in self.ready:
            self.ready[band] = prepare(recordings, band)
        return self.ready[band]


def constants() -> list[str]:
    """Names of the constants that are numbers."""
    return [one.name for one in fields(Policy) if one.name != "version"]


def scaled(name: str, factor: float) -> Policy:
    """The policy with one constant scaled; whole numbers stay whole."""
    value = getattr(POLICY, name)
    if isinstance(value, tuple):
        return replace(POLICY, **{name: tuple(factor * one for one in value)})
    return replace(POLICY, **{name: type(value)(factor * value)})


def asked(case: CaseSpec) -> list[dict[str, Any]]:
    """Answers to a case: as the policy is, and by each constant scaled."""
    with TemporaryDirectory() as folder:
        make(case, 60.0, folder)
        card, train, held = given(folder)
    replay = Replay(train, held, card)
    usual = replay.answer(POLICY)
    rows = [_row(case, "", 1.0, usual)]
    for name in constants():
        rows += [_row(case, name, one, replay.answer(scaled(name, one), name)) for one in FACTORS]
    return rows


def _row(case: CaseSpec, name: str, factor: float, said: Sequence[str]) -> dict[str, Any]:
    answer = " + ".join(said) or "none"
    return {"case": case.number, "concealed": case.label, "constant": name, "factor": factor, "answer": answer}


def is_right(row: dict[str, Any]) -> bool:
    """Whether an answer is right: nothing, `unknown` first, the name first, or all names of several and no other."""
    concealed, said = row["concealed"].split(" + "), row["answer"].split(" + ")
    if set(concealed) & set(OUTSIDE):
        return said[0] == "unknown"
    return said[0] == concealed[0] if len(concealed) == 1 else set(said) == set(concealed)


def as_it_is(rows: Sequence[dict[str, Any]]) -> dict[int, dict[str, Any]]:
    """The rows of the policy as it is, by case."""
    return {row["case"]: row for row in rows if not row["constant"]}


def page(rows: Sequence[dict[str, Any]], options: argparse.Namespace, seconds: float) -> str:
    """The page of results/."""
    usual = as_it_is(rows)
    command = f"python bench/sensitivity.py --cases {options.cases} --seed {options.seed}"
    lines = ["# How much depends on each constant of the decision", "", f"    {command} --out {options.out}", ""]
    lines += [
        f"mount-cosim {__version__}, code {code()[:16]}, seed {options.seed}: {len(usual)} cases of the home "
        f"generator, {seconds / 60:.0f} minutes. As the policy is, {sum(map(is_right, usual.values()))} answers are "
        "right: nothing where nothing is concealed, `unknown` first, the name first, all names of several. Each "
        "constant of `cosim/diagnosis/decide/policy.py` at half and at twice its value: answers that become another, "
        "and how many are right then. Cases in [sensitivity.csv](sensitivity.csv). No number here was written by hand.",
        "",
        "| constant | value | others at half | right | others at twice | right |",
        "|---|---|---|---|---|---|",
    ]
    for name in constants():
        cells = []
        for factor in FACTORS:
            said = [row for row in rows if row["constant"] == name and row["factor"] == factor]
            cells += [sum(row["answer"] != usual[row["case"]]["answer"] for row in said), sum(map(is_right, said))]
        lines.append(f"| {name} | {getattr(POLICY, name)} | {' | '.join(map(str, cells))} |")
    lines += ["", "| concealed | constant | from | to |", "|---|---|---|---|"]
    for row in rows:
        before = usual[row["case"]]["answer"]
        if row["answer"] != before:
            how = "half" if row["factor"] < 1 else "twice"
            lines.append(f"| {row['concealed']} | {row['constant']}, {how} | {before} | {row['answer']} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=12)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options, begun = parser.parse_args(), time.perf_counter()
    rows = []
    with ProcessPoolExecutor() as pool:
        for answers in pool.map(asked, cases_of(options.seed, options.cases)):
            rows += answers
            print(", ".join(str(value) for value in answers[0].values() if value != ""), flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "sensitivity.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        usual = as_it_is(rows)
        table.writerows(row for row in rows if not row["constant"] or row["answer"] != usual[row["case"]]["answer"])
    (options.out / "sensitivity.md").write_text(page(rows, options, time.perf_counter() - begun), "utf-8")


if __name__ == "__main__":
    main()
