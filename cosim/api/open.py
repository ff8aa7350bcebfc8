"""`cosim.open`: a scenario or system in hand, stepped from Python code."""

from collections.abc import Callable, Mapping
from pathlib import Path

from cosim.api.changes import changed
from cosim.master.session import Session
from cosim.models.cache import with_fmus
from cosim.system.address import Value
from cosim.system.scenario import Scenario, read_scenario
from cosim.system.system import System


def open(  # as a file is opened
    system: str | Path | Scenario | System,
    *,
    set: Mapping[str, Value] | None = None,  # the word of the option
    compiled: bool = True,
    on_build: Callable[[str], None] = lambda text: None,
) -> Session:
    """Open a scenario, an SSP or a system to step it by hand.

        with cosim.open("sidereal") as s:
            while s.t < 5:
                s.step()
                s["controller.tau"] = mine(s["reference.position"], s["mount.q"])

    Args:
        system: a scenario (.toml) or SSP: its path, the name of a shipped one, a `Scenario`; or a `System`.
        set: other numbers for this run, by name, as in `cosim.run`.
        compiled: False asks for the loop in Python, which is slow and gives the same bits.
        on_build: called with a word on each FMU that is built.

    Raises:
        ScenarioError, SweepError: the scenario is not good, or a number cannot be set. Others come with the `with`.
    """
    if isinstance(system, System):
        return Session(system, compiled)
    scenario = system if isinstance(system, Scenario) else read_scenario(str(system))
    return Session(changed(with_fmus(scenario, on_build), set or {}).system(), compiled)
