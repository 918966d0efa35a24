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

from damperfit.statistics import median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["YIELDS", "held_share"]

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
    shares = [
        _share(
            trace.velocity[one.window],
            trace.force[one.window] if modelled is None else modelled[place],
        )
        for one, place in zip(trace.stretches, trace.places if trace.stretches else (), strict=True)
    ]
    known = [share for share in shares if math.isfinite(share)]
    return median(known) if known else math.nan


def _share(v: FloatArray, f: FloatArray) -> float:
    slow = _SLOW * float(np.abs(v).max())
    out, into = _while_slowing(v, f, slow), _while_slowing(-v, f, slow)
    return (out - into) / max(float(np.ptp(f)), 1e-300)


def _while_slowing(speed: FloatArray, force: FloatArray, at: float) -> float:
    """Return the mean force where the speed falls through a value; NaN where it never does."""
    places = np.flatnonzero((speed[:-1] >= at) & (speed[1:] < at))
    if not len(places):
        return math.nan
    share = (speed[places] - at) / (speed[places] - speed[places + 1])
    return float(np.mean(force[places] + share * (force[places + 1] - force[places])))
