"""What can go wrong, drawn as a tree.

CosimError                  everything this package raises on purpose
├── InputError              something the user gave breaks a rule: culprit, value, rule, choices
│   ├── RecordingError      a recording is missing, unreadable, or its numbers break a rule
│   │   ├── UndecidedError  a recording can be read in two ways; options that would decide
│   │   └── ManyRecordingsError  a file holds many recordings where one is needed
│   ├── UnitError           a unit is unknown or is of another kind than needed
│   ├── SignalError         a set-point generator or recorded signal cannot be made
│   ├── ScenarioError       a scenario file is missing, unreadable, or a key or value breaks a rule
│   ├── SweepError          a sweep file is missing, unreadable, or a key or value breaks a rule
│   ├── ProofError          a sealed truth was changed
│   ├── WiringError         a connection names what is not there, or joins what does not fit
│   ├── HardwareError       a machine file breaks a rule, or a scenario cannot run on a machine
│   ├── FmuError            a file is no FMU, or one that cannot run here
│   └── OutputError         a result would overwrite a file, or cannot be written
├── CheckError              a law or an effect of one's own fails a check
├── StepError               a component failed while stepping: component, tick, time, last inputs
├── LostComponentError      a component crashed, ended or blocked the process that it ran in
├── MissingPackageError     an optional package is needed and not installed
└── PlugInError             what an installed package adds to this one cannot be loaded
"""

from typing import Any

from cosim.support.near import MEANT, did_you_mean


class CosimError(Exception):
    """Base of every error this package raises on purpose; its text is one sentence for a person."""


class InputError(CosimError):
    """Something the user gave breaks a rule.

    Args:
        message: one sentence that names culprit, value, rule and choices.
        culprit: the file, key, column or wire at fault.
        value: what was found there.
        choices: what would have been legal, if that can be listed.
    """

    def __init__(self, message: str, *, culprit: str = "", value: Any = None, choices: tuple[str, ...] = ()) -> None:
        super().__init__(f"{message}{self._meant(message, culprit, value, choices)}")
        self.culprit = culprit
        self.value = value
        self.choices = choices

    def _meant(self, message: str, culprit: str, value: Any, choices: tuple[str, ...]) -> str:
        """Return ` Did you mean "sidereal"?` where what was given is a near miss of a choice."""
        if not choices or MEANT in message:
            return ""
        given = value if isinstance(value, str) else culprit
        asked = (did_you_mean(name, choices) for name in (given, given.rpartition(".")[2]) if name)
        return "" if given in choices else next((text for text in asked if text), "")


class RecordingError(InputError):
    """A recording is missing, unreadable, or its numbers break a rule."""


class UndecidedError(RecordingError):
    """A recording can be read in more than one way.

    Args:
        message: one sentence that names the option that decides.
        decided_by: an example of what would decide, by option: {"columns": {"tau": "torque_1"}}.
        more: culprit, value and choices of an `InputError`.
    """

    def __init__(self, message: str, *, decided_by: dict[str, dict[str, str]], **more: Any) -> None:
        super().__init__(message, **more)
        self.decided_by = decided_by

    def _meant(self, message: str, culprit: str, value: Any, choices: tuple[str, ...]) -> str:
        """Return nothing: each of the choices may be meant."""
        return ""


class ManyRecordingsError(RecordingError):
    """A file holds many recordings where one is needed.

    Args:
        message: one sentence that says how one is taken.
        runs: its recordings (`cosim.data.runs.Run`).
        more: culprit, value and choices of an `InputError`.
    """

    def __init__(self, message: str, *, runs: tuple[Any, ...], **more: Any) -> None:
        super().__init__(message, **more)
        self.runs = runs


class UnitError(InputError):
    """A unit is unknown, or of another kind than the one needed."""


class SignalError(InputError):
    """A set-point generator or recorded signal cannot be made."""


class ScenarioError(InputError):
    """A scenario file is missing, unreadable, or a key or value in it breaks a rule."""


class SweepError(InputError):
    """A sweep file is missing, unreadable, or a key or value in it breaks a rule."""


class ProofError(InputError):
    """The truth of a concealed case is not the one that was sealed before the tool ran."""


class WiringError(InputError):
    """A connection names what is not there, or joins what does not fit."""


class HardwareError(InputError):
    """A machine file or black box breaks a rule, or a scenario cannot run on a machine; no torque was enabled."""


class FmuError(InputError):
    """A file is no FMU, or one that cannot run here."""


class OutputError(InputError):
    """A result would overwrite a file, or cannot be written."""


class CheckError(CosimError):
    """A law or an effect of one's own fails a check, or several: each with its reason."""


class StepError(CosimError):
    """A component failed while stepping; what was recorded before stays readable.

    Args:
        message: one sentence.
        component: name of the component that failed.
        tick: number of the tick in which it failed; its time is tick times step.
        inputs: the last inputs of the component, by name.
    """

    def __init__(
        self, message: str, *, component: str = "", tick: int = 0, inputs: dict[str, float] | None = None
    ) -> None:
        super().__init__(message)
        self.component = component
        self.tick = tick
        self.inputs = inputs or {}


class LostComponentError(CosimError):
    """A component crashed, ended or blocked the process that it ran in; nothing was recorded.

    Args:
        message: one sentence.
        component: its name; empty where it is not known.
        reason: how the process ended.
    """

    def __init__(self, message: str, *, component: str = "", reason: str = "") -> None:
        super().__init__(message)
        self.component = component
        self.reason = reason


class MissingPackageError(CosimError):
    """An optional package is needed and not installed; the text says how to install it."""


class PlugInError(CosimError):
    """What an installed package adds to this one cannot be loaded."""
