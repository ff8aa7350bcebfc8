"""How a plant's equations come about, overheard while the mount writes them.

Each part of the mount, and the mount itself, is replaced by a listening copy, which notes what its methods return:
`friction.level`, `cogging.load`, `loads`. So a reader gets the quantities of the one source, in its order.
"""

from collections.abc import Callable
from dataclasses import fields, replace
from functools import wraps
from typing import Any, Self

import casadi as ca

from pyfmi_models.friction import FrictionLaw
from pyfmi_models.model import Derivation, Pair, Scalar, Variable
from pyfmi_models.mount import Mount
from pyfmi_models.plant import written

_WORDS = (
    Variable(name="applied", unit="N.m", description="Torque that comes out"),
    Variable(name="stiffness", unit="N.m/rad", description="Stiffness of an element"),
    Variable(name="level", unit="N.m", description="Friction level"),
    Variable(name="viscous", unit="N.m", description="Viscous torque"),
    Variable(name="contact", unit="N.m", description="Contact torque of the friction law"),
    Variable(name="load", unit="N.m", description="Torque, resists"),
    Variable(name="loads", unit="N.m", description="Sum of the loads beside friction, resists"),
    Variable(name="payload", unit="N.m", description="Torque of the weights on the axis"),
    Variable(name="share", unit="1", description="Share of the inertia on the far side"),
    Variable(name="torque", unit="N.m", description="Torque passed on to the far side"),
    Variable(name="drag", unit="N.m", description="Friction torque on the far side, resists"),
    Variable(name="inertia", unit="kg.m2", description="Inertia"),
    Variable(name="reading", unit="rad", description="Reading"),
    Variable(name="ahead", unit="s", description="Time by which the reading is ahead of the torque"),
)
"""Methods whose results a reader wants to see by name."""
_OF_MOUNT = ("level", "viscous", "loads", "payload", "inertia")
"""Those of the mount itself that are more than a call of its parts."""

_SYMBOLS = {"position": "q", "speed": "v", "der(speed)": "a", "tau": "command", "temperature": "T"}
"""What textbooks call the motion of the axis."""

Observer = Callable[[str, Variable, Scalar], None]


def derivation_of(mount: Mount) -> Derivation:
    """Return the derivation of `mount.model()`: its quantities in the order of writing."""
    observed: dict[str, tuple[Variable, Any]] = {}
    point, following, shown = written(_listening_mount(mount, lambda *told: _note(observed, *told)))
    told = ca.vertcat(ca.SX(0, 1), *(value for _, value in observed.values()))
    results = [following, ca.vertcat(*shown.values()), told]
    return Derivation(
        quantities=tuple(mount.in_axis_units(variable) for variable, _ in observed.values()),
        symbols=_SYMBOLS,
        equations=ca.Function("derivation", point, results, ["t", "x", "u", "p"], ["next", "y", "quantities"]),
    )


def _note(observed: dict[str, tuple[Variable, Any]], name: str, variable: Variable, value: Scalar) -> None:
    """Keep a value under its name, each entry of a column under its number, a further one of the same name too."""
    entries = ca.vertsplit(ca.SX(value))
    for index, entry in enumerate(entries):
        full = f"{name}_{index + 1}" if len(entries) > 1 else name
        again = sum(one == full or one.startswith(f"{full}_again") for one in observed)
        full = f"{full}_again{again if again > 1 else ''}" if again else full
        observed[full] = (replace(variable, name=full), entry)


def _listening_mount(mount: Mount, observe: Observer) -> Mount:
    class Listening(Mount):
        def with_symbols(self, symbols: dict[str, Scalar], v: Scalar) -> Self:
            this = super().with_symbols(symbols, v)
            _hear_pairs(mount, this, observe)
            axis, *rest = (_listening(part, f"{prefix}.", observe) for prefix, part in this.components().items())
            return replace(this, axis=axis, friction=rest[0], effects=tuple(rest[1:]))

        @property
        def law(self) -> FrictionLaw:
            law: FrictionLaw = super().law
            return law if law is self.friction else _listening(law, "friction.", observe)

    copy: Mount = _listening(mount, "", observe, Listening, _OF_MOUNT)
    return copy


def _hear_pairs(mount: Mount, this: Mount, observe: Observer) -> None:
    """Name what a number that differs by direction is now."""
    for (prefix, part), symbolic in zip(mount.components().items(), this.components().values(), strict=True):
        for one in fields(part):
            if isinstance(getattr(part, one.name), Pair):
                observe(f"{prefix}.{one.name}", one.metadata["variable"], getattr(symbolic, one.name))


def _listening(
    part: Any, prefix: str, observe: Observer, base: type[Any] | None = None, names: tuple[str, ...] | None = None
) -> Any:
    """Copy a part into a class whose methods tell `observe` what they return."""
    base = base or type(part)
    wanted = [word for word in _WORDS if hasattr(base, word.name) and (names is None or word.name in names)]
    methods = {word.name: _observed(getattr(base, word.name), prefix, word, observe) for word in wanted}
    return type(base.__name__, (base,), methods)(**{one.name: getattr(part, one.name) for one in fields(part)})


def _observed(method: Callable[..., Any], prefix: str, word: Variable, observe: Observer) -> Callable[..., Any]:
    @wraps(method)
    def tell(*arguments: Any) -> Any:
        value = method(*arguments)
        observe(prefix + word.name, word, value)
        return value

    return tell
