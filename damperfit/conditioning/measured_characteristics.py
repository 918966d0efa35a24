"""What a test engineer reads off each segment: peak forces and speeds, energy, hysteresis.

From the measured force behind the filter. Of steady cycles the mean over them, but for
cycles in which the filter still holds another speed; of a motion that
does not repeat the largest and the smallest force, and the energy of all of it.
"""

import math

import numpy as np

from damperfit.conditioning.cycles import clean_cycles
from damperfit.conditioning.signals import FloatArray, IntArray
from damperfit.passed_speeds import cycle_energies, in_both_strokes
from damperfit.recording import Segment, SegmentFigures, Trace
from damperfit.statistics import median

# Of the peak speed: what is about the peak, and what lies between two strokes.
_NEAR_PEAK, _SLOW = 0.9, 0.5


def counted_edges(segment: Segment) -> IntArray:
    """Return first samples of the cycles that figures are read off, and the last one's end."""
    return np.rint(_edges(segment)).astype(np.int64)


def _edges(segment: Segment) -> FloatArray:
    """The boundaries of these cycles, fractional samples."""
    if segment.n_cycles:
        return clean_cycles(segment)
    return np.array([segment.first, segment.stop], dtype=np.float64)


def figures_in(trace: Trace, segment: Segment) -> SegmentFigures:
    """Return the figures of a segment of a trace, as it holds them where it does."""
    edges = counted_edges(segment)
    start, stop = (trace.start_time + trace.interval * int(edge) for edge in edges[[0, -1]])
    known = segment.figures
    if known is not None and (known.start, known.stop) == (start, stop):
        return known
    window = slice(int(edges[0]), int(edges[-1]))
    velocity, force = trace.velocity[window], trace.force[window]
    (rebound, peak_rebound), (bump, peak_bump) = mean_extremes(
        np.stack([velocity, force]), edges[:-1] - edges[0]
    )
    half = 0.5 * min(rebound, -bump)
    # Opening less closing force of both strokes, and its standard error.
    loops, errors = [math.nan, math.nan], [math.nan, math.nan]
    if segment.n_cycles:
        counts, means, squares = in_both_strokes(velocity, force[None, :], (half,))
        loops = (means[:, 0, 0, 0] - means[:, 1, 0, 0]).tolist()
        n = np.where(counts[:, :, 0] > 1.0, counts[:, :, 0], np.nan)
        errors = np.sqrt(np.sum(squares[:, :, 0, 0] / (n * (n - 1.0)), axis=1)).tolist()
    energies = cycle_energies(trace.velocity, trace.force, _edges(segment), trace.interval)
    scatter = float(np.std(energies, ddof=1)) if len(energies) > 1 else math.nan
    return SegmentFigures(
        peak_force_rebound=peak_rebound,
        peak_force_bump=peak_bump,
        peak_speed_rebound=rebound,
        peak_speed_bump=-bump,
        energy=float(np.mean(energies)),
        hysteresis_speed=half,
        hysteresis_rebound=loops[0],
        hysteresis_bump=loops[1],
        start=start,
        stop=stop,
        energy_se=scatter / math.sqrt(len(energies)),
        hysteresis_rebound_se=errors[0],
        hysteresis_bump_se=errors[1],
    )


def mean_extremes(signals: FloatArray, begins: IntArray) -> tuple[list[float], list[float]]:
    """Return largest and smallest values of signals, (k, n), each the mean over the cycles."""
    tops = np.maximum.reduceat(signals, begins, axis=1).mean(axis=1)
    bottoms = np.minimum.reduceat(signals, begins, axis=1).mean(axis=1)
    return tops.tolist(), bottoms.tolist()


def mean_energy(trace: Trace, segment: Segment, force: FloatArray) -> float:
    """Return the work in a cycle of another force than the measured one, as its figures have it."""
    return float(np.mean(cycle_energies(trace.velocity, force, _edges(segment), trace.interval)))


def peak_velocity_forces(
    speed: FloatArray, signals: FloatArray, begins: IntArray
) -> tuple[float, FloatArray, FloatArray]:
    """Return the peak speed of a stroke, and what signals, (k, n), are there, with their errors.

    Of steady cycles that begin at these samples, speed positive in the stroke. About the middle of
    each passage of 0.9 of the peak speed a parabola is laid through half of its samples, of all
    cycles in one: noise must not pick the sample. Errors by the scatter of the cycles; NaN for one.
    """
    top = median(np.maximum.reduceat(speed, begins))
    is_fast, is_slow = speed >= _NEAR_PEAK * top, speed < _SLOW * top
    if is_fast[0] and is_slow.any():  # whole cycles: the passage goes on where it began
        rest = int(np.argmax(is_slow)) + 1
        speed, is_fast, is_slow = (
            np.concatenate([row, row[:rest]]) for row in (speed, is_fast, is_slow)
        )
        signals = np.concatenate([signals, signals[:, :rest]], axis=1)
    # Between two slow samples lies one passage, however often noise takes it below 0.9.
    fast, passage = np.flatnonzero(is_fast), np.cumsum(is_slow)[is_fast]
    is_whole = passage > (0 if is_fast[0] else -1)
    if is_fast[-1]:
        is_whole &= passage < passage[-1]
    fast, passage = fast[is_whole], passage[is_whole]
    nothing = np.full(len(signals), math.nan)
    if not len(fast):
        return float(np.max(speed)), nothing, nothing
    is_first = np.diff(passage, prepend=-1) != 0
    starts, stops = fast[is_first], fast[np.append(is_first[1:], True)]
    lengths = stops - starts + 1
    halves = 0.25 * median(lengths)
    middles = (0.5 * (starts + stops))[lengths >= halves]
    few = [np.arange(math.ceil(m - halves), math.floor(m + halves) + 1) for m in middles]
    at = np.clip(np.concatenate(few), 0, len(speed) - 1)
    which = np.repeat(np.arange(len(few)), [len(places) for places in few])
    offsets = (at - middles[which]) / max(halves, 1.0)
    n_places = len(set(offsets.round(3).tolist()))  # np.unique would load numpy.ma
    powers = np.vander(offsets, min(3, n_places), increasing=True)
    rows = np.vstack([speed[at], signals[:, at]])
    parabolas = np.linalg.lstsq(powers, rows.T, rcond=None)[0]
    left_over = rows - (powers @ parabolas).T
    counts = np.bincount(which)
    means = np.array([np.bincount(which, row) for row in left_over[1:]])[:, counts > 0]
    means /= counts[counts > 0]
    n = means.shape[1]
    errors = np.std(means, axis=1, ddof=1) / math.sqrt(n) if n > 1 else nothing
    return float(parabolas[0, 0]), parabolas[0, 1:], errors
