"""The part of a log that nobody fits: changes of speed, and what else a trace holds beside cycles.

Other speeds and part of a stroke: what a law makes of them it was not bent to. Every log of several
speeds has them, so that no further test is needed. Run-up and coast-down count as far as
conditioning has kept them, which is where they lie within the filter's reach.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.recording import Stretch

if TYPE_CHECKING:
    from damperfit.recording import Trace

__all__ = ["transients"]

# s; less tells nothing.
_SHORTEST = 0.25
# Of the highest speed: a log that begins slower begins at rest, as the model does.
_AT_REST = 0.02
_LEAD = 0.05  # s, over which that is looked at
# Of the longest stroke: what moves less is rest.
_MOVES = 0.02


def transients(trace: Trace) -> Trace | None:
    """Return a log with what lies beside its stretches as stretches; None where there is nothing.

    Parameters
    ----------
    trace : Trace
        A log. What it holds before its first stretch counts only where it begins at rest: else
        the model's state is not yet that of the damper.
    """
    n = len(trace.force)
    firsts = [one.first for one in trace.stretches]
    stops = [one.stop for one in trace.stretches]
    begin = 0 if _begins_at_rest(trace) else firsts[0]
    gaps = zip([begin, *stops], [*firsts, n], strict=True)
    found = tuple(one for one in (_moving(trace, *gap) for gap in gaps) if one is not None)
    return replace(trace, stretches=found) if found else None


def _begins_at_rest(trace: Trace) -> bool:
    lead = max(1, round(_LEAD / trace.interval))
    fastest = max(one.peak_speed for one in trace.stretches)
    return float(np.max(np.abs(trace.velocity[:lead]))) < _AT_REST * fastest


def _moving(trace: Trace, first: int, stop: int) -> Stretch | None:
    """What lies between two samples, where it lasts and moves."""
    if (stop - first) * trace.interval < _SHORTEST:
        return None
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
