"""The measured force at a speed beside the model's: mean of all compared cycles of a setting.

At the motion that was tested the force is known, whatever model is bent to it. Measured force and
residual are read where the velocity passes a speed, on the opening and on the closing branch, in
every cycle; their means differ by what the model misses there. What repeats in the residual at
like speeds of the same stroke is an error of the model's force that no noise explains.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from damperfit.passed_speeds import in_both_strokes
from damperfit.simulation import NAMED_SPEEDS
from damperfit.uncertainty.repeating import residual_scatter

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from damperfit.recording import Stretch, Trace
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.linearisation import Linearisation

    FloatArray = NDArray[np.float64]

__all__ = ["SAME_MOTION", "SpeedForces", "speed_forces"]

# Strokes, speeds and frequencies that differ by less are one motion.
SAME_MOTION = 0.05
# Shares of the peak speed at which forces are read besides the named ones.
_SHARES = tuple(k / 20.0 for k in range(1, 20))
# Speeds within this factor are alike: the misfit there is the error of the force here.
_ALIKE = 2.0


@dataclass(frozen=True, slots=True)
class SpeedForces:
    """Force over speed of one setting and stroke, at the fastest motion that it was tested with.

    Attributes
    ----------
    setting : Setting
        Which.
    stroke : str
        "rebound" or "bump".
    amplitude, frequency : float
        Of the motion, m and Hz.
    half_range : float
        Half the range of the measured force, N.
    speeds : tuple of float
        m/s, positive and rising.
    measured, measured_se : tuple of float
        Mean of opening and closing branch over all compared cycles, and its standard error, N;
        NaN for a single cycle.
    difference : tuple of float
        Measured less modelled force on the same cycles, behind the same filter, N.
    misfit : tuple of float
        What repeats in the residual at like speeds, root mean square, N; 0 where nothing does.
    """

    setting: Setting
    stroke: str
    amplitude: float
    frequency: float
    half_range: float
    speeds: tuple[float, ...]
    measured: tuple[float, ...]
    measured_se: tuple[float, ...]
    difference: tuple[float, ...]
    misfit: tuple[float, ...]

    def is_at(self, amplitude: float, frequency: float) -> bool:
        """Whether this is the force of that motion."""
        ratios = (self.amplitude / amplitude, self.frequency / frequency)
        return all(abs(ratio - 1.0) <= SAME_MOTION for ratio in ratios)

    def at(self, speed: float) -> tuple[float, float, float, float] | None:
        """Return measured force, its error, difference and misfit at a speed; None beyond it."""
        if not self.speeds or not self.speeds[0] <= speed <= self.speeds[-1]:
            return None
        rows = (self.measured, self.measured_se, self.difference, self.misfit)
        before = bisect_right(self.speeds, speed) - 1
        if self.speeds[before] == speed:
            a, b, c, d = (row[before] for row in rows)
            return a, b, c, d
        low, high = self.speeds[before : before + 2]
        share = (speed - low) / (high - low)
        a, b, c, d = (row[before] + share * (row[before + 1] - row[before]) for row in rows)
        return a, b, c, d


def speed_forces(linearised: Linearisation, *, is_structured: bool) -> tuple[SpeedForces, ...]:
    """Return the forces of a setting in rebound and in bump; none where no cycle repeats.

    Parameters
    ----------
    linearised : Linearisation
        Of the setting.
    is_structured : bool
        Whether more repeats in its residuals than noise explains.
    """
    parts = list(_fastest(linearised))
    if not parts:
        return ()
    peak = min(min(float(v.max()), float(-v.min())) for _, v, *_ in parts)
    speeds = tuple(
        sorted(
            {round(share * peak, 6) for share in _SHARES} | {s for s in NAMED_SPEEDS if s < peak}
        )
    )
    half_range = 0.5 * max(float(np.ptp(force)) for _, _, force, _ in parts)
    amplitude = median(one.amplitude for one, *_ in parts)
    frequency = median(one.frequency for one, *_ in parts)
    found = []
    each = [_at_speeds(part, speeds) for part in parts]
    both = each[0] if len(each) == 1 else np.mean(each, axis=0)
    # The highest may be passed by the first sample alone, and so on no branch.
    passed = np.flatnonzero(np.isfinite(both[:, 0]).all(axis=0))
    both, speeds = both[:, :, passed], tuple(speeds[k] for k in passed)
    for stroke, towards, rows in zip(("rebound", "bump"), (1.0, -1.0), both, strict=True):
        misfit = [_misfit(parts, towards, speed) if is_structured else 0.0 for speed in speeds]
        errors = rows[1] / math.sqrt(len(parts))
        found.append(
            SpeedForces(
                setting=linearised.fit.setting,
                stroke=stroke,
                amplitude=amplitude,
                frequency=frequency,
                half_range=half_range,
                speeds=speeds,
                measured=tuple(rows[0].tolist()),
                measured_se=tuple(errors.tolist()),
                difference=tuple(rows[2].tolist()),
                misfit=tuple(misfit),
            )
        )
    return tuple(found)


_Part = tuple["Stretch", "FloatArray", "FloatArray", "FloatArray"]


def _fastest(linearised: Linearisation) -> Iterator[_Part]:
    """Yield the steady stretches of the fastest motion: velocity, measured force, residual."""
    steady: list[tuple[Trace, Stretch, FloatArray]] = [
        (log.trace, one, seen.residuals[place])
        for log, seen in zip(linearised.fit.logs, linearised.logs, strict=True)
        for one, place in zip(log.trace.stretches, log.trace.places, strict=True)
        if one.n_cycles
    ]
    top = max((one.peak_speed for _, one, _ in steady), default=0.0)
    near = [part for part in steady if part[1].peak_speed >= (1.0 - SAME_MOTION) * top]
    strokes = median(one.amplitude for _, one, _ in near) if near else 0.0
    for trace, one, residuals in near:
        if abs(one.amplitude / strokes - 1.0) <= SAME_MOTION:
            yield one, trace.velocity[one.window], trace.force[one.window], residuals


def _at_speeds(part: _Part, speeds: Sequence[float]) -> FloatArray:
    """Return mean force of both branches, standard error of its mean, mean residual: (2, 3, k).

    In rebound and in bump.
    """
    _, velocity, force, residuals = part
    counts, means, squares = in_both_strokes(velocity, np.stack([force, residuals]), speeds)
    # A mean of squares about the mean, of one less than there are.
    variances = np.full(counts.shape, math.nan)
    np.divide(squares[..., 1], counts - 1.0, out=variances, where=counts > 1.0)
    variances /= np.maximum(counts, 1.0)
    found = np.empty((2, 3, len(speeds)))
    found[:, ::2] = 0.5 * np.swapaxes(means[:, 0] + means[:, 1], 1, 2)
    found[:, 1] = 0.5 * np.sqrt(variances[:, 0] + variances[:, 1])
    return found


def _misfit(parts: Sequence[_Part], towards: float, speed: float) -> float:
    """Return the root mean square of what repeats in a stroke at speeds like this one, N."""
    squares = []
    for stretch, velocity, _, residuals in parts:
        along = towards * velocity
        alike = residuals[(along >= speed / _ALIKE) & (along <= speed * _ALIKE)]
        noise = residual_scatter(residuals, stretch)
        if len(alike):
            squares.append(float(np.mean(alike**2)) - (noise if math.isfinite(noise) else 0.0))
    return math.sqrt(max(float(np.mean(squares)), 0.0)) if squares else 0.0
