"""The paper's two appendices in full: all equations that the program itself does not need.

The tests hold the model and the program against them. What the program uses stands elsewhere:
eq. (28) in `bulk_modulus`, the gas pressure and the incompressible limit of the full model in
`closed_forms`.

**Appendix 1**, the effective bulk modulus of oil with some gas in it inside an elastic tube. Oil,
gas bubbles and tube wall give way together, like springs in series:

    V_v V_f     volume of bubbles (vapour, gas) and of liquid            m3
    V_t         V_v + V_f                                                m3
    V_r         V_v / V_f                                                -
    K_g K_B K_c bulk modulus of the gas, the liquid, the tube            Pa
    K_e         of all together                                          Pa
    gamma P     polytropic exponent and absolute pressure                -, Pa
    t_c D_i E   wall thickness, inner diameter, Young's modulus          m, m, Pa

    (23) 1/K_e = (V_v/V_t)/K_g + (V_f/V_t)/K_B + 1/K_c       effective_modulus
    (24) V_v/V_t = V_r/(1 + V_r),  V_f/V_t = 1/(1 + V_r)     volume_fractions
    (25) K_e = K_g K_B / ((V_r K_B + K_g)/(1 + V_r) + K_g K_B/K_c)       from (23) and (24)
    (26) K_e = K_g K_B / (V_r K_B + K_g + K_g K_B/K_c)       the same for V_r << 1
    (27) K_g = gamma P,  K_c = t_c E/D_i                     gas_modulus, tube_modulus
    (28) K_e = K_B gamma P / (K_B V_r + C gamma P),  C = 1 + K_B D_i/(t_c E)
    (29) K_e -> 0      for P -> 0                            low_pressure_limit
    (30) K_e -> K_B/C  for P -> infinity                     high_pressure_limit

The paper prints K_e K_B as the numerator of (25) and (26); with K_e on both sides that cannot be
meant, and (23) gives K_g K_B, which is used here.

**Appendix 2**, the simple model: oil that cannot be compressed, no friction, all valves linear. The
flows Q_1 (chamber 1 to 3), Q_2 (2 to 1) and Q_3 (3 to 2) in m3/s follow from v alone, eta of the
gas piston (positive: gas compressed, m) from x; x, v, f > 0 in rebound. Its valves relate pressure
to volume flow, P = R_v Q, so R_v is in Pa s/m3 = N s/m5: only then do the squared areas of (38)
give newtons. A valve of the full model that is linear in mass flow has R_v = rho_0 R_m.

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

Here (33), (35), (38) and (39) carry the paper's numbers, the others stand
where the derivation needs them. Slips of the paper that are corrected here: (33) and (35) print
eta with the sign opposite to (16), and (16) is kept; (17) prints V_g0 + m_3/rho_0, but oil that
enters chamber 3 compresses the gas. From force only the two slopes (39) can be identified, not
the three R_v.

All equations are worked out anew; where a line joins two steps, the number is the one that the
line comes closest to. All functions take floats or arrays that broadcast against each other.

Source: D. J. Purdy, Proc. IMechE D, 2000.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.purdy.closed_forms import gas_pressure
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from damperfit.damper.purdy.parameters import Damper

    FloatArray = NDArray[np.float64]

__all__ = [
    "LinearValves",
    "Tube",
    "bump_flows",
    "bump_pressures",
    "compliance_factor",
    "dilute_modulus",
    "effective_modulus",
    "gas_piston_displacement",
    "high_pressure_limit",
    "low_pressure_limit",
    "mixture_modulus",
    "rebound_flows",
    "rebound_pressures",
    "simple_force",
    "simple_slopes",
    "tube_modulus",
    "volume_fractions",
]


@dataclass(frozen=True, slots=True)
class Tube:
    """A thin-walled elastic tube: t_c and D_i in m, E in Pa."""

    wall_thickness: float
    inner_diameter: float
    youngs_modulus: float

    def __post_init__(self) -> None:
        """Refuse a tube that is not there."""
        if not (self.wall_thickness > 0 and self.inner_diameter > 0 and self.youngs_modulus > 0):
            raise ConfigurationError(
                "thickness, diameter and Young's modulus must all be positive; give SI",
                subject=self,
            )


def volume_fractions(volume_ratio: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return V_v/V_t and V_f/V_t for V_r = V_v/V_f, eq. (24).

    Parameters
    ----------
    volume_ratio : array_like
        V_r, dimensionless, 0 or more.

    Returns
    -------
    gas, liquid : numpy.ndarray
        The two shares, dimensionless; they add to 1.

    Examples
    --------
    >>> gas, liquid = volume_fractions(0.25)
    >>> float(gas), float(liquid)
    (0.2, 0.8)
    """
    ratio = np.asarray(volume_ratio, dtype=np.float64)
    return np.asarray(ratio / (1.0 + ratio)), np.asarray(1.0 / (1.0 + ratio))


def tube_modulus(tube: Tube) -> float:
    """Return K_c = t_c E/D_i, Pa, of a thin-walled tube, eq. (27).

    Hoop stress P D_i/(2 t_c) widens the bore by P D_i/(2 t_c E), and its area by twice that.
    """
    return tube.wall_thickness * tube.youngs_modulus / tube.inner_diameter


def compliance_factor(liquid_modulus: float, tube: Tube | None) -> float:
    """Return C = 1 + K_B D_i/(t_c E), dimensionless; 1 for a rigid tube (None)."""
    return 1.0 if tube is None else 1.0 + liquid_modulus / tube_modulus(tube)


def effective_modulus(
    gas_share: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e from the sum of compliances, eq. (23).

    Parameters
    ----------
    gas_share : array_like
        V_v/V_t, dimensionless, 0 to 1; the liquid has the rest.
    gas, liquid, container : array_like, float, float
        K_g, K_B, K_c in Pa; an infinite K_c is a rigid container.

    Returns
    -------
    numpy.ndarray
        K_e in Pa.
    """
    share = np.asarray(gas_share, dtype=np.float64)
    compliance = share / np.asarray(gas) + (1.0 - share) / liquid + 1.0 / container
    return np.asarray(1.0 / compliance)


def mixture_modulus(
    volume_ratio: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e for V_r = V_v/V_f of any size, eq. (25) with the numerator K_g K_B.

    Parameters
    ----------
    volume_ratio : array_like
        V_r, dimensionless.
    gas, liquid, container : array_like, float, float
        K_g, K_B, K_c in Pa.

    Returns
    -------
    numpy.ndarray
        K_e in Pa.
    """
    ratio = np.asarray(volume_ratio, dtype=np.float64)
    k_g = np.asarray(gas, dtype=np.float64)
    softness = (ratio * liquid + k_g) / (1.0 + ratio) + k_g * (liquid / container)
    return np.asarray(k_g * liquid / softness)


def dilute_modulus(
    volume_ratio: ArrayLike, *, gas: ArrayLike, liquid: float, container: float = np.inf
) -> FloatArray:
    """Return K_e for little gas, V_r << 1, eq. (26) with the numerator K_g K_B.

    The difference to (25) is at most V_r of K_e, in proportion to V_r.
    Parameters and return value are those of `mixture_modulus`.
    """
    ratio = np.asarray(volume_ratio, dtype=np.float64)
    k_g = np.asarray(gas, dtype=np.float64)
    return np.asarray(k_g * liquid / (ratio * liquid + k_g + k_g * (liquid / container)))


def low_pressure_limit(volume_ratio: float, *, liquid: float, compliance: float) -> float:
    """Return K_e for P -> 0, eq. (29): 0 with any gas in the oil, K_B/C without."""
    return 0.0 if volume_ratio > 0.0 else liquid / compliance


def high_pressure_limit(*, liquid: float, compliance: float) -> float:
    """Return K_e for P -> infinity, eq. (30): K_B/C, the oil and the tube alone."""
    return liquid / compliance


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
