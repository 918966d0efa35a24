"""Forces that a flaw of log or model would leave in the residuals, one unit of each.

A signature that explains what the fit misses, with everything the fit could absorb projected out,
names the flaw: the fit then lies in no wrong valley, and `damperfit.uncertainty.flaws` says which.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["gain", "signatures"]

# Speeds over which seal friction falls from its breakaway level, m/s.
_STRIBECK_SPEEDS = (0.01, 0.03, 0.1)


def signatures(
    trace: Trace, force: FloatArray, stiff: Sequence[FloatArray] = ()
) -> dict[str, list[FloatArray]]:
    """Return the force that one unit of each flaw adds, behind the filter, where it is compared.

    Parameters
    ----------
    trace : Trace
        The log.
    force : numpy.ndarray
        Shape (n,), over the compared samples, modelled or measured, N.
    stiff : sequence of numpy.ndarray
        Shape (n,) each, derivatives of the modelled force by ln of stiffnesses; none leave a
        stiffness that changes with pressure out.
    """
    x, v = trace.displacement, trace.velocity
    peak = float(np.max(np.abs(v[trace.compared])))
    stroke = float(np.max(np.abs(x[trace.compared])))

    def passed(values: FloatArray) -> FloatArray:
        return apply_filter(trace.model_filter, values)[trace.compared]

    # Stretch by stretch: where one ends and the next begins nothing was logged in between.
    rate = np.concatenate([np.gradient(force[place], trace.interval) for place in trace.places])
    found = {
        "delay": [-rate],
        "gas_volume": [passed(x / stroke)],
        "offset": [np.ones(len(force))],
        "friction_with_speed": [
            passed(np.tanh(v / 1e-3) * np.exp(-np.abs(v) / speed)) for speed in _STRIBECK_SPEEDS
        ],
    }
    if stiff:
        pressure = np.abs(force - force.mean())
        share = pressure / max(float(pressure.max()), 1e-300)
        found["compressibility"] = [column * share for column in stiff]
    found["valve_law_rebound"] = [passed(np.maximum(v, 0.0) ** 2 / peak**2)]
    found["valve_law_bump"] = [passed(np.minimum(v, 0.0) ** 2 / peak**2)]
    return found


def gain(column: FloatArray, absorbed: FloatArray, residuals: FloatArray) -> tuple[float, float]:
    """Return by how much a signature lowers the sum of squares, and its amount.

    Parameters
    ----------
    column : numpy.ndarray
        Shape (n,), the signature.
    absorbed : numpy.ndarray
        Shape (n, k), orthonormal basis of what the fit could absorb.
    residuals : numpy.ndarray
        Shape (n,).
    """
    left = column - absorbed @ (absorbed.T @ column)
    power = float(left @ left)
    if power <= 1e-12 * float(column @ column):
        return 0.0, 0.0  # the fit absorbs it whole
    amount = float(left @ residuals) / power
    return amount * amount * power, amount
