"""Make a deck: python -m worlds.machines --seed 1 --n 3 --out DIR (run in, or with PYTHONPATH, the tests folder)."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads cost more than they give

import argparse
import pathlib
import time

import numpy as np

from .cases import make_case
from .combinations import PAIRS, TRIPLES
from .effects import EFFECTS
from .files import write
from .outside import OUTSIDE

TRIES = 80
"""Draws of a case before it is given up."""


def hands(rng, arguments):
    """List what the deck holds: (family, effects, kind of unknown), in a random order."""
    names = (
        [*EFFECTS, "none", "unknown", "pairs", "triples"]
        if arguments.families == "all"
        else arguments.families.split(",")
    )
    special = {"none": arguments.nulls, "unknown": arguments.unknowns, "triples": arguments.triples}
    out = []
    for family in names:
        count = special.get(family)
        count = arguments.n if count is None else count
        pairs, triples, kinds = (rng.permutation(len(x)) for x in (PAIRS, TRIPLES, OUTSIDE))
        for k in range(count):
            effects = {
                "none": (),
                "pairs": PAIRS[pairs[k % len(PAIRS)]],
                "triples": TRIPLES[triples[k % len(TRIPLES)]],
            }.get(family, (family,))
            out.append((family, effects, list(OUTSIDE)[kinds[k % len(OUTSIDE)]] if family == "unknown" else ""))
    return [out[k] for k in rng.permutation(len(out))]


def deal(seed, number, hand):
    """Draw one case until it is accepted; returns it, its seed and what was rejected."""
    family, effects, kind = hand
    faults = []
    for attempt in range(TRIES):
        own = int(np.random.SeedSequence([seed, number, attempt]).generate_state(1)[0])
        made, word = make_case(own, family, effects, kind)
        if made is not None:
            return made, own, faults
        faults.append(word)
    return None, 0, faults


def _line(t):
    """Say what a case is, on one line."""
    what = "+".join(t["effects"]) or "none"
    motions = "/".join(r["kind"] for r in t["recordings"].values())
    machine = f"{t['machine']} {t['rate_hz']:.0f} Hz {t['truth_friction']}/{t['base_friction']}"
    shares = f"shares {t['share_train']:.2f} {t['share_heldout']:.2f} misfit {t['law_misfit']:.2f} {t['history']}"
    return f"{t['case']} {what} {t['kind']} {t['level']}: {machine} {motions} {shares}"


def main():
    """Read the command line and write the deck."""
    p = argparse.ArgumentParser(prog="worlds.machines", description=__doc__)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--n", "--n-per-family", type=int, default=3, dest="n", help="cases of a family")
    p.add_argument("--nulls", type=int, help="cases where nothing is missing (default: 4 n)")
    p.add_argument("--unknowns", type=int, help="cases with unknown physics (default: 3 n)")
    p.add_argument("--triples", type=int, help="cases with three effects (default: n)")
    p.add_argument("--families", default="all", help="comma list or 'all'")
    p.add_argument("--out", required=True, type=pathlib.Path)
    a = p.parse_args()
    a.nulls, a.unknowns = 4 * a.n if a.nulls is None else a.nulls, 3 * a.n if a.unknowns is None else a.unknowns
    sealed = a.out.with_name(a.out.name + "_truth")
    a.out.mkdir(parents=True, exist_ok=True)
    sealed.mkdir(parents=True, exist_ok=True)
    begin = time.time()
    for number, hand in enumerate(hands(np.random.default_rng(a.seed), a)):
        start = time.time()
        name = f"case_{number:04d}"
        if (sealed / f"{name}.json").exists():
            continue
        made, own, faults = deal(a.seed, number, hand)
        if made is None:
            print(name, hand, "given up:", faults[-3:], flush=True)
            continue
        t = write(a.out, sealed, name, made, own)
        print(_line(t), f"tries {len(faults) + 1} {time.time() - start:.1f} s", *faults[-2:], flush=True)
    print(f"{number + 1} cases in {time.time() - begin:.0f} s")


if __name__ == "__main__":
    main()
