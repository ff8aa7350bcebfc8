"""Checks of an effect: words, units, equations, bounds, what it does to the axis, identification, diagnosis, FMU."""

from functools import partial

import casadi as ca
import numpy as np

from cosim.diagnosis.effects import TRIED
from cosim_checks import recordings, shared
from cosim_checks.plant import LAW, Equations, mount_of, numbers_of
from cosim_checks.suite import Check, Checks, NotApplicable, reported, require
from pyfmi_models.effects import CATALOGUE, Effect, FrictionEffect, GravityUnbalance

PLACES = tuple((float(q), v) for q in np.linspace(-3, 3, 61) for v in (-0.3, -1e-3, 1e-3, 0.3))
"""Positions [rad] and speeds [rad/s] at which torques are looked at."""
WEIGHT = GravityUnbalance(mgl=2.0)
"""On the axis, so that what depends on a load has one."""


def checks_of(effect: Effect) -> Checks:
    """All checks of an effect."""
    checks = {
        "words": words,
        "units": shared.units,
        "finite": shared.finite,
        "derivatives": shared.derivatives,
        "acts": acts,
        "resists": resists,
        "bounds": shared.bounds,
        "fmu": shared.fmu,
        "fits_itself": recordings.fits_itself,
        "found_where_concealed": recordings.found_where_concealed,
    }
    listed: list[tuple[str, Check]] = [(name, reported(partial(check, effect))) for name, check in checks.items()]
    return Checks(type(effect).__name__, listed)


def words(effect: Effect) -> None:
    """A person reads what it is: docstring, title, equation, action, a sentence with its size; rivals exist."""
    kind = type(effect)
    require(effect.id.isidentifier() and effect.id.islower(), f'id = "{effect.id}" must be in lower_case.')
    require((kind.__doc__ or "").strip() and not (kind.__doc__ or "").startswith(f"{kind.__name__}("), _NO_DOCSTRING)
    for name in ("title", "action", *(("equation",) if effect.id in TRIED else ())):
        require(str(getattr(effect, name, "")).strip(), f"{name} is empty; a report prints it.")
    said = effect.statement()
    require(said.endswith(".") and len(said) > len("It acts."), f'statement() = "{said}" must be one full sentence.')
    if hasattr(effect, "main") or effect.id in TRIED:
        require(hasattr(effect, "main"), 'main is missing; main = Main("coefficient") names the number of its size.')
        main = effect.leading()
        require(main.parameter in numbers_of(effect), f'main names "{main.parameter}", which is no parameter.')
    unknown = [one for one in effect.rivals if one not in CATALOGUE]
    require(not unknown, f"rivals: {', '.join(unknown)} are no effects; effects are: {', '.join(CATALOGUE)}.")
    require(effect.told_apart_by or not effect.rivals, "told_apart_by is empty; it says how rivals are distinguished.")


_NO_DOCSTRING = "the class has no docstring; it states the equation, its limits and its source."


def acts(effect: Effect) -> None:
    """An axis with the effect moves or reads otherwise than one without it."""
    models = [Equations(mount.model()) for mount in (mount_of(effect, WEIGHT), mount_of(LAW, WEIGHT))]
    if len(models[0].model.states) > len(models[1].model.states):
        return  # it has a memory of its own, which the axis without it lacks
    for q, v in PLACES:
        given = {"position": q, "speed": v, "tau": 4.0}
        given |= {one.name: one.start + one.nominal for one in effect.inputs()}
        here = models[0].named(0.7, **given)
        there = models[1].named(0.7, position=q, speed=v, tau=4.0)
        if any(abs(here[name] - there[name]) > 1e-9 * (1 + abs(there[name])) for name in there):
            return
        if any(abs(here[one] - here["q"]) > 0 for one in ("q_true", "q_recorded") if one in here):
            return
    require(False, "an axis with it moves and reads as one without it, at all positions and speeds that were tried.")


def resists(effect: Effect) -> None:
    """Friction that an effect changes never drives: its torque has the sign of the speed, its level is not negative."""
    if not isinstance(effect, FrictionEffect):
        raise NotApplicable("it does not change friction")
    mount = mount_of(effect)
    given = {one.name: one.start or one.nominal for one in effect.inputs()}
    start = [state.start for state in effect.states()]
    for q, v in PLACES:
        motion, states = mount.at(0.0, q, v, given), {effect.id: start}
        level = float(mount.level(motion, states))
        contact = ca.DM.zeros(len(mount.law.states()))
        torque = float(mount.law.contact(contact, v, level)) + float(mount.viscous(motion, states))
        require(np.isfinite(torque) and level >= 0, f"friction level {level:.3g} N m is negative at v = {v:g}.")
        require(torque * v >= 0, f"friction drives: {torque:.3g} N m at v = {v:g} rad/s.")
