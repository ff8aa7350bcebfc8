"""`cosim why`: the ledger of a diagnosis that was written to a folder."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.diagnosis.answer.ledger import Trial
from cosim.support.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

DOCUMENT = "diagnosis.json"


@dataclass(frozen=True)
class Written:
    """A diagnosis as it was written, and its ledger."""

    document: dict[str, Any]
    trials: tuple[Trial, ...]

    def check(self, effect: str) -> None:
        """Raise InputError where an effect was never looked for."""
        entries = [*(entry["effect"] for entry in self.document["effects"]), "unknown"]
        names = dict.fromkeys([*entries, *(one.effect for one in self.trials)])
        if effect not in names:
            near = get_close_matches(effect, names, 1)
            hint = f" Did you mean {near[0]}?" if near else ""
            text = f"no effect is called {effect!r} in this diagnosis.{hint} Effects are: {', '.join(names)}"
            raise InputError(text, culprit=effect)


def read_ledger(place: str | Path) -> Written:
    """Read the ledger of a diagnosis: its folder, or diagnosis.json itself.

    Raises:
        InputError: there is no diagnosis, it cannot be read, or it was written without a ledger.
    """
    path = Path(place)
    path = path / DOCUMENT if path.is_dir() else path
    try:
        document = json.loads(path.read_text("utf-8"))
        rows, _ = document["ledger"], document["effects"]
        return Written(document, tuple(map(Trial.of_json, rows)))
    except OSError as error:
        raise InputError(f"{path}: no diagnosis is there ({error.strerror}).", culprit=str(path)) from error
    except RecursionError:
        raise InputError(f"{path} is nested too deeply for a diagnosis.", culprit=str(path)) from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        text = f"{path} holds no ledger; it is no diagnosis, or one of a version before 0.2. Diagnose again."
        raise InputError(text, culprit=str(path)) from error


def frame(trials: Sequence[Trial]) -> "pd.DataFrame":
    """The ledger as a table, a row a trial; `refused_by` is the name of the first rule that refuses."""
    import pandas as pd

    rows = []
    for one in trials:
        row = one.as_json()
        refused = one.refused_by
        rows.append({**row, "effects": " + ".join(one.effects), "refused_by": refused.name if refused else ""})
    return pd.DataFrame(rows)
