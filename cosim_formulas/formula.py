"""A formula in the place of a learned table: the shortest closed form that is as good on recordings it has not seen.

    f(x) = sum_i c_i A_i(x) B_i(y),   left = f g + X d + e

A, B closed forms (`forms.py`), d what the base's fitted numbers move by beside it. Numbers inside the forms are fitted
by variable projection in training; of each length the best there is asked on the held-out recordings, shortest first,
and is proposed where its loss is within a standard error of the table's.
References: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; Breiman et al., CART (1984), 3.4.3 for the rule.
"""

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cosim.diagnosis.terms.partial import Partial
from cosim.estimation.blocks import Blocks, sandwich
from cosim.estimation.prepare import Array
from cosim.support.statistics import Z95, rms
from cosim_formulas.forms import FADE, FORMS, SECOND, Form

ROWS = 1500
"""Rows of the search; the formula that is found is fitted to all."""
BETTER = 1e-3
"""Share of the loss that a longer formula must remove in training to be asked at all."""
BEST = 4
"""Single shapes that sums are made with."""
STEPS = 40


@dataclass(frozen=True)
class Shape:
    """One summand without its coefficient: a form of the first quantity, times one of the second if there is one."""

    first: Form | None
    second: Form | None = None

    @property
    def parts(self) -> tuple[tuple[int, Form], ...]:
        """Forms with the number of the quantity of each."""
        return tuple((k, one) for k, one in enumerate((self.first, self.second)) if one)

    @property
    def count(self) -> int:
        """Numbers inside."""
        return sum(len(form.numbers) for _, form in self.parts)


@dataclass(frozen=True)
class Formula:
    """Summands with their numbers; numbers of a form that stands in several summands are the same."""

    shapes: tuple[Shape, ...]
    tops: tuple[float, ...]
    """Largest size seen of each quantity."""
    inner: tuple[float, ...] = ()
    coefficients: tuple[float, ...] = ()
    errors: tuple[float, ...] = ()
    """Standard errors: of the inner numbers, then of the coefficients."""

    @property
    def forms(self) -> tuple[tuple[int, Form], ...]:
        """Forms with numbers, each once, in order."""
        return tuple(dict.fromkeys(part for shape in self.shapes for part in shape.parts if part[1].numbers))

    @property
    def length(self) -> int:
        """Numbers and forms: how much there is to read, in halves.

        A number inside a form is read twice; of two powers the lower one is the shorter, a free one is none of them.
        """
        parts = [form for shape in self.shapes for _, form in shape.parts]
        powers = sum(max(0, form.power - 1) for form in parts)
        return 2 * (len(self.shapes) + len(parts) + 2 * sum(len(form.numbers) for _, form in self.forms)) + powers

    def placed(self) -> dict[tuple[int, Form], range]:
        """Where the numbers of each form are, among the inner ones."""
        edges = np.cumsum([0, *(len(form.numbers) for _, form in self.forms)])
        return {one: range(int(a), int(b)) for one, (a, b) in zip(self.forms, pairwise(edges), strict=True)}

    def columns(self, quantities: Sequence[Array], inner: Sequence[float]) -> Array:
        """Value of each summand, (rows, summands)."""
        placed = self.placed()
        out = []
        for shape in self.shapes:
            column = np.ones(len(quantities[0]))
            for k, form in shape.parts:
                numbers = [inner[i] for i in placed.get((k, form), ())]
                column = column * form.value(quantities[k], numbers, self.tops[k])
            out.append(column)
        return np.column_stack(out)

    def value(self, quantities: Sequence[Array]) -> Array:
        """Return f."""
        return np.asarray(self.columns(quantities, self.inner) @ np.array(self.coefficients))


@dataclass(frozen=True, eq=False)
class Rows:
    """Weighted rows of a term: quantities, what is left, what one of it adds, what the base's numbers add."""

    quantities: tuple[Array, ...]
    left: Array
    unit: Array
    slopes: Array

    @classmethod
    def of(cls, part: Partial, slopes: Array) -> "Rows":
        """Weigh the rows of a term."""
        quantities = (part.over,) if part.by is None else (part.over, part.by)
        w = part.weight
        return cls(quantities, w * part.left, w * part.unit, w[:, None] * slopes)

    def thinned(self) -> "Rows":
        """Every so many rows, so that a search is quick."""
        step = max(1, len(self.left) // ROWS)
        thin = (one[::step] for one in (self.left, self.unit, self.slopes))
        return Rows(tuple(one[::step] for one in self.quantities), *thin)


@dataclass(frozen=True)
class Search:
    """A search on some rows: the base's numbers are taken out of everything first."""

    rows: Rows
    basis: Array
    target: Array

    @classmethod
    def of(cls, rows: Rows) -> "Search":
        """Prepare a search."""
        u, s, _ = np.linalg.svd(rows.slopes / (np.linalg.norm(rows.slopes, axis=0) + 1e-300), full_matrices=False)
        basis = u[:, s > 1e-8 * s.max()] if s.size else u
        return cls(rows, basis, rows.left - basis @ (basis.T @ rows.left))

    def beyond(self, formula: Formula, inner: Sequence[float]) -> Array:
        """What the formula leaves with its best coefficients."""
        columns = formula.columns(self.rows.quantities, inner) * self.rows.unit[:, None]
        columns = columns - self.basis @ (self.basis.T @ columns)
        size = np.linalg.norm(columns, axis=0) + 1e-300
        found = np.linalg.lstsq(columns / size, self.target, rcond=1e-8)[0]
        return np.asarray(self.target - (columns / size) @ found)

    def fitted(self, formula: Formula) -> tuple[float, Formula]:
        """The loss and the formula with the best inner numbers, from the best start of a grid."""
        from scipy.optimize import least_squares  # a tenth of a second that most diagnoses do not need

        starts = list(_starts(formula, self.rows.quantities))
        losses = [float(np.sum(self.beyond(formula, one) ** 2)) for one in starts]
        best = int(np.argmin(losses))
        if not formula.forms:
            return losses[0], formula
        low, high = _bounds(formula, self.rows.quantities)
        found = least_squares(
            functools.partial(self.beyond, formula),
            np.clip(starts[best], low + 1e-9 * (high - low), high - 1e-9 * (high - low)),
            bounds=(low, high),
            x_scale=high - low,
            max_nfev=STEPS,
        )
        return 2 * float(found.cost), replace(formula, inner=tuple(map(float, found.x)))


def fading(rows: Rows) -> list[Formula]:
    """What fades after a reversal has one form: the others would need to know when that was."""
    return [Search.of(rows.thinned()).fitted(Formula((Shape(FADE),), _tops(rows)))[1]]


def _tops(rows: Rows) -> tuple[float, ...]:
    return tuple(float(np.abs(one).max()) for one in rows.quantities)


def shortest(rows: Rows) -> list[Formula]:
    """The best formula of each length, shortest first; a longer one only where it fits better."""
    search, tops = Search.of(rows.thinned()), _tops(rows)
    singles = sorted((search.fitted(Formula(shapes, tops)) for shapes in _singles(len(tops))), key=lambda one: one[0])
    tried = [*singles, *(search.fitted(Formula(s, tops)) for s in _sums([one for _, one in singles[:BEST]], len(tops)))]
    best: list[Formula] = []
    least = np.inf
    for loss, formula in sorted(tried, key=lambda one: (one[1].length, one[0])):
        if loss < (1 - BETTER) * least:
            best, least = [*best, formula], loss
    return best


def complete(formula: Formula, rows: Rows, part: Partial) -> tuple[Formula, Array] | None:
    """The formula fitted to all rows, with standard errors, and what the base's numbers move by."""
    shaped = formula.columns(rows.quantities, formula.inner) * rows.unit[:, None]
    columns = np.column_stack([shaped, rows.slopes])
    size = np.linalg.norm(columns, axis=0) + 1e-300
    beta = np.linalg.lstsq(columns / size, rows.left, rcond=1e-8)[0] / size
    many = len(formula.shapes)
    whole = replace(formula, coefficients=tuple(map(float, beta[:many])))
    inner = _inner_slopes(whole, rows)
    scale = np.linalg.norm(inner, axis=0) + 1e-300
    every = np.column_stack([inner / scale, columns / size])
    variance = np.diag(sandwich(every, rows.left - columns @ beta, part.blocks))
    spread = np.where(variance >= 0, np.sqrt(np.abs(variance)), np.nan)  # less than none: nothing is known
    errors = spread / np.concatenate([scale, size])
    told = tuple(map(float, errors[: inner.shape[1] + many]))
    return (replace(whole, errors=told), beta[many:]) if np.isfinite(told).all() else None


def _inner_slopes(formula: Formula, rows: Rows) -> Array:
    """Derivatives by the inner numbers, by differences."""
    out = []
    for k, value in enumerate(formula.inner):
        step = 1e-5 * (abs(value) + 1e-6)
        moved = [(*formula.inner[:k], value + sign * step, *formula.inner[k + 1 :]) for sign in (1, -1)]
        above, below = (replace(formula, inner=one).value(rows.quantities) for one in moved)
        out.append(rows.unit * (above - below) / (2 * step))
    return np.column_stack(out) if out else np.zeros((len(rows.left), 0))


CONSTANT = Shape(None)


def _singles(quantities: int) -> Iterator[tuple[Shape, ...]]:
    """One form, also beside a constant, or a product of two.

    (a + b y) A(x) says where a line of y begins, and with c y beside it where A does.
    """
    for form in FORMS:
        yield (Shape(form),)
        yield (Shape(form), CONSTANT)
    for second in SECOND if quantities > 1 else ():
        yield (Shape(None, second),)
        for form in FORMS:
            yield (Shape(form, second),)
            yield (Shape(form), Shape(form, second))
            yield (Shape(form), Shape(form, second), Shape(None, second))


def _sums(best: Sequence[Formula], quantities: int) -> Iterator[tuple[Shape, ...]]:
    """The best alone and one form more."""
    single = [one.shapes for one in best if len(one.shapes) == 1]
    for shapes in single:
        yield from ((*shapes, Shape(form)) for form in FORMS if Shape(form) not in shapes)
        if quantities > 1:
            yield from ((*shapes, Shape(None, form)) for form in SECOND if Shape(None, form) not in shapes)


def _starts(formula: Formula, quantities: Sequence[Array]) -> Iterator[list[float]]:
    """Grid of each form with numbers, those of the others in the middle of theirs."""
    grids = [form.starts(float(quantities[k].min()), float(quantities[k].max())) for k, form in formula.forms]
    middle = [grid[len(grid) // 2] for grid in grids]
    yield [one for numbers in middle for one in numbers]
    for which, grid in enumerate(grids):
        for numbers in grid:
            yield [one for k, own in enumerate(middle) for one in (numbers if k == which else own)]


def _bounds(formula: Formula, quantities: Sequence[Array]) -> tuple[Array, Array]:
    pairs = [form.bounds(float(quantities[k].min()), float(quantities[k].max())) for k, form in formula.forms]
    return np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs])


def interval(value: float, error: float) -> list[float]:
    """95 % range of a number."""
    return [value - Z95 * error, value + Z95 * error]


KEPT = 0.8
"""Share of the table's held-out gain that a formula must keep."""
LARGEST = 3.0
"""RMS of what a formula says, at most, relative to what is left without it. A larger one lives by what it takes out of
the base: a loss of all of the drive's torque, and a machine that needs none, leave no error either."""


@dataclass(frozen=True, eq=False)
class Unseen:
    """Held-out rows of a term, and the weighted errors there: with the table, and without any term."""

    rows: Rows
    blocks: Blocks
    table: Array
    nothing: Array

    def losses(self, error: Array) -> Array:
        """Mean square of each block."""
        return np.array([float(np.mean(error[own] ** 2)) for own in self.blocks.rows])

    def residual(self, formula: Formula, moved: Array) -> Array:
        """Weighted error with a formula, the base moved as it was in training."""
        value = formula.value(self.rows.quantities)
        return np.asarray(self.rows.left - self.rows.unit * value - self.rows.slopes @ moved)

    def is_of_its_size(self, formula: Formula) -> bool:
        """Whether a formula says no more than what there is to be said."""
        said = self.rows.unit * formula.value(self.rows.quantities)
        return rms(said) <= LARGEST * rms(self.rows.left)

    def is_as_good(self, formula: Formula, moved: Array) -> bool:
        """Whether the loss is within a standard error of the table's, and most of what that gained is kept."""
        own, table, nothing = (self.losses(one) for one in (self.residual(formula, moved), self.table, self.nothing))
        error = float(np.std(table, ddof=1) / np.sqrt(len(table))) if len(table) > 1 else 0.0
        gained = nothing.mean() - own.mean() >= KEPT * (nothing.mean() - table.mean())
        return bool(own.mean() <= table.mean() + error and gained)


def proposed(part: Partial, train: Rows, unseen: Unseen) -> Formula | None:
    """The shortest formula that is as good as the table; None where none is."""
    return first_as_good(fading(train) if part.effect.since() else shortest(train), part, train, unseen)


def first_as_good(formulas: Sequence[Formula], part: Partial, train: Rows, unseen: Unseen) -> Formula | None:
    """The first of some formulas, fitted to all rows of training, that is as good as the table."""
    for formula in formulas:
        found = complete(formula, train, part)
        if found and unseen.is_of_its_size(found[0]) and unseen.is_as_good(*found):
            return found[0]
    return None
