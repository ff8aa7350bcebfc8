"""The cases of a benchmark: what each case conceals, drawn from one seed.

Kinds of case in fixed shares, families in fair rotation: each comes once before any comes again. A benchmark of 60
cases is the beginning of the one of 200 with the same seed, so a proof can be made longer.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count, islice

import numpy as np

from cosim_studies.proof.generator import FAMILIES, OUTSIDE
from cosim_studies.proof.simulated_axis import log_uniform, stream

SHARES = {"none": 0.25, "one": 0.4, "several": 0.2, "outside": 0.15}
"""Kinds of case: nothing concealed, one effect, two or three, one that is outside the list."""
SIZES = (0.2, 1.0)
"""Sizes of effects, see `families.py`; drawn evenly in their logarithm, one for all effects of a case."""
ONE_IN = 4
"""Of the cases with several effects one in this many has three, the others two."""
TOGETHER = (
    {"delay", "actuator_lag", "clock_skew"},
    {"compliance", "backlash"},
    {"torque_offset", "cable_wrap"},
    {"gravity_unbalance", "load_dependent_friction"},
)
"""Never in one case: their sum has no two true names (an offset moves the home of a cable, an unbalance the known
load), or the generator has one place for both (the second mass)."""


@dataclass(frozen=True)
class CaseSpec:
    """One case: its number, the seed of its generator, its kind, the effects it conceals, and their size."""

    number: int
    seed: int
    kind: str
    effects: tuple[str, ...]
    size: float = 1.0

    @property
    def label(self) -> str:
        """What is concealed, for people."""
        return " + ".join(self.effects) or "none"


def cases_of(seed: int, cases: int) -> list[CaseSpec]:
    """The first `cases` of the benchmark of a seed."""
    return list(islice(_cases(stream(seed, "deck")), cases))


def _cases(rng: np.random.Generator) -> Iterator[CaseSpec]:
    families, first, foreign = (_rotation(rng.spawn(1)[0], names) for names in (FAMILIES, FAMILIES, OUTSIDE))
    several = count(1)
    for number, kind in enumerate(_kinds()):
        seed = int(rng.integers(2**31))
        effects: tuple[str, ...] = ()
        if kind == "one":
            effects = (next(families),)
        elif kind == "outside":
            effects = (next(foreign),)
        elif kind == "several":
            effects = _combined(rng, next(first), 3 if next(several) % ONE_IN == 0 else 2)
        yield CaseSpec(number, seed, kind, effects, log_uniform(stream(seed, "size"), *SIZES))


def _kinds() -> Iterator[str]:
    """The kind that lags most behind its share, again and again."""
    dealt = dict.fromkeys(SHARES, 0)
    for number in count(1):
        kind = max(SHARES, key=lambda name: SHARES[name] * number - dealt[name])
        dealt[kind] += 1
        yield kind


def _rotation(rng: np.random.Generator, names: Sequence[str]) -> Iterator[str]:
    while True:
        yield from (str(name) for name in rng.permutation(names))


def _combined(rng: np.random.Generator, first: str, size: int) -> tuple[str, ...]:
    """`first` and others that may stand beside it, in the order of the families."""
    chosen = {first}
    while len(chosen) < size:
        other = str(rng.choice(FAMILIES))
        if not any({other, one} <= group for group in TOGETHER for one in chosen):
            chosen.add(other)
    return tuple(name for name in FAMILIES if name in chosen)
