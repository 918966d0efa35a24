"""Forces that need no integration: the incompressible limit and the paper's Appendix 2.

With oil that cannot be compressed, the flows follow from the velocity alone (x, v, f > 0 in
rebound):

    rebound  v > 0   Q_1 = a_p1 v    Q_2 = 0          Q_3 = a_p2 v
    bump     v < 0   Q_1 = -a_r v    Q_2 = -a_p2 v    Q_3 = 0

Q_1 (chamber 1 to 3), Q_2 (2 to 1) and Q_3 (3 to 2) are volume flows in m3/s; the mass flows of
the full model are w = rho_0 Q. The oil that the rod draws from chamber 3 lets the gas expand, so

    eta = -x a_r/a_g                                gas piston (positive: gas compressed), m
    P_3 = P_0 (V_g0/(V_g0 + a_r x))^gamma           gas, Pa

**Full model, K_e -> infinity** (square-root valve 1, linear valves 2 and 3, friction). The force
is linear in R_m1^2, R_m2, R_m3, f_f, which gives a fit its starting values:

    f = a_p1 (R_m1 rho_0 a_p1 v)^2 + rho_0 R_m3 a_p2^2 v - a_r P_3 + f_f + f_0      v > 0
    f = -a_r (R_m1 rho_0 a_r v)^2  + rho_0 R_m2 a_p2^2 v - a_r P_3 - f_f + f_0      v < 0

**Appendix 2** (simple model: also no friction, and valve 1 linear). Its valves relate pressure to
volume flow, P = R_v Q, so R_v is in Pa s/m3 = N s/m5: only then do the squared areas of (38) give
newtons. A valve of the full model that is linear in mass flow has R_v = rho_0 R_m.

    (31) rebound: Q_1 and Q_3 from v                              rebound_flows
    (32) rebound: P_1 = P_3 + R_v1 Q_1, P_2 = P_3 - R_v3 Q_3      rebound_pressures
    (33) rebound: eta = -x a_r/a_g                                gas_piston_displacement
    (34) bump: Q_1 and Q_2 from v                                 bump_flows
    (35) bump: eta = -x a_r/a_g                                   gas_piston_displacement
    (36) bump: P_1 = P_3 + R_v1 Q_1, P_2 = P_1 + R_v2 Q_2         bump_pressures
    (37) P_3 from eta                                             gas_pressure
    (38) f = v (a_p1^2 R_v1 + a_p2^2 R_v3) - P_3 a_r  for v > 0
         f = v (a_p2^2 R_v2 + a_r^2 R_v1) - P_3 a_r   for v < 0   simple_force
    (39) the two slopes df/dv at constant x                       simple_slopes

The steps are derived anew; (33), (35), (38) and (39) carry the paper's numbers, the others stand
where the derivation needs them. Slips of the paper that are corrected here: (33) and (35) print
eta with the sign opposite to (16), and (16) is kept; (17) prints V_g0 + m_3/rho_0, but oil that
enters chamber 3 compresses the gas. From force only the two slopes (39) can be identified, not
the three R_v.

Source: D. J. Purdy, Proc. IMechE D, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from damperfit.damper.parameters import Damper, Parameters

    FloatArray = NDArray[np.float64]

__all__ = [
    "DESIGN_COLUMNS",
    "LinearValves",
    "bump_flows",
    "bump_pressures",
    "gas_piston_displacement",
    "gas_pressure",
    "incompressible_design",
    "incompressible_force",
    "rebound_flows",
    "rebound_pressures",
    "simple_force",
    "simple_slopes",
]

DESIGN_COLUMNS = ("r_m1_squared", "r_m2", "r_m3", "f_f")


@dataclass(frozen=True, slots=True)
class LinearValves:
    """R_v1, R_v2, R_v3 of Appendix 2: pressure drop per volume flow, Pa s/m3 (= N s/m5)."""

    r_v1: float
    r_v2: float
    r_v3: float


def gas_piston_displacement(damper: Damper, displacement: ArrayLike) -> FloatArray:
    """Return eta = -x a_r/a_g, eq. (16), and (33) and (35) with its sign.

    Parameters
    ----------
    damper : Damper
        Geometry.
    displacement : array_like
        x, m, positive in rebound.

    Returns
    -------
    numpy.ndarray
        eta in m, positive where the gas is compressed (bump).
    """
    gas_area = damper.gas_volume / damper.gas_length
    return np.asarray(-np.asarray(displacement, dtype=np.float64) * (damper.rod_area / gas_area))


def gas_pressure(damper: Damper, displacement: ArrayLike) -> FloatArray:
    """Return P_3 = P_0 (V_g0/(V_g0 + a_r x))^gamma, eq. (17) corrected and (37).

    Parameters
    ----------
    damper : Damper
        Geometry and gas.
    displacement : array_like
        x, m, positive in rebound.

    Returns
    -------
    numpy.ndarray
        P_3 in Pa, absolute, of the shape of ``displacement``.

    Raises
    ------
    SimulationError
        The rod goes in so far that no room is left for the gas.

    Examples
    --------
    >>> from damperfit.damper.parameters import PURDY_DAMPER
    >>> float(gas_pressure(PURDY_DAMPER, 0.0))
    460000.0
    """
    x = np.asarray(displacement, dtype=np.float64)
    gas_volume = damper.gas_volume + damper.rod_area * x
    if np.any(gas_volume <= 0.0):
        raise SimulationError(
            f"gas volume used up at displacement {float(np.min(x)):.4g} m; expected more than "
            f"{-damper.gas_volume / damper.rod_area:.4g} m; check the stroke and the gas length"
        )
    return np.asarray(damper.gas_pressure * (damper.gas_volume / gas_volume) ** damper.gas_exponent)


def incompressible_design(
    damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the matrix and offset in which the incompressible force is linear.

    ``force = columns @ [r_m1**2, r_m2, r_m3, f_f] + offset`` is section "Full model" above with
    f_0 = 0. A column is zero in the stroke its valve is shut in; at v = 0 friction is 0.

    Parameters
    ----------
    damper : Damper
        Geometry, oil and gas.
    displacement, velocity : array_like
        Shape (n,); x in m and v in m/s, positive in rebound.

    Returns
    -------
    columns : numpy.ndarray
        Shape (n, 4), in the order of `DESIGN_COLUMNS`.
    offset : numpy.ndarray
        Shape (n,); the gas force -a_r P_3, N.

    Raises
    ------
    SimulationError
        The stroke leaves no room for the gas.
    """
    v = np.asarray(velocity, dtype=np.float64)
    a_p1, a_p2, a_r = damper.annulus_area, damper.piston_area, damper.rod_area
    out, into = np.maximum(v, 0.0), np.minimum(v, 0.0)
    through_1 = damper.oil_density**2 * (a_p1**3 * out**2 - a_r**3 * into**2)
    through_2 = damper.oil_density * a_p2**2 * into
    through_3 = damper.oil_density * a_p2**2 * out
    columns = np.stack([through_1, through_2, through_3, np.sign(v)], axis=-1)
    return columns, np.asarray(-a_r * gas_pressure(damper, displacement))


def incompressible_force(
    parameters: Parameters, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> FloatArray:
    """Return the force of the full model for K_e -> infinity.

    Valid as long as chamber 2 does not cavitate: P_3 > rho_0 R_m3 a_p2 v in rebound.

    Parameters
    ----------
    parameters : Parameters
        ``k_e`` is not used.
    damper : Damper
        Geometry, oil and gas.
    displacement, velocity : array_like
        Shape (n,); x in m and v in m/s, positive in rebound.

    Returns
    -------
    numpy.ndarray
        Shape (n,); f in N, positive in rebound.

    Raises
    ------
    SimulationError
        The stroke leaves no room for the gas.

    Examples
    --------
    >>> from damperfit.damper.parameters import PURDY_DAMPER, Parameters
    >>> set_m = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=0.0)
    >>> speed = 2.0 * 3.141592653589793 * 1.5 * 0.032
    >>> incompressible_force(set_m, PURDY_DAMPER, [0.0, 0.0], [speed, -speed]).round(3)
    array([ 892.855, -862.009])
    """
    columns, offset = incompressible_design(damper, displacement, velocity)
    weights = [parameters.r_m1**2, parameters.r_m2, parameters.r_m3, parameters.f_f]
    return np.asarray(columns @ np.array(weights) + offset + parameters.f_0)


def rebound_flows(damper: Damper, velocity: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return Q_1 = a_p1 v and Q_3 = a_p2 v, m3/s, for v > 0 in m/s, eq. (31)."""
    v = np.asarray(velocity, dtype=np.float64)
    return np.asarray(damper.annulus_area * v), np.asarray(damper.piston_area * v)


def bump_flows(damper: Damper, velocity: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return Q_1 = -a_r v and Q_2 = -a_p2 v, m3/s, for v < 0 in m/s, eq. (34)."""
    v = np.asarray(velocity, dtype=np.float64)
    return np.asarray(-damper.rod_area * v), np.asarray(-damper.piston_area * v)


def rebound_pressures(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return P_1 and P_2, Pa, of the simple model for v > 0, eq. (32).

    Parameters
    ----------
    valves : LinearValves
        R_v1 and R_v3 are used.
    damper : Damper
        Geometry and gas.
    displacement, velocity : array_like
        Shape (n,); x in m, v in m/s.

    Returns
    -------
    pressure_1, pressure_2 : numpy.ndarray
        Shape (n,); absolute, Pa. A negative P_2 means that the real damper cavitates.
    """
    p_3 = gas_pressure(damper, displacement)
    q_1, q_3 = rebound_flows(damper, velocity)
    return np.asarray(p_3 + valves.r_v1 * q_1), np.asarray(p_3 - valves.r_v3 * q_3)


def bump_pressures(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return P_1 and P_2, Pa, of the simple model for v < 0, eq. (36).

    Parameters
    ----------
    valves : LinearValves
        R_v1 and R_v2 are used.
    damper : Damper
        Geometry and gas.
    displacement, velocity : array_like
        Shape (n,); x in m, v in m/s.

    Returns
    -------
    pressure_1, pressure_2 : numpy.ndarray
        Shape (n,); absolute, Pa.
    """
    q_1, q_2 = bump_flows(damper, velocity)
    p_1 = gas_pressure(damper, displacement) + valves.r_v1 * q_1
    return np.asarray(p_1), np.asarray(p_1 + valves.r_v2 * q_2)


def simple_slopes(valves: LinearValves, damper: Damper) -> tuple[float, float]:
    """Return df/dv at constant x in rebound and in bump, N s/m, eq. (39).

    Returns
    -------
    rebound, bump : float
        a_p1^2 R_v1 + a_p2^2 R_v3 and a_p2^2 R_v2 + a_r^2 R_v1. A force record fixes these two
        numbers and no more.
    """
    a_p1, a_p2, a_r = damper.annulus_area, damper.piston_area, damper.rod_area
    rebound = a_p1**2 * valves.r_v1 + a_p2**2 * valves.r_v3
    bump = a_p2**2 * valves.r_v2 + a_r**2 * valves.r_v1
    return rebound, bump


def simple_force(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> FloatArray:
    """Return the force of the simple model, eq. (38).

    Incompressible, frictionless, all valves linear; -P_3 a_r at v = 0.

    Parameters
    ----------
    valves : LinearValves
        R_v1, R_v2, R_v3 in Pa s/m3.
    damper : Damper
        Geometry and gas.
    displacement, velocity : array_like
        Shape (n,); x in m, v in m/s, positive in rebound.

    Returns
    -------
    numpy.ndarray
        Shape (n,); f in N, positive in rebound.

    Raises
    ------
    SimulationError
        The stroke leaves no room for the gas.
    """
    v = np.asarray(velocity, dtype=np.float64)
    rebound, bump = simple_slopes(valves, damper)
    gas_force = -damper.rod_area * gas_pressure(damper, displacement)
    return np.asarray(np.where(v > 0.0, rebound, bump) * v + gas_force)
