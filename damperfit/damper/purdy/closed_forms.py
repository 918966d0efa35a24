"""Closed forms of the paper: forces that need no integration, and its two appendices.

The gas expands by what the rod draws from chamber 3: P_3 = P_0 (V_g0/(V_g0 + a_r x))^gamma. With
oil that cannot be compressed, the flows follow from the velocity alone (x, v, f > 0 in rebound),
as Appendix 2 has them; the mass flows of the full model are w = rho_0 Q.

**Full model, K_e -> infinity** (square-root valve 1, linear valves 2 and 3, friction). The force
is linear in R_m1^2, R_m2, R_m3, f_f, which gives a fit its starting values:

    f = a_p1 (R_m1 rho_0 a_p1 v)^2 + rho_0 R_m3 a_p2^2 v - a_r (P_3 - P_amb) + f_f + f_0      v > 0
    f = -a_r (R_m1 rho_0 a_r v)^2  + rho_0 R_m2 a_p2^2 v - a_r (P_3 - P_amb) - f_f + f_0      v < 0

**Appendix 1**, eqs (23) to (30): the effective bulk modulus of oil with some gas in it inside an
elastic tube. Oil, gas bubbles and tube wall give way together, like springs in series; V_r is the
volume of bubbles over that of liquid, K_g, K_B and K_c the moduli of gas, liquid and tube, C = 1 +
K_B/K_c. The paper prints K_e K_B as the numerator of (25) and (26); (23) gives K_g K_B, used here.

**Appendix 2**, eqs (31) to (39), the simple model: oil that cannot be compressed, no friction, all
valves linear. The flows Q_1 (chamber 1 to 3), Q_2 (2 to 1) and Q_3 (3 to 2) in m3/s follow from v
alone, eta of the gas piston (positive: gas compressed) from x, and with it P_3, eq. (37). P = R_v
Q, R_v in Pa s/m3: a valve of the full model that is linear in mass flow has R_v = rho_0 R_m. (33)
and (35) print eta with the sign opposite to (16), and (16) is kept.

Functions of the appendices take floats or arrays that broadcast against each other, in SI. Source:
D. J. Purdy, Proc. IMechE D, 2000.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from damperfit.arrays import FloatArray
from damperfit.errors import ConfigurationError, SimulationError

if TYPE_CHECKING:
    from damperfit.damper.purdy.parameters import Damper, Parameters


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


# The appendices.


class Tube(NamedTuple):
    """A thin-walled elastic tube."""

    wall_thickness: float  # t_c, m
    inner_diameter: float  # D_i, m
    youngs_modulus: float  # E, Pa


def volume_fractions(volume_ratio: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the shares of gas and liquid, V_r/(1 + V_r) and 1/(1 + V_r), eq. (24)."""
    ratio = np.asarray(volume_ratio, dtype=np.float64)
    return ratio / (1.0 + ratio), 1.0 / (1.0 + ratio)


def gas_modulus(pressure: ArrayLike, *, gas_exponent: float = 1.4) -> FloatArray:
    """Return K_g = gamma P, Pa, for a polytropic gas at absolute pressure P in Pa, eq. (27)."""
    return np.asarray(gas_exponent * np.asarray(pressure, dtype=np.float64))


def tube_modulus(tube: Tube) -> float:
    """Return K_c = t_c E/D_i, Pa, eq. (27): the bore widens by P D_i/(2 t_c E), its area twice."""
    if not min(tube) > 0.0:
        raise ConfigurationError(
            "thickness, diameter and Young's modulus must all be positive; give SI",
            subject=tube,
            code="out-of-range",
        )
    return tube.wall_thickness * tube.youngs_modulus / tube.inner_diameter


def compliance_factor(liquid_modulus: float, tube: Tube | None) -> float:
    """Return C = 1 + K_B D_i/(t_c E), dimensionless; 1 for a rigid tube (None)."""
    return 1.0 if tube is None else 1.0 + liquid_modulus / tube_modulus(tube)


def effective_modulus(
    gas_share: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e, Pa: 1/K_e = (V_v/V_t)/K_g + (V_f/V_t)/K_B + 1/K_c, eq. (23)."""
    share = np.asarray(gas_share, dtype=np.float64)
    return np.asarray(1.0 / (share / np.asarray(gas) + (1.0 - share) / liquid + 1.0 / container))


def mixture_modulus(
    volume_ratio: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e = K_g K_B/((V_r K_B + K_g)/(1 + V_r) + K_g K_B/K_c), Pa, eq. (25)."""
    ratio, k_g = np.asarray(volume_ratio, dtype=float), np.asarray(gas, dtype=float)
    softness = (ratio * liquid + k_g) / (1.0 + ratio) + k_g * (liquid / container)
    return np.asarray(k_g * liquid / softness)


def dilute_modulus(
    volume_ratio: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e = K_g K_B/(V_r K_B + K_g + K_g K_B/K_c), Pa, for V_r << 1, eq. (26)."""
    ratio, k_g = np.asarray(volume_ratio, dtype=float), np.asarray(gas, dtype=float)
    return np.asarray(k_g * liquid / (ratio * liquid + k_g + k_g * (liquid / container)))


def modulus_at_pressure(
    pressure: ArrayLike,
    *,
    volume_ratio: ArrayLike,
    liquid: float = 1.5e9,
    compliance: float = 1.1,
    gas_exponent: float = 1.4,
) -> FloatArray:
    """Return K_B gamma P/(K_B V_r + C gamma P), Pa, eq. (28); V_r and P (absolute) as they are.

    Examples
    --------
    >>> [f"{k:.1e}" for k in modulus_at_pressure(20e5, volume_ratio=[0.001, 0.005, 0.01])]
    ['9.2e+08', '4.0e+08', '2.3e+08']
    """
    k_g = gas_modulus(pressure, gas_exponent=gas_exponent)
    ratio = np.asarray(volume_ratio, dtype=np.float64)
    return np.asarray(liquid * k_g / (liquid * ratio + compliance * k_g))


def low_pressure_limit(volume_ratio: float, *, liquid: float, compliance: float) -> float:
    """Return K_e for P -> 0, eq. (29): 0 with any gas in the oil, K_B/C without."""
    return 0.0 if volume_ratio > 0.0 else liquid / compliance


def high_pressure_limit(*, liquid: float, compliance: float) -> float:
    """Return K_e for P -> infinity, eq. (30): K_B/C, the oil and the tube alone."""
    return liquid / compliance


class LinearValves(NamedTuple):
    """R_v1, R_v2, R_v3 of Appendix 2: pressure drop per volume flow, Pa s/m3 (= N s/m5)."""

    r_v1: float
    r_v2: float
    r_v3: float


def gas_piston_displacement(damper: Damper, displacement: ArrayLike) -> FloatArray:
    """Return eta = -x a_r/a_g, m, eq. (16), and (33) and (35) with its sign."""
    gas_area = damper.gas_volume / damper.gas_length
    return np.asarray(-np.asarray(displacement, dtype=np.float64) * (damper.rod_area / gas_area))


def rebound_flows(damper: Damper, velocity: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return Q_1 = a_p1 v and Q_3 = a_p2 v, m3/s, for v > 0, eq. (31)."""
    v = np.asarray(velocity, dtype=np.float64)
    return damper.annulus_area * v, damper.piston_area * v


def bump_flows(damper: Damper, velocity: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return Q_1 = -a_r v and Q_2 = -a_p2 v, m3/s, for v < 0, eq. (34)."""
    v = np.asarray(velocity, dtype=np.float64)
    return -damper.rod_area * v, -damper.piston_area * v


def rebound_pressures(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return P_3 + R_v1 Q_1 and P_3 - R_v3 Q_3, Pa, v > 0, eq. (32); negative: it cavitates."""
    p_3 = gas_pressure(damper, displacement)
    q_1, q_3 = rebound_flows(damper, velocity)
    return p_3 + valves.r_v1 * q_1, p_3 - valves.r_v3 * q_3


def bump_pressures(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return P_1 = P_3 + R_v1 Q_1 and P_1 + R_v2 Q_2, Pa, for v < 0, eq. (36)."""
    q_1, q_2 = bump_flows(damper, velocity)
    p_1 = gas_pressure(damper, displacement) + valves.r_v1 * q_1
    return p_1, p_1 + valves.r_v2 * q_2


def simple_slopes(valves: LinearValves, damper: Damper) -> tuple[float, float]:
    """Return df/dv at constant x in rebound and in bump, N s/m, eq. (39)."""
    a_p1, a_p2, a_r = damper.annulus_area, damper.piston_area, damper.rod_area
    rebound = a_p1**2 * valves.r_v1 + a_p2**2 * valves.r_v3
    return rebound, a_p2**2 * valves.r_v2 + a_r**2 * valves.r_v1


def simple_force(
    valves: LinearValves, damper: Damper, displacement: ArrayLike, velocity: ArrayLike
) -> FloatArray:
    """Return v times the slope of its stroke, less P_3 a_r, N, eq. (38)."""
    v = np.asarray(velocity, dtype=np.float64)
    rebound, bump = simple_slopes(valves, damper)
    gas_force = -damper.rod_area * gas_pressure(damper, displacement)
    return np.asarray(np.where(v > 0.0, rebound, bump) * v + gas_force)
