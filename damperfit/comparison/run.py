"""One run to be compared: what its results folder, baseline or logs tell."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from damperfit.results import Run
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["ComparedRun", "MeasuredTest"]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredTest:
    """One steady motion of one log: the mean of its cycles, and how far the cycles scatter.

    Attributes
    ----------
    setting : Setting or None
        Of the log; None where it tells none.
    log : str
        Its name.
    amplitude, frequency : float
        Of the motion, m and Hz; NaN of a curve without time.
    n_cycles : int
        How many there are.
    displacement, velocity, force, simulated : numpy.ndarray
        Shape (n,), the mean cycle at equal phases; `simulated` is NaN where nothing was.
    speeds : numpy.ndarray
        Shape (k,), m/s, positive and rising.
    strokes : mapping of str to numpy.ndarray
        By "rebound" and "bump": shape (2, k), force and its standard error, N, mean of the opening
        and the closing branch.
    figures : mapping of str to (float, float)
        "energy" (J), "hysteresis_rebound", "hysteresis_bump" (N, at half of the peak speed), each
        with its standard error.
    temperature : float
        degC; NaN where it was not logged.
    """

    setting: Setting | None
    log: str
    amplitude: float
    frequency: float
    n_cycles: int
    displacement: FloatArray
    velocity: FloatArray
    force: FloatArray
    simulated: FloatArray
    speeds: FloatArray
    strokes: Mapping[str, FloatArray]
    figures: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    temperature: float = math.nan

    @property
    def peak_speed(self) -> float:
        """Largest speed that both strokes reach, m/s."""
        if not len(self.velocity):
            return float(self.speeds[-1]) if len(self.speeds) else 0.0
        return float(min(self.velocity.max(), -self.velocity.min()))

    def force_at(self, speed: float, stroke: str) -> tuple[float, float]:
        """Return force and standard error at a speed, N; NaN beyond those that were reached."""
        if not len(self.speeds):
            return math.nan, math.nan
        force, error = (
            float(np.interp(speed, self.speeds, row, left=math.nan, right=math.nan))
            for row in self.strokes[stroke]
        )
        return force, error


@dataclass(frozen=True, slots=True, eq=False)
class ComparedRun:
    """One run to be compared.

    Attributes
    ----------
    name : str
        What people call it: its folder's name, unlike those of the others.
    place : str
        Where it stands.
    fitted : Run or None
        What was fitted; None: measured curves alone.
    tests : tuple of MeasuredTest
        What was measured.
    record : mapping
        run.json; empty where there is none.
    remarks : tuple of str
        What is missing or damaged.
    notes : tuple of str
        What a reader must know of how it was read; nothing is missing.
    """

    name: str
    place: str
    fitted: Run | None
    tests: tuple[MeasuredTest, ...]
    record: Mapping[str, Any]
    remarks: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Settings that have parameters, else those that were measured."""
        if self.fitted is not None:
            return tuple(stage.setting for stage in self.fitted.settings)
        return tuple(sorted({test.setting for test in self.tests if test.setting is not None}))

    def at(self, setting: Setting) -> tuple[MeasuredTest, ...]:
        """Return the tests of a setting, the fastest first."""
        mine = (test for test in self.tests if test.setting == setting)
        return tuple(sorted(mine, key=lambda test: -test.peak_speed))


def same_motion(a: MeasuredTest, b: MeasuredTest, *, within: float) -> bool:
    """Whether two tests ran one motion, as far as it is known."""
    pairs: Iterable[tuple[float, float]] = (
        (a.amplitude, b.amplitude),
        (a.frequency, b.frequency),
    )
    return all(math.isnan(x) or math.isnan(y) or abs(x / y - 1.0) <= within for x, y in pairs)
