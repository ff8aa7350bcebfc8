"""The comparison as a page: what was run, how far each method is off, where it becomes unstable."""

from collections.abc import Sequence

from cosim.support.version import __version__
from cosim_studies.stiffness.comparison import Limit, Row
from cosim_studies.stiffness.errata import FOUND

HEAD = """\
# The stiff friction state: FMU against the paper's analytic update

    python -m cosim_studies.stiffness --out results/stiffness --force

Version mount-cosim {version}, card `{card}`, steps of {steps} ms. Files: `stiffness.txt` (for reading),
`stiffness.csv`, `stiffness.json` (an error that diverges is `null`), `stiffness.svg`.

The bristle equation (4) of the paper runs under a prescribed speed, inside an exported FMU and beside it with the
analytic update (17) and two explicit methods. Errors are the largest over the motion: of z relative to the largest |z|,
of the friction torque in N m with dz/dt from (4) at the new z. `FMU` is co-simulation in the compiled loop at the
default tolerance of 1e-8; `FMU in CVode` is model exchange in FMPy at a tolerance of 1e-10 a step. The truth is Radau
collocation of order 9 (the equation is linear in z once the speed is given); a test holds it against SciPy's Radau at
rtol 1e-12, and other tests hold the plants of all friction laws against that solver.

| motion | what it is |
|---|---|
| reference | the paper's sine, 0.2 Hz, at most 5 x 7.268e-5 rad/s, 5 s |
| 5 deg/s, 40 deg/s, 3 rad/s | sines of 0.2 Hz with that largest speed, 5 s |
| reversals at 2 Hz | 5 deg/s at 2 Hz, 1 s |
| presliding step | 20 urad in 50 ms and another 20 urad, from rest |

![error of z over speed](stiffness.svg)
"""
TAIL = """\
The error of (17) is the frozen speed, not the exponential: with the speed at the middle of the step, which is what
`LuGre.advance` asks for, it falls by orders of magnitude. (17) never diverges, but its error grows with speed and
step; explicit methods have no answer at all there.

## Beside the errata of the paper

With the paper's parameter set of positive speed, which is theirs; error of z / of the torque in N m, at 0.1 ms.
"""


def readme(rows: Sequence[Row], limits: Sequence[Limit], again: Sequence[Row], card: str) -> str:
    """Write the page; `again` are the rows of the errata, computed here."""
    steps = list(dict.fromkeys(row.step for row in rows))
    head = HEAD.format(version=__version__, card=card, steps=" and ".join(f"{1e3 * step:g}" for step in steps))
    return "\n".join([head, *_errors(rows, steps), "", *_limits(limits, steps), "", TAIL, *_errata(again), ""])


def _errors(rows: Sequence[Row], steps: Sequence[float]) -> list[str]:
    lines = ["Largest error of z, at " + " / ".join(f"{1e3 * step:g} ms" for step in steps) + ":", ""]
    methods, regimes = (list(dict.fromkeys(getattr(row, key) for row in rows)) for key in ("method", "regime"))
    found = {(row.regime, row.method, row.step): f"{row.z_error:.1e}" if row.stable else "diverges" for row in rows}
    lines += [f"| motion | {' | '.join(methods)} |", "|---" * (1 + len(methods)) + "|"]
    for regime in regimes:
        cells = [" / ".join(found[regime, method, step] for step in steps) for method in methods]
        lines.append(f"| {regime} | {' | '.join(cells)} |")
    return lines


def _limits(limits: Sequence[Limit], steps: Sequence[float]) -> list[str]:
    found = {(one.method, one.step): f"{one.degrees:.3g} deg/s" for one in limits}
    lines = ["Stable up to a steady speed of:", ""]
    lines += [f"| method | {' | '.join(f'{1e3 * step:g} ms' for step in steps)} |", "|---" * (1 + len(steps)) + "|"]
    for method in dict.fromkeys(one.method for one in limits):
        lines.append(f"| {method} | {' | '.join(found[method, step] for step in steps)} |")
    return [*lines, "| FMU, (17) | no limit" + " | no limit" * (len(steps) - 1) + " |"]


def _errata(again: Sequence[Row]) -> list[str]:
    lines = ["| motion | method | here | errata |", "|---|---|---|---|"]
    for row in again:
        here, there = (row.z_error, row.torque_error), FOUND[row.regime, row.method]
        cells = [" / ".join(f"{error:.1e}" for error in errors) for errors in (here, there)]
        lines.append(f"| {row.regime} | {row.method} | {cells[0]} | {cells[1]} |")
    return lines
