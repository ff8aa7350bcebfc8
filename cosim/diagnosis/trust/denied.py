"""Doubts that the model with its effects denies: what is missing from a plain balance may look like two clocks."""

from collections.abc import Iterator, Sequence

from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.effects import hypothesis_of
from cosim.diagnosis.search.stages import Stage
from cosim.diagnosis.trust.clocks import LATE
from cosim.estimation.fit import Fit
from pyfmi_models.effects import Effect


def beyond_denial(sanity: Sequence[Sanity]) -> tuple[Sanity, ...]:
    """Doubts that no model can settle: a unit, a sign, another machine."""
    return tuple(one for one in sanity if one.finding != "clocks")


def without_denied(sanity: Sequence[Sanity], chosen: Fit, beside: Stage) -> tuple[Sanity, ...]:
    """Leave out that position and torque are not of one time, where the model that stands wants no such lag.

    A ripple over the position, a shaking ground or friction that creeps look late to a balance of inertia, friction and
    load. The model knows more: beside its effects, what is late is of that size or is not there.

    Args:
        sanity: what is doubted.
        chosen: the structure that stands.
        beside: what was tried beside it.
    """
    latest = max((abs(lag) for lag in _lags(chosen, beside)), default=0.0)
    return tuple(sanity) if latest >= LATE / 2 else beyond_denial(sanity)


def _lags(chosen: Fit, beside: Stage) -> Iterator[float]:
    """Lags [s] of the structure, and those that gained anything beside it."""
    yield from (_lag(effect) for effect in chosen.mount.effects if hypothesis_of(effect).is_timing)
    for one in beside.tried:
        if one.evidence > 0 and hypothesis_of(one.effect).is_timing:
            yield _lag(one.fit.mount.effects[-1])


def _lag(effect: Effect) -> float:
    """Seconds by which a timing effect is late; all of them count in milliseconds."""
    return float(getattr(effect, effect.main.parameter)) / 1e3
