"""The filter's corner that fits the fastest motion of a log.

The paper filters at 30 Hz a test of 1.5 Hz: twenty harmonics pass, enough for the knee of a valve
and the jump of friction. At 10 Hz three pass, and what is between them is hidden. The corner that
follows the motion keeps the twenty; it is not below 30 Hz, which suits all slower tests, and not
above 0.4 of the sample rate, where a filter has nothing left to do.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.conditioning.passages import fastest_frequency
from damperfit.conditioning.timebase import make_uniform
from damperfit.recording import Finding

if TYPE_CHECKING:
    from damperfit.conditioning.options import ConditionOptions
    from damperfit.recording import Recording

__all__ = ["HARMONICS", "fitting_corner", "with_corner"]

HARMONICS = 20.0
_LEAST = 30.0  # Hz
_HIGHEST = 0.4  # of the sample rate


def fitting_corner(frequency: float, sample_rate: float) -> float:
    """Return the corner that fits a motion, Hz, to two digits.

    Parameters
    ----------
    frequency, sample_rate : float
        Hz.
    """
    corner = min(max(HARMONICS * frequency, _LEAST), _HIGHEST * sample_rate)
    return float(f"{corner:.2g}")


def with_corner(
    recording: Recording, options: ConditionOptions
) -> tuple[ConditionOptions, tuple[Finding, ...]]:
    """Return the options with the corner that fits a log where it is to be found, and what it is.

    Parameters
    ----------
    recording : Recording
        As read.
    options : ConditionOptions
        With `auto_corner`, or as they stand.
    """
    if not options.auto_corner or options.rig_filter != "none" or options.filter == "none":
        return options, ()
    log = make_uniform(recording)
    frequency = fastest_frequency(log.displacement, options.steadiness) / log.interval
    corner = fitting_corner(frequency, 1.0 / log.interval)
    text = f"filter corner {corner:g} Hz, to fit the fastest motion of {frequency:.3g} Hz"
    found = Finding("filter_corner", "note", text, corner, "Hz")
    return replace(options, filter_corner=corner, auto_corner=False), (found,)
