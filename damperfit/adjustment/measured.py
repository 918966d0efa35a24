"""Levels with the measured force beside them, and which of the two is shown.

The model's force has two errors, of noise and of the model itself. Where the test was made the
force is known as measured: a model that misses it by more than it may is not the one to ask.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.adjustment.forces import Sine
    from damperfit.adjustment.level import Level
    from damperfit.uncertainty import SpeedForces

__all__ = ["beside_measured", "credible_forces", "measured_at"]


def beside_measured(
    levels: Sequence[Level], forces: Sequence[SpeedForces], sine: Sine
) -> tuple[Level, ...]:
    """Return the levels with misfit and, where the sine is the test's motion, measured force.

    Parameters
    ----------
    levels : sequence of Level
        Forces of the model.
    forces : sequence of SpeedForces
        Of the same settings.
    sine : Sine
        The motion of the levels. At another one than the test's the misfit is that of the test.
    """
    table = {(one.setting, one.stroke): one for one in forces}
    return tuple(_beside(level, table.get((level.setting, level.stroke)), sine) for level in levels)


def _beside(level: Level, known: SpeedForces | None, sine: Sine) -> Level:
    tare = 0.0 if level.is_whole else level.tare
    found: dict[str, Any] = (
        {} if known is None else measured_at(known, level.speed, sine, tare=tare)
    )
    return replace(level, **found) if found else level


def measured_at(
    known: SpeedForces, speed: float, sine: Sine, *, tare: float = 0.0
) -> dict[str, Any]:
    """Return what of a `Level` is known as measured, or by the misfit of another motion.

    Parameters
    ----------
    known : SpeedForces
        Of the level's setting and stroke.
    speed : float
        m/s.
    sine : Sine
        The motion of the level.
    tare : float
        What the rig's offset puts into the measured force and the level's has not, N.
    """
    if not known.speeds:
        return {}
    if not known.is_at(sine.amplitude, sine.frequency):
        nearest = min(max(speed, known.speeds[0]), known.speeds[-1])
        seen = known.at(nearest)
        return {} if seen is None else {"misfit": seen[3]}
    seen = known.at(speed)
    if seen is None:
        return {}
    measured, error, difference, misfit = seen
    return {
        "misfit": misfit,
        "measured": measured - tare,
        "measured_error": error,
        "difference": difference,
        "half_range": known.half_range,
    }


def credible_forces(levels: Sequence[Level]) -> tuple[Level, ...]:
    """Return the levels to tell: as measured at speeds and strokes where any setting disagrees.

    All settings there, so that a change from one to the next is of one kind.
    """
    at = {(level.speed, level.stroke) for level in levels if level.disagrees}
    return tuple(
        level.as_measured if (level.speed, level.stroke) in at else level for level in levels
    )
