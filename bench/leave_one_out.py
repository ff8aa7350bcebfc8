"""What is said of physics that the diagnosis cannot name, or has no shape for: each effect left out of it, once.

    python bench/leave_one_out.py --cases 4 --seed 5 --out results/proof

Fresh cases of the home generator, machines of any class, one effect each. Two questions:

* *names*: a listed effect that is found while it may be named is left out of the candidates. Right is "unknown"; wrong
  is another name and nothing else; "none" says that nothing is missing.
* *shapes*: an effect outside the list for which the diagnosis has a general shape loses that shape. Right is "unknown".

Writes left_out.md and left_out.csv.
"""

import argparse
import csv
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
from bounds import wilson

from cosim.data.recording import Recording
from cosim.diagnosis.diagnose import diagnose
from cosim.diagnosis.evidence import comparison
from cosim.diagnosis.measure import bounds
from cosim.diagnosis.search import global_test, scores
from cosim.diagnosis.search import stages as search
from cosim.diagnosis.search.stages import Start
from cosim.support.version import __version__
from cosim_studies.proof.conduct import code
from cosim_studies.proof.generator import ANY, FAMILIES, make_case, write_given
from cosim_studies.proof.outside import SHAPED
from cosim_studies.proof.tool import given
from pyfmi_models.card import Card

SHAPES = {
    "acceleration_drag": ("acceleration", "acceleration and speed"),
    "random_walk": ("time since the start",),
    "remanence": ("hysteresis over a long stroke",),
    "reversal_kick": ("time since reversal",),
    "rubbing": ("friction level over time since the start",),
    "thermal_tilt": ("position and temperature",),
}
"""Terms of `cosim/diagnosis/terms/dictionary.py` that say what an effect outside the list follows."""
SIZES = (0.45, 1.0)
"""Of an effect: what is concealed well enough to be found, mostly."""
EVERY = [*SHAPED, *FAMILIES]
WHOLE, NAME, SHAPE = "as it is", "without the name", "without the shape"


@contextmanager
def left_out(effect: str) -> Iterator[None]:
    """Diagnose without candidates of an effect, or without the shapes of one outside the list."""
    with ExitStack() as stack:
        for module in (comparison, global_test, bounds):
            stack.enter_context(patch.object(module, "candidates", _less(module.candidates, effect)))
        stack.enter_context(patch.object(search, "starts", _no_twin(search.starts, effect)))
        stack.enter_context(patch.object(scores, "dictionary", _fewer(scores.dictionary, effect)))
        yield


def _less(candidates: Callable[..., list[Any]], effect: str) -> Callable[..., list[Any]]:
    def others(*args: Any, **names: Any) -> list[Any]:
        return [one for one in candidates(*args, **names) if one.effect != effect]

    return others


def _no_twin(starts: Callable[..., list[Start]], effect: str) -> Callable[..., list[Start]]:
    """What is left out does not come back as the twin of another effect."""

    def others(*args: Any) -> list[Start]:
        return [start for start in starts(*args) if start[0].id != effect]

    return others


def _fewer(dictionary: Callable[..., dict[str, Any]], effect: str) -> Callable[..., dict[str, Any]]:
    def others(*args: Any) -> dict[str, Any]:
        return {name: term for name, term in dictionary(*args).items() if name not in SHAPES.get(effect, ())}

    return others


def recorded(seed: int, effect: str) -> tuple[Card, list[Recording], Recording]:
    """A card and recordings of a machine in which an effect is concealed."""
    size = float(np.exp(np.random.default_rng(seed).uniform(*np.log(SIZES))))
    with TemporaryDirectory() as folder:
        write_given(make_case(seed, [effect], size, machine=ANY), Path(folder))
        return given(folder)


def asked(job: tuple[int, str]) -> list[dict[str, Any]]:
    """Diagnose a case as it is and, where the effect is seen, without it."""
    seed, effect = job
    card, train, held = recorded(seed, effect)
    whole = diagnose(train, [held], card).diagnosis.verdict
    rows = [{"seed": seed, "effect": effect, "asked": WHOLE, "answer": " + ".join(whole) or "none"}]
    if effect in SHAPES or whole[:1] == (effect,):
        with left_out(effect):
            less = diagnose(train, [held], card).diagnosis.verdict
        rows.append({**rows[0], "asked": SHAPE if effect in SHAPES else NAME, "answer": " + ".join(less) or "none"})
    return rows


def kind(answer: str) -> str:
    """What an answer amounts to: unknown first, a name with unknown beside it, a name alone, or none."""
    first, *rest = answer.split(" + ")
    return first if first in ("unknown", "none") else "name and unknown" if "unknown" in rest else "name"


def shares(rows: Sequence[dict[str, Any]]) -> str:
    """The kinds of answers of some cases, as cells of a table."""
    said = [kind(row["answer"]) for row in rows]
    counted = [str(said.count(one)) for one in ("unknown", "name and unknown", "name", "none")]
    low, high = wilson(said.count("unknown"), len(said)) if said else (0.0, 1.0)
    share = f"{said.count('unknown') / len(said):.2f} [{low:.2f}, {high:.2f}]" if said else "-"
    return " | ".join([str(len(said)), *counted, share])


def page(rows: Sequence[dict[str, Any]], options: argparse.Namespace, seconds: float) -> str:
    """The page of results/."""
    command = "python bench/leave_one_out.py"
    one = {what: [row for row in rows if row["asked"] == what] for what in (WHOLE, NAME, SHAPE)}
    shaped = [row for row in one[WHOLE] if row["effect"] in SHAPES]
    head = "| cases | unknown first | a name, and unknown | a name alone | none | unknown, share |"
    lines = ["# Left out of the diagnosis", ""]
    chosen = "" if options.effects == EVERY else f" --effects {' '.join(options.effects)}"
    lines += [f"    {command} --cases {options.cases} --seed {options.seed}{chosen} --out {options.out}", ""]
    lines += [
        f"mount-cosim {__version__}, code {code()[:16]}, seed {options.seed}: {options.cases} cases of each of "
        f"{len(set(options.effects) & set(FAMILIES))} listed effects and of {len(set(options.effects) & set(SHAPES))} "
        f"outside the list, of machines of any class, sizes {SIZES[0]} to {SIZES[1]}, {seconds / 60:.0f} minutes. No "
        "number on this page was written by hand.",
        "",
        f"Listed effects that are the first name while they may be named: "
        f"{len(one[NAME])} of {len(one[WHOLE]) - len(shaped)}. Below, each without that name.",
        "",
        f"| what is left out {head}",
        "|---|---|---|---|---|---|---|",
        f"| nothing; outside the list, with a shape | {shares(shaped)} |",
        f"| its shape; outside the list | {shares(one[SHAPE])} |",
        f"| its name; listed | {shares(one[NAME])} |",
        "",
        "| left out | answers |",
        "|---|---|",
    ]
    for effect in dict.fromkeys(row["effect"] for row in (*one[SHAPE], *one[NAME])):
        said = [row["answer"] for row in (*one[SHAPE], *one[NAME]) if row["effect"] == effect]
        lines.append(f"| {effect} | {', '.join(said)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=4, help="of each effect")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--effects", nargs="*", default=EVERY, metavar="EFFECT")
    parser.add_argument("--out", type=Path, required=True)
    options, begun = parser.parse_args(), time.perf_counter()
    seeds = np.random.default_rng(options.seed).integers(2**31, size=options.cases * len(options.effects)).tolist()
    with ProcessPoolExecutor() as pool:
        jobs = zip(seeds, options.effects * options.cases, strict=True)
        rows = []
        for answers in pool.map(asked, jobs):
            rows += answers
            print(", ".join(map(str, answers[-1].values())), flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    with (options.out / "left_out.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    (options.out / "left_out.md").write_text(page(rows, options, time.perf_counter() - begun), "utf-8")


if __name__ == "__main__":
    main()
