"""What each number of the decision is worth: stored scores decided again with one step moved or one rule off.

    python bench/ablation.py --home 281127341 320128911 --rough 730915562 832011281 --out results/proof

Plays the beginning of the home decks of these seeds (rough machines too), keeps the scores of each answer
(`scores` of diagnosis.json), and decides them again: each step and share of `Policy` a third less and a half more, each
rule of the decision off. `--also` adds other machines whose answers were kept in the same way.

An answer is right if it says nothing of a null, `unknown` of what has no name, one name that is true or a set that
holds it of one effect, true names alone of several; of a measured machine, which always lacks more than one knows, true
names or `unknown`. Of each change: answers lost and won, and the probability that
chance alone would be as unequal (McNemar, exact). Scores that were kept before are not played again. Nothing is fitted
or proven again: of the rules of search and of held-out proof the page says, from the ledgers, how many effects each was
the first to refuse, of those that were concealed and of those that were not.
"""

import argparse
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scipy.stats import binomtest

from cosim.delivery.deliver import as_json
from cosim.diagnosis.answer.scores import Scores
from cosim.diagnosis.decide.decision import decide
from cosim.diagnosis.decide.policy import POLICY, Policy
from cosim.diagnosis.diagnose import diagnose
from cosim.support.version import __version__
from cosim_studies.proof import tool
from cosim_studies.proof.cases import CaseSpec, cases_of
from cosim_studies.proof.make import make

Row = Mapping[str, Any]
STEPS = ("fair", "clear", "strong", "sure")
SHARES = ("negligible", "slight", "small", "considerable", "half", "nearly_all")
KEPT = ("true_beside_unknown", "true_ahead", "wander")
MOVED = (2 / 3, 3 / 2)
"""Factors by which a number is moved: to half of the way to its neighbours, which are about three times apart."""
SECONDS = 60.0
OFF: Mapping[str, Callable[[dict[str, Any]], None]] = {
    "slow error in training": lambda scores: scores["rest"].update(share=0.0),
    "slow error held out": lambda scores: scores["rest"].update(share_there=0.0),
    "the same beside friction-law error": lambda scores: scores["rest"].update(share_beside=0.0),
    "error in bursts": lambda scores: scores["rest"].update(in_bursts=0.0),
    "random disturbance at any motion": lambda scores: scores["rest"].update(shaken=0.0),
    "another cause explains more than a name": lambda scores: scores["rest"].update(in_place=[]),
    "error follows a quantity": lambda scores: scores["rest"].update(terms=[]),
    "a learned term says unknown": lambda scores: scores.update(learned=None),
    "held-out recordings contradict": lambda scores: [
        one.update(share=abs(one["share"])) for one in scores["rest"]["terms"]
    ],
    "a little uneven over position": lambda scores: [one.update(uneven=None) for one in scores["rest"]["terms"]],
    "ahead of what has no name": lambda scores: [one.update(ahead=0.0) for one in scores["effects"]],
    "rivals": lambda scores: [one.update(margins={}) for one in scores["effects"]],
}
"""Rules of the decision, and what of the scores is taken away to switch each off."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--home", type=int, nargs="+", default=(281127341, 320128911), help="seeds")
    parser.add_argument("--rough", type=int, nargs="+", default=(730915562, 832011281), help="seeds of rough machines")
    parser.add_argument("--cases", type=int, default=120, help="of each")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--scores", type=Path, default=Path("ablation.jsonl"), help="where answers are kept")
    parser.add_argument("--also", type=Path, nargs="*", default=(), help="answers of other machines, kept so")
    parser.add_argument("--out", type=Path, default=Path("results/proof"))
    options = parser.parse_args()
    known = {(row["world"], row["number"]) for row in _read(options.scores)}
    jobs = [
        (world, one)
        for kind, seeds in (("home", options.home), ("rough", options.rough))
        for seed in seeds
        for one in cases_of(seed, options.cases)
        if ((world := f"{kind} {seed}"), one.number) not in known
    ]
    with ProcessPoolExecutor(options.workers) as pool, options.scores.open("a") as file:
        for row in pool.map(_played, *zip(*jobs, strict=True)) if jobs else ():
            file.write(json.dumps(row) + "\n")
            file.flush()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = [row for path in (options.scores, *options.also) for row in _read(path) if row["scores"]]
    text = page(rows, f"--home {_listed(options.home)} --rough {_listed(options.rough)}")
    (options.out / "ablation.md").write_text(text, "utf-8")
    print(text)


def _listed(seeds: Sequence[int]) -> str:
    return " ".join(map(str, seeds))


def _read(path: Path) -> Iterator[Row]:
    if path.exists():
        yield from (json.loads(line) for line in path.read_text("utf-8").splitlines())


def _played(world: str, case: CaseSpec) -> Row:
    with TemporaryDirectory() as folder:
        make(case, SECONDS, folder, world.startswith("rough"))
        card, train, held = tool.given(folder)
        answer = as_json(diagnose(train, [held], card).diagnosis)
    head = {"world": world, "number": case.number, "kind": case.kind, "effects": list(case.effects)}
    return head | {"scores": answer["scores"], "refused": refused(answer["ledger"])}


def refused(ledger: Iterable[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Rules by which a ledger refuses effects, and which; one that names a rival or a term is one for all of them."""
    found: dict[str, set[str]] = {}
    for row in ledger:
        for rule in row["rules"]:
            if not rule["outcome"] and row["effect"] != "unknown":
                name = re.sub(r"(behind|ahead of|better by) .*", r"\1 another", rule["name"])
                found.setdefault(name, set()).add(row["effect"])
    return {name: sorted(effects) for name, effects in found.items()}


def is_right(row: Row, policy: Policy, change: Callable[[dict[str, Any]], Any] = lambda _: None) -> bool:
    """Whether scores, changed, are decided rightly by a policy."""
    scores = json.loads(json.dumps(row["scores"]))
    change(scores)
    found, true = decide(Scores.of_json(scores), policy), set(row["effects"])
    if row["kind"] in ("none", "outside"):
        return found.is_unknown if row["kind"] == "outside" else not (found.is_unknown or found.sets)
    said = [true & {name, *members} for name, members in found.sets.items()]
    if row["kind"] == "measured":
        return all(said) and (bool(said) or found.is_unknown)
    return bool(said) and all(said) and not found.is_unknown and (row["kind"] == "several" or len(said) == 1)


def page(rows: Sequence[Row], seeds: str) -> str:
    """The page of results/."""
    now = [is_right(row, POLICY) for row in rows]
    lines = [
        "# What each number and each rule of the decision is worth",
        "",
        f"`python bench/ablation.py {seeds}`, mount-cosim {__version__}, policy {POLICY.version}.",
        f"{len(rows)} machines, {_worlds(rows)}; {sum(now)} answers are right. Lost and won are answers that are right",
        "before and after alone; p is that of McNemar's exact test. Scores are decided again, nothing is fitted again.",
        "",
        "| change | lost | won | p |",
        "|---|--:|--:|--:|",
    ]
    for name in (*STEPS, *SHARES, *KEPT):
        value = getattr(POLICY, name)
        for factor in MOVED:
            moved = min(factor * value, 0.99) if name in SHARES else factor * value
            lines.append(_line(f"`{name}` {value:g} → {moved:.3g}", rows, now, replace(POLICY, **{name: moved})))
    lines += [_line(f"without: {name}", rows, now, POLICY, off) for name, off in OFF.items()]
    lines += ["", "| rule of search or proof | refuses of what is concealed | of what is not |", "|---|--:|--:|"]
    return "\n".join([*lines, *_refusals(rows)]) + "\n"


def _refusals(rows: Sequence[Row]) -> Iterator[str]:
    count: dict[str, list[int]] = {}
    for row in rows:
        for rule, effects in row.get("refused", {}).items():
            true = len(set(effects) & set(row["effects"]))
            here = count.setdefault(rule, [0, 0])
            here[0], here[1] = here[0] + true, here[1] + len(effects) - true
    for rule, (true, false) in sorted(count.items(), key=lambda one: -one[1][1]):
        yield f"| {rule} | {true} | {false} |"


def _worlds(rows: Sequence[Row]) -> str:
    count = Counter(row["world"] for row in rows)
    return ", ".join(f"{world} ({number})" for world, number in count.items())


def _line(
    name: str,
    rows: Sequence[Row],
    now: Sequence[bool],
    policy: Policy,
    change: Callable[[dict[str, Any]], Any] = lambda _: None,
) -> str:
    after = [is_right(row, policy, change) for row in rows]
    lost = sum(a and not b for a, b in zip(now, after, strict=True))
    won = sum(b and not a for a, b in zip(now, after, strict=True))
    p = float(binomtest(lost, lost + won).pvalue) if lost + won else 1.0
    return f"| {name} | {lost} | {won} | {p:.2g} |"


if __name__ == "__main__":
    main()
