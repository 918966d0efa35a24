"""The part of a log that nobody fits: run-up, coast-down, changes of speed.

Other speeds and part of a stroke: what a law makes of them it was not bent to. Nearly every log has
them, so that no further test is needed. Only what moves counts, and no passage from turn to turn
that has the stroke and the speed of a steady one: more of the same cycles says nothing of a law.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning.passages import TURN, turning_points
from damperfit.recording import Stretch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Trace

__all__ = ["TRANSIENTS", "transients"]

TRANSIENTS = "transients"  # their name among what is held out

# s; less tells nothing.
_SHORTEST = 0.25
# Of the highest speed: slower is rest, as the model begins.
_AT_REST = 0.02
_LEAD = 0.05  # s, over which a log's beginning is looked at
_PAUSE = 0.5  # s; shorter ones are part of a motion
# Of the longest stroke: what moves less is rest.
_MOVES = 0.02
# Stroke and speed that differ by less are the steady motion's: rigs repeat both to 1 or 2 %.
_ALIKE = 0.05


def transients(trace: Trace) -> Trace | None:
    """Return a log with what moves beside its stretches as stretches; None where nothing does.

    Parameters
    ----------
    trace : Trace
        A log. What it holds before its first stretch counts only where it begins at rest: else
        the model's state is not yet that of the damper.
    """
    seen = trace if trace.whole is None else trace.whole
    counts = _is_moving(seen)
    if not _begins_at_rest(seen):
        counts[: seen.stretches[0].first] = False
    for one in seen.stretches:
        counts[one.window] = False
    if not _parts(counts, seen.interval):
        return None
    counts &= ~_is_steady(seen)
    parts = _parts(counts, seen.interval)
    found = tuple(one for one in (_moving(seen, *part) for part in parts) if one is not None)
    if not found:
        return None
    return replace(
        seen,
        name=trace.name,
        setting=trace.setting,
        gas_pressure=trace.gas_pressure,
        temperature=trace.temperature,
        findings=trace.findings,
        stretches=found,
        whole=None,
    )


def _parts(counts: NDArray[np.bool_], interval: float) -> list[tuple[int, int]]:
    """Return begin and end of what counts, where it lasts."""
    edges = (np.flatnonzero(counts[1:] != counts[:-1]) + 1).tolist()
    edges = [*([0] if counts[0] else []), *edges, *([len(counts)] if counts[-1] else [])]
    parts = zip(edges[::2], edges[1::2], strict=True)
    return [part for part in parts if (part[1] - part[0]) * interval >= _SHORTEST]


def _begins_at_rest(trace: Trace) -> bool:
    lead = max(1, round(_LEAD / trace.interval))
    return float(np.max(np.abs(trace.velocity[:lead]))) < _AT_REST * _fastest(trace)


def _fastest(trace: Trace) -> float:
    return max(one.peak_speed for one in trace.stretches)


def _is_moving(trace: Trace) -> NDArray[np.bool_]:
    """Where it moves, turns and short pauses included."""
    moves = np.abs(trace.velocity) > _AT_REST * _fastest(trace)
    edges = np.flatnonzero(moves[1:] != moves[:-1]).tolist()
    # From the last sample that moves to the next one that does.
    for last, at_rest in pairwise(edges):
        if moves[last] and (at_rest + 1 - last) * trace.interval <= _PAUSE:
            moves[last + 1 : at_rest + 1] = True
    return np.asarray(moves)


def _is_steady(trace: Trace) -> NDArray[np.bool_]:
    """Where a passage from turn to turn is one of the steady motion's.

    The first and the last, from rest or to it, may be a part of one.
    """
    last = len(trace.force) - 1
    found = np.zeros(last + 1, dtype=bool)
    turns = turning_points(trace.displacement, TURN * float(np.ptp(trace.displacement)))
    ends = np.concatenate([[0], turns, [last]])
    ends = ends[np.concatenate([[True], np.diff(ends) > 0])]
    strokes = np.abs(np.diff(trace.displacement[ends]))
    speed = np.abs(trace.velocity)
    fastest = np.maximum(np.maximum.reduceat(speed[:last], ends[:-1]), speed[ends[1:]])
    is_part = np.zeros(len(strokes), dtype=bool)
    is_part[[0, -1]] = True
    is_like = np.zeros(len(strokes), dtype=bool)
    for one in trace.stretches:
        if one.n_cycles:
            has_its_stroke = is_part | (np.abs(0.5 * strokes / one.amplitude - 1.0) < _ALIKE)
            is_like |= has_its_stroke & (np.abs(fastest / one.peak_speed - 1.0) < _ALIKE)
    found[:last] = np.repeat(is_like, np.diff(ends))
    return found


def _moving(trace: Trace, first: int, stop: int) -> Stretch | None:
    """What lies between two samples, where it moves."""
    x, v = trace.displacement[first:stop], trace.velocity[first:stop]
    amplitude = 0.5 * float(np.ptp(x))
    if amplitude < _MOVES * max(one.amplitude for one in trace.stretches):
        return None
    turns = int(np.count_nonzero(np.diff(np.signbit(v))))
    return Stretch(
        kind="moving",
        first=first,
        stop=stop,
        cycle_starts=np.empty(0),
        frequency=0.5 * turns / ((stop - first) * trace.interval),
        amplitude=amplitude,
        peak_speed=float(np.max(np.abs(v))),
    )
