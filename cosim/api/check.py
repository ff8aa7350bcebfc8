"""`cosim.check`: does an FMU run here as its maker meant."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.experiments import deliver
from cosim.experiments.check import TIMEOUT, Checked
from cosim.experiments.check import check as carry_out
from cosim.experiments.comparison import RTOL
from cosim.fmi.description import INTERFACES
from cosim.support.errors import InputError
from cosim.support.files import check_free
from cosim.support.html import table as html_table
from cosim.support.plain import JsonObject


@dataclass(frozen=True)
class CheckResult:
    """What a check found: each experiment, variable by variable, and what was asked beside."""

    checked: Checked
    files: Mapping[str, Path] = field(default_factory=dict)
    """What was written: json, picture_1, ..."""

    @property
    def passed(self) -> bool:
        """Whether everything holds."""
        return self.checked.passed

    def frame(self) -> Any:
        """Return the variables of all experiments as a pandas `DataFrame`."""
        import pandas

        return pandas.DataFrame(deliver.rows_of(self.checked))

    def as_json(self) -> JsonObject:
        """Return everything but the columns as plain data, as check.json holds it."""
        return deliver.as_json(self.checked)

    def __str__(self) -> str:
        return "\n".join(deliver.lines_of(self.checked))

    def __repr__(self) -> str:
        return f"CheckResult({self.checked.path.name}, {'passed' if self.passed else 'failed'})"

    def _repr_html_(self) -> str:
        return html_table(repr(self), deliver.rows_of(self.checked))


def check(
    fmu: str | Path,
    out: str | Path | None = None,
    *,
    rtol: float = RTOL,
    interface: str = "",
    timeout: float = TIMEOUT,
    force: bool = False,
    on_progress: Callable[[str], None] = lambda text: None,
) -> CheckResult:
    """Run the experiments that an FMU brings along (FMI-LS-REF), and compare each variable with its reference.

    A variable passes where `|y - r| <= rtol * (range of r)` at every row of the reference. An FMU without experiments
    runs its default experiment: to its end, with the same bits after a reset and in a new instance.

    Args:
        fmu: the FMU, also a third-party one.
        out: folder for check.json and a picture of each experiment; None writes nothing.
        rtol: allowed difference, relative to the range of the reference; texts and whole numbers must be equal.
        interface: "co-simulation" or "model-exchange"; "" takes what the FMU has, co-simulation first.
        timeout: seconds that one experiment may take.
        force: overwrite what is there.
        on_progress: told which experiment is run.

    Returns:
        `CheckResult`; a variable that fails is no error.

    Raises:
        FmuError: the file is no FMU that can run here, or its experiments are of a version that is not known.
        InputError: an option breaks a rule.
        OutputError: a file is there already; nothing was run then.
    """
    for name, value in (("--rtol", rtol), ("--timeout", timeout)):
        if not 0 < value < float("inf"):
            raise InputError(f"{name} {value:g}: it must be above 0.", culprit=name, value=value)
    if interface and interface not in INTERFACES.values():
        choices = tuple(INTERFACES.values())
        text = f'--interface "{interface}": there are: {", ".join(choices)}.'
        raise InputError(text, culprit="--interface", value=interface, choices=choices)
    folder = None if out is None else Path(out)
    if folder:
        check_free(folder / deliver.JSON, force)
    done = carry_out(Path(fmu), rtol, timeout, interface, on_progress)
    return CheckResult(done, deliver.deliver(done, folder, force) if folder else {})
