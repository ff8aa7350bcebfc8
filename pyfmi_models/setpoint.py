"""Set points as models, for tools that bring none of their own."""

from dataclasses import dataclass, replace
from math import pi

import casadi as ca

from pyfmi_models.model import Model, Scalar, Variable, chapter_of, parameter, parameters_of, symbols_of, with_symbols


@dataclass(frozen=True, kw_only=True)
class Sine:
    """A sine with a smooth start; speed and acceleration are its exact derivatives.

        q_d(t) = s(t / smooth_start) amplitude sin(2 pi frequency t + phase),   s(x) = 10 x^3 - 15 x^4 + 6 x^5

    s stays 1 from x = 1 on, and is 1 throughout where smooth_start is 0.
    """

    name: str
    unit: str = "rad"
    frequency: Scalar = parameter("Hz", "Frequency of the sine", low=1e-9, tunable=False)
    amplitude: Scalar = parameter("rad", "Amplitude of the sine", tunable=False)
    phase: Scalar = parameter("rad", "Phase at time zero", default=0.0, tunable=False)
    smooth_start: Scalar = parameter(
        "s", "Time over which the motion grows to its full size", default=0.0, low=0, tunable=False
    )

    def position(self, t: Scalar) -> Scalar:
        """Desired position at t [s]."""
        x = ca.fmin(t / ca.fmax(self.smooth_start, 1e-9), 1)
        rise = ca.if_else(self.smooth_start > 0, x**3 * (10 - 15 * x + 6 * x**2), 1)
        return rise * self.amplitude * ca.sin(2 * pi * self.frequency * t + self.phase)

    def model(self) -> Model:
        """Write the set point as a `Model` without inputs and states: outputs position, velocity, acceleration."""
        parameters = tuple(self._in_unit(variable) for variable in parameters_of(self))
        t, x, u = ca.SX.sym("t"), ca.SX.sym("x", 0), ca.SX.sym("u", 0)
        p, symbols = symbols_of(parameters)
        position = with_symbols(self, symbols, 0).position(t)
        velocity = ca.jtimes(position, t, 1)
        results = [ca.SX(0, 1), ca.vertcat(position, velocity, ca.jtimes(velocity, t, 1))]
        return Model(
            name=self.name,
            description="Set point: a sine with a smooth start",
            inputs=(),
            parameters=parameters,
            states=(),
            outputs=tuple(self._in_unit(variable) for variable in _OUTPUTS),
            chapters=(chapter_of(self, "", "Set point"),),
            equations=ca.Function("equations", [t, x, u, p], results, ["t", "x", "u", "p"], ["next", "y"]),
        )

    def _in_unit(self, variable: Variable) -> Variable:
        """Give a motion the unit of this set point; the phase stays an angle."""
        if variable.name == "phase":
            return variable
        return replace(variable, unit=variable.unit.replace("rad", self.unit))


_OUTPUTS = (
    Variable(name="position", unit="rad", description="Desired position"),
    Variable(name="velocity", unit="rad/s", description="Desired speed"),
    Variable(name="acceleration", unit="rad/s2", description="Desired acceleration"),
)
