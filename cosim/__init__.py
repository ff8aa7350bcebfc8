"""Run a mount as co-simulation, record it, compare it with a recording, find what is missing, deploy the controller.

    read        a file, data frame or dict of arrays  ->  Recording
    open        a scenario                            ->  Session: stepped by hand, values read and set between steps
    run         a scenario                            ->  RunResult, with its recording
    diagnose    recordings and a card                 ->  DiagnosisResult: what the card lacks, and a better card
    diagnose_folder  recordings of several machines   ->  FolderResult: what each machine's card lacks
    investigate scenario, card, machine               ->  InvestigateResult: motions until one answer is left
    compare     runs, recordings                      ->  Comparison: overlay and differences
    card        recordings                            ->  CardResult: a first card, with ranges
    identify    recordings and a card                 ->  IdentifyResult: the card's numbers with standard errors
                recordings and an FMU, or a system    ->  CalibrateResult: its numbers with standard errors
    check       an FMU                                ->  CheckResult: whether it runs as its maker meant
    export      a card                                ->  Exported: FMUs, SSP, Modelica
    sweep       a sweep file                          ->  SweepResult: a table, a row a run, and the best
    check_effect, check_law   a class of your own physics  ->  Checks that it must pass
    show        any file of this project              ->  Shown: what it holds

SI units inside, other units only where files come in. Time is counted in integer ticks, never summed. Results print
themselves on a terminal and show themselves in a notebook. A name is loaded when it is first used: `import cosim` alone
costs next to nothing; `sweep`, `investigate`, `check_effect` and `check_law` come from packages that are plugged in.
What these raise on purpose is a `CosimError` or a `ModelError`, and its text is one sentence.
"""

from importlib import import_module

from cosim.support.version import __version__

TYPE_CHECKING = False
"""As type checkers know it; to load `typing` takes long, in which a signal would meet Python's own traceback."""

if TYPE_CHECKING:
    from typing import Any

    from cosim.api.card import CardResult, card
    from cosim.api.check import CheckResult, check
    from cosim.api.compare import Comparison, compare
    from cosim.api.diagnose import DiagnosisResult, diagnose
    from cosim.api.export import Exported, export
    from cosim.api.folder import FolderResult, diagnose_folder
    from cosim.api.identify import IdentifyResult, identify
    from cosim.api.open import open
    from cosim.api.recordings import read
    from cosim.api.run import run
    from cosim.api.show import Shown, show
    from cosim.data.recording import Recording
    from cosim.master.result import RunResult
    from cosim.support.errors import CheckError, CosimError, InputError, StepError
    from cosim_calibration.front import CalibrateResult as CalibrateResult
    from cosim_checks.front import check_effect as check_effect
    from cosim_checks.front import check_law as check_law
    from cosim_checks.suite import Checks as Checks
    from cosim_investigation.investigate import InvestigateResult as InvestigateResult
    from cosim_investigation.investigate import investigate as investigate
    from cosim_sweeps.front import SweepResult as SweepResult
    from cosim_sweeps.front import sweep as sweep
    from pyfmi_models.card import Card, read_card
    from pyfmi_models.errors import ModelError
    from pyfmi_models.plugins import load_plugins

_HOMES = {
    "cosim.api.card": ("CardResult", "card"),
    "cosim.api.check": ("CheckResult", "check"),
    "cosim.api.compare": ("Comparison", "compare"),
    "cosim.api.diagnose": ("DiagnosisResult", "diagnose"),
    "cosim.api.export": ("Exported", "export"),
    "cosim.api.folder": ("FolderResult", "diagnose_folder"),
    "cosim.api.identify": ("IdentifyResult", "identify"),
    "cosim.api.open": ("open",),
    "cosim.api.recordings": ("read",),
    "cosim.api.run": ("run",),
    "cosim.master.result": ("RunResult",),
    "cosim.api.show": ("Shown", "show"),
    "cosim.data.recording": ("Recording",),
    "cosim.support.errors": ("CheckError", "CosimError", "InputError", "StepError"),
    "pyfmi_models.card": ("Card", "read_card"),
    "pyfmi_models.errors": ("ModelError",),
    "pyfmi_models.plugins": ("load_plugins",),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Card",
    "CardResult",
    "CheckError",
    "CheckResult",
    "Comparison",
    "CosimError",
    "DiagnosisResult",
    "Exported",
    "FolderResult",
    "IdentifyResult",
    "InputError",
    "ModelError",
    "Recording",
    "RunResult",
    "Shown",
    "StepError",
    "__version__",
    "card",
    "check",
    "compare",
    "diagnose",
    "diagnose_folder",
    "export",
    "identify",
    "load_plugins",
    "open",
    "read",
    "read_card",
    "run",
    "show",
]


def __getattr__(name: str) -> "Any":
    """Load a public name from its home, once."""
    if name in _HOME_OF:
        found = getattr(import_module(_HOME_OF[name]), name)
    elif name in _plugged():
        from cosim.support.plugins import HANDLES, loaded

        found = loaded(HANDLES, name)
    else:
        raise AttributeError(f"module 'cosim' has no attribute {name!r}; it offers: {', '.join(__dir__())}")
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*__all__, *_plugged()})


def _plugged() -> tuple[str, ...]:
    """Names that packages add by entry points, those of this project among them."""
    from cosim.support.plugins import HANDLES, names

    return names(HANDLES)
