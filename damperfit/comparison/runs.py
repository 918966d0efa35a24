"""Runs to be compared, fitted or measured alone.

Measured is the mean cycle of each steady segment, with the force where its samples pass a speed, as
in the table of characteristics. Energy and hysteresis are those of the run.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.passed_speeds import in_both_strokes
from damperfit.simulation import NAMED_SPEEDS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.results import Run
    from damperfit.tables.reading import LogSignals
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["SAME_MOTION", "ComparedRun", "MeasuredTest", "measured_tests", "same_motion"]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredTest:
    """One steady motion of one log: the mean of its cycles, and how far the cycles scatter.

    Attributes
    ----------
    setting : Setting
        Of the log.
    log : str
        Its name.
    amplitude, frequency : float
        Of the motion, m and Hz; NaN of a curve without time.
    n_cycles : int
        How many there are.
    displacement, velocity, force : numpy.ndarray
        Shape (n,), the mean cycle at equal phases; of a curve without time its points.
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

    setting: Setting
    log: str
    amplitude: float
    frequency: float
    n_cycles: int
    displacement: FloatArray
    velocity: FloatArray
    force: FloatArray
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
    def model(self) -> Run:
        """What was fitted, where something was."""
        assert self.fitted is not None
        return self.fitted

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Settings that have parameters, else those that were measured."""
        if self.fitted is not None:
            return tuple(stage.setting for stage in self.fitted.settings)
        return tuple(sorted({test.setting for test in self.tests}))

    def at(self, setting: Setting) -> tuple[MeasuredTest, ...]:
        """Return the tests of a setting, the fastest first."""
        mine = (test for test in self.tests if test.setting == setting)
        return tuple(sorted(mine, key=lambda test: -test.peak_speed))


SAME_MOTION = 0.05  # rigs repeat stroke and speed to 1 %


def same_motion(a: MeasuredTest, b: MeasuredTest) -> bool:
    """Whether two tests ran one motion, as far as it is known."""
    pairs = ((a.amplitude, b.amplitude), (a.frequency, b.frequency))
    return all(math.isnan(x / y) or abs(x / y - 1.0) <= SAME_MOTION for x, y in pairs)


# Signals of a log to a test for each steady segment

_PHASES = 240  # samples of a mean cycle: at 1.5 Hz as fine as a log of 360 Hz
_SHARES = tuple(k / 40.0 for k in range(2, 40))  # of the peak speed, besides the named speeds
_FEWEST = 8  # samples of a cycle
_FIGURES = {"energy": "J", "hysteresis_rebound": "N", "hysteresis_bump": "N"}
_STROKES = ("rebound", "bump")


def measured_tests(
    signals: LogSignals, segments: Sequence[Mapping[str, Any]], *, temperature: float = math.nan
) -> tuple[MeasuredTest, ...]:
    """Return a test for each steady segment of a log.

    Parameters
    ----------
    signals : LogSignals
        Measured displacement, velocity and force.
    segments : sequence of mapping
        As run.json tells them, and `damperfit.recording.Stretch.describe`.
    temperature : float
        degC.
    """
    found = (_test_of(signals, facts, temperature) for facts in segments)
    return tuple(one for one in found if one is not None)


def _test_of(
    signals: LogSignals, facts: Mapping[str, Any], temperature: float
) -> MeasuredTest | None:
    rate = _size(facts.get("frequency_Hz"))
    if facts.get("kind") == "moving" or math.isnan(rate) or len(signals.time) < _FEWEST:
        return None
    interval = float(np.median(np.diff(signals.time)))
    # Without cycles in which the filter still holds another motion; older runs have one a log.
    whole = {"start": float(signals.time[0]), "stop": float(signals.time[-1]) + interval}
    start, stop = (
        _size(facts.get(f"figures_{name}_s", facts.get(f"{name}_s", end)))
        for name, end in whole.items()
    )
    if math.isnan(start + stop):
        return None
    n = round((stop - start) * rate)
    # Between segments samples may be left out.
    window = slice(*np.searchsorted(signals.time, [start - 0.5 * interval, stop - 0.5 * interval]))
    velocity, force = signals.velocity[window], signals.force_measured[window]
    if n < 1 or len(force) < _FEWEST * n:
        return None
    # The edges of whole cycles are rounded to samples: the frequency is of their whole length.
    times = start + (stop - start) * np.arange(n * _PHASES) / (n * _PHASES)
    rows = (signals.displacement, signals.velocity, signals.force_measured)
    mean = [np.interp(times, signals.time, row).reshape(n, _PHASES).mean(axis=0) for row in rows]
    peak = float(min(mean[1].max(), -mean[1].min()))
    speeds = sorted({round(s * peak, 6) for s in _SHARES} | {s for s in NAMED_SPEEDS if s < peak})
    amplitude = _size(facts.get("amplitude_m"))
    return MeasuredTest(
        setting=signals.setting,
        log=signals.log,
        amplitude=0.5 * float(np.ptp(mean[0])) if math.isnan(amplitude) else amplitude,
        frequency=rate,
        n_cycles=n,
        displacement=mean[0],
        velocity=mean[1],
        force=mean[2],
        speeds=np.array(speeds),
        strokes=_forces(velocity, force, speeds),
        figures={
            name: (_size(facts.get(f"{name}_{unit}")), _size(facts.get(f"{name}_se_{unit}")))
            for name, unit in _FIGURES.items()
        },
        temperature=temperature,
    )


def _size(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) else math.nan


def _forces(
    velocity: FloatArray, force: FloatArray, speeds: Sequence[float]
) -> dict[str, FloatArray]:
    """Return by stroke the mean of both branches at speeds, and its standard error."""
    counts, means, squares = in_both_strokes(velocity, force[None], speeds)
    variances = np.full(counts.shape, math.nan)
    np.divide(squares[..., 0], counts * (counts - 1.0), out=variances, where=counts > 1.0)
    forces, errors = means[..., 0].mean(axis=1), 0.5 * np.sqrt(variances.sum(axis=1))
    return {name: np.stack([forces[k], errors[k]]) for k, name in enumerate(_STROKES)}
