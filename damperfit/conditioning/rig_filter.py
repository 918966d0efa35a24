"""Whether a log looks as if the rig had filtered it.

Sensor noise is about as strong just above the motion's harmonics as near half the sample rate. A
low-pass in the rig takes it away up there by several powers of ten, in both channels. The ratio of
the two levels, as medians over the lines of the spectrum so that harmonics do not count, was
measured on made-up logs (`python -m tests.conditioning.limits --filters`): without a filter 0.5 to
1.7 for displacement and 0.2 to 1.9 for force; behind 30 or 60 Hz up to 1500 and 41 000, but 3.5 and
34 where the noise that is left is below the last digit of the log. Such a filter is not seen.
Lines beside a harmonic are left out: in a short cut of a fast motion none may be left to tell.

Where nothing repeats, motion and force have content just above the motion. There the noise is
looked at by itself: two bands far above the motion, the upper one twice as high, of which a
low-pass leaves less: of the force at least 47 times, mostly a thousand times. Of a raw road or
sweep the force has up to 5 times as much in the lower one (its friction jumps), the displacement
1.4 times; where speeds jump, or turn within 20 ms, the force has up to 34 times.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.statistics import mean_of, median

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    IntArray = NDArray[np.int64]

__all__ = ["falls_off", "looks_filtered"]

_NEAR = (15.0, 25.0)  # Hz, below any low-pass that a damper rig uses
_FAR = (0.3, 0.45)  # of the sample rate
_LEAST_FAR = 60.0  # Hz
_FEWEST_LINES = 8
_LOBE = 4.0  # lines beside a harmonic that Blackman's window smears it over
_DISPLACEMENT_RATIO = 100.0
_FORCE_RATIO = 1000.0
# Of the sample rate, and by how much more the lower band has of each channel.
_LOWER = (0.15, 0.2)
_UPPER = (0.4, 0.45)
_MORE_DISPLACEMENT, _MORE_FORCE = 4.0, 40.0
_FEWEST_OF_NOISE = 50  # lines of each band


def looks_filtered(
    displacement: FloatArray, force: FloatArray, interval: float, frequency: float
) -> bool:
    """Whether both channels lack the noise far above the motion that they have just above it.

    Parameters
    ----------
    displacement, force : numpy.ndarray
        Shape (n,), as logged.
    interval : float
        Sample interval, s.
    frequency : float
        Of the motion, Hz: its harmonics are no noise.

    Returns
    -------
    bool
        False also where the log is too short or too slow to tell.
    """
    return (
        _fall(displacement, interval, frequency) > _DISPLACEMENT_RATIO
        and _fall(force, interval, frequency) > _FORCE_RATIO
    )


def falls_off(displacement: FloatArray, force: FloatArray, interval: float) -> bool:
    """Whether the noise of both channels falls off far above a motion that does not repeat.

    Parameters
    ----------
    displacement, force : numpy.ndarray
        Shape (n,), as logged.
    interval : float
        Sample interval, s.

    Returns
    -------
    bool
        False also where the log is too short or too slow to tell.
    """
    return (
        _more_below(displacement, interval) > _MORE_DISPLACEMENT
        and _more_below(force, interval) > _MORE_FORCE
    )


def _more_below(signal: FloatArray, interval: float) -> float:
    """Ratio of the noise's level in the lower band to that in the upper; 0 when not known."""
    if _LOWER[0] / interval < _LEAST_FAR:
        return 0.0
    length = len(signal) * interval
    lower, upper = (
        _lines(below / interval, above / interval, length, len(signal))
        for below, above in (_LOWER, _UPPER)
    )
    if min(len(lower), len(upper)) < _FEWEST_OF_NOISE:
        return 0.0
    spectrum = np.fft.rfft((signal - mean_of(signal)) * _window(len(signal)))
    level = median(np.abs(spectrum[upper]) ** 2)
    return median(np.abs(spectrum[lower]) ** 2) / level if level > 0.0 else 0.0


def _fall(signal: FloatArray, interval: float, motion: float) -> float:
    """Ratio of the spectrum's level near the motion to that far above it; 0 when not known."""
    length = len(signal) * interval
    near = _lines(*_NEAR, length, len(signal))
    order = np.rint(near / (motion * length))
    near = near[np.abs(near - order * motion * length) > _LOBE]
    far = _lines(max(_LEAST_FAR, _FAR[0] / interval), _FAR[1] / interval, length, len(signal))
    if min(len(near), len(far)) < _FEWEST_LINES:
        return 0.0
    spectrum = np.fft.rfft((signal - mean_of(signal)) * _window(len(signal)))
    level = median(np.abs(spectrum[far]) ** 2)
    return median(np.abs(spectrum[near]) ** 2) / level if level > 0.0 else 0.0


def _lines(above: float, below: float, length: float, n: int) -> IntArray:
    """Return the lines of the spectrum of a log between two frequencies."""
    some = np.arange(int(above * length), min(math.ceil(below * length), n // 2) + 1)
    return some[(some / length > above) & (some / length < below)]


@lru_cache(maxsize=2)
def _window(n: int) -> FloatArray:
    """Blackman's: logs of one rig are of one length, and its cosines cost more than a spectrum."""
    return np.blackman(n)
