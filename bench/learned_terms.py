"""What a learned term is worth: cases whose effect is in no catalogue, and nulls; what is learned, and is it true?

    python bench/learned_terms.py --cases 2 --nulls 10 --seed S --out results/learned
        [--data FOLDER --python PYTHON --abroad 12] [--decks results/decks.md]

At home: every effect of `cosim_studies/proof/outside.py`, of full and of half size by turns, in machines of any class,
and nulls. With `--data` also a generator by others (see `abroad.py`), its family `unknown`. What could be removed at
best: at home the error that the refitted base has on a twin without the effect, abroad that of the true structure.
The work goes on where it was ended, case by case, in the folder WORK. Writes README.md and learned.json.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

for library in ("OMP", "OPENBLAS"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
sys.path.append(str(Path(__file__).parent))
from abroad import RECORDINGS, Part, make, missing  # noqa: E402
from learned_step import ratio_of  # noqa: E402
from learned_terms_page import write  # noqa: E402

from cosim.data.recording import Recording  # noqa: E402
from cosim.diagnosis.diagnose import Outcome, diagnose  # noqa: E402
from cosim.diagnosis.measure.protocol import heldout_rms  # noqa: E402
from cosim.estimation.fit import fit  # noqa: E402
from cosim.estimation.prepare import choose_cutoff, prepare  # noqa: E402
from cosim.estimation.row_weights import weights  # noqa: E402
from cosim.reading import read_recordings  # noqa: E402
from cosim_studies.proof.conduct import code  # noqa: E402
from cosim_studies.proof.generator import ANY, OUTSIDE, make_case, write_given  # noqa: E402
from cosim_studies.proof.ledger import enlist  # noqa: E402
from cosim_studies.proof.simulated_axis import stream  # noqa: E402
from pyfmi_models.card import Card, read_card  # noqa: E402

Row = dict[str, Any]
HOME, ABROAD, NULL = "home", "abroad", "none"
SIZES = (1.0, 0.5)
"""Full and half: in the words of the generator about a quarter and an eighth of the friction."""
SECONDS = 60.0
ROUNDS = 9
"""Pairs of blocks of steps, of which the median ratio counts."""


@dataclass(frozen=True)
class Case:
    """One case: world, family, its size or level, its seed; the folder of one that lies there already."""

    world: str
    family: str
    size: float
    seed: int
    folder: Path | None = None

    @property
    def name(self) -> str:
        """Name of its answer."""
        return f"{self.world}-{self.family}-{self.seed}" + (f"-{self.folder.name}" if self.folder else "")


def main() -> None:
    """Make, diagnose, measure, write."""
    given = arguments()
    began = time.perf_counter()
    work = given.work or Path(tempfile.gettempdir()) / f"cosim-learned-{given.seed}"
    deck = [*at_home(given.seed, given.cases, given.nulls), *abroad(given, work)]
    answers = work / f"answers-{code()[:16]}"
    answers.mkdir(parents=True, exist_ok=True)
    played(deck, answers, given.jobs)
    rows = [json.loads((answers / f"{case.name}.json").read_text("utf-8")) for case in deck]
    if given.decks:
        enlist(given.decks, "learned", given.seed, len(deck), given.purpose, code())
    write(given.out, rows, facts(given, time.perf_counter() - began))
    print((given.out / "README.md").read_text("utf-8"))


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=2, help="cases of each effect outside the catalogue")
    parser.add_argument("--nulls", type=int, default=10, help="cases with nothing concealed")
    parser.add_argument("--data", type=Path, default=None, help="folder of a generator by others")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has numba")
    parser.add_argument("--abroad", type=int, default=0, help="its cases of the family `unknown`")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time")
    parser.add_argument("--work", type=Path, default=None, help="where cases and answers are kept")
    parser.add_argument("--purpose", default="scoring", help="scoring, or tuning: whether the code may be shaped by it")
    parser.add_argument("--decks", type=Path, default=None, help="list of all decks to which this one is added")
    parser.add_argument("--out", type=Path, required=True)
    return parser.parse_args()


def at_home(seed: int, cases: int, nulls: int) -> list[Case]:
    """Each effect outside the catalogue so many times, then the nulls, each with a seed of its own."""
    rng = stream(seed, "learned")
    drawn = [(name, SIZES[(k + j) % len(SIZES)]) for k in range(cases) for j, name in enumerate(OUTSIDE)]
    drawn += [(NULL, 0.0)] * nulls
    return [Case(HOME, family, size, int(rng.integers(2**31))) for family, size in drawn]


def abroad(given: argparse.Namespace, work: Path) -> list[Case]:
    """Cases of the other generator; none, and the reason said, where it cannot run."""
    if not given.data or not given.abroad:
        return []
    if reason := missing(given.data, given.python):
        print(f"abroad skipped: {reason}")
        return []
    part = Part("unknown", given.abroad, given.seed)
    work.mkdir(parents=True, exist_ok=True)
    make(part, given, work)
    folders = sorted(path for path in (work / part.name).iterdir() if path.is_dir())
    return [Case(ABROAD, "unknown", 0.0, given.seed, folder) for folder in folders]


def played(deck: list[Case], answers: Path, jobs: int) -> None:
    """Play what has no answer yet."""
    rest = [case for case in deck if not (answers / f"{case.name}.json").exists()]
    with ProcessPoolExecutor(jobs) as pool:
        for done, said in enumerate(pool.map(play, rest, [answers] * len(rest)), 1):
            print(f"{done} of {len(rest)}: {said}", flush=True)


def play(case: Case, answers: Path) -> str:
    """Diagnose one case, measure what is delivered, and write the row; an answer is complete or not there."""
    began = time.process_time()
    card, train, held, truth = _opened(case)
    outcome = diagnose(train, [held], card)
    seconds = time.process_time() - began
    cutoff = outcome.diagnosis.heldout.cutoff_hz
    row = _answered(case, outcome) | truth | {"seconds": seconds}
    if case.world == HOME:
        row["floor"] = _floor_at_home(case, cutoff) if case.family != NULL else row["base"]
    partial = answers / f"{case.name}.partial"
    partial.write_text(json.dumps(row), "utf-8")
    partial.replace(answers / f"{case.name}.json")
    delivered = ", ".join(row["quantities"]) or "nothing"
    return f"{case.name}: {' + '.join(row['verdict']) or 'none'}; learned {delivered}; {row['equation']}"


def _opened(case: Case) -> tuple[Card, list[Recording], Recording, Row]:
    """Card, recordings and what the truth says that the row holds."""
    if case.folder is None:
        return *_made(case.seed, () if case.family == NULL else (case.family,), case.size), {}
    card = read_card(case.folder / "model.toml")
    paths = [case.folder / f"{name}.csv.gz" for name in RECORDINGS]
    *train, held = read_recordings(paths, card.columns, None, None, card.mount.motion)
    told = json.loads((Path(f"{case.folder.parent}_truth") / f"{case.folder.name}.json").read_text("utf-8"))
    best = told["recordings"]["heldout"]
    truth = {"family": told["parameters"]["unknown"]["kind"], "size": told["level"]}
    return card, train, held, truth | {"floor": best["oracle_libfriction_rms"], "base_of_truth": best["base_rms"]}


def _made(seed: int, effects: tuple[str, ...], size: float) -> tuple[Card, list[Recording], Recording]:
    with tempfile.TemporaryDirectory(prefix="cosim-learned-") as name:
        folder = Path(name)
        write_given(make_case(seed, effects, size, duration=SECONDS, machine=ANY), folder)
        card = read_card(folder / "card.toml")
        paths = [folder / f"{one}.parquet" for one in RECORDINGS]
        *train, held = read_recordings(paths, card.columns, None, None, card.mount.motion)
    return card, train, held


def _floor_at_home(case: Case, cutoff: float) -> float:
    """Held-out error of the refitted base on the same machine, motion and noise without the effect."""
    card, train, held = _made(case.seed, (), case.size)
    mount, prepared = card.plant(), prepare(train, choose_cutoff(train, card.mount.inertia))
    found = fit(mount, prepared.pieces, weights(mount.friction, prepared), mount, 25)
    return heldout_rms([held], found.mount, cutoff)


def _answered(case: Case, outcome: Outcome) -> Row:
    """What the answer says and the errors before and after it, all in the band of the headline."""
    found, held = outcome.diagnosis, outcome.diagnosis.heldout
    formulas = found.learned.get("formula", [])
    return {
        **{"world": case.world, "family": case.family, "size": case.size, "seed": case.seed},
        "verdict": list(found.verdict),
        "quantities": list(found.learned.get("quantities", ())),
        "tried": list(found.not_learned.get("quantities", ())),
        **{"base": held.before_rms, "after": held.after_rms, "before_learned": found.learned.get("before")},
        "equation": "; ".join(str(one["equation"]) for one in formulas),
        "step": _step_ratio(outcome) if found.learned else None,
    }


def _step_ratio(outcome: Outcome) -> float:
    """Time of a step of the delivered plant over that of the same plant without what was learned."""
    card = outcome.card
    named = tuple(effect for effect in card.effects if effect.id != "learned")
    models = [one.plant().model() for one in (replace(card, effects=named), card)]
    return ratio_of(models, ROUNDS)


def facts(given: argparse.Namespace, seconds: float) -> Row:
    """What the page says of how it was made."""
    names = [f"--{name} {getattr(given, name)}" for name in ("cases", "nulls", "seed")]
    names += [f"--data FOLDER --python PYTHON --abroad {given.abroad}"] if given.data else []
    command = f"python bench/learned_terms.py {' '.join(names)} --out results/learned"
    return {"command": command, "seed": given.seed, "purpose": given.purpose, "code": code()[:16], "seconds": seconds}


if __name__ == "__main__":
    main()
