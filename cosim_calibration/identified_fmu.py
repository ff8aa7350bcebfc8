"""The experiment that an identified FMU carries: the recording on which its numbers were judged.

The stimulus is what the inputs were given at each step, the reference what the FMU gives with the numbers that were
found: a check elsewhere compares tools. What was measured lies beside, and the description says how far it is from the
reference: that is noise and what the model leaves out, and no tolerance of the check.
"""

import zipfile
from collections.abc import Callable
from math import ceil
from pathlib import Path

import numpy as np

from cosim.delivery.experiment import ROWS, Stimulus, experiment_files
from cosim.fmi.manifest import MANIFEST, manifest_of
from cosim.fmi.xml_member import xml_in
from cosim.support.cell import Cell, LostError
from cosim.support.errors import CosimError
from cosim.support.files import replacing
from cosim_calibration.calibrate import Calibrated
from pyfmi_models.export.related import empty, listed

FOLDER = "identified/"
"""Where the files lie beside the manifest: those that the FMU had keep their names."""


def carry(done: Calibrated, timeout: float, say: Callable[[str], None], path: Path) -> None:
    """Put the experiment into an FMU with the numbers that were found; what else its manifest lists stays.

    An FMU whose simulation fails here, or whose manifest is not known, is left without; `say` is told why.
    """
    stimulus, cell = stimulus_of(done), Cell()
    try:
        manifest = empty() if manifest_of(path) is None else xml_in(path, MANIFEST)
        files = listed(cell.call(experiment_files, path, stimulus, FOLDER, timeout=timeout), manifest)
    except (CosimError, LostError) as reason:
        say(f"{path.name} carries no experiment: {reason}")
        return
    finally:
        cell.close()
    with (
        zipfile.ZipFile(path) as archive,
        replacing(path, True) as partial,
        zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for member in archive.infolist():
            if member.filename not in files:
                target.writestr(member, archive.read(member))
        for name, content in files.items():
            target.writestr(name, content)


def stimulus_of(done: Calibrated) -> Stimulus:
    """The first rows of the recording that is shown, its inputs at the steps where they change."""
    one = done.shown
    assert one is not None
    last = min(one.ticks, max(1, ceil(one.times[:ROWS][-1] / one.step - 1e-3)))
    moves = np.zeros(last + 1, bool)
    for values in one.inputs.values():
        moves[1:] |= np.diff(values[: last + 1]) != 0
    kept = moves | np.append(moves[1:], True)  # the step before a change too: numbers between rows run linearly
    kept[0] = True
    ticks = np.flatnonzero(kept)[:ROWS]
    times = one.step * ticks.astype(np.float64)
    rows = one.times[: np.searchsorted(one.times[:ROWS], times[-1] + 1e-3 * one.step, side="right")]
    return Stimulus(
        one.name,
        _said(done),
        times,
        {name: values[ticks] for name, values in one.inputs.items()},
        one.step,
        {name: values[: len(rows)] for name, values in one.outputs.items()},
        rows,
        tuple(one.outputs),
        done.shown_with,
    )


def _said(done: Calibrated) -> str:
    mine = [each for each in done.traces if done.shown and each.times is done.shown.times]
    kept = "kept out" if any(each.held_out for each in mine) else "fitted"
    rms = ", ".join(f"{each.output} {each.rms(each.after):.3g} {each.unit}".rstrip() for each in mine)
    return f"Inputs of {mine[0].recording}, {kept}; measured is from the reference (RMS): {rms}"
