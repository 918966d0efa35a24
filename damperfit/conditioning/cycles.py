"""Find the cycles of a motion, and the longest run of steady ones.

A cycle runs from one upward crossing of mid-stroke to the next. A crossing counts only when the
displacement goes beyond a quarter of the amplitude on both sides, so noise at rest makes none.
Positions are fractional samples, from the cubic Hermite piece of (x, v).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.conditioning.plateaus import level_share, off_level
from damperfit.statistics import mean_of, median, percentiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Stretch

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

__all__ = ["Cycles", "clean_cycles", "crossings", "find_cycles"]

_HYSTERESIS = 0.25  # of the amplitude
_MIN_SHARE = 0.1  # of all cycles; noise has many, but hardly two alike in a row


@dataclass(frozen=True, slots=True, eq=False)
class Cycles:
    """The longest run of steady cycles in a motion.

    Attributes
    ----------
    rising, falling : numpy.ndarray
        Fractional sample positions of the steady upward and downward crossings.
    period : float
        Median, samples.
    centre, amplitude : float
        Mid-stroke and half the stroke, medians over the steady cycles, m.
    n_found : int
        Whole cycles of motion in the log, steady or not.
    n_elsewhere : int
        Steady cycles outside of the longest run of them, beyond a break in the motion.
    break_at : float
        Where the run meets the nearest break, samples; NaN where nothing stands beyond.
    begin, end : float
        Where cycles of another length or size begin, samples; infinite where none do.
    """

    rising: FloatArray
    falling: FloatArray
    period: float
    centre: float
    amplitude: float
    n_found: int
    n_elsewhere: int = 0
    break_at: float = math.nan
    begin: float = -math.inf
    end: float = math.inf


def find_cycles(
    displacement: FloatArray, velocity: FloatArray, *, steadiness: float
) -> Cycles | None:
    """Return the steady cycles of a motion, or None when there are none.

    Parameters
    ----------
    displacement, velocity : numpy.ndarray
        Shape (n,); m and metres per sample interval.
    steadiness : float
        Fraction of the medians within which amplitude and period must be.
    """
    speed = np.abs(velocity)
    moving = displacement[speed > 0.5 * np.sqrt(mean_of(velocity**2))]
    if not len(moving):
        return None
    low, level, high = percentiles(moving, 5.0, 50.0, 95.0)
    amplitude = 0.5 * (high - low)
    run = None
    for _ in range(3):  # the first level is a guess; the second is exact to rounding
        run = _steady_run(displacement, velocity, level, _HYSTERESIS * amplitude, steadiness)
        if run is None:
            return None
        level, amplitude = level + run.middle, run.amplitude
        if abs(run.middle) < 1e-6 * amplitude:
            break
    assert run is not None
    rising, falling = (
        crossings(displacement, velocity, _HYSTERESIS * amplitude, level=level, sign=sign)
        for sign in (1.0, -1.0)
    )
    first = max(run.boundaries[0] - 0.75 * run.period, run.begin - 1.0)
    last = min(run.boundaries[-1] + 0.75 * run.period, run.end + 1.0)
    between, begin, end = _of_run(falling[(falling > first) & (falling < last)], run, steadiness)
    return Cycles(
        rising=run.boundaries,
        falling=between,
        period=run.period,
        centre=float(level),
        amplitude=run.amplitude,
        n_found=_whole_cycles(np.sort(np.concatenate([rising, falling])), run.period, len(speed)),
        n_elsewhere=run.n_elsewhere,
        break_at=run.break_at,
        begin=begin,
        end=end,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    boundaries: FloatArray
    period: float
    middle: float
    amplitude: float
    n_elsewhere: int
    break_at: float
    begin: float
    end: float


def _steady_run(
    x: FloatArray, velocity: FloatArray, level: float, hysteresis: float, steadiness: float
) -> _Run | None:
    boundaries = crossings(x, velocity, hysteresis, level=level)
    if len(boundaries) < 2:
        return None
    periods = np.diff(boundaries)
    tops = _tops(x, velocity, boundaries, level)
    bottoms = -_tops(x, velocity, boundaries, level, sign=-1.0)
    amplitudes = 0.5 * (tops - bottoms)
    is_steady = _near_median(periods, steadiness) & _near_median(amplitudes, steadiness)
    start, stop = _longest(is_steady)
    if stop - start < max(1.0, _MIN_SHARE * len(periods)):
        return None
    before, behind = int(np.sum(is_steady[:start])), int(np.sum(is_steady[stop:]))
    ends = start, stop
    start, stop = _without_others(periods, amplitudes, start, stop, steadiness)
    steady = slice(start, stop)
    nearest = boundaries[stop] if behind >= before else boundaries[start]
    return _Run(
        boundaries=boundaries[start : stop + 1],
        period=median(periods[steady]),
        middle=median(0.5 * (tops + bottoms)[steady]),
        amplitude=median(amplitudes[steady]),
        n_elsewhere=before + behind,
        break_at=float(nearest) if before + behind else math.nan,
        begin=float(boundaries[start]) if start > ends[0] else -math.inf,
        end=float(boundaries[stop]) if stop < ends[1] else math.inf,
    )


def _of_run(falling: FloatArray, run: _Run, steadiness: float) -> tuple[FloatArray, float, float]:
    """Return the falling passages of a run, and where it begins and ends by them.

    The first and the last may stand half a cycle outside of the rising ones: there half of the
    difference that a cycle may have is enough.
    """
    begin, end = run.begin, run.end
    rising = run.boundaries
    allowed = 0.5 * level_share(np.diff(rising), steadiness) * run.period
    inside = falling[(falling > rising[0]) & (falling < rising[-1])]
    if not len(inside):
        return falling, begin, end
    ahead, behind = inside[0] - falling[0], falling[-1] - inside[-1]
    if ahead > 0.0 and abs(ahead - run.period) > allowed:
        falling, begin = falling[1:], float(rising[0])
    if behind > 0.0 and abs(behind - run.period) > allowed:
        falling, end = falling[:-1], float(rising[-1])
    return falling, begin, end


def _without_others(
    periods: FloatArray, amplitudes: FloatArray, start: int, stop: int, steadiness: float
) -> tuple[int, int]:
    """Leave out cycles at both ends that lead over to another test."""
    is_off = off_level(periods[start:stop], "period", steadiness)
    is_off |= off_level(amplitudes[start:stop], "amplitude", steadiness)
    like = np.flatnonzero(~is_off)
    return (start + int(like[0]), start + int(like[-1]) + 1) if len(like) else (start, stop)


def _near_median(values: FloatArray, tolerance: float) -> NDArray[np.bool_]:
    middle = median(values)
    return np.abs(values - middle) <= tolerance * middle


def _longest(is_steady: NDArray[np.bool_]) -> tuple[int, int]:
    """Return start and stop of the longest run of True; the first of equals."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_steady.astype(np.int8), [0]])))
    if not len(edges):
        return 0, 0
    starts, stops = edges[::2], edges[1::2]
    best = int(np.argmax(stops - starts))
    return int(starts[best]), int(stops[best])


def crossings(
    x: FloatArray, velocity: FloatArray, hysteresis: float, *, level: float = 0.0, sign: float = 1.0
) -> FloatArray:
    """Return fractional positions where x rises through a level, from -h to +h beside it.

    Parameters
    ----------
    x, velocity : numpy.ndarray
        Shape (n,); m and metres per sample interval.
    hysteresis : float
        h, m.
    level : float
        m.
    sign : float
        1; or -1, where x falls.
    """
    x, v = (np.ascontiguousarray(values, np.float64) for values in (x, velocity))
    at = np.empty(len(x) // 2 + 1)
    return at[: compiled_core().crossings(x, v, at, hysteresis, level, sign)].copy()


def clean_cycles(stretch: Stretch) -> FloatArray:
    """Return boundaries of the cycles in which the filter holds no other motion, samples.

    Where it holds one in all of them, those of the cycle farthest from both.

    Parameters
    ----------
    stretch : Stretch
        Steady cycles.
    """
    starts = stretch.cycle_starts
    if stretch.smeared == (0, 0):
        return starts
    low, high = stretch.first + stretch.smeared[0], stretch.stop - stretch.smeared[1]
    clean = starts[(starts >= low) & (starts <= high)]
    if len(clean) >= 2:
        return clean
    period = float(starts[-1] - starts[0]) / stretch.n_cycles
    begin = min(max(0.5 * (low + high - period), float(starts[0])), float(starts[-1]) - period)
    return np.array([begin, begin + period])


def _tops(
    x: FloatArray, velocity: FloatArray, boundaries: FloatArray, level: float, *, sign: float = 1.0
) -> FloatArray:
    """Return the top of each cycle: that of the Hermite piece beside its highest sample."""
    x, v = (np.ascontiguousarray(values, np.float64) for values in (x, velocity))
    tops = np.empty(len(boundaries) - 1)
    compiled_core().tops(x, v, boundaries, tops, level, sign)
    return tops


def _whole_cycles(crossings: FloatArray, period: float, n: int) -> int:
    """Return how many whole cycles fit from the beginning of the motion to its end.

    Ahead of the first and behind the last crossing, up to half a cycle is motion that the log's
    ends cut; more is rest, run-up or coast-down. The last crossing is not seen until the hysteresis
    behind it is passed, up to a sample later.
    """
    ahead, behind = float(crossings[0]), n - float(crossings[-1])
    length = float(crossings[-1] - crossings[0])
    length += sum(part for part in (ahead, behind) if part <= 0.55 * period + 1.0)
    return int(length / period + 0.02)
