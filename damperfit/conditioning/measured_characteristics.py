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

__all__ = [
    "branch_forces",
    "counted_edges",
    "energy_of",
    "figures_in",
    "figures_of",
    "mean_extremes",
    "with_figures",
]


def with_figures(trace: Trace) -> Trace:
    """Return a trace whose stretches hold their figures."""
    return replace(
        trace,
        stretches=tuple(replace(one, figures=figures_in(trace, one)) for one in trace.stretches),
    )


def counted_edges(stretch: Stretch) -> NDArray[np.int64]:
    """Return first samples of the cycles that figures are read off, and the last one's end."""
    if stretch.n_cycles:
        return np.rint(clean_cycles(stretch)).astype(np.int64)
    return np.array([stretch.first, stretch.stop])


def figures_in(trace: Trace, stretch: Stretch) -> StretchFigures:
    """Return the figures of a stretch of a trace, as it holds them where it does."""
    edges = counted_edges(stretch)
    start, stop = (trace.start_time + trace.interval * int(edge) for edge in edges[[0, -1]])
    known = stretch.figures
    if known is not None and (known.start, known.stop) == (start, stop):
        return known
    window = slice(int(edges[0]), int(edges[-1]))
    figures = figures_of(
        trace.velocity[window],
        trace.force[window],
        edges - edges[0],
        interval=trace.interval,
        is_steady=stretch.n_cycles > 0,
    )
    return replace(figures, start=start, stop=stop)


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
    begins, stop = edges[:-1], int(edges[-1])
    velocity, force = velocity[:stop], force[:stop]
    (rebound, peak_rebound), (bump, peak_bump) = mean_extremes(np.stack([velocity, force]), begins)
    half = 0.5 * min(rebound, -bump)
    hysteresis = (math.nan, math.nan)
    if is_steady:
        hysteresis = (
            _hysteresis(velocity, force, half, 1.0),
            _hysteresis(velocity, force, half, -1.0),
        )
    return StretchFigures(
        peak_force_rebound=peak_rebound,
        peak_force_bump=peak_bump,
        peak_speed_rebound=rebound,
        peak_speed_bump=-bump,
        energy=energy_of(velocity, force, len(begins), interval),
        hysteresis_speed=half,
        hysteresis_rebound=hysteresis[0],
        hysteresis_bump=hysteresis[1],
    )


def mean_extremes(
    signals: FloatArray, begins: NDArray[np.int64]
) -> tuple[list[float], list[float]]:
    """Return largest and smallest values of signals, (k, n), each the mean over the cycles."""
    tops = np.maximum.reduceat(signals, begins, axis=1).mean(axis=1)
    bottoms = np.minimum.reduceat(signals, begins, axis=1).mean(axis=1)
    return tops.tolist(), bottoms.tolist()


def energy_of(velocity: FloatArray, force: FloatArray, n_cycles: int, interval: float) -> float:
    """Return the work that a force does in a cycle, J, from all cycles of a motion."""
    return float(np.sum(force * velocity)) * interval / n_cycles


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
