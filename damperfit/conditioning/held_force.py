"""Whether a damper yields before it slides, as magneto-rheological ones and dry friction do.

A valve's force goes with its flow: while the piston slows down it falls with the speed. What yields
holds its force down to no speed, gives elastically behind the reversal, and slides again. So the
force that is left at a tenth of the peak speed *while slowing down* is looked at, of both strokes
together, over the force's range: a tare, the gas and elasticity in series drop out.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from damperfit.passed_speeds import in_both_strokes
from damperfit.statistics import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["YIELDS", "held_share", "held_shares"]

# Share of the force's range from which it yields. Linear valves keep a tenth and friction adds its
# own share: 0.05 to 0.17 over the reference set. Magneto-rheological logs with current have 0.59 to
# 0.71, made-up preloaded valves with a small bleed 0.43 to 0.79.
YIELDS = 0.4
_SLOW = 0.1  # of the stretch's peak speed


def held_share(trace: Trace, modelled: FloatArray | None = None) -> float:
    """Return the share of the force's range that is left at a tenth of the speed.

    The median over the stretches of a log; NaN where none passes that speed both ways.

    Parameters
    ----------
    trace : Trace
        Conditioned.
    modelled : numpy.ndarray, optional
        A model's force at the compared samples, to be asked in place of the measured one, N.
    """
    if not trace.stretches:
        return math.nan
    force = trace.force[trace.compared] if modelled is None else modelled
    return held_shares(trace, force[None, :])[0]


def held_shares(trace: Trace, forces: FloatArray) -> tuple[float, ...]:
    """Return the `held_share` of several forces, (k, n), at the compared samples."""
    shares = np.array(
        [
            _shares(trace.velocity[one.window], forces[:, place])
            for one, place in zip(trace.stretches, trace.places, strict=True)
        ]
    )
    return tuple(median([x for x in of if math.isfinite(x)]) for of in shares.T.tolist())


def _shares(v: FloatArray, forces: FloatArray) -> FloatArray:
    slow = (_SLOW * float(max(v.max(), -v.min())),)
    out, into = in_both_strokes(v, forces, slow)[1][:, 1, 0]
    return np.asarray((out - into) / np.maximum(np.ptp(forces, axis=1), 1e-300))
