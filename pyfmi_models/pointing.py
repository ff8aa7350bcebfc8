"""Where a mount with altitude over azimuth points, seen on the sky."""

from dataclasses import dataclass

import casadi as ca

from pyfmi_models.model import Model, Variable


@dataclass(frozen=True, kw_only=True)
class PointingError:
    """Difference on the sky between where a mount should point and where it points.

        cross_elevation = 2 asin(cos h sin((A_d - A) / 2))       the azimuth error, shrunk by cos h
        elevation       = h_d - h
        error           = 2 asin sqrt(sin^2((h_d - h) / 2) + cos h_d cos h sin^2((A_d - A) / 2))

    `error` is the angle between the two directions (haversine formula, exact and good for small angles); for small ones
    it is the root of the sum of squares of the other two. Whole turns of the azimuth do not count.
    """

    name: str = "pointing_error"

    def model(self) -> Model:
        """Write it as a `Model` without states: four angles in, three out."""
        t, x, u, p = (ca.SX.sym(name, size) for name, size in (("t", 1), ("x", 0), ("u", len(_INPUTS)), ("p", 0)))
        wanted_azimuth, wanted, azimuth, altitude = ca.vertsplit(u)
        across = ca.sin((wanted_azimuth - azimuth) / 2)
        up = ca.sin((wanted - altitude) / 2)
        far = ca.sqrt(up**2 + ca.cos(wanted) * ca.cos(altitude) * across**2 + _TINY)
        outputs = ca.vertcat(2 * ca.asin(ca.cos(altitude) * across), wanted - altitude, 2 * ca.asin(ca.fmin(far, 1)))
        return Model(
            name=self.name,
            description="Pointing error on the sky of a mount with altitude over azimuth",
            inputs=_INPUTS,
            parameters=(),
            states=(),
            outputs=_OUTPUTS,
            equations=ca.Function(
                "equations", [t, x, u, p], [ca.SX(0, 1), outputs], ["t", "x", "u", "p"], ["next", "y"]
            ),
        )


_TINY = 1e-40
"""Keeps the slope of the root finite where there is no error; 2e-20 rad of error come of it."""

_INPUTS = (
    Variable(name="azimuth_d", unit="rad", description="Azimuth where it should point"),
    Variable(name="altitude_d", unit="rad", description="Altitude where it should point"),
    Variable(name="azimuth", unit="rad", description="Azimuth where it points"),
    Variable(name="altitude", unit="rad", description="Altitude where it points"),
)
_OUTPUTS = (
    Variable(name="cross_elevation", unit="rad", description="Error across the elevation, on the sky"),
    Variable(name="elevation", unit="rad", description="Error in elevation"),
    Variable(name="error", unit="rad", description="Angle on the sky between the two directions"),
)
