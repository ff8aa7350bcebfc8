"""Figures laid out like the paper's Figs. 7-11: error, friction estimate, torque and disturbance over time.

matplotlib is imported on use only.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cosim.plots.sheet import figure
from cosim.plots.style import AFTER, BEFORE, GREY, MEASURED
from cosim_studies.paper.experiment import Floats
from cosim_studies.paper.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NUMBERS = {"C1": 7, "C2a": 8, "C2b": 9, "C3a": 10, "C3b": 11}
"""The paper's number of the figure of a case."""
COLUMNS = {"base": "base, no noise", "realistic_observer": "realistic B, first seed"}
EVERY = 2
"""Kept samples for each drawn one: 20 ms."""


def tracking_figures(study: Study, inertia: float, folder: Path, force: bool = False) -> list[Path]:
    """Draw one figure a case; `inertia` turns zeta3 into a torque."""
    done = []
    for case, number in NUMBERS.items():
        path = folder / f"fig{number:02d}_{case}.svg"
        panels = _panels(case)
        with figure(path, len(panels), len(COLUMNS), (9.0, 1.6 * len(panels) + 0.6), force) as (sheet, axes):
            sheet.suptitle(f"{case}, as in Fig. {number} of the paper", x=0.01, ha="left", fontsize=11)
            for place, (key, title) in enumerate(COLUMNS.items()):
                trace = study.traced(key, case).trace
                column = [one[place] for one in axes]
                column[0].set_title(title, loc="left", color=GREY)
                _draw(column, panels, {**trace, "disturbance": inertia * trace["zeta3"]})
        done.append(path)
    return done


def _panels(case: str) -> dict[str, tuple[str, str]]:
    """Curves from top to bottom, with label and colour."""
    found = {"e": ("e [arcsec]", MEASURED), "friction": ("friction estimate\n[N m]", AFTER)}
    found |= {"tau": ("torque [N m]", GREY), "disturbance": ("zeta3 J [N m]", BEFORE)}
    if case == "C1":
        del found["friction"]
    return found


def _draw(axes: Sequence["Axes"], panels: dict[str, tuple[str, str]], trace: dict[str, Floats]) -> None:
    t = trace["t"][::EVERY]
    for one, (name, (label, colour)) in zip(axes, panels.items(), strict=True):
        curve = trace[name][::EVERY]
        one.plot(t, np.round(curve, 4), color=colour, linewidth=0.9)
        one.set(xlim=(0, t[-1]), ylabel=label)
        one.tick_params(labelbottom=one is axes[-1])
        one.grid(True)
        for reversal in _reversals(trace):
            one.axvline(reversal, color="#C9CED3", linewidth=0.7, zorder=0)
    axes[-1].set_xlabel("t [s]")


def _reversals(trace: dict[str, Floats]) -> list[float]:
    """Times at which the reference turns round."""
    turns = np.flatnonzero(np.diff(np.signbit(trace["v_d"])))
    return [float(trace["t"][turn]) for turn in turns]
