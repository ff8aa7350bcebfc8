"""A machine that becomes another one in the middle of a recording: a load that comes or goes, a part that gives way.

Of one recording's kept rows, r what the model leaves of the torque:

    r = C b + d k H(t - t1) + e

C are shapes that a model may have wrong all the time: a constant, a weight, waves of the position, each alone and as a
level of friction, friction over speed, inertia. k is one of them alone. The change is told where k from t1 on takes
half of the energy that C leaves, and more than the same k with smooth waves of time does: what changes slowly is wear,
or warmth. Of six generated machines onto which a payload comes four are told so (two times were compared: within .1 s);
of 67 others, a half of them rough, none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from cosim.diagnosis.answer.doubt_entry import Sanity
from cosim.diagnosis.decide.policy import POLICY
from cosim.diagnosis.trust.balance import ROWS_A_COLUMN
from cosim.estimation.prepare import Array, Prepared
from cosim.estimation.residuals import kept
from cosim.estimation.row_weights import weights
from cosim.support.statistics import column_rms
from pyfmi_models.mount import Mount

CELLS, FINER = 24, 16
"""Cells of a recording's time, at whose edges a change is looked for, then at so many places beside the best one."""
LEAST_SIDE, TURNS = 0.1, 2
"""Share of the rows that must lie before a change and after it, and turns of the motion. Of fewer turns a place or a
direction is visited on one side only, and what it lacks looks like a change."""
WAVES = 4
"""Waves over the range of positions, and over the time in which something changes slowly."""
SIGN, BENDS = 0.003, (0.02, 0.1, 0.3)
"""Speeds at which friction sets in and bends, in the fastest. Unit: 1."""
UNITS = {
    "constant torque": ("N·m", "N"),
    "weight": ("N·m", "N"),
    "friction level": ("N·m", "N"),
    "inertia": ("kg·m²", "kg"),
    "drag": ("N·m·s/rad", "N·s/m"),
}
"""What may change, and its unit where an axis turns and where it moves along."""


@dataclass(frozen=True)
class Change:
    """What of a machine is another from a time on [s], by how much, and its share of what the model leaves."""

    what: str
    start: float
    size: float
    share: float


def changes(several: Sequence[Prepared], mount: Mount) -> tuple[Sanity, ...]:
    """Say where a machine changes within a recording, beside a model of it."""
    said = []
    for prepared in several:
        residual, says = kept(prepared, mount), weights(mount.friction, prepared) > 0
        for number, name in enumerate(prepared.names):
            rows = (prepared.recording_of == number) & says
            found = _change(prepared, residual, rows, mount.motion == "rotary") if rows.any() else None
            said += [_words(name, found, mount.motion == "linear")] if found else []
    return tuple(Sanity(finding="change_at_a_time", statement=text) for text in said)


def _words(name: str, found: Change, linear: bool) -> str:
    what = "constant force" if linear and found.what == "constant torque" else found.what
    article = "an" if what[0] in "aeiou" else "a"
    more = (
        f"{article} {what} of {abs(found.size):.3g} {UNITS[found.what][linear]} {'more' if found.size > 0 else 'less'}"
    )
    return (
        f"{name} becomes another machine in the middle: from t = {found.start:.4g} s on it needs {more}, which "
        f"explains {100 * found.share:.0f} % of the error that is left. A load came or went, or a part gave way; "
        "effects that are named may stand for it. Analyse what lies before and after as two recordings."
    )


def _change(prepared: Prepared, residual: Array, rows: Array, turns: bool) -> Change | None:
    t, q, v, a = (prepared.stacked(name)[rows] for name in "tqva")
    always, kinds = _shapes(q, v, a, turns)
    if len(t) < ROWS_A_COLUMN * always.shape[1]:
        return None
    rest = _Rest.of(always, residual[rows])
    tried = [
        (rest.gain(shape * (t >= start)[:, None]), what, start)
        for start in _starts(t, v, np.linspace(t[0], t[-1], CELLS + 1)[1:-1])
        for what, shape in kinds.items()
    ]
    if not tried:
        return None
    _, what, near = max(tried)
    shape, cell = kinds[what], (t[-1] - t[0]) / CELLS
    finer = _starts(t, v, near + cell * np.linspace(-1, 1, 2 * FINER + 1))
    gain, start = max((rest.gain(shape * (t >= start)[:, None]), start) for start in finer)
    slow = [shape * np.cos(pi * k * (t - t[0]) / (t[-1] - t[0]))[:, None] for k in range(1, WAVES + 1)]
    if gain < POLICY.half * rest.energy or gain <= rest.gain(np.column_stack(slow)):
        return None
    return Change(what, start, rest.size(shape * (t >= start)[:, None]), gain / rest.energy)


def _starts(t: Array, v: Array, tried: Array) -> Iterator[float]:
    """Those of some times that have enough rows and turns on either side."""
    turned = np.diff(np.sign(v), prepend=np.sign(v[:1])) != 0
    for start in tried.tolist():
        sides = (t < start), (t >= start)
        if all(side.mean() >= LEAST_SIDE and turned[side].sum() >= TURNS for side in sides):
            yield start


def _shapes(q: Array, v: Array, a: Array, turns: bool) -> tuple[Array, dict[str, Array]]:
    """What may be wrong all the time, (rows, n), and by name what may change at once."""
    place = (q - q.min()) / max(float(np.ptp(q)), 1e-300)
    speed = v / (float(np.abs(v).max()) + 1e-300)
    sign, one = np.tanh(speed / SIGN), np.ones_like(q)
    waves = [np.cos(pi * k * place) for k in range(1, WAVES + 1)]
    weight = [np.sin(q), np.cos(q)] if turns else []
    bends = [np.tanh(speed / edge) for edge in BENDS]
    always = [one, *waves, *weight, sign, *(wave * sign for wave in waves), *bends, v, a]
    kinds = {"constant torque": [one], "friction level": [sign], "inertia": [a], "drag": [v]}
    kinds |= {"weight": weight} if turns else {}
    return np.column_stack(always), {name: np.column_stack(shape) for name, shape in kinds.items()}


@dataclass(frozen=True)
class _Rest:
    """What is left beside shapes that are taken out of everything: an orthonormal basis of these, and the rest."""

    basis: Array
    left: Array

    @classmethod
    def of(cls, always: Array, residual: Array) -> "_Rest":
        basis = _basis(always)
        return cls(basis, residual - basis @ (basis.T @ residual))

    @property
    def energy(self) -> float:
        return float(self.left @ self.left)

    def gain(self, shape: Array) -> float:
        """Energy that a shape (rows, n) takes of the rest."""
        along = _basis(self._cleared(shape)).T @ self.left
        return float(along @ along)

    def size(self, shape: Array) -> float:
        """How large it is: with its sign, or the amplitude of a sine and a cosine."""
        found = np.linalg.lstsq(self._cleared(shape), self.left, rcond=1e-9)[0]
        return float(found[0]) if len(found) == 1 else float(np.hypot(*found))

    def _cleared(self, shape: Array) -> Array:
        return np.asarray(shape - self.basis @ (self.basis.T @ shape))


def _basis(columns: Array) -> Array:
    vectors, sizes, _ = np.linalg.svd(columns / (column_rms(columns) + 1e-300), full_matrices=False)
    return np.asarray(vectors[:, sizes > 1e-6 * sizes[0]])
