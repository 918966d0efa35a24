"""Forces that need no integration: the gas, and the full model with oil that is incompressible.

With oil that cannot be compressed, the flows follow from the velocity alone (x, v, f > 0 in
rebound), as Appendix 2 has them (`appendices`); the mass flows of the full model are w = rho_0 Q.
The gas expands by what the rod draws from chamber 3: P_3 = P_0 (V_g0/(V_g0 + a_r x))^gamma.

**Full model, K_e -> infinity** (square-root valve 1, linear valves 2 and 3, friction). The force
is linear in R_m1^2, R_m2, R_m3, f_f, which gives a fit its starting values:

    f = a_p1 (R_m1 rho_0 a_p1 v)^2 + rho_0 R_m3 a_p2^2 v - a_r (P_3 - P_amb) + f_f + f_0      v > 0
    f = -a_r (R_m1 rho_0 a_r v)^2  + rho_0 R_m2 a_p2^2 v - a_r (P_3 - P_amb) - f_f + f_0      v < 0

Source: D. J. Purdy, Proc. IMechE D, 2000.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from damperfit.damper.purdy.parameters import Damper, Parameters

    FloatArray = NDArray[np.float64]


def gas_pressure(damper: Damper, displacement: ArrayLike) -> FloatArray:
    """Return P_3 = P_0 (V_g0/(V_g0 + a_r x))^gamma, eq. (17) corrected and (37).

    Pa absolute, of the shape of the displacement, m, positive in rebound. A `SimulationError`: the
    rod goes in so far that no room is left for the gas.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER
    >>> float(gas_pressure(PURDY_DAMPER, 0.0))
    460000.0
    """
    x = np.asarray(displacement, dtype=np.float64)
    gas_volume = damper.gas_volume + damper.rod_area * x
    if np.any(gas_volume <= 0.0):
        raise SimulationError(
            f"gas volume used up at displacement {float(np.min(x)):.4g} m; expected more than "
            f"{-damper.gas_volume / damper.rod_area:.4g} m; check the stroke and the gas length",
            code="stroke",
        )
    return np.asarray(damper.gas_pressure * (damper.gas_volume / gas_volume) ** damper.gas_exponent)


def incompressible_design(
    damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the matrix and offset in which the incompressible force is linear.

    ``force = columns @ [r_m1**2, r_m2, r_m3, f_f] + offset`` is "Full model" above with f_0 = 0,
    columns of shape (n, 4), offset the force of gas and air, N. A column is zero in the stroke its
    valve is shut in; at v = 0 friction is 0.
    """
    v = np.asarray(velocity, dtype=np.float64)
    a_p1, a_p2, a_r = damper.annulus_area, damper.piston_area, damper.rod_area
    out, into = np.maximum(v, 0.0), np.minimum(v, 0.0)
    through_1 = damper.oil_density**2 * (a_p1**3 * out**2 - a_r**3 * into**2)
    through_2 = damper.oil_density * a_p2**2 * into
    through_3 = damper.oil_density * a_p2**2 * out
    columns = np.stack([through_1, through_2, through_3, np.sign(v)], axis=-1)
    return columns, damper.rest_force(displacement)


def incompressible_force(
    parameters: Parameters, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> FloatArray:
    """Return the force of the full model for K_e -> infinity.

    N, shape (n,), of x in m and v in m/s, shape (n,); all positive in rebound. Valid as long as
    chamber 2 does not cavitate: P_3 > rho_0 R_m3 a_p2 v in rebound.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
    >>> set_m = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=0.0)
    >>> speed = 2.0 * 3.141592653589793 * 1.5 * 0.032
    >>> incompressible_force(set_m, PURDY_DAMPER, [0.0, 0.0], [speed, -speed]).round(3)
    array([ 892.855, -862.009])
    """
    columns, offset = incompressible_design(damper, displacement, velocity)
    weights = [parameters.r_m1**2, parameters.r_m2, parameters.r_m3, parameters.f_f]
    return np.asarray(columns @ np.array(weights) + offset + parameters.f_0)
