"""What was measured of a run: mean cycles of steady motions, how tests repeat, the zero shift.

Force is taken where the samples of a segment pass a speed, the mean of opening and closing branch;
at its peak speed as it is there. Energy and hysteresis are the run's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.special import chdtri, stdtr, stdtrit

from damperfit.adjustment.force_at import REPEATS, STROKE_WORDS, STROKES, named_speeds
from damperfit.arrays import FloatArray
from damperfit.passed_speeds import in_both_strokes
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import student_quantile
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.tables.files import LogSignals
    from damperfit.tested.setting import Setting

    Readings = dict["Topic", "Reading"]

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


class Topic(NamedTuple):
    """What is compared."""

    kind: str  # measured, force, parameter or figure
    name: str  # for scripts: force, r_m1, energy
    label: str
    unit: str
    setting: Setting | None = None  # None: of all
    speed: float | None = None  # m/s, positive, of a force
    stroke: str = ""  # rebound or bump, of a force
    is_logarithmic: bool = False  # its errors are those of its logarithm

    def place(self, units: ShownUnits = SI) -> str:
        """Say of what a line is, as in "setting 3, 0.26 m/s rebound"."""
        setting = "" if self.setting is None else f"setting {self.setting}, "
        if self.speed is None:
            return f"{setting}{self.label}"
        return f"{setting}{units.write_speed(self.speed)} {STROKE_WORDS[self.stroke]}"


class Reading(NamedTuple):
    """A number of one run, with errors in its own unit.

    Errors were estimated from so many cycles, which Student's t counts.
    """

    value: float
    error: float = math.nan  # standard error of noise; NaN: not known
    freedom: float = math.inf  # degrees of freedom that the error has
    repeat: float = 0.0  # standard error between tests of one setting, beyond their noise
    repeat_freedom: float = math.inf
    misfit: float = 0.0  # error from the model's misfit
    misses: float = math.nan  # measured less modelled, with its sign, at the motion of the test
    misses_error: float = math.nan
    disagrees: bool = False  # the model misses the measured force by more than it may
    # 100 %: the damping of a force, with its sign; half the force's range for a hysteresis; the
    # usual size of an offset. NaN: the value.
    scale: float = math.nan
    is_measured: bool = False
    objection: str = ""  # why nothing can be said of it

    def errors(self, factor: float = 1.0) -> list[tuple[float, float]]:
        """Return its standard errors without the misfit, each with its degrees of freedom."""
        return [(factor * self.error, self.freedom), (factor * self.repeat, self.repeat_freedom)]

    @property
    def half_interval(self) -> float:
        """Half of the 95 % interval of the reading by itself; NaN where no error is known."""
        return reach_of([*self.errors(), (0.0 if self.is_measured else self.misfit, math.inf)])[0]

    @property
    def bare(self) -> Reading:
        """The reading without errors, where the scatter of repeats is the measure."""
        return self._replace(error=0.0, repeat=0.0, misfit=0.0, misses=math.nan)


def reach_of(errors: Sequence[tuple[float, float]], distance: float = 0.0) -> tuple[float, float]:
    """Return half of the 95 % interval of a sum, and how often chance makes it as far from zero.

    `errors` are standard errors with their degrees of freedom, summed by Welch and Satterthwaite.
    """
    total = sum(error**2 for error, _ in errors)
    squares = sum(error**4 / freedom for error, freedom in errors if math.isfinite(freedom))
    error, freedom = math.sqrt(total), min(total**2 / squares, 1e9) if squares > 0.0 else 1e9
    chance = math.nan
    if error == 0.0:
        chance = float(distance == 0.0)
    elif math.isfinite(error):
        chance = 2.0 * float(stdtr(freedom, -abs(distance) / error))
    return error * float(stdtrit(freedom, 0.975)), chance


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
        if not self.reaches(speed):
            return math.nan, math.nan
        at = min(speed, self.speeds[-1])
        rows = self.strokes[stroke]
        force, error = (np.interp(at, self.speeds, row, left=math.nan) for row in rows)
        return float(force), float(error)

    def reaches(self, speed: float) -> bool:
        """Whether a stroke passes a speed, or is at it: its peak repeats within some per cent."""
        return len(self.speeds) > 0 and speed <= (1.0 + REPEATS) * float(self.speeds[-1])

    def repeats(self, other: MeasuredTest) -> bool:
        """Whether two tests ran one motion, as far as it is known."""
        ratios = (self.amplitude / other.amplitude, self.frequency / other.frequency)
        return all(math.isnan(ratio) or abs(ratio - 1.0) <= SAME_MOTION for ratio in ratios)


def measured_tests(
    signals: LogSignals, segments: Sequence[Mapping[str, Any]], *, temperature: float = math.nan
) -> tuple[MeasuredTest, ...]:
    """Return a test for each steady segment of a log, whose segments are as in run.json."""
    time = signals.time
    if len(time) < _FEWEST:
        return ()
    interval = float(np.median(np.diff(time)))
    ends = {"start": float(time[0]), "stop": float(time[-1]) + interval}
    tests = []
    for facts in segments:
        rate, amplitude = (_size(facts.get(name)) for name in ("frequency_Hz", "amplitude_m"))
        # Without cycles in which the filter still holds another motion; older runs have one a log.
        start, stop = (
            _size(facts.get(f"figures_{name}_s", facts.get(f"{name}_s", end)))
            for name, end in ends.items()
        )
        if facts.get("kind") == "moving" or math.isnan(rate + start + stop):
            continue
        n = round((stop - start) * rate)
        # Between segments samples may be left out.
        edges = [start - 0.5 * interval, stop - 0.5 * interval]
        window = slice(*np.searchsorted(time, edges))
        velocity, force = signals.velocity[window], signals.force_measured[window]
        if n < 1 or len(force) < _FEWEST * n:
            continue
        # The edges of whole cycles are rounded to samples: the frequency is of their whole length.
        phases = start + (stop - start) * np.arange(n * _PHASES) / (n * _PHASES)
        x, v, f = (
            np.interp(phases, time, row).reshape(n, _PHASES).mean(axis=0)
            for row in (signals.displacement, signals.velocity, signals.force_measured)
        )
        peak = float(min(v.max(), -v.min()))
        speeds = {round(share * peak, 6) for share in _SHARES}
        speeds |= {speed for speed in NAMED_SPEEDS if speed < peak}
        counts, means, squares = in_both_strokes(velocity, force[None], sorted(speeds))
        variances = np.full(counts.shape, math.nan)
        np.divide(squares[..., 0], counts * (counts - 1.0), out=variances, where=counts > 1.0)
        forces, errors = means[..., 0].mean(axis=1), 0.5 * np.sqrt(variances.sum(axis=1))
        # Near the peak a speed may be passed by no cycle, or by one: its error is that of a speed
        # that all pass.
        of_all = errors[:, [sorted(speeds).index(round(_SHARES[-1] * peak, 6))]]
        errors = np.where(np.isnan(errors), math.sqrt(n) * of_all, errors)
        is_passed = np.isfinite(forces).all(axis=0)
        forces, errors = forces[:, is_passed], errors[:, is_passed]
        at_peaks = f[[int(np.argmax(v)), int(np.argmin(v))]]
        amplitude = 0.5 * float(np.ptp(x)) if math.isnan(amplitude) else amplitude
        test = MeasuredTest(
            *(signals.setting, signals.log, amplitude, rate, n, x, v, f),
            speeds=np.array([*np.array(sorted(speeds))[is_passed], peak]),
            strokes={
                name: np.array([[*forces[k], at_peaks[k]], [*errors[k], errors[k, -1]]])
                for k, name in enumerate(STROKES)
            },
            figures={
                name: (_size(facts.get(f"{name}_{unit}")), _size(facts.get(f"{name}_se_{unit}")))
                for name, (_, unit) in _FIGURES.items()
            },
            temperature=temperature,
        )
        tests.append(test)
    return tuple(tests)


def _size(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) else math.nan


_Groups = tuple[tuple[MeasuredTest, ...], ...]  # of each run its tests at one motion


def tests_at(run: Run, setting: Setting) -> tuple[MeasuredTest, ...]:
    """Return the tests of a setting, the fastest first."""
    tests = (test for test in run.tests if test.setting == setting)
    return tuple(sorted(tests, key=lambda test: -test.peak_speed))


def common_tests(runs: Sequence[Run], setting: Setting) -> list[_Groups]:
    """Return each motion that all runs have, the fastest first: of each run its tests at it."""
    motions, tests = [], tests_at(runs[0], setting)
    while tests:
        groups = tuple(
            tuple(test for test in tests_at(run, setting) if test.repeats(tests[0])) for run in runs
        )
        if all(groups):
            motions.append(groups)
        tests = tuple(test for test in tests if not test.repeats(tests[0]))
    return motions


def measured_readings(
    runs: Sequence[Run],
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float] = (),
    kind: str = "force",
) -> tuple[Readings, ...]:
    """Return measured forces of each run by setting, speed and stroke, then energy and hysteresis.

    Speeds are by default the named ones that all reach. A force is that of the slowest common
    motion that reaches its speed, energy and hysteresis those of the fastest. Forces are of the
    kind "force", or "measured" beside the model's forces.
    """
    forces: tuple[Readings, ...] = tuple({} for _ in runs)
    figures: tuple[Readings, ...] = tuple({} for _ in runs)
    scatters = [repeat_scatter(run) for run in runs]
    name = "force" if kind == "force" else "measured_force"
    for setting in settings:
        motions = common_tests(runs, setting)
        if not motions:
            continue
        fastest = motions[0]
        top = min(test.peak_speed for group in fastest for test in group)
        by_speed = {speed: _slowest_at(motions, speed) for speed in speeds or named_speeds(top)}
        for k, (group, (scatter, freedom)) in enumerate(zip(fastest, scatters, strict=True)):
            for speed, groups in by_speed.items():
                tests = groups[k]
                repeat = scatter / math.sqrt(len(tests)) * _damping(tests, speed)
                for stroke in STROKES:
                    topic = Topic(kind, name, "force", "N", setting, speed, stroke)
                    force = _force(tests, speed, stroke)
                    forces[k][topic] = force._replace(repeat=repeat, repeat_freedom=freedom)
            half_range = fmean(0.5 * float(np.ptp(test.force)) for test in group)
            for figure, (label, unit) in _FIGURES.items():
                if all(figure in test.figures for tests in fastest for test in tests):
                    pooled = _pooled(group, [test.figures[figure] for test in group])
                    figures[k][Topic("figure", figure, label, unit, setting)] = pooled._replace(
                        repeat=scatter / math.sqrt(len(group)) * abs(pooled.value),
                        repeat_freedom=freedom,
                        scale=pooled.value if figure == "energy" else half_range,
                    )
    return tuple(a | b for a, b in zip(forces, figures, strict=True))


def _slowest_at(motions: Sequence[_Groups], speed: float) -> _Groups:
    """Return the slowest motion that reaches a speed, of several cycles; else the fastest."""
    reaching = [
        groups for groups in reversed(motions) if all(t.reaches(speed) for g in groups for t in g)
    ]
    repeated = (groups for groups in reaching if all(t.n_cycles != 1 for g in groups for t in g))
    return next(repeated, [*reaching, motions[0]][0])


def _force(group: Sequence[MeasuredTest], speed: float, stroke: str) -> Reading:
    pooled = _pooled(group, [test.force_at(speed, stroke) for test in group])
    largest = max(float(np.nanmax(np.abs(test.strokes[stroke][0]))) for test in group)
    has_size = math.isnan(pooled.value) or abs(pooled.value) >= _LEAST * largest
    # Harder is positive in both strokes, also of a rebound in which the gas still pushes.
    size = math.copysign(pooled.value, 1.0 if stroke == STROKES[0] else -1.0)
    return pooled._replace(scale=size if has_size else 0.0)


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
        group = [test for test in tests if test.repeats(tests[0])]
        top, extra = min(test.peak_speed for test in group), len(group) - 1
        if not extra:
            continue
        places = [(share * top, stroke) for share in _AT for stroke in STROKES]
        forces = np.array([[test.force_at(*place) for place in places] for test in group])
        sizes = np.array([_damping(group, speed) for speed, _ in places])
        noise = np.mean(forces[..., 1] ** 2, axis=0)
        usable = np.isfinite(noise) & (sizes > 0.0)
        if not usable.any():
            continue
        noise = np.maximum(noise, (_ROUNDING * sizes) ** 2)  # synthetic cycles may be all alike
        variances = np.var(forces[..., 0], axis=0, ddof=1)
        excess += extra * float(np.mean((variances - noise)[usable] / sizes[usable] ** 2))
        # Each point counts alike, whatever its force.
        scatters += extra * float(np.mean((variances / noise)[usable]))
        freedom += extra
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
    offsets = [_offset_of(first, second, settings, stroke) for stroke in STROKES]
    if any(freedom < 1 for _, _, freedom in offsets):
        return 0.0, 0.0
    (a, error_a, n_a), (b, error_b, n_b) = offsets
    reach = student_quantile(n_a + n_b, 1.0 - 0.5 * _SURE)
    shift, error = 0.5 * (a + b), math.hypot(error_a, error_b)
    is_common = abs(a - b) <= max(reach * error, _LEAST * abs(shift))
    if is_common and abs(shift) > max(0.5 * reach * error, _NO_SHIFT):
        return shift, 0.5 * error
    return 0.0, 0.0


def _offset_of(
    first: Run, second: Run, settings: Sequence[Setting], stroke: str
) -> tuple[float, float, int]:
    """Return the offset of one stroke with its standard error and degrees of freedom."""
    rows, steps, errors, fitted = [], [], [], set()
    for k, setting in enumerate(settings):
        groups = next(iter(common_tests((first, second), setting)), ())
        top = min([_SLOW, *(0.9 * test.peak_speed for group in groups for test in group)])
        for speed in (np.linspace(0.25, 1.0, 4) * top).tolist() if groups else ():
            a, b = (_force(group, speed, stroke) for group in groups)
            noise = math.hypot(a.error, b.error)
            if math.isfinite(noise + b.value - a.value):
                row = np.zeros(len(settings) + 1)
                row[[k, -1]] = _damping(groups[0], speed), 1.0
                rows.append(row)
                steps.append(b.value - a.value)
                errors.append(max(noise, _ROUNDING * abs(a.value), 1e-9))
                fitted.add(k)
    freedom = len(rows) - len(fitted) - 1
    if freedom < 1:
        return 0.0, math.inf, 0
    weights = 1.0 / np.array(errors)
    weighted, targets = np.array(rows) * weights[:, None], np.array(steps) * weights
    inverse = np.linalg.pinv(weighted)
    values = inverse @ targets
    mean_square = float(np.sum((targets - weighted @ values) ** 2)) / freedom
    error = math.sqrt(float(np.sum(inverse[-1] ** 2)) * max(mean_square, 1.0))
    return float(values[-1]), error, freedom
