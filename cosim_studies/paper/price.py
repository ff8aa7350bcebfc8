"""What a controller costs: margins of its loop and torque for the encoder's noise, at the worst point it visits.

The plant is the condition's without friction, as far from forgiving as it gets: friction's slope, where there is any,
adds phase. The drive's lag and any flexible mode or dead time are in it. Its controller is taken at rest and in sliding
at the reference's largest speed, so that friction that is compensated by the observed speed, and friction that is being
identified, are part of the loop. What learns from pass to pass is not: within a pass it is a given torque.
"""

from dataclasses import replace

import casadi as ca

from cosim_studies.paper.conditions import Condition, tuned
from cosim_studies.paper.experiment import STARS
from cosim_studies.paper.margins import Linear, Margins, feedback, held, margins
from pyfmi_models.effects import FrictionEffect
from pyfmi_models.friction import FrictionLaw, Frictionless
from pyfmi_models.model import Model, Pair, fields_of

SPEEDS = {"at rest": 0.0, "sliding": 5 * STARS}
"""Points at which loops are linearised: speeds [rad/s], up to the reference's largest."""


def loops(condition: Condition) -> dict[str, tuple[Linear, Linear]]:
    """Return plant and controller, linearised at rest and in sliding."""
    effects = tuple(one for one in condition.plant.effects if not isinstance(one, FrictionEffect))
    plant = replace(condition.plant, friction=Frictionless(), effects=effects).plant().model()
    card = tuned(condition.controller, learning=None)
    controller, law = card.controller_model(), card.believed or card.friction
    points = {name: _moving(controller, law, v, condition.period) for name, v in SPEEDS.items()}
    return {name: (held(plant, condition.period, {}), feedback(controller, at)) for name, at in points.items()}


def price(condition: Condition) -> Margins:
    """Return the margins at the worst point of each kind."""
    found = [margins(*pair) for pair in loops(condition).values()]
    return Margins(
        stable=all(one.stable for one in found),
        phase=min(one.phase for one in found),
        delay=min(one.delay for one in found),
        Ms=max(one.Ms for one in found),
        crossover=max(one.crossover for one in found),
        noise=max(one.noise for one in found),
    )


def _moving(controller: Model, law: FrictionLaw, v: float, period: float) -> dict[str, float]:
    """Values of the controller's inputs and states while the axis follows at a speed, at position 0."""
    found = {"started": 1.0, "v_d": v, "observer.v": v, "velocity.q_last": -v * period}
    level = float(ca.evalf(ca.DM(_forward(law).level(v)))) if v else 0.0
    for state in controller.states:
        if state.name.endswith(".bristle"):
            found[state.name] = level
        elif state.name.endswith(".speed"):
            found[state.name] = v
    return found


def _forward(law: FrictionLaw) -> FrictionLaw:
    """The law with the numbers of the positive direction."""
    numbers = {name: getattr(law, name) for name in fields_of(law)}
    return replace(law, **{name: value.positive for name, value in numbers.items() if isinstance(value, Pair)})
