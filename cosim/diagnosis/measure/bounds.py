"""How large may an effect be that was not seen? A bound that is tested: concealed at that size, the search finds it.

Sizes are raised from what would be too small to be named until the effect is found, whichever phase or sign it has.
Where a kind has members (cycles a turn, frequencies, widths), the bound holds for those beside each other that are seen
nearly as well; `Bound.range` says for which. Where the number says where an effect sets in (a resonance, a knee, the
stiffness of a contact, a gap), the bound is the last one that is found.

Findings of effects that are not named say so: not seen from which size, for what, or why that cannot be tested.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import log, sqrt

import numpy as np

from cosim.diagnosis.answer.result import Bound, Finding
from cosim.diagnosis.decide.policy import POLICY, Policy
from cosim.diagnosis.effects import TRIED, candidates, hypothesis_of, named
from cosim.diagnosis.effects.base import NOT_DETERMINED, UNSEEN, Seen
from cosim.diagnosis.effects.candidates import span_of
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.measure.concealment import Concealment, Hidden, Member, members
from cosim.diagnosis.measure.findings import unit_on
from cosim.diagnosis.search.rivals import AcceptedEffect
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Array, Prepared
from pyfmi_models.effects import CATALOGUE, Effect
from pyfmi_models.mount import Mount

STEP, STEPS = 1.5, 12
"""Factor between two sizes that are tried, and how many are: up to 86 times the first. The first is also one such step
above the least that has a name, as what is read is smaller than what is concealed: the base takes a part of it. Of a
delay at 500 Hz .79 to .84 was read (tests/diagnosis/measure/test_bounds.py)."""
ALIKE = 3.0
"""Members of a kind share a bound if theirs differ by no more than this factor."""
MARGIN = 1.25
"""A bound is this much larger than what was just found: another recording has other noise, and a refit gives a linear
step's evidence only nearly. Where the number says where an effect sets in, the last member found is left out."""


@dataclass(frozen=True)
class SeenFrom:
    """A size from which on an effect would have been found, for which members, and the share that was found at it."""

    size: float
    """Main number of the effect."""
    places: tuple[float, float]
    power: float
    instance: Effect


def bounds(comparison: Comparison, chosen: Fit, named: Sequence[str], largest: float) -> dict[str, SeenFrom]:
    """Test every effect that is not named beside the structure that is delivered.

    `largest` is the evidence of the strongest effect in it: others must stand beside that. An effect that is missing
    in the result is not found at any size.
    """
    prepared, level = comparison.problem.prepared, np.abs(comparison.nuisances.level)
    tried = [one for one in candidates(chosen.mount, prepared, chosen.residual, level) if one.effect not in named]
    span = span_of(chosen.mount, prepared, chosen.residual, level)
    hidden = members(comparison.problem, chosen.mount, span, tried, chosen.values)
    concealment = Concealment(comparison, chosen, [one.columns for one in hidden], largest)
    groups: dict[str, list[tuple[Member, Hidden]]] = {}
    for one, place in zip(hidden, placed(hidden), strict=True):
        costs = log(max(one.many, 1)) + comparison.policy.phase_price * one.phases
        loud = hypothesis_of(one.instance).must_stand_out
        groups.setdefault(one.effect, []).append((one, Hidden(one.effect, place, one.prior, costs, loud)))
    return tested(concealment, groups)


def tested(concealment: Concealment, members: Mapping[str, Sequence[tuple[Member, Hidden]]]) -> dict[str, SeenFrom]:
    """Test each effect's members; an effect that is missing here is not found at any size."""
    found = {
        name: _last(concealment, some) if some[0][0].easiest else _smallest(concealment, some)
        for name, some in members.items()
    }
    return {name: one for name, one in found.items() if one}


def _last(concealment: Concealment, members: Sequence[tuple[Member, Hidden]]) -> SeenFrom | None:
    """The last member that is found, those that are easier to find first; so are all before it."""
    order = sorted(members, key=lambda pair: -pair[0].easiest * pair[0].place)
    last: list[float] = []
    for member, hidden in order:
        if not (member.has_name and all(concealment.is_found(hidden, way) for way in member.directions)):
            break
        last.append(member.place)
    sure = last[:-1] or last
    return SeenFrom(sure[-1], (min(sure), max(sure)), 1.0, order[0][0].instance) if sure else None


def _smallest(concealment: Concealment, members: Sequence[tuple[Member, Hidden]]) -> SeenFrom | None:
    """The size from which on members beside each other are found."""
    sizes = [(member, hidden, _raised(concealment, member, hidden)) for member, hidden in members]
    seen = [(member, hidden, size) for member, hidden, size in sizes if size is not None]
    if not seen:
        return None
    hardest: dict[float, float] = {}  # forms that no number of the bound tells apart share it
    for member, _, size in seen:
        hardest[member.place] = max(size, hardest.get(member.place, 0.0))
    most = ALIKE * min(hardest.values())
    shared = [one for one in seen if hardest[one[0].place] <= most]
    size = max(one[2] for one in shared)
    while True:
        hits = [concealment.is_found(h, size * way) for m, h, _ in shared for way in m.directions]
        power = float(np.mean(hits))
        if power >= POLICY.nearly_all or size > STEP**2 * most:
            break
        size *= STEP
    size *= MARGIN
    if power < POLICY.nearly_all:
        return None
    places, first = [member.place for member, _, _ in shared], shared[0][0]
    return SeenFrom(first.none + size, (min(places), max(places)), power, first.instance)


def _raised(concealment: Concealment, member: Member, hidden: Hidden) -> float | None:
    """The first size of one member that is found whichever way it is concealed."""
    shares = [concealment.energy(hidden, way) for way in member.directions]
    if min(shares) <= 0:
        return None
    size = max(sqrt(POLICY.negligible / min(shares)), STEP * member.least)
    for _ in range(STEPS):
        if size > member.most:
            return None
        if all(concealment.is_found(hidden, size * way) for way in member.directions):
            return size
        size *= STEP
    return None


def placed(hidden: Sequence[Member]) -> list[Array]:
    """Numbers of the columns of each member, one after the other."""
    ends = np.cumsum([0, *(one.columns.shape[1] for one in hidden)])
    return [np.arange(first, last) for first, last in pairwise(ends.tolist())]


def not_found(comparison: Comparison, chosen: Fit, known: Sequence[str], largest: float) -> list[Finding]:
    """One finding for each effect that is tried and not named; `largest` is the evidence of the strongest that is."""
    problem, found = comparison.problem, bounds(comparison, chosen, known, largest)
    sizeless = {name for name in TRIED if named(name).share_of in problem.held}
    seen = {name: one for name, one in found.items() if name not in sizeless}
    others = [(name, own) for name in TRIED if (own := named(name)).same_as in seen]
    seen |= {name: seen[own.same_as] for name, own in others if not own.is_settled(chosen.mount)}
    reasons = {name: f"{NOT_DETERMINED} {named(name).share_of.rpartition('.')[2]}" for name in sizeless}
    lost = [name for name in TRIED if name not in known]
    return [_absent(n, seen.get(n), chosen.mount, problem.prepared, reasons.get(n, "")) for n in lost]


def undecided(finding: Finding, standing: Sequence[AcceptedEffect], policy: Policy) -> Finding:
    """A finding of an effect that no size would show, where it would be named but for a rival: that is not decided."""
    if finding.answer != "not_testable" or not finding.bound or finding.bound.reason != UNSEEN:
        return finding
    for one in standing:
        for rival in one.rivals:
            if rival.effect.id == finding.effect and rival.evidence >= policy.clear:
                removes = f"{100 * one.own.plain_gain:.0f} % of the error energy, this {100 * rival.plain_gain:.0f} %"
                said = f"{one.effect.title} stands in its place: it removes {removes}"
                told = replace(finding, answer="not_decided", rival=one.effect.id, evidence=said, gain=rival.plain_gain)
                return replace(told, bound=replace(finding.bound, reason=said))
    return finding


def _absent(name: str, found: SeenFrom | None, mount: Mount, prepared: Prepared, reason: str) -> Finding:
    form = CATALOGUE[name][0]
    main = form.main
    axes = ("q", "v") if prepared.has_position else ("v",)
    visited = {key: (float(prepared.ranges[key][0]), float(prepared.ranges[key][1])) for key in axes}
    if found:
        own, seen = hypothesis_of(found.instance), Seen(found.size, *found.places, prepared.cutoff)
        where, range_ = own.looked(seen, mount), ({own.member: found.places} if own.member else {}) | visited
    else:
        where, range_ = reason or named(name).why_not(mount, prepared), visited
    value, power = (main.factor * found.size, found.power) if found else (None, None)
    band = (0.0, prepared.cutoff)
    bound = Bound(value=value, unit=unit_on(main.unit, mount), band_hz=band, range=range_, power=power, reason=where)
    return Finding(
        effect=name,
        title=form.title,
        answer="not_seen" if found else "not_testable",
        probability=0.0,
        gain=0.0,
        units={main.parameter: bound.unit},
        visible_from=value if main.is_size else None,
        evidence=where,
        action="" if found or named(name).is_settled(mount) else form.to_record,
        bound=bound,
    )
