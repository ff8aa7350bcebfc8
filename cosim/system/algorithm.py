"""Algorithms: in which order components take their inputs and step, and so how long each wire delays.

    [algorithm]
    kind = "jacobi"                         all inputs are gathered, then all step (the default)
    kind = "gauss-seidel", order = [...]    one after the other, each with the newest values of those before it
    kind = "iterated", components = [...]   those named agree at the end of each step: rollback and iteration
    kind = "energy", bonds = [["a.torque", "b.speed"]]
                                            those named lose little energy: pieces of a step, no rollback

Where no option is wanted, `algorithm = "gauss-seidel"` says the same. A component that steps every n ticks takes its
inputs at the first of them under each algorithm, and is seen after the last.

Components that `iterated` and `energy` do not name step as in `jacobi`. What a wire delays under each is told by
`schedule.delays` and drawn by `cosim show`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from cosim.support.errors import WiringError
from cosim.system.ports import PortRef

Name = str


@dataclass(frozen=True)
class Stage:
    """One stage of a tick, by names: these components gather their inputs, step, or are taken over the tick coupled."""

    what: Literal["gather", "step", "couple"]
    names: tuple[Name, ...]


class _Algorithm(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Jacobi(_Algorithm):
    """All inputs are gathered at the tick, then every component steps; what they compute is seen at the next."""

    kind: Literal["jacobi"] = "jacobi"

    def stages(self, names: Sequence[Name]) -> tuple[Stage, ...]:
        """Return what is done in a tick, in its order."""
        return (Stage("gather", tuple(names)), Stage("step", tuple(names)))


JACOBI = Jacobi()


class GaussSeidel(_Algorithm):
    """One component after the other; each takes the newest values of those before it, and old ones of those after.

    `order` names every component once; without it the order is that of the scenario.
    """

    kind: Literal["gauss-seidel"]
    order: tuple[Name, ...] = ()

    def stages(self, names: Sequence[Name]) -> tuple[Stage, ...]:
        """Return what is done in a tick, in its order."""
        order = self.order or tuple(names)
        if sorted(order) != sorted(names):
            said, have = ", ".join(order), ", ".join(names)
            message = f"The Gauss-Seidel order names {said}; it must name each component once: {have}."
            raise WiringError(message, culprit="order", value=order, choices=tuple(names))
        return tuple(Stage(what, (name,)) for name in order for what in ("gather", "step"))  # type: ignore[arg-type]


class Iterated(_Algorithm):
    """The theta method: a wire between these components holds (1 - theta) y(t_k) + theta y(t_(k+1)) over the step.

    The values at the end are iterated with rollback until each wire that closes a loop repeats itself to `tolerance`,
    relative to the largest value it has carried. theta = 0.5 is of second order, theta = 1 damps most.
    A single such wire takes two or three passes, stiff chains of many components some tens. Algebraic loops inside are
    solved. Needs FMUs that save and restore their state.
    """

    kind: Literal["iterated"]
    components: tuple[Name, ...] = ()
    tolerance: float = Field(default=1e-9, gt=0, lt=1)
    max_iterations: int = Field(default=50, ge=2, le=1_000_000)
    theta: float = Field(default=0.5, ge=0.0, le=1.0)

    def stages(self, names: Sequence[Name]) -> tuple[Stage, ...]:
        """Return what is done in a tick, in its order."""
        return _coupled(names, self.components or tuple(names), "components")


class Energy(_Algorithm):
    """Non-iterative, for FMUs that cannot be taken back: a step is cut into pieces after the energy lost on the bonds.

    A bond is a pair of outputs that feed each other's components and multiply to a power (torque and speed). Each wire
    between the components holds its value at the middle of a piece as the piece before predicts it (for equal pieces
    the correction of NEPCE, Benedikt et al. 2013); the size of the pieces is controlled so that the energy lost in one
    stays below `tolerance` times the greatest power on the bond times the step (ECCO: Sadjina et al., Engineering with
    Computers 33 (2017) 607). Of second order. `max_pieces`, a power of two, is the most there may be in a step; the
    statistics say how often it was not enough.
    """

    kind: Literal["energy"]
    bonds: tuple[tuple[str, str], ...] = Field(min_length=1)
    tolerance: float = Field(default=1e-5, gt=0, lt=1)
    max_pieces: int = Field(default=64, ge=1, le=1 << 20)

    @model_validator(mode="after")
    def _power_of_two(self) -> "Energy":
        if self.max_pieces & (self.max_pieces - 1):
            raise ValueError("max_pieces must be a power of two, so that time stays counted")
        return self

    def stages(self, names: Sequence[Name]) -> tuple[Stage, ...]:
        """Return what is done in a tick, in its order."""
        owners = tuple(dict.fromkeys(PortRef(output).owner for bond in self.bonds for output in bond))
        return _coupled(names, owners, "bonds")


def _named(value: Any) -> Any:
    """Let `algorithm = "gauss-seidel"` stand for the kind alone."""
    return {"kind": value} if isinstance(value, str) else value


Algorithm = Annotated[Jacobi | GaussSeidel | Iterated | Energy, Field(discriminator="kind"), BeforeValidator(_named)]


def _coupled(names: Sequence[Name], members: tuple[Name, ...], key: str) -> tuple[Stage, ...]:
    for name in members:
        if name not in names:
            message = f'algorithm.{key} names "{name}", which is no component; components are: {", ".join(names)}.'
            raise WiringError(message, culprit=name, choices=tuple(names))
    others = tuple(name for name in names if name not in members)
    gather = Stage("gather", (*others, *members))
    return (gather, *((Stage("step", others),) if others else ()), Stage("couple", members))
