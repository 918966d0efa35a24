"""One run to be compared: what its results folder, baseline or logs tell."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import figures_of
from damperfit.simulation import NAMED_SPEEDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from damperfit.results import Run
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]
    from collections.abc import Sequence

    from damperfit.tables.reading import LogSignals

__all__ = [
    "ComparedRun",
    "MeasuredTest",
    "measured_tests",
]


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


# Signals of a log to the mean cycle of each of its steady motions, and how its cycles scatter.

_PHASES = 240  # samples of a mean cycle: at 1.5 Hz as fine as a log of 360 Hz
_SHARES = tuple(k / 40.0 for k in range(2, 40))  # of the peak speed
_FEWEST = 8  # samples of a cycle
_ENDS = ("start", "stop")
_FIGURES = {"energy": "J", "hysteresis_rebound": "N", "hysteresis_bump": "N"}
_LATE = 1e-6  # s; time stamps are rounded alike


def measured_tests(
    signals: LogSignals, stretches: Sequence[Mapping[str, Any]], *, temperature: float = math.nan
) -> tuple[MeasuredTest, ...]:
    """Return a test for each steady stretch of a log.

    Parameters
    ----------
    signals : LogSignals
        Measured and, where there is one, simulated force.
    stretches : sequence of mapping
        As `damperfit.recording.Stretch.describe` tells them, and run.json.
    temperature : float
        degC.
    """
    found = []
    for facts in stretches:
        cycles = _cycles(signals, facts)
        if cycles is not None:
            found.append(_test(signals, facts, cycles, temperature))
    return tuple(found)


def _cycles(signals: LogSignals, facts: Mapping[str, Any]) -> FloatArray | None:
    """Return displacement, velocity, force and simulated force, shape (4, cycles, phases)."""
    rate, start, stop = (_size(facts.get(key)) for key in ("frequency_Hz", "start_s", "stop_s"))
    clean = [_size(facts.get(f"figures_{key}_s")) for key in ("start", "stop")]
    if not math.isnan(clean[0]) and not math.isnan(clean[1]):
        start, stop = clean  # without cycles in which the filter still holds another motion
    if math.isnan(rate) or math.isnan(start) or math.isnan(stop) or facts.get("kind") == "moving":
        return None
    n = round((stop - start) * rate)
    inside = signals.time[(signals.time >= start - _LATE) & (signals.time < stop + _LATE)]
    if n < 1 or len(inside) < _FEWEST * n:
        return None
    # The edges of whole cycles are rounded to samples: the frequency is of their whole length.
    times = start + (stop - start) * np.arange(n * _PHASES) / (n * _PHASES)
    rows = (signals.displacement, signals.velocity, signals.force_measured, signals.force)
    return np.stack([np.interp(times, signals.time, row).reshape(n, _PHASES) for row in rows])


def _size(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) else math.nan


def _test(
    signals: LogSignals, facts: Mapping[str, Any], cycles: FloatArray, temperature: float
) -> MeasuredTest:
    _, v, force, _ = cycles
    mean = cycles.mean(axis=1)
    peak = float(min(mean[1].max(), -mean[1].min()))
    speeds = np.array(
        sorted({round(s * peak, 6) for s in _SHARES} | {s for s in NAMED_SPEEDS if s < peak})
    )
    strokes = {}
    for stroke, towards in (("rebound", 1.0), ("bump", -1.0)):
        opening, closing = _branches(towards * v, force, speeds)
        strokes[stroke] = _means_of(0.5 * (opening + closing))
    amplitude = _size(facts.get("amplitude_m"))
    return MeasuredTest(
        setting=signals.setting,
        log=signals.log,
        amplitude=0.5 * float(np.ptp(mean[0])) if math.isnan(amplitude) else amplitude,
        frequency=_size(facts.get("frequency_Hz")),
        n_cycles=len(force),
        displacement=mean[0],
        velocity=mean[1],
        force=mean[2],
        simulated=mean[3],
        speeds=speeds,
        strokes=strokes,
        figures=_figures(signals, facts, len(force)),
        temperature=temperature,
    )


def _branches(
    along: FloatArray, force: FloatArray, speeds: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the force where the speed rises through each value, and where it falls.

    By speed and cycle, NaN in a cycle that does not pass it.
    """
    later, force_later = (np.roll(row, -1, axis=1) for row in (along, force))
    is_below = along < speeds[:, None, None]
    will_be = later < speeds[:, None, None]
    cycles = np.arange(len(along))
    found = []
    for passes in (is_below & ~will_be, ~is_below & will_be):
        place = np.argmax(passes, axis=2)
        low, high = (row[cycles, place] - speeds[:, None] for row in (along, later))
        f, g = force[cycles, place], force_later[cycles, place]
        at = f + low / (low - high) * (g - f)
        found.append(np.where(passes.any(axis=2), at, np.nan))
    return found[0], found[1]


def _means_of(values: FloatArray) -> FloatArray:
    """Return means over cycles and their standard errors, shape (2, n)."""
    n = values.shape[1]
    scatter = np.std(values, axis=1, ddof=1) if n > 1 else np.full(len(values), math.nan)
    return np.stack([np.mean(values, axis=1), scatter / math.sqrt(n)])


def _figures(
    signals: LogSignals, facts: Mapping[str, Any], n_cycles: int
) -> dict[str, tuple[float, float]]:
    """Return energy and hysteresis with their errors, as they were told when the log was read."""
    if "energy_se_J" not in facts:  # an older run
        edges = [_size(facts.get(f"figures_{key}_s", facts.get(f"{key}_s"))) for key in _ENDS]
        first, interval = float(signals.time[0]), float(np.median(np.diff(signals.time)))
        begin, end = ((edge - first) / interval for edge in edges)
        found = figures_of(
            signals.velocity,
            signals.force_measured,
            np.linspace(begin, end, n_cycles + 1),
            interval=interval,
            is_steady=True,
        )
        facts = found.describe()
    return {
        name: (_size(facts.get(f"{name}_{unit}")), _size(facts.get(f"{name}_se_{unit}")))
        for name, unit in _FIGURES.items()
    }
