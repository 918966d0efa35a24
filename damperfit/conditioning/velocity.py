"""The logged velocity beside the slope of the displacement: checked, never used.

Rigs derive it behind a filter of their own, which makes it late, or write it in another unit than
they say. Both channels are compared by their fundamental: the lag is that of the phase.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from damperfit.recording import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Recording, Trace

    FloatArray = NDArray[np.float64]

__all__ = ["check_velocity"]

_SCALE = 0.1  # a velocity further off than this has another unit, or the clock has
_FASTEST = 1e6  # m/s; a damaged value beyond it must not overflow
_ALIKE = 0.7  # share of its power that must be in the fundamental


def check_velocity(trace: Trace, recording: Recording) -> tuple[Finding, ...]:
    """Return how a logged velocity compares with ours; nothing where none was logged.

    Parameters
    ----------
    trace : Trace
        With our velocity.
    recording : Recording
        With the logged one, and with what was reversed of the displacement.
    """
    if recording.velocity is None or not trace.fastest.n_cycles:
        return ()
    stretch = trace.fastest
    index = np.arange(stretch.first, stretch.stop)
    time = trace.start_time + index * trace.interval
    logged = np.interp(time, recording.time, np.clip(recording.velocity, -_FASTEST, _FASTEST))
    if recording.reverse_displacement:
        logged = -logged
    turn = np.exp(-2j * np.pi * trace.frequency * time)
    ours = complex(np.mean(trace.velocity[stretch.window] * turn))
    theirs = complex(np.mean((logged - np.mean(logged)) * turn))
    share = 2.0 * abs(theirs) ** 2 / max(float(np.var(logged)), 1e-300)
    if not share >= _ALIKE:
        text = "the logged velocity does not follow the displacement; it is not used"
        return (Finding("velocity_channel", "note", text, share),)
    ratio = theirs / ours
    is_opposite = ratio.real < 0.0
    phase = np.angle(-ratio if is_opposite else ratio)
    lag = float(-phase / (2.0 * math.pi * trace.frequency))
    sign = ", with the opposite sign" if is_opposite else ""
    text = (
        f"the logged velocity is {abs(ratio):.3g} times the slope of the displacement and "
        f"{1e3 * lag:.1f} ms late{sign}; it is not used"
    )
    if abs(abs(ratio) - 1.0) <= _SCALE:
        return (Finding("velocity_channel", "note", text, lag, "s"),)
    text += "; a unit or the clock of the log is wrong: check displacement, velocity and time"
    return (Finding("velocity_channel", "warning", text, abs(ratio)),)
