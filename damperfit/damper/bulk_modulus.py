"""Effective bulk modulus of oil with some gas in it inside an elastic tube: the paper's Appendix 1.

Oil, gas bubbles and tube wall give way together, like springs in series:

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

Source: D. J. Purdy, Proc. IMechE D, 2000, Appendix 1. The equations are worked out anew here;
where a line joins two steps, the number is the one that the line comes closest to. The paper
prints K_e K_B as the numerator of (25) and (26); with K_e on both sides that cannot be meant, and
(23) gives K_g K_B, which is used here.

All functions take floats or arrays that broadcast against each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    FloatArray = NDArray[np.float64]

__all__ = [
    "Tube",
    "compliance_factor",
    "dilute_modulus",
    "effective_modulus",
    "gas_modulus",
    "high_pressure_limit",
    "low_pressure_limit",
    "mixture_modulus",
    "modulus_at_pressure",
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
                f"{self}: thickness, diameter and Young's modulus must all be positive; give SI"
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


def gas_modulus(pressure: ArrayLike, *, gas_exponent: float = 1.4) -> FloatArray:
    """Return K_g = gamma P, Pa, for a polytropic gas at absolute pressure P in Pa, eq. (27)."""
    return np.asarray(gas_exponent * np.asarray(pressure, dtype=np.float64))


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


def modulus_at_pressure(
    pressure: ArrayLike,
    *,
    volume_ratio: ArrayLike,
    liquid: float = 1.5e9,
    compliance: float = 1.1,
    gas_exponent: float = 1.4,
) -> FloatArray:
    """Return K_e = K_B gamma P/(K_B V_r + C gamma P), eq. (28).

    Parameters
    ----------
    pressure : array_like
        P, absolute, Pa.
    volume_ratio : array_like
        V_r at this pressure, dimensionless, << 1.
    liquid : float
        K_B, Pa.
    compliance : float
        C of the tube, see `compliance_factor`.
    gas_exponent : float
        gamma.

    Returns
    -------
    numpy.ndarray
        K_e in Pa.

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
