"""The answer of a diagnosis as one matplotlib figure, for notebooks."""

from typing import TYPE_CHECKING, Any

from cosim.diagnosis.answer.result import Diagnosis, Trace
from cosim.plots.style import AFTER, BAND, BEFORE, GREY, STYLE, thin
from cosim.report.lead import heading
from cosim.report.quantities import Scales

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 1200


def answer_figure(diagnosis: Diagnosis) -> Any:
    """Draw the error on the validation run from the delivered card to the effects, and its missing torque over time."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    scales = Scales.of(diagnosis)
    held = [one for one in diagnosis.traces if one.heldout] or list(diagnosis.traces)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10, 4.2 if held else 2.2), layout="constrained")
        panels = figure.subplots(2 if held else 1, 1, squeeze=False, height_ratios=[1, 1.6][: 2 if held else 1])[:, 0]
        _errors(panels[0], diagnosis, scales)
        if held:
            _missing(panels[1], held[0], scales)
        figure.suptitle(heading(diagnosis), x=0.01, ha="left")
    return figure


def _errors(axes: "Axes", diagnosis: Diagnosis, scales: Scales) -> None:
    held, factor = diagnosis.heldout, scales.torque.factor
    rows = {"with effects": (held.after_rms, AFTER), "refitted card": (held.before_rms, BEFORE)}
    rows |= {"delivered card": (held.nominal_rms, GREY)}
    values = [value * factor for value, _ in rows.values()]
    axes.barh(list(rows), values, color=[colour for _, colour in rows.values()], height=0.6)
    axes.axvline(held.floor_rms * factor, color=BAND, lw=1.2, ls=":")
    axes.annotate("noise", (held.floor_rms * factor, 1), (3, -2), xycoords=("data", "axes fraction"),
                  textcoords="offset points", color=GREY, fontsize=9)  # fmt: skip
    axes.set_xlabel(f"validation RMS error [{scales.torque.unit}]")


def _missing(axes: "Axes", trace: Trace, scales: Scales) -> None:
    factor = scales.torque.factor
    for signal, colour, label in (
        (trace.missing, BEFORE, "refitted card"),
        (trace.tau - trace.after, AFTER, "with effects"),
    ):
        axes.plot(*thin(trace.t, signal * factor, POINTS), color=colour, lw=1, label=label)
    axes.axhline(0, color=GREY, lw=0.8)
    axes.set(xlabel="time [s]", ylabel=f"error [{scales.torque.unit}]")
    axes.set_title(trace.name, loc="left", color=GREY)
    axes.legend(frameon=False, fontsize=9, loc="upper right", ncols=2)
