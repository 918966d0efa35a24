"""The sine that stands for the motions of tests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Sine", "fastest_sine"]

_AS_FAST = 0.05  # rigs repeat a speed to 1 %
_SAME_STROKE = 0.05  # and a stroke no worse
_SINE = 0.1  # peak speed of a sine by its frequency against the one found; a triangle's is 36 % off


@dataclass(frozen=True, slots=True)
class Sine:
    """A sine.

    Attributes
    ----------
    amplitude, frequency : float
        m, Hz.
    was_run : bool
        It is a test's own motion; false where it stands for one that is no sine.
    """

    amplitude: float
    frequency: float
    was_run: bool = True

    @property
    def peak_speed(self) -> float:
        """Largest speed, m/s."""
        return 2.0 * math.pi * self.frequency * self.amplitude


def fastest_sine(tested: Sequence[tuple[float, float, float]]) -> Sine:
    """Return the sine of the fastest motion; of several as fast, that of the middle stroke.

    A motion that is no sine (a triangle, a road) stands for the sine of its stroke and speed.

    Parameters
    ----------
    tested : sequence of (float, float, float)
        Amplitude, frequency and peak speed of each motion: m, Hz, m/s.
    """
    fastest = max(speed for *_, speed in tested)
    near = [one for one in tested if one[2] >= (1.0 - _AS_FAST) * fastest]
    # Tests of one speed at several strokes have no motion in common: their means were never run.
    middle = sorted(near)[(len(near) - 1) // 2][0]
    alike = [one for one in near if abs(one[0] / middle - 1.0) <= _SAME_STROKE]
    amplitude, frequency = (median(one[k] for one in alike) for k in (0, 1))
    by_speed = max(speed for *_, speed in alike) / (2.0 * math.pi * amplitude)
    is_sine = abs(frequency / by_speed - 1.0) <= _SINE
    return Sine(amplitude, frequency if is_sine else by_speed, is_sine)
