"""The last steady cycles of a log, parted from those that are fitted."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import LogError

if TYPE_CHECKING:
    from damperfit.recording import Trace

__all__ = ["split_cycles"]


def split_cycles(trace: Trace, cycles: float) -> tuple[Trace, Trace]:
    """Return a log without its last steady cycles, and with these alone.

    The last ones of each stretch, in one piece: where a log drifts, from warming or gas, it shows
    there, and the filter's memory joins the two parts at one place only. A stretch with too few
    cycles to part is fitted whole.

    Parameters
    ----------
    trace : Trace
        A log.
    cycles : float
        Whole number of cycles, or below 1 a share of them (one at least).

    Raises
    ------
    LogError
        No cycle would be left to fit.

    Examples
    --------
    15 cycles with ``cycles=0.2`` or 3: twelve are fitted, three predicted.
    """
    fitted, held_out = [], []
    for stretch in trace.stretches:
        n = stretch.n_cycles
        held = max(1, round(cycles * n)) if cycles < 1.0 else round(cycles)
        if held < n:
            edge, starts = round(float(stretch.cycle_starts[n - held])), stretch.cycle_starts
            ahead, behind = stretch.smeared
            inner = starts[: n - held + 1]
            fitted.append(replace(stretch, stop=edge, cycle_starts=inner, smeared=(ahead, 0)))
            outer = starts[n - held :]
            held_out.append(replace(stretch, first=edge, cycle_starts=outer, smeared=(0, behind)))
        else:
            fitted.append(stretch)
    if not held_out:
        n = max(stretch.n_cycles for stretch in trace.stretches)
        held = max(1, round(cycles))
        raise LogError(
            f"{n} steady cycle{'s' if n > 1 else ''}, of which {held} are to be held "
            "out: none is left to fit; hold out fewer, or give a longer log",
            subject=trace.name,
        )
    return replace(trace, stretches=tuple(fitted)), replace(trace, stretches=tuple(held_out))
