"""What a test engineer reads off each stretch: peak forces and speeds, energy, hysteresis.

From the measured force behind the filter. Of steady cycles the mean over them, but for
cycles in which the filter still holds another speed; of a motion that
does not repeat the largest and the smallest force, and the energy of all of it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.cycles import clean_cycles
from damperfit.passed_speeds import at_speeds
from damperfit.recording import StretchFigures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Stretch, Trace

    FloatArray = NDArray[np.float64]

__all__ = ["branch_forces", "figures_of", "with_figures"]


def with_figures(trace: Trace) -> Trace:
    """Return a trace whose stretches hold their figures."""
    return replace(
        trace,
        stretches=tuple(replace(one, figures=_figures(trace, one)) for one in trace.stretches),
    )


def _figures(trace: Trace, stretch: Stretch) -> StretchFigures:
    edges = np.array([stretch.first, stretch.stop])
    if stretch.n_cycles:
        edges = np.rint(clean_cycles(stretch)).astype(np.int64)
    window = slice(int(edges[0]), int(edges[-1]))
    figures = figures_of(
        trace.velocity[window],
        trace.force[window],
        edges - edges[0],
        interval=trace.interval,
        is_steady=stretch.n_cycles > 0,
    )
    ends = (trace.start_time + trace.interval * int(edge) for edge in (edges[0], edges[-1]))
    return replace(figures, **dict(zip(("start", "stop"), ends, strict=True)))


def figures_of(
    velocity: FloatArray,
    force: FloatArray,
    edges: NDArray[np.int64],
    *,
    interval: float,
    is_steady: bool,
) -> StretchFigures:
    """Return what is read off some cycles, or off a motion that does not repeat.

    Parameters
    ----------
    velocity, force : numpy.ndarray
        Shape (n,); m/s, N.
    edges : numpy.ndarray
        First samples of the cycles, and the end of the last one.
    interval : float
        s.
    is_steady : bool
        The cycles repeat.
    """
    v, f = velocity, force
    begins = edges[:-1]
    stop = int(edges[-1])

    def largest(values: FloatArray) -> float:
        return float(np.mean(np.maximum.reduceat(values[:stop], begins)))

    speeds = largest(v), largest(-v)
    half = 0.5 * min(speeds)
    hysteresis = (math.nan, math.nan)
    if is_steady:
        hysteresis = _hysteresis(v, f, half, 1.0), _hysteresis(v, f, half, -1.0)
    return StretchFigures(
        peak_force_rebound=largest(f),
        peak_force_bump=-largest(-f),
        peak_speed_rebound=speeds[0],
        peak_speed_bump=speeds[1],
        energy=float(np.sum(f[:stop] * v[:stop])) * interval / len(begins),
        hysteresis_speed=half,
        hysteresis_rebound=hysteresis[0],
        hysteresis_bump=hysteresis[1],
    )


def _hysteresis(velocity: FloatArray, force: FloatArray, at: float, sign: float) -> float:
    """Return the mean force where the speed rises through a value, less that where it falls."""
    opening, closing = branch_forces(velocity, force[None, :], (at,), sign=sign)[:, 0, 0].tolist()
    return float(opening - closing)


def branch_forces(
    velocity: FloatArray, forces: FloatArray, speeds: Sequence[float], *, sign: float = 1.0
) -> FloatArray:
    """Return the mean forces where the speed rises through values, and where it falls.

    Parameters
    ----------
    velocity : numpy.ndarray
        Shape (n,), m/s.
    forces : numpy.ndarray
        Shape (k, n), N.
    speeds : sequence of float
        m/s, rising.
    sign : float
        What makes the stroke's velocity positive.

    Returns
    -------
    numpy.ndarray
        Shape (2, number of speeds, k): opening and closing branch, N; NaN where a speed is never
        passed so.
    """
    return at_speeds(velocity, forces, speeds, sign=sign)[1]
