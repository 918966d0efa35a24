"""The bulk modulus of oil with some gas in it at a pressure: eq. (28) of the paper's Appendix 1.

    K_e = K_B gamma P / (K_B V_r + C gamma P)

    K_e K_B     bulk modulus of all together, of the liquid              Pa
    V_r         volume of bubbles (vapour, gas) over that of liquid      -
    C           1 + K_B over the bulk modulus of the tube                -
    gamma P     polytropic exponent and absolute pressure                -, Pa

The other equations of the appendix stand in `appendices`.

Source: D. J. Purdy, Proc. IMechE D, 2000.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    FloatArray = NDArray[np.float64]

__all__ = [
    "gas_modulus",
    "modulus_at_pressure",
]


def gas_modulus(pressure: ArrayLike, *, gas_exponent: float = 1.4) -> FloatArray:
    """Return K_g = gamma P, Pa, for a polytropic gas at absolute pressure P in Pa, eq. (27)."""
    return np.asarray(gas_exponent * np.asarray(pressure, dtype=np.float64))


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
        C of the tube, see `damperfit.damper.purdy.appendices`.
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
