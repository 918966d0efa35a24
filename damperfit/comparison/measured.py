"""What was measured, compared: mean cycles of steady segments, how tests repeat, the zero shift.

Force is taken where the samples of a segment pass a speed, as in the table of characteristics, the
mean of opening and closing branch. Energy and hysteresis are those that the run tells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from statistics import fmean
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtri

from damperfit.adjustment.force_at import STROKES
from damperfit.comparison.verdict import Reading, Topic
from damperfit.passed_speeds import in_both_strokes
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import student_quantile

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.results import Run
    from damperfit.tables.reading import LogSignals
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]
    Readings = dict[Topic, Reading]

SAME_MOTION = 0.05  # rigs repeat stroke and speed to 1 %
_PHASES = 240  # samples of a mean cycle: at 1.5 Hz as fine as a log of 360 Hz
_SHARES = tuple(k / 40.0 for k in range(2, 40))  # of the peak speed, besides the named speeds
_FEWEST = 8  # samples of a cycle
_AT = (0.3, 0.6, 0.9)  # shares of the peak speed at which tests are compared with one another
_SURE = 0.01  # of tests that repeat to their noise so many are said not to
_FIGURES = {
    "energy": ("energy per cycle", "J"),
    "hysteresis_rebound": ("hysteresis, rebound", "N"),
    "hysteresis_bump": ("hysteresis, compression", "N"),
}
_ROUNDING = 1e-6  # of the force
_LEAST = 0.05  # of the largest force: below it a force has no per cent to speak of
_SLOW = 0.2  # m/s; above it the forces of a changed valve are no straight line over those before
_NO_SHIFT = 0.05  # N; no cell is tared closer


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredTest:
    """One steady motion of one log: the mean of its cycles, and how far the cycles scatter."""

    setting: Setting
    log: str  # its name
    amplitude: float  # of the motion, m; NaN of a curve without time
    frequency: float  # Hz, likewise
    n_cycles: int
    # Shape (n,), the mean cycle at equal phases; of a curve without time its points.
    displacement: FloatArray
    velocity: FloatArray
    force: FloatArray
    speeds: FloatArray  # shape (k,), m/s, positive and rising
    # By "rebound" and "bump": shape (2, k), force and its standard error, N.
    strokes: Mapping[str, FloatArray]
    # "energy" (J), "hysteresis_rebound", "hysteresis_bump" (N, at half of the peak speed), each
    # with its standard error.
    figures: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    temperature: float = math.nan  # degC; NaN where it was not logged

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
        rows = self.strokes[stroke]
        force, error = (np.interp(speed, self.speeds, row, math.nan, math.nan) for row in rows)
        return float(force), float(error)

    def repeats(self, other: MeasuredTest) -> bool:
        """Whether two tests ran one motion, as far as it is known."""
        ratios = (self.amplitude / other.amplitude, self.frequency / other.frequency)
        return all(math.isnan(ratio) or abs(ratio - 1.0) <= SAME_MOTION for ratio in ratios)


def measured_tests(
    signals: LogSignals, segments: Sequence[Mapping[str, Any]], *, temperature: float = math.nan
) -> tuple[MeasuredTest, ...]:
    """Return a test for each steady segment of a log, whose segments are as run.json tells them."""
    tests = (_test_of(signals, facts, temperature) for facts in segments)
    return tuple(test for test in tests if test is not None)


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
    counts, means, squares = in_both_strokes(velocity, force[None], speeds)
    variances = np.full(counts.shape, math.nan)
    np.divide(squares[..., 0], counts * (counts - 1.0), out=variances, where=counts > 1.0)
    forces, errors = means[..., 0].mean(axis=1), 0.5 * np.sqrt(variances.sum(axis=1))
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
        strokes={name: np.stack([forces[k], errors[k]]) for k, name in enumerate(STROKES)},
        figures={
            name: (_size(facts.get(f"{name}_{unit}")), _size(facts.get(f"{name}_se_{unit}")))
            for name, (_, unit) in _FIGURES.items()
        },
        temperature=temperature,
    )


def _size(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) else math.nan


def tests_at(run: Run, setting: Setting) -> tuple[MeasuredTest, ...]:
    """Return the tests of a setting, the fastest first."""
    mine = (test for test in run.tests if test.setting == setting)
    return tuple(sorted(mine, key=lambda test: -test.peak_speed))


def common_tests(runs: Sequence[Run], setting: Setting) -> tuple[tuple[MeasuredTest, ...], ...]:
    """Return the tests of each run at the fastest motion that all ran; nothing where none is."""
    for first in tests_at(runs[0], setting) if runs else ():
        groups = tuple(
            tuple(test for test in tests_at(run, setting) if test.repeats(first)) for run in runs
        )
        if all(groups):
            return groups
    return ()


def measured_readings(
    runs: Sequence[Run],
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float] = (),
    kind: str = "force",
) -> tuple[Readings, ...]:
    """Return measured forces of each run by setting, speed and stroke, then energy and hysteresis.

    Speeds are by default the named ones that all reach. Forces are of the kind "force", or
    "measured" beside the model's forces.
    """
    forces: tuple[Readings, ...] = tuple({} for _ in runs)
    figures: tuple[Readings, ...] = tuple({} for _ in runs)
    scatters = [repeat_scatter(run) for run in runs]
    name = "force" if kind == "force" else "measured_force"
    for setting in settings:
        groups = common_tests(runs, setting)
        top = min((test.peak_speed for group in groups for test in group), default=0.0)
        for k, (group, (scatter, freedom)) in enumerate(zip(groups, scatters, strict=False)):
            share = scatter / math.sqrt(len(group))
            for speed in speeds or [one for one in NAMED_SPEEDS if one <= top]:
                for stroke in STROKES:
                    topic = Topic(kind, name, "force", "N", setting, speed, stroke)
                    repeat = share * _damping(group, speed)
                    force = _force(group, speed, stroke)
                    forces[k][topic] = replace(force, repeat=repeat, repeat_freedom=freedom)
            half_range = fmean(0.5 * float(np.ptp(test.force)) for test in group)
            for figure, (label, unit) in _FIGURES.items():
                if all(figure in test.figures for mine in groups for test in mine):
                    pooled = _pooled(group, [test.figures[figure] for test in group])
                    figures[k][Topic("figure", figure, label, unit, setting)] = replace(
                        pooled,
                        repeat=share * abs(pooled.value),
                        repeat_freedom=freedom,
                        scale=pooled.value if figure == "energy" else half_range,
                    )
    return tuple(a | b for a, b in zip(forces, figures, strict=True))


def _force(group: Sequence[MeasuredTest], speed: float, stroke: str) -> Reading:
    pooled = _pooled(group, [test.force_at(speed, stroke) for test in group])
    largest = max(float(np.nanmax(np.abs(test.strokes[stroke][0]))) for test in group)
    has_size = math.isnan(pooled.value) or abs(pooled.value) >= _LEAST * largest
    return replace(pooled, scale=pooled.value if has_size else 0.0)


def _pooled(group: Sequence[MeasuredTest], values: Sequence[tuple[float, float]]) -> Reading:
    """Return the mean over tests, with the error that the scatter of their cycles gives it."""
    error = math.hypot(*(e for _, e in values)) / len(group)
    freedom = sum(max(test.n_cycles - 1, 0) for test in group)
    mean = fmean(value for value, _ in values)
    return Reading(mean, error, freedom or math.inf, is_measured=True)


def _damping(group: Sequence[MeasuredTest], speed: float) -> float:
    """Return half the force between the strokes at a speed, N: without the gas force."""
    rebound, bump = (fmean(test.force_at(speed, side)[0] for test in group) for side in STROKES)
    return 0.5 * abs(rebound - bump)


def repeat_scatter(run: Run) -> tuple[float, float]:
    """Return how far tests of one setting differ beyond their noise, and its degrees of freedom.

    As a share of the damping, one standard deviation, over all settings that were tested more than
    once; (0, inf) where none was, or where they repeat to their noise.
    """
    excess, scatters, freedom = 0.0, 0.0, 0
    for setting in dict.fromkeys(test.setting for test in run.tests):
        tests = tests_at(run, setting)
        group = tuple(test for test in tests if test.repeats(tests[0]))
        if len(group) < 2:
            continue
        top = min(test.peak_speed for test in group)
        points = []  # variance of force between tests, that of their noise, and the force
        for speed, stroke in ((share * top, stroke) for share in _AT for stroke in STROKES):
            forces, errors = np.array([test.force_at(speed, stroke) for test in group]).T
            noise = float(np.mean(errors**2))
            points.append((float(np.var(forces, ddof=1)), noise, _damping(group, speed)))
        variances, quiet, sizes = np.array(points).T
        known = np.isfinite(quiet) & (sizes > 0.0)
        if not known.any():
            continue
        quiet = np.maximum(quiet, (_ROUNDING * sizes) ** 2)  # synthetic cycles may be all alike
        more = len(group) - 1
        excess += more * float(np.mean((variances - quiet)[known] / sizes[known] ** 2))
        # Each point counts alike, whatever its force.
        scatters += more * float(np.mean((variances / quiet)[known]))
        freedom += more
    if not freedom or scatters <= float(chdtri(freedom, _SURE)):
        return 0.0, math.inf
    return math.sqrt(max(excess / freedom, 0.0)), float(freedom)


def zero_shift(first: Run, second: Run, settings: Sequence[Setting]) -> tuple[float, float]:
    """Return by how much all measured forces of the second are shifted, and its error, N.

    A cell that was tared otherwise, or more gas, moves the forces of both strokes, at every speed
    and setting, by one amount. What a valve changes grows with the damping and has one sign in
    rebound and the other in bump. So the difference is fitted by an offset for each stroke and a
    share of the damping for each setting and stroke; it is one shift where both offsets are the
    same within their errors, and beyond them. Else nothing is shifted: (0, 0).
    """
    (a, error_a, n_a), (b, error_b, n_b) = (
        _offset_of(first, second, settings, stroke) for stroke in STROKES
    )
    if not (n_a > 0 and n_b > 0):
        return 0.0, 0.0
    reach = student_quantile(n_a + n_b, 1.0 - 0.5 * _SURE)
    apart, error = abs(a - b), math.hypot(error_a, error_b)
    shift = 0.5 * (a + b)
    is_one = apart <= reach * error or apart <= _LEAST * abs(shift)
    if is_one and abs(shift) > max(0.5 * reach * error, _NO_SHIFT):
        return shift, 0.5 * error
    return 0.0, 0.0


def _offset_of(
    first: Run, second: Run, settings: Sequence[Setting], stroke: str
) -> tuple[float, float, int]:
    """Return the offset of one stroke with its standard error and degrees of freedom."""
    rows, steps, errors = [], [], []
    for k, setting in enumerate(settings):
        groups = common_tests((first, second), setting)
        top = min([_SLOW, *(0.9 * test.peak_speed for group in groups for test in group)])
        for speed in (np.linspace(0.25, 1.0, 4) * top).tolist() if groups else ():
            a, b = (_force(group, speed, stroke) for group in groups)
            row = np.zeros(len(settings) + 1)
            row[[k, -1]] = _damping(groups[0], speed), 1.0
            noise = math.hypot(a.error, b.error)
            if math.isfinite(noise + b.value - a.value):
                rows.append(row)
                steps.append(b.value - a.value)
                errors.append(max(noise, _ROUNDING * abs(a.value), 1e-9))
    freedom = len(rows) - len({int(np.argmax(row[:-1] != 0.0)) for row in rows}) - 1
    if freedom < 1:
        return 0.0, math.inf, 0
    weights = 1.0 / np.array(errors)
    weighted, targets = np.array(rows) * weights[:, None], np.array(steps) * weights
    used = np.any(weighted != 0.0, axis=0)
    inverse = np.linalg.pinv(weighted[:, used])
    values = inverse @ targets
    left = float(np.sum((targets - weighted[:, used] @ values) ** 2)) / freedom
    error = math.sqrt(float(np.sum(inverse[-1] ** 2)) * max(left, 1.0))
    return float(values[-1]), error, freedom
