"""Which part of a log is compared: one steady run, several, or motion that does not repeat.

One steady run goes cycle by cycle: a cycle of run-in and the filter's edges are left out. Where
that leaves fewer than three cycles, and where a short run stands at an end of the log, the log is
continued by its own cycles (`damperfit.conditioning.continuation`); one between two rests is
compared from break to break, where that is more.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning.behind_filter import FilteredLog, behind_filter
from damperfit.conditioning.continuation import continue_log
from damperfit.conditioning.cycles import Cycles, find_cycles
from damperfit.conditioning.drive import content_beyond
from damperfit.conditioning.filters import fading_samples, settling_samples
from damperfit.conditioning.moving import find_moving
from damperfit.conditioning.passages import ends_in_motion
from damperfit.conditioning.refusals import MIN_CYCLES, refuse_fast
from damperfit.conditioning.stretches import (
    Edges,
    FoundStretch,
    find_runs,
    is_one_run,
    steady_stretch,
)
from damperfit.errors import ConditioningError
from damperfit.recording import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.conditioning.options import ConditionOptions
    from damperfit.conditioning.timebase import UniformLog

    FloatArray = NDArray[np.float64]

__all__ = ["ComparedPart", "choose_compared"]

# Speed beyond half the corner, over all of it: noise behind the filter has 0.95, a random walk
# 0.65, a road up to 15 Hz nothing.
_NOISE = 0.5
_SPLINE_EDGE = 14  # samples; 0.268^14 = 1e-8, how an end condition fades in a cubic spline


class ComparedPart(NamedTuple):
    """What is compared of a log.

    `seen` may be longer than what was logged. `keep` are the samples of it that the model runs
    through; `cycles` is None where the log is no single steady run.
    """

    seen: FilteredLog
    found: tuple[FoundStretch, ...]
    n_found: int
    cycles: Cycles | None
    keep: slice
    findings: tuple[Finding, ...] = ()


def choose_compared(name: str, log: UniformLog, options: ConditionOptions) -> ComparedPart:
    """Return what of a log is compared with the model.

    Parameters
    ----------
    name : str
        Of the log, for refusals.
    log : UniformLog
        As logged.
    options : ConditionOptions
        Filter and rig facts.

    Raises
    ------
    ConditioningError
        Too few steady cycles, a motion that the filter takes away, a corner beyond half the rate.
    """
    try:
        seen = behind_filter(log, options)
    except ConditioningError as error:
        raise ConditioningError(f"{name}: {error}") from None
    cycles = _cycles(seen, options)
    one = _one_run(name, seen, cycles, options) if _is_one_run(seen, options) else None
    if one and _n_cycles(one.found) >= MIN_CYCLES:
        return one
    found, n_found = _several(seen, _edges(seen), options)
    if one is None:
        if found and found[0].stretch.kind == "moving":
            return _kept(seen, found, n_found, None)
        if len(found) > 1:
            return _continued(name, seen, found, n_found, None, options) or _kept(
                seen, found, n_found, None
            )
        one = _one_run(name, seen, cycles, options)
    if one and not _is_longer_run(found, n_found, one):
        return one
    # A short run in the middle of a log needs no run-in and no edges of the filter.
    of_run = None if n_found < MIN_CYCLES else found
    n_cycles = cycles.n_found if cycles else 0
    longer = n_cycles >= MIN_CYCLES and _continued(name, seen, (), n_cycles, cycles, options)
    if longer:
        return longer
    if not of_run:
        _window(name, log, cycles, _edge(seen))  # says why there is none
    return _kept(seen, found, n_found, None)


def _n_cycles(found: tuple[FoundStretch, ...]) -> int:
    return sum(one.stretch.n_cycles for one in found)


def _is_longer_run(found: tuple[FoundStretch, ...], n_found: int, one: ComparedPart) -> bool:
    """Whether the run between its breaks has more cycles than behind a run-in and edges."""
    if len(found) != 1 or found[0].stretch.kind == "moving" or n_found < MIN_CYCLES:
        return False
    return _n_cycles(found) > _n_cycles(one.found)


def _is_one_run(seen: FilteredLog, options: ConditionOptions) -> bool:
    return is_one_run(
        seen.displacement,
        interval=seen.log.interval,
        steadiness=options.steadiness,
        edges=_edges(seen),
    )


def _one_run(
    name: str, seen: FilteredLog, cycles: Cycles | None, options: ConditionOptions
) -> ComparedPart | None:
    """Return what is compared of one steady run; None where it leaves no window."""
    log = seen.log
    try:
        starts = _window(name, log, cycles, _edge(seen))
    except ConditioningError:
        return None
    assert cycles is not None
    refuse_fast(name, log, cycles, options)
    stretch = steady_stretch(starts, seen.velocity, log.interval, cycles.amplitude)
    found = (FoundStretch(stretch, -math.inf, math.inf),)
    if stretch.n_cycles < MIN_CYCLES:
        longer = _continued(name, seen, found, cycles.n_found, cycles, options)
        if longer:
            return longer
    return _kept(seen, found, cycles.n_found, cycles)


def _edge(seen: FilteredLog) -> int:
    return max(settling_samples(seen.model_filter), _SPLINE_EDGE)


def _edges(seen: FilteredLog) -> Edges:
    return Edges(max(fading_samples(seen.model_filter), _SPLINE_EDGE))


def _cycles(seen: FilteredLog, options: ConditionOptions) -> Cycles | None:
    speed = seen.velocity * seen.log.interval
    return find_cycles(seen.displacement, speed, steadiness=options.steadiness)


def _kept(
    seen: FilteredLog, found: tuple[FoundStretch, ...], n_found: int, cycles: Cycles | None
) -> ComparedPart:
    """Add what the model runs through: from where the motion begins, or a cycle before."""
    first, last = found[0].stretch, found[-1].stretch
    edge = _edge(seen)
    ahead = edge + first.first - math.floor(max(found[0].begin, 0.0))
    if cycles is not None:
        ahead = edge + math.ceil(cycles.period) + 1
    keep = slice(max(0, first.first - ahead), last.stop + edge + 2)
    return ComparedPart(seen, found, n_found, cycles, keep)


def _continued(
    name: str,
    seen: FilteredLog,
    found: tuple[FoundStretch, ...],
    n_found: int,
    cycles: Cycles | None,
    options: ConditionOptions,
) -> ComparedPart | None:
    """Return what is compared when the log is continued by its cycles; None where no more is."""
    log = seen.log
    begin, end = ends_in_motion(log.displacement, options.steadiness)
    at_begin = found[0].stretch.n_cycles if found and math.isinf(found[0].begin) else 0
    at_end = found[-1].stretch.n_cycles if found and math.isinf(found[-1].end) else 0
    begin = begin if at_begin < MIN_CYCLES else None
    end = end if at_end < MIN_CYCLES else None
    if begin is None and end is None:
        return None
    longer = continue_log(log, begin, end, reach=_edge(seen))
    seen = behind_filter(longer.log, options)
    edges = _edges(seen)._replace(
        first=None if begin is None else float(longer.first),
        stop=None if end is None else float(longer.stop),
    )
    more, _ = find_runs(
        seen.displacement,
        seen.velocity,
        interval=log.interval,
        steadiness=options.steadiness,
        edges=edges,
    )
    if sum(one.stretch.n_cycles for one in more) <= sum(one.stretch.n_cycles for one in found):
        return None
    single = None
    if cycles is not None and len(more) == 1:
        refuse_fast(name, log, cycles, options)
        steady = _cycles(seen, options)
        single = None if steady is None else replace(steady, n_found=n_found)
    where = " and ".join(
        word for word, at in (("beginning", begin), ("end", end)) if at is not None
    )
    text = (
        f"there are few cycles at the {where} of the log: it is continued there by its own cycles "
        "for run-in and filter; only what was logged is compared"
    )
    finding = Finding("continued", "note", text)
    return _kept(seen, more, n_found, single)._replace(findings=(finding,))


def _several(
    seen: FilteredLog, edges: Edges, options: ConditionOptions
) -> tuple[tuple[FoundStretch, ...], int]:
    """Return the stretches of a log that is not one steady run, and its cycles; none where it is.

    Noise of a sensor at rest is no motion: nearly all of its speed is far up.
    """
    interval = seen.log.interval
    displacement, velocity = seen.displacement, seen.velocity
    found, n_found = find_runs(
        displacement, velocity, interval=interval, steadiness=options.steadiness, edges=edges
    )
    if found:
        return found, n_found
    half = 0.5 * (
        options.filter_corner if options.rig_filter == "none" else options.rig_filter_corner
    )
    if content_beyond(displacement, interval, min(half, 0.1 / interval)) > _NOISE:
        return (), n_found
    return find_moving(displacement, velocity, interval=interval, edges=edges), n_found


def _window(name: str, log: UniformLog, cycles: Cycles | None, edge: int) -> FloatArray:
    """Return boundaries of the steady cycles that neither run-in nor filter edges touch."""
    n, h = len(log.force), log.interval
    length = f"the log is {n * h:.3g} s long"
    if cycles is None or cycles.n_found < MIN_CYCLES:
        found = 0 if cycles is None else cycles.n_found
        stroke = 1e3 * float(np.ptp(log.displacement))
        period = "" if cycles is None else f" ({MIN_CYCLES * cycles.period * h:.3g} s)"
        raise ConditioningError(
            f"{name}: found {found} whole steady cycle{'s' * (found != 1)} in the displacement "
            f"(it spans {stroke:.3g} mm; {length}); expected at least {MIN_CYCLES}{period}; "
            "record a longer log"
        )
    low, high = _untouched(cycles, n, edge)
    rising, falling = (
        crossings[(crossings >= low) & (crossings <= high)]
        for crossings in (cycles.rising, cycles.falling)
    )
    # Short logs: half a cycle more may fit when cycles are cut at the other crossing.
    starts = falling if len(rising) <= MIN_CYCLES and len(falling) > len(rising) else rising
    if len(starts) >= 2:
        return starts
    if high - low >= cycles.period:  # a whole cycle that starts in mid-cycle
        n_cycles = math.floor((high - low) / cycles.period)
        return low + cycles.period * np.arange(n_cycles + 1, dtype=np.float64)
    needed = (2.0 * cycles.period + 2.0 * edge) * h
    raise ConditioningError(
        f"{name}: no whole steady cycle is left after the run-in of one cycle "
        f"({cycles.period * h:.3g} s) and the filter's edges ({edge * h:.3g} s at each end); "
        f"{length} with {cycles.n_found} cycles, expected at least {needed:.3g} s of steady "
        "motion; record a longer log"
    )


def _untouched(cycles: Cycles, n: int, edge: int) -> tuple[float, float]:
    """Return first and last sample that run-in and filter edges leave alone.

    Where the steady cycles do not reach the log's own ends, their first and last crossing count
    as ends: an abrupt start or stop beside them is smeared by the filter like an end of the log.
    """
    reach = 1.1 * cycles.period
    begin, end = float(cycles.rising[0]), float(cycles.rising[-1])
    begin = 0.0 if begin <= reach else begin
    end = n - 1.0 if n - 1.0 - end <= reach else end
    return max(begin + cycles.period + edge, cycles.begin), min(end - edge, cycles.end)
