"""Residuals of a calibration and their derivatives by finite differences.

    z = w (y(p) - y_measured),   one row a number that was measured, w a weight for each output

The step of a difference is chosen by noise: it moves the rows by `SHARE` of what one standard error would, so that the
model is as good as linear over it, but by no less than `FLOOR` of an output's spread, far above what a solver's
tolerance makes of two runs. A model whose events fall on steps of its own is a staircase at small scales: `settle`
looks for the widest step over which it is as good as linear, below which none is taken. Differences are central,
one-sided at a bound or beside a point that cannot be simulated. Start values of different experiments move together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from cosim_calibration.experiment import Array, Experiment
from cosim_calibration.free import Free
from cosim_calibration.processes import Processes
from cosim_calibration.simulation import Outputs

SHARE = 0.3
FLOOR = 1e-4
FIRST, LEAST, MOST = 1e-3, 1e-9, 0.1
"""Steps relative to a number's size: the first one, and the least and greatest."""
AGREE = 0.2
"""Share by which slopes at two scales may differ where the model is smooth."""
NEARLY = 0.5
"""Share from which on narrower slopes that differ more than wider ones are those of a staircase."""
AGREE_OWN = 0.02
"""Share by which derivatives that an FMU gives may differ from differences to be taken."""
STAIRS = 0.5
"""Share by which slopes at the smallest scale differ from those at the settled one where a model is a staircase."""
WIDER = 4.0
"""Factor from one scale to the next."""
KEPT = 4
"""Simulations that are kept, for each number."""


@dataclass(frozen=True)
class Rows:
    """The measured numbers of all experiments in one column: where each is from."""

    measured: Array
    output: npt.NDArray[np.intp]
    """Which output each row is of."""
    names: tuple[str, ...]
    spread: Array
    """RMS of each output about its mean; 1 where it is constant at 0."""
    seen: tuple[tuple[npt.NDArray[np.bool_], ...], ...]
    runs: tuple[slice, ...]
    """Rows of each experiment and output, in their order."""
    parts: tuple[slice, ...]
    """Rows of each experiment."""

    @classmethod
    def of(cls, experiments: Sequence[Experiment]) -> "Rows":
        """Put the outputs of experiments below each other."""
        names = tuple(dict.fromkeys(name for one in experiments for name in one.outputs))
        seen = tuple(tuple(np.isfinite(values) for values in one.outputs.values()) for one in experiments)
        parts = [values[np.isfinite(values)] for one in experiments for values in one.outputs.values()]
        numbers = [names.index(name) for one in experiments for name in one.outputs]
        output = np.concatenate([np.full(len(part), k) for part, k in zip(parts, numbers, strict=True)])
        measured = np.concatenate(parts)
        ends = np.cumsum([len(part) for part in parts])
        runs = tuple(slice(int(end - len(part)), int(end)) for end, part in zip(ends, parts, strict=True))
        spread = np.array([_spread(measured[output == k]) for k in range(len(names))])
        last = np.cumsum([len(one.outputs) for one in experiments]).tolist()
        spans = tuple(slice(runs[0 if k == 0 else last[k - 1]].start, runs[last[k] - 1].stop) for k in range(len(last)))
        return cls(measured, output, names, spread, seen, runs, spans)

    def of_outputs(self, outputs: Outputs) -> Array:
        """Simulated numbers in the same order."""
        pairs = (pair for masks, run in zip(self.seen, outputs, strict=True) for pair in zip(masks, run, strict=True))
        return np.concatenate([values[mask] for mask, values in pairs])


@dataclass(frozen=True)
class Slopes:
    """Derivatives d z / d x at a point, with the weights that z had, and whether differences were central."""

    point: bytes
    weights: Array
    columns: Array
    central: bool


@dataclass
class Residuals:
    """Residuals z at points x = p / scale; keeps the steps that derivatives have found to be good."""

    processes: Processes
    free: tuple[Free, ...]
    rows: Rows
    weights: Array
    part: slice
    steps: Array = field(init=False)
    bad: float = 0.0
    """What a row is at a point that cannot be simulated."""

    def __post_init__(self) -> None:
        self.scales = np.array([one.scale for one in self.free])
        self.steps = FIRST * np.ones(len(self.free))
        self.least = LEAST * np.ones(len(self.free))
        self.stairs = False
        self.quick = False
        """Whether differences are one-sided: half as dear, good enough to come near a minimum."""
        self.rough: tuple[str, ...] = ()
        self.groups = groups_of(self.free)
        """Numbers that one simulation moves together."""
        self.reach = [slice(None) if one.experiment < 0 else self.rows.parts[one.experiment] for one in self.free]
        """Rows that each number moves."""
        self.notes: tuple[str, ...] = ()
        self.own: tuple[int, ...] = ()
        """Numbers whose derivatives the FMU gives."""
        self._known: dict[bytes, Outputs | None] = {}
        self._slopes: Slopes | None = None

    def point(self, x: Array) -> Mapping[str, float]:
        """Values by name."""
        inside = ((one, float(np.clip(v * one.scale, one.low, one.high))) for one, v in zip(self.free, x, strict=True))
        return {one.name: value for one, value in inside}

    def inside(self, x: Array) -> Array:
        """The nearest point within the bounds."""
        low = np.array([one.low for one in self.free]) / self.scales
        high = np.array([one.high for one in self.free]) / self.scales
        return np.asarray(np.clip(x, low, high), np.float64)

    def know(self, x: Array, outputs: Outputs) -> None:
        """Take the outputs at a point as known."""
        self._known[x.tobytes()] = outputs

    def outputs(self, x: Array) -> Outputs | None:
        """Outputs at a point, by experiment."""
        self.simulated([x])
        return self._known[x.tobytes()]

    def simulated(self, points: Sequence[Array]) -> list[Array | None]:
        """Outputs at points, in rows; None where there are none, or one is no number."""
        keys = list(dict.fromkeys(x.tobytes() for x in points))
        new = [x for x in keys if x not in self._known]
        found = self.processes.at([self.point(np.frombuffer(x)) for x in new], self.part) if new else []
        self._known |= dict(zip(new, found, strict=True))
        rows = {x: self._rows(self._known[x]) for x in keys}
        for old in list(self._known)[: -KEPT * (len(self.groups) + 1)]:
            if old not in rows:
                del self._known[old]
        return [rows[x.tobytes()] for x in points]

    def _rows(self, outputs: Outputs | None) -> Array | None:
        values = None if outputs is None else self.rows.of_outputs(outputs)
        return values if values is not None and np.isfinite(values).all() else None

    def at(self, x: Array) -> Array:
        """Residuals at a point."""
        return self.many([x])[0]

    def many(self, points: Sequence[Array]) -> list[Array]:
        """Residuals at points; where a point cannot be simulated, all rows are large."""
        return [
            np.full(len(self.rows.measured), self.bad) if one is None else self._residual(one)
            for one in self.simulated(points)
        ]

    def _residual(self, values: Array) -> Array:
        return self.weights[self.rows.output] * (values - self.rows.measured)

    def jacobian(self, x: Array, final: bool = False) -> Array:
        """Derivatives d z / d x at a point, shape (rows, numbers); the `final` ones are of central differences.

        Those of the same point are taken again, with other weights: the simulations would be the same.
        """
        kept, here = self._slopes, None
        if kept is not None and kept.point == x.tobytes() and (kept.central or not final):
            columns = kept.columns * (self.weights / kept.weights)[self.rows.output][:, None]
            (here,) = self.simulated([x])
        else:
            columns, here = self._derivatives(x, self.steps)
            self._slopes = None if self.quick else Slopes(x.tobytes(), self.weights, columns, True)
        if here is not None:
            self._learn(columns, self._residual(here), np.maximum(np.abs(x), 1.0))
        return columns

    def settle(self, x: Array) -> None:
        """Find for each number the widest step near a point over which the model is as good as linear.

        Slopes over a step and over a quarter of it agree there, or at narrower steps differ more. Where they agree, a
        central difference over the quarter is wrong by a sixteenth of that. Where the smallest steps see the same
        slopes, these are taken: what two numbers that act only as a product leave must be far below noise. `rough` are
        numbers for which no two steps agree; `stairs` says that the smallest steps see other slopes: a staircase around
        a smooth course.
        """
        if self._is_smooth(x):
            return
        steps = MOST * np.ones(len(self.free))
        wide, here = self._differences(x, steps)
        if here is None:
            return
        floor = np.minimum(self._wanted(wide, 0.0, np.maximum(np.abs(x), 1.0)), FIRST)
        agree, before = np.zeros(len(x), bool), np.full(len(x), np.inf)
        while np.any(~agree & (steps > floor)):
            narrow = np.where(agree, steps, np.maximum(steps / WIDER, floor))
            fine = self._differences(x, narrow)[0]
            gap = _apart(fine, wide)
            worse = ~agree & (before < NEARLY) & (gap > before)
            steps, wide = np.where(worse, steps, narrow), np.where(worse, wide, fine)
            agree |= worse | (gap <= AGREE)
            before = gap
        fine = self._differences(x, np.minimum(floor, steps))[0]
        gap = _apart(fine, wide)
        self.least = np.where(agree & (gap <= AGREE), np.minimum(floor, steps), steps)
        self.stairs = bool(np.any(agree & (gap > STAIRS)))
        self.rough = tuple(one.name for one, is_smooth in zip(self.free, agree, strict=True) if not is_smooth)

    def _is_smooth(self, x: Array) -> bool:
        """Whether slopes to one side agree over the greatest and the smallest steps; these are good then."""
        quick, self.quick = self.quick, True
        wide, here = self._differences(x, MOST * np.ones(len(self.free)))
        floor = np.minimum(self._wanted(wide, 0.0, np.maximum(np.abs(x), 1.0)), FIRST)
        fine = wide if here is None else self._derivatives(x, floor)[0]
        self.quick = quick
        shared = [k for k in range(len(x)) if k not in self.own]
        if here is None or np.any(_apart(fine, wide)[shared] > AGREE):
            return False
        self.least, self.stairs, self.rough = floor, False, ()
        self._slopes = Slopes(x.tobytes(), self.weights, fine, False)
        return True

    def use_directional(self, x: Array) -> tuple[str, ...]:
        """Take the FMU's own derivatives where they agree with differences at a point; returns notes on where not."""
        shared = [k for k, one in enumerate(self.free) if one.experiment < 0]
        exact = self._directional(x, shared)
        names = [self.free[k].name for k in shared]
        if exact is None:
            return (f"The FMU gives no directional derivatives by {', '.join(names)}: differences are used.",)
        gap = _apart(exact, self._differences(x, self.steps)[0][:, shared])
        self.own = tuple(k for k, one in zip(shared, gap, strict=True) if one <= AGREE_OWN)
        self.groups = [one for one in self.groups if not set(one) & set(self.own)]
        return tuple(
            f"The FMU's derivatives by {name} are {100 * one:.0f} % from differences, which are used in their place."
            for name, one in zip(names, gap, strict=True)
            if one > AGREE_OWN
        )

    def _directional(self, x: Array, numbers: Sequence[int]) -> Array | None:
        """Derivatives d z / d x by some numbers, by the FMU itself."""
        names = [self.free[k].name for k in numbers]
        found = self.processes.slopes(self.point(x), self.part, names) if numbers else None
        if found is None:
            return None
        pairs = (
            pair for masks, run in zip(self.rows.seen, found, strict=True) for pair in zip(masks, run, strict=True)
        )
        slopes = np.concatenate([values[mask] for mask, values in pairs])
        return np.asarray(self.weights[self.rows.output][:, None] * slopes * self.scales[list(numbers)], np.float64)

    def _derivatives(self, x: Array, steps: Array) -> tuple[Array, Array | None]:
        """Derivatives by the FMU where they are taken, else by differences; and the outputs at the point."""
        columns, here = self._differences(x, steps)
        if self.own and (exact := self._directional(x, self.own)) is not None:
            columns[:, list(self.own)] = exact
        return columns, here

    def _differences(self, x: Array, steps: Array) -> tuple[Array, Array | None]:
        """Derivatives with these relative steps, and the outputs at the point."""
        size = np.maximum(np.abs(x), 1.0)
        low = np.array([one.low for one in self.free]) / self.scales
        high = np.array([one.high for one in self.free]) / self.scales
        up, down = np.minimum(x + steps * size, high), np.maximum(x - steps * size, low)
        if self.quick:
            up = np.where(up - x < x - down, down, up)  # a bound leaves more room on the other side
        points = [_moved(x, group, values) for values in ((up,) if self.quick else (up, down)) for group in self.groups]
        here, *found = self.simulated([x, *points])
        found += [None] * (2 * len(self.groups) - len(points))
        columns, weights = np.zeros((len(self.rows.measured), len(x))), self.weights[self.rows.output]
        for group, above, below in zip(self.groups, found, found[len(self.groups) :], strict=False):
            for k in group:
                ends = [(up[k], above), (down[k], below), (x[k], here)]
                good = [(at, values) for at, values in ends if values is not None]
                if len(good) > 1 and good[0][0] != good[1][0]:
                    (first, upper), (second, lower) = good[:2]
                    rows = self.reach[k]
                    columns[rows, k] = weights[rows] * (upper[rows] - lower[rows]) / (first - second)
        return columns, here

    def _learn(self, columns: Array, z: Array, size: Array) -> None:
        """Choose the next steps."""
        self.steps = np.maximum(self._wanted(columns, SHARE * float(np.sqrt(np.mean(z**2))), size), self.least)

    def _wanted(self, columns: Array, noise: float, size: Array) -> Array:
        """Relative steps that move the rows by a norm of `noise`, and by no less than `FLOOR` asks for."""
        least = (FLOOR * self.weights * self.rows.spread)[self.rows.output] ** 2
        floor = np.array([np.sqrt(np.sum(least[rows])) for rows in self.reach])
        slopes = np.linalg.norm(columns, axis=0)
        wanted = np.divide(np.maximum(noise, floor), slopes, out=np.full(len(slopes), np.inf), where=slopes > 0)
        steps: Array = np.clip(wanted / size, LEAST, MOST)
        return steps


def groups_of(free: Sequence[Free]) -> list[list[int]]:
    """Numbers whose derivatives one simulation gives: each alone, or one start value of every experiment."""
    shared = [[k] for k, one in enumerate(free) if one.experiment < 0]
    own: dict[int, list[int]] = {}
    for k, one in enumerate(free):
        if one.experiment >= 0:
            own.setdefault(one.experiment, []).append(k)
    most = max((len(numbers) for numbers in own.values()), default=0)
    return shared + [[numbers[place] for numbers in own.values() if place < len(numbers)] for place in range(most)]


def _moved(x: Array, numbers: Sequence[int], values: Array) -> Array:
    moved = x.copy()
    moved[numbers] = values[numbers]
    return moved


def _apart(one: Array, other: Array) -> Array:
    """How far apart columns are, relative to the larger of both."""
    size = np.maximum(np.linalg.norm(one, axis=0), np.linalg.norm(other, axis=0))
    gap = np.linalg.norm(one - other, axis=0)
    return np.asarray(np.divide(gap, size, out=np.zeros(len(size)), where=size > 0), np.float64)


def _spread(values: Array) -> float:
    return float(np.std(values)) or float(np.abs(values).max()) or 1.0
