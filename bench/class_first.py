"""Class first, name second: does one flexible term a class say better where a rest lives than the named effects do?

    python -m bench.class_first PROOF [PROOF ...] --out results/proof

PROOF is a folder of `cosim prove`. Each machine with one concealed effect (or none) is made again; beside its refitted
base every term that may be learned is weighed alone, in the nats of the search, the number of terms priced. The class
of the best one is said where it has `clear` nats in training and the held-out recordings gain `fair`. Beside it: the
class of the name that the tool gave, first name alone. What no term is made for (a late command, a spring, an encoder,
a tone) is counted apart: class first could never say it. Both orders are compared machine by machine (McNemar).
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from math import log
from multiprocessing import Pool
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scipy.stats import binomtest

from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _admitted, _refitted
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.evidence.predictive import Predictive
from cosim.diagnosis.terms.candidate_terms import candidate_terms
from cosim.diagnosis.terms.grams import columns_of, grams_of
from cosim.diagnosis.terms.learn import allowed, is_recorded
from cosim.estimation.prepare import PROTOCOL_HZ, prepare
from cosim_studies.proof.cases import cases_of
from cosim_studies.proof.make import make
from cosim_studies.proof.tool import given

CLASSES = {
    "friction over speed": (
        ("speed", "speed and acceleration"),
        ("stribeck", "quadratic_drag", "concave_viscous", "friction_asymmetry"),
    ),
    "torque over position": (
        ("position", "position over the turn"),
        ("cogging", "gravity_unbalance", "cable_wrap", "torque_offset"),
    ),
    "friction over position": (("friction level over position", "speed and position"), ("position_friction",)),
    "since a reversal": (
        ("time since reversal", "distance since reversal", "hysteresis over a long stroke"),
        ("presliding", "dwell_breakaway", "backlash"),
    ),
    "drive": (("torque", "torque and position"), ("torque_saturation",)),
    "warmth": (("way travelled", "temperature"), ("thermal_viscosity",)),
}
"""Classes: the terms that belong to each (a word of a column is enough), and the effects."""
NONE, OTHER = "nothing", "none of these"


def class_of_term(name: str) -> str:
    """The class that a term belongs to."""
    return next((kind for kind, (terms, _) in CLASSES.items() if name in terms or name.split()[-1] in terms), OTHER)


def class_of_effect(name: str) -> str:
    """The class that an effect belongs to."""
    return next((kind for kind, (_, effects) in CLASSES.items() if name in effects), OTHER)


def best_class(folder: str) -> str:
    """The class that one flexible term tells beside the base, or nothing."""
    card, read, held_out = given(folder)
    train, heldout, _ = _admitted(read, [held_out], card)
    problem, base, _ = _refitted(train, heldout, card)
    comparison = Comparison.of(problem, base, POLICY)
    held = Predictive.of(comparison, prepare(heldout, problem.prepared.band), base, prepare(heldout, PROTOCOL_HZ))
    terms = [one for one in candidate_terms(base.mount, problem.prepared) if is_recorded(one, held)]
    grams = grams_of(comparison, base, [columns_of(base.mount, one, problem.prepared) for one in terms], terms)
    every = list(range(grams.recordings))
    plain = grams.marginal([], every).log_likelihood
    gains = [grams.marginal([k], every).log_likelihood - plain - log(len(terms)) for k in range(len(terms))]
    best = max(range(len(terms)), key=lambda k: gains[k])
    if gains[best] < POLICY.clear:
        return NONE
    mount, effects = allowed(comparison, base, [terms[best]])
    gain = held.log_likelihood(held.residual(mount)) - held.log_likelihood(held.residual(base.mount))
    return class_of_term(terms[best].name) if effects and gain >= POLICY.fair else NONE


def _played(job: tuple[int, int, int, float, bool]) -> tuple[int, str]:
    seed, many, number, seconds, rough = job
    with TemporaryDirectory() as folder:
        make(cases_of(seed, many)[number], seconds, folder, rough)
        return number, best_class(folder)


def rows_of(folder: Path, workers: int) -> Iterable[dict[str, str]]:
    """True class, class of the first name, and class of the best term, for each machine with at most one effect."""
    proof = json.loads((folder / "proof.json").read_text())
    runs = {row["run"]: row for row in map(json.loads, (folder / "runs.jsonl").read_text().splitlines())}
    wanted = {number: row for number, row in runs.items() if row["kind"] in ("none", "one") and row["status"] == "ok"}
    rough = "--rough" in proof["command"]
    jobs = [(proof["seed"], len(runs), number, proof["seconds"], rough) for number in wanted]
    with Pool(workers, maxtasksperchild=8) as pool:
        for number, told in pool.imap_unordered(_played, jobs):
            row = wanted[number]
            named = [name for name in row["answer"]["verdict"] if name != "unknown"]
            yield {
                "world": "rough" if rough else "home",
                "true": class_of_effect(row["effects"][0]) if row["effects"] else NONE,
                "named": class_of_effect(named[0]) if named else NONE,
                "term": told,
            }


def page(rows: Sequence[dict[str, Any]], command: str) -> str:
    """The table, and what the comparison of the two orders says."""
    how = str(__doc__).split("\n\n", 2)[2].strip()
    lines = ["# Class first, name second: measured", "", f"    {command}", "", how, ""]
    lines += ["| true class | machines | right by name | right by term | class of the term |", "|---|---|---|---|---|"]
    for kind in (*CLASSES, OTHER, NONE):
        own = [row for row in rows if row["true"] == kind]
        by_name, by_term = (sum(row[way] == kind for row in own) for way in ("named", "term"))
        told = ", ".join(f"{one} {many}" for one, many in Counter(row["term"] for row in own).most_common())
        lines.append(f"| {kind} | {len(own)} | {by_name} | {by_term} | {told} |")
    own = [row for row in rows if row["true"] in CLASSES]
    right = Counter((row["named"] == row["true"], row["term"] == row["true"]) for row in own)
    names, terms = right[True, False], right[False, True]
    p = binomtest(names, names + terms).pvalue if names + terms else 1.0
    told = f"{names} have the right class by the name alone and {terms} by the term alone (McNemar, p = {p:.2g})."
    lines += ["", f"Of {len(own)} machines whose effect has a class,", told]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Play the machines again and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("proof", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--workers", type=int, default=2)
    given_ = parser.parse_args()
    rows = [row for folder in given_.proof for row in rows_of(folder, given_.workers)]
    made = [json.loads((folder / "proof.json").read_text())["command"] for folder in given_.proof]
    own = f"python -m bench.class_first {' '.join(folder.name for folder in given_.proof)} --out results/proof"
    (given_.out / "class_first.md").write_text(page(rows, "\n    ".join([*made, own])))


if __name__ == "__main__":
    main()
