"""Motion in which nothing repeats: its parts between rests, each compared as a whole."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.passages import TURN, turning_points
from damperfit.conditioning.stretches import Edges, FoundStretch
from damperfit.recording import Stretch
from damperfit.statistics import median, percentiles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

__all__ = ["find_moving"]

_SLOW = 0.02  # of the fastest speed; below is rest
_PAUSE = 0.5  # s; shorter ones are part of a motion
_FEWEST_TURNS = 8  # more than three cycles have
_LONGEST_RUN_IN = 2.0  # s


def find_moving(
    displacement: FloatArray, velocity: FloatArray, *, interval: float, edges: Edges
) -> tuple[FoundStretch, ...]:
    """Return the parts of a log that move, for one in which nothing repeats.

    Parameters
    ----------
    displacement, velocity : numpy.ndarray
        Shape (n,), behind the filter; m, m/s.
    interval : float
        s.
    edges : Edges
        What is left out.
    """
    turns = turning_points(displacement, TURN * float(np.ptp(displacement)))
    if len(turns) < _FEWEST_TURNS:
        return ()
    fastest = percentiles(np.abs(velocity), 99.0)[0]
    found = []
    for low, high in _parts(np.abs(velocity) > _SLOW * fastest, round(_PAUSE / interval)):
        inside = turns[(turns >= low) & (turns < high)]
        if len(inside) < 2:
            continue
        begin = -math.inf if low == 0 else float(low)
        end = math.inf if high == len(velocity) else float(high)
        # What went before the log is forgotten after a cycle.
        run_in = min(2.0 * median(np.diff(inside)), _LONGEST_RUN_IN / interval)
        beside = math.ceil(0.25 * edges.ends)
        first = low + (round(run_in) + edges.ends if low == 0 else beside)
        stop = high - (edges.ends if high == len(velocity) else beside)
        if stop - first > run_in:
            found.append(
                FoundStretch(
                    _moving(first, stop, inside, displacement, velocity, interval), begin, end
                )
            )
    return tuple(found)


def _moving(
    first: int,
    stop: int,
    turns: IntArray,
    displacement: FloatArray,
    velocity: FloatArray,
    interval: float,
) -> Stretch:
    part = slice(first, stop)
    n_turns = max(int(np.count_nonzero((turns >= first) & (turns < stop))), 1)
    return Stretch(
        kind="moving",
        first=first,
        stop=stop,
        cycle_starts=np.empty(0),
        frequency=0.5 * n_turns / ((stop - first) * interval),
        amplitude=0.5 * float(np.ptp(displacement[part])),
        peak_speed=float(np.abs(velocity[part]).max()),
    )


def _parts(is_moving: NDArray[np.bool_], pause: int) -> Sequence[tuple[int, int]]:
    """Return first and stop of the parts that move, short pauses counted in."""
    at = np.flatnonzero(is_moving)
    if not len(at):
        return ()
    breaks = np.flatnonzero(np.diff(at) > pause)
    firsts = at[np.concatenate([[0], breaks + 1])]
    stops = at[np.concatenate([breaks, [len(at) - 1]])] + 1
    # The log's own ends: a turn there is no rest.
    firsts[0] = 0 if firsts[0] <= pause else firsts[0]
    stops[-1] = len(is_moving) if len(is_moving) - stops[-1] <= pause else stops[-1]
    return list(zip(firsts.tolist(), stops.tolist(), strict=True))
