"""Bounds of what was not seen, tested: an effect of just that size is concealed anew, and must be found.

    python bench/bounds.py --cases 4 --seed 7100 --out results/proof

Fresh cases of the home generator without a gap (their truth is not the card's friction law), every other one a mount,
the rest machines of any class with cards of any law. For each effect with a bound, the torque that an effect of that
size adds along the recorded motion, by the plant's own equations, is added to the recorded torque; sign, phase and
cycles are drawn within what the bound says it holds for. Then the recordings are prepared, the base is refitted, the
effect's candidates are screened and the best is refitted: it is found if it is admissible and has the evidence that
the search asks for. Writes bounds.csv and bounds.md.
"""

import argparse
import csv
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.data.recording import Recording
from cosim.diagnosis.answer.ledger import all_pass
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.diagnose import _problem
from cosim.diagnosis.effects import candidates, hypothesis_of
from cosim.diagnosis.effects.candidates import columns_of, span_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.measure.bounds import SeenFrom, bounds
from cosim.diagnosis.measure.concealment import Member, members
from cosim.diagnosis.search.candidate_fit import is_small
from cosim.diagnosis.search.stages import admission, least, refitted
from cosim.estimation.fit import Fit
from cosim.estimation.inverse import Inverse
from cosim.estimation.prepare import prepare
from cosim.estimation.problem import Problem
from cosim.support.version import __version__
from cosim_studies.proof.generator import ANY, make_case, to_toml
from pyfmi_models.card import Card, parse_card
from pyfmi_models.effects import Effect
from pyfmi_models.model import parameters_of

Z = 1.96
BAR = 0.9


def case(seed: int, seconds: float = 30.0) -> tuple[Card, list[Recording]]:
    """A card and two recordings from which nothing is missing: of a mount, of odd seeds of a machine of any class."""
    made = make_case(seed, [], duration=seconds, machine=ANY if seed % 2 else "")
    runs = [Recording(f"train_{k}", {n: f[n].to_numpy(float) for n in f.columns}) for k, f in enumerate(made.train)]
    return parse_card(to_toml(made.card), "card.toml"), runs


class Stand:
    """A case with its base refitted, and the bounds that a diagnosis would print."""

    def __init__(self, card: Card, runs: Sequence[Recording]) -> None:
        self.card, self.runs = card, list(runs)
        self.problem = _problem(self.runs, card)
        self.base = self.problem.fit(self.problem.mount, 25)
        self.comparison = Comparison.of(self.problem, self.base, POLICY)
        self.bounds = bounds(self.comparison, self.base, [], 0.0)

    def members(self) -> list[Member]:
        """What was concealed to find the bounds."""
        prepared, level = self.problem.prepared, np.abs(self.comparison.nuisances.level)
        mount = self.base.mount
        tried = candidates(mount, prepared, self.base.residual, level)
        span = span_of(mount, prepared, self.base.residual, level)
        return members(self.problem, mount, span, tried, self.base.values)

    def is_found(self, name: str, effects: Sequence[Effect]) -> bool:
        """Conceal one effect, in each recording its own, and look for it."""
        runs = [self._with(run, effect) for run, effect in zip(self.runs, effects, strict=True)]
        prepared = prepare(runs, self.problem.prepared.band)
        problem = Problem(self.problem.mount, prepared, self.problem.weight, self.problem.sample_time)
        comparison = replace(self.comparison, problem=problem)
        return looked_for(comparison, problem.fit(self.base.mount, 25), name)

    def _with(self, run: Recording, effect: Effect) -> Recording:
        mount = self.base.mount
        grown = replace(mount, effects=(*mount.effects, effect))
        (piece,) = prepare([run], self.problem.prepared.band).pieces
        without, torque = (Inverse(one, ()).torque(piece, np.zeros(0))[0] for one in (mount, grown))
        return replace(run, table=run.table | {"tau": run["tau"] + np.interp(run.t, piece.t, torque - without)})


def looked_for(comparison: Comparison, base: Fit, name: str) -> bool:
    """Screen one effect's candidates, refit the best by either statistic, and ask the search's rules."""
    prepared, level = comparison.problem.prepared, np.abs(comparison.nuisances.level)
    tried = candidates(base.mount, prepared, base.residual, level, only=(name,))
    if not tried:
        return False
    scored = comparison.score(base, tried, columns_of(base.mount, tried, prepared, base.values))
    best = {id(max(scored, key=lambda one: getattr(one, key))): key for key in ("evidence", "plain")}
    for one in (one for one in scored if id(one) in best):
        fit = refitted(comparison, base, one.candidate.start(one.coefficients), len(tried))
        enough = fit.evidence >= least(POLICY, 0.0, fit.plain_gain) and not is_small(fit, POLICY)
        if enough and all_pass(admission(comparison, fit)):
            return True
    return False


def drawn(member: Member, bound: SeenFrom, draw: np.random.Generator, runs: int) -> list[Effect]:
    """An effect of the size of its bound, for each recording: alike but for the phase of a tone."""
    main, own = member.instance.main.parameter, hypothesis_of(member.instance)
    known = {variable.name: variable for variable in parameters_of(member.instance)}
    numbers: dict[str, Any] = {} if own.easiest else {main: bound.size}
    if "cycles_per_rev" in known or "frequency_hz" in known:
        low, high = bound.places
        numbers[own.member] = float(np.exp(draw.uniform(np.log(low), np.log(high))))
    if known[main].low < 0 and not own.easiest:
        numbers[main] = float(bound.size * draw.choice([-1.0, 1.0]))
    is_tone = "frequency_hz" in known
    phases = draw.uniform(-np.pi, np.pi, runs if is_tone else 1).tolist() * (1 if is_tone else runs)
    return [_changed(member.instance, numbers | ({"phase": one} if "phase" in known else {})) for one in phases]


def _changed(effect: Effect, numbers: dict[str, Any]) -> Effect:
    change: Any = replace
    return change(effect, **numbers)  # type: ignore[no-any-return]


def trials(seed: int) -> Iterator[dict[str, Any]]:
    """Conceal every effect that has a bound in one case."""
    stand, draw = Stand(*case(seed)), np.random.default_rng(seed)
    inside = [one for one in stand.members() if one.effect in stand.bounds]
    for name, bound in stand.bounds.items():
        places = [one for one in inside if one.effect == name and bound.places[0] <= one.place <= bound.places[1]]
        edge = [one for one in places if one.easiest and one.place == bound.size]
        member = edge[0] if edge else places[int(draw.integers(len(places)))]
        hit = stand.is_found(name, drawn(member, bound, draw, len(stand.runs)))
        yield {"seed": seed, "effect": name, "bound": f"{bound.size:.3g}", "found": "yes" if hit else "no"}


def wilson(hits: int, of: int) -> tuple[float, float]:
    """95 % interval of a share."""
    p, z2 = hits / of, Z * Z
    middle, half = (
        (p + z2 / 2 / of) / (1 + z2 / of),
        Z / (1 + z2 / of) * float(np.sqrt(p * (1 - p) / of + z2 / 4 / of**2)),
    )
    return middle - half, middle + half


def page(found: Sequence[dict[str, Any]], given: argparse.Namespace, seconds: float) -> str:
    """The table for people."""
    hits, names = sum(row["found"] == "yes" for row in found), list(dict.fromkeys(row["effect"] for row in found))
    low, high = wilson(hits, len(found))
    rows = [
        f"| {name} | {sum(r['found'] == 'yes' for r in found if r['effect'] == name)} of "
        f"{sum(r['effect'] == name for r in found)} |"
        for name in names
    ]
    held = "reached" if low >= BAR else "inconclusive" if high >= BAR else "missed"
    return "\n".join(
        [
            "# Bounds of what was not seen: concealed at the bound, found?",
            "",
            f"    python bench/bounds.py --cases {given.cases} --seed {given.seed} --out results/proof",
            "",
            f"mount-cosim {__version__}, {seconds:.0f} s. Found: {hits} of {len(found)}, {hits / len(found):.2f} "
            f"({low:.2f} to {high:.2f}); the bar of {BAR:g} is {held}.",
            "",
            "| effect | found at its bound |",
            "| --- | --- |",
            *rows,
            "",
            "An effect is concealed by adding to the recorded torque what the plant's equations need for it along the "
            "recorded motion; then recordings are prepared and fitted anew and the effect is looked for as the search "
            "does. What has no number of its own size (a resonance, a knee, a contact's stiffness, a gap) is concealed "
            "as the last one that the bound calls visible. The loop does not answer to what is concealed.",
            "",
        ]
    )


def main() -> None:
    """Conceal all effects in all cases and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=4)
    parser.add_argument("--seed", type=int, default=7000)
    parser.add_argument("--out", type=Path, required=True)
    given, started, found = parser.parse_args(), time.process_time(), []
    for seed in range(given.seed, given.seed + given.cases):
        for row in trials(seed):
            print(*row.values(), file=sys.stderr, flush=True)
            found.append(row)
    given.out.mkdir(parents=True, exist_ok=True)
    with (given.out / "bounds.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, list(found[0]))
        table.writeheader()
        table.writerows(found)
    (given.out / "bounds.md").write_text(page(found, given, time.process_time() - started), "utf-8")


if __name__ == "__main__":
    main()
