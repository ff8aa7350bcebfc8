"""`cosim show SCENARIO --schedule`: what happens in a step and in which order, before anything runs."""

from collections.abc import Iterator

from cosim.support.plain import Json
from cosim.system.algorithm import Algorithm, Energy, Iterated, Stage
from cosim.system.diagram import in_short, in_words, on_the_way, origin, wire_delays
from cosim.system.scenario import Scenario, read_scenario
from cosim.system.schedule import coupled_of

Row = dict[str, Json]
_WHAT = {"gather": "take their inputs", "step": "step", "couple": "step together"}
_UNUSED = {
    "hasEventMode": "event mode",
    "mightReturnEarlyFromDoStep": "early return by itself",
    "canReturnEarlyAfterIntermediateUpdate": "early return after an intermediate update",
    "providesIntermediateUpdate": "intermediate update",
    "canInterpolateInputs": "interpolation of inputs by their derivatives",
    "maxOutputDerivativeOrder": "derivatives of outputs",
    "canRunAsynchronuously": "asynchronous steps",
}
"""What the interface of a component may offer and the master does not use, by FMI's name of it (as FMPy spells it)."""


def schedule(file: str) -> tuple[dict[str, Json], dict[str, list[Row]]]:
    """Facts, and the tables `order`, `inputs` and `offered`, of a scenario or SSP.

    `order`: the stages of a step, one after the other. `inputs`: of each input its source, how old the value is when it
    acts, and what it is over the step. `offered`: what FMUs have and the master does not use.

    Raises:
        ScenarioError, WiringError: the scenario is not good.
        FmuError: an FMU cannot be read.
    """
    scenario = read_scenario(file)
    stages = scenario.algorithm.stages(tuple(scenario.components))
    facts: dict[str, Json] = {
        "scenario": scenario.name,
        "step": f"{scenario.step:g} s",
        "algorithm": in_short(scenario),
        "recorded": "at the start of a step: outputs as they are then, inputs as they act in it",
    }
    tables = {"order": [*_order(scenario, stages)], "inputs": [*_inputs(scenario)], "offered": [*_offered(scenario)]}
    return facts, {name: rows for name, rows in tables.items() if rows}


def _order(scenario: Scenario, stages: tuple[Stage, ...]) -> Iterator[Row]:
    for number, stage in enumerate(stages, 1):
        for name in stage.names:
            every = scenario.every.get(name, 1)
            yield {
                "stage": number,
                "what": _WHAT[stage.what],
                "component": name,
                "when": "every step" if every == 1 else _when(stage, every, scenario.step),
            }


def _when(stage: Stage, every: int, step: float) -> str:
    which = "first" if stage.what == "gather" else "last"
    return f"in the {which} of {every} steps ({every * step:g} s)"


def _inputs(scenario: Scenario) -> Iterator[Row]:
    stated = wire_delays(scenario)
    for wire in scenario.wires:
        yield {
            "input": wire.target,
            "from": wire.source,
            "age": in_words(stated[wire.target], scenario.step),
            "over the step": _over(scenario, wire.source.owner, wire.target.owner),
            "on the way": on_the_way(wire).removeprefix("; "),
        }


def _over(scenario: Scenario, source: str, target: str) -> str:
    """Say what an input is while its component steps."""
    algorithm: Algorithm = scenario.algorithm
    members = coupled_of(algorithm.stages(tuple(scenario.components)))
    if source not in members or target not in members:
        return "held"
    if isinstance(algorithm, Iterated):
        return f"held at {1 - algorithm.theta:g} of its start + {algorithm.theta:g} of its end"
    assert isinstance(algorithm, Energy)  # the two algorithms that couple
    return f"extrapolated to the middle of each of up to {algorithm.max_pieces} pieces"


def _offered(scenario: Scenario) -> Iterator[Row]:
    for name, component in scenario.components.items():
        if component.fmu is None:
            continue
        from cosim.fmi.description import describe

        said = describe(component.fmu)
        unused = [words for key, words in _UNUSED.items() if getattr(said.coSimulation, key, False)]
        told = ", ".join(unused) or "nothing"
        yield {"component": name, "FMU": origin(component), "FMI": said.fmiVersion, "offered, not used": told}
