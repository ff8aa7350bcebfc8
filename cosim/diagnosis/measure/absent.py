"""Findings of effects that are not named: not seen from which size, for what, or why that cannot be tested."""

from collections.abc import Sequence
from dataclasses import replace

from cosim.diagnosis.answer.result import Bound, Finding
from cosim.diagnosis.decide.policy import Policy
from cosim.diagnosis.effects import TRIED, hypothesis_of, named
from cosim.diagnosis.effects.base import NOT_DETERMINED, UNSEEN, Seen
from cosim.diagnosis.evidence.comparison import Comparison
from cosim.diagnosis.measure.bounds import SeenFrom, bounds
from cosim.diagnosis.measure.findings import unit_on
from cosim.diagnosis.search.rivals import AcceptedEffect
from cosim.estimation.fit import Fit
from cosim.estimation.prepare import Prepared
from pyfmi_models.effects import CATALOGUE
from pyfmi_models.mount import Mount


def not_found(comparison: Comparison, chosen: Fit, known: Sequence[str], largest: float) -> list[Finding]:
    """One finding for each effect that is tried and not named; `largest` is the evidence of the strongest that is."""
    problem, found = comparison.problem, bounds(comparison, chosen, known, largest)
    sizeless = {name for name in TRIED if named(name).share_of in problem.held}
    seen = {name: one for name, one in found.items() if name not in sizeless}
    seen |= {name: seen[like] for name in TRIED if (like := named(name).same_as) in seen and _may_be(name, chosen)}
    reasons = {name: f"{NOT_DETERMINED} {named(name).share_of.rpartition('.')[2]}" for name in sizeless}
    lost = [name for name in TRIED if name not in known]
    return [_absent(n, seen.get(n), chosen.mount, problem.prepared, reasons.get(n, "")) for n in lost]


def _may_be(name: str, chosen: Fit) -> bool:
    """Whether the axis can have an effect that is another under its own name."""
    return not named(name).is_settled(chosen.mount)


def undecided(finding: Finding, standing: Sequence[AcceptedEffect], policy: Policy) -> Finding:
    """A finding of an effect that no size would show, where it would be named but for a rival: that is not decided."""
    if finding.answer != "not_testable" or not finding.bound or finding.bound.reason != UNSEEN:
        return finding
    for one in standing:
        for rival in one.rivals:
            if rival.effect.id == finding.effect and rival.evidence >= policy.least_evidence:
                removes = f"{100 * one.own.plain_gain:.0f} % of the error energy, this {100 * rival.plain_gain:.0f} %"
                said = f"{one.effect.title} stands in its place: it removes {removes}"
                told = replace(finding, answer="not_decided", rival=one.effect.id, evidence=said, gain=rival.plain_gain)
                return replace(told, bound=replace(finding.bound, reason=said))
    return finding


def _absent(name: str, found: SeenFrom | None, mount: Mount, prepared: Prepared, reason: str) -> Finding:
    form = CATALOGUE[name][0]
    main = form.main
    where = _looked(found, mount, prepared) if found else reason or named(name).why_not(mount, prepared)
    value = main.factor * found.size if found else None
    bound = Bound(
        value=value,
        unit=unit_on(main.unit, mount),
        band_hz=(0.0, prepared.cutoff),
        range=_range(found, prepared),
        power=found.power if found else None,
        reason=where,
    )
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


def _range(found: SeenFrom | None, prepared: Prepared) -> dict[str, tuple[float, float]]:
    """What a bound holds for: the members that were concealed, and the positions and speeds that were visited."""
    visited = {key: (float(prepared.ranges[key][0]), float(prepared.ranges[key][1])) for key in ("q", "v")}
    member = hypothesis_of(found.instance).member if found else ""
    own = {member: found.places} if found and member else {}
    return own | (visited if prepared.has_position else {"v": visited["v"]})


def _looked(found: SeenFrom, mount: Mount, prepared: Prepared) -> str:
    return hypothesis_of(found.instance).looked(Seen(found.size, *found.places, prepared.cutoff), mount)
