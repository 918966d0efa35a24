"""What is compared: numbers of runs with their errors, read from what was measured.

Force is taken where the samples of a segment pass a speed, as in the table of characteristics, the
mean of opening and closing branch. Energy and hysteresis are those that the run tells.

Two runs are two tests, so that their errors add. What both have in common does not: at the same
motion a wrong model misses the same force in both, and only by how much it misses them differently
is an error of the difference (`Reading.misses`). Errors were estimated from so many cycles, which
Student's t counts; of sums of such errors by Welch and Satterthwaite.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from statistics import fmean
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.special import chdtri, stdtr, stdtrit

from damperfit.adjustment.force_at import STROKES
from damperfit.arrays import FloatArray
from damperfit.passed_speeds import in_both_strokes
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import student_quantile
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.tables.reading import LogSignals
    from damperfit.tested.setting import Setting

    Readings = dict["Topic", "Reading"]

# "Same" is said only where a difference of so much of the damping, or of the value, would be seen.
SEEN = 0.05
_LEVEL = 0.05  # of all verdicts of a comparison together
_MOST_LOG = 700.0  # beyond it exp overflows


class Sameness(Enum):
    """What two readings say of each other; the value is for scripts."""

    SAME = "same"
    DIFFERENT = "different"
    UNDETERMINED = "undetermined"


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
        where = "" if self.setting is None else f"setting {self.setting}, "
        if self.speed is None:
            return f"{where}{self.label}"
        return f"{where}{units.write_speed(self.speed)} {self.stroke}"


@dataclass(frozen=True, slots=True)
class Reading:
    """A number of one run, with errors in its own unit."""

    value: float
    error: float = math.nan  # standard error of noise; NaN: not known
    freedom: float = math.inf  # degrees of freedom that the error has
    repeat: float = 0.0  # standard error of what tests of one setting differ by beyond their noise
    repeat_freedom: float = math.inf
    misfit: float = 0.0  # error from the model's misfit
    misses: float = math.nan  # measured less modelled, with its sign, at the motion of the test
    misses_error: float = math.nan
    disagrees: bool = False  # the model misses the measured force by more than it may
    # What per cents are of: the damping of a force, with its sign; half the force's range for a
    # hysteresis; the usual size of an offset. NaN: of the value.
    scale: float = math.nan
    is_measured: bool = False
    objection: str = ""  # why nothing can be said of it

    def errors(self, factor: float = 1.0) -> list[tuple[float, float]]:
        """Return its standard errors without the misfit, each with its degrees of freedom."""
        return [(factor * self.error, self.freedom), (factor * self.repeat, self.repeat_freedom)]

    @property
    def half_interval(self) -> float:
        """Half of the 95 % interval of the reading by itself; NaN where no error is known."""
        return _reach([*self.errors(), (0.0 if self.is_measured else self.misfit, math.inf)])[0]


@dataclass(frozen=True, slots=True)
class Difference:
    """Two readings of one subject, the second beside the first (of the reference)."""

    subject: Topic
    first: Reading
    second: Reading
    low: float = math.nan  # 95 % interval of the difference; NaN where no error is known
    high: float = math.nan
    # The same in per cent, for a force of the reference's damping: positive is harder; for a
    # hysteresis of half the force's range. NaN where there is nothing to take it of.
    percent: float = math.nan
    percent_low: float = math.nan
    percent_high: float = math.nan
    chance: float = math.nan  # how often chance alone makes a difference as large; NaN: not known
    verdict: Sameness = Sameness.UNDETERMINED  # at 95 %, each line by itself
    reason: str = ""  # why nothing can be said
    is_sure: bool = False  # different also when it is remembered how many lines there are
    words: str = ""  # the verdict, where the subject has words of its own

    @property
    def difference(self) -> float:
        """Second less first."""
        return self.second.value - self.first.value

    @property
    def is_measured(self) -> bool:
        """Whether measured numbers are compared."""
        return self.first.is_measured and self.second.is_measured


def _reach(parts: Sequence[tuple[float, float]], distance: float = 0.0) -> tuple[float, float]:
    """Half of the 95 % interval of a sum, and how often chance makes it as far from zero."""
    total = sum(error**2 for error, _ in parts)
    squares = sum(error**4 / freedom for error, freedom in parts if math.isfinite(freedom))
    error, freedom = math.sqrt(total), min(total**2 / squares, 1e9) if squares > 0.0 else 1e9
    chance = math.nan
    if error == 0.0:
        chance = float(distance == 0.0)
    elif math.isfinite(error):
        chance = 2.0 * float(stdtr(freedom, -abs(distance) / error))
    return error * float(stdtrit(freedom, 0.975)), chance


def compared(
    subject: Topic, first: Reading, second: Reading, *, is_same_motion: bool = False
) -> Difference:
    """Return two readings beside each other; of one model and motion, common misfit cancels."""
    a, b = first.value, second.value
    reason = first.objection or second.objection
    if not (math.isfinite(a) and math.isfinite(b)):
        return Difference(subject, first, second, reason=reason or "not known for both")
    is_log = subject.is_logarithmic and a > 0.0 and b > 0.0
    units = (a, b) if is_log else (1.0, 1.0)
    misfits = [one.misfit / unit for one, unit in zip((first, second), units, strict=True)]
    misfit, apart = math.hypot(*misfits), second.misses - first.misses
    if first.is_measured and second.is_measured:
        misfit = 0.0
    elif is_same_motion and any(misfits) and math.isnan(apart):
        misfit = abs(misfits[1] - misfits[0])
    elif is_same_motion and any(misfits):
        noise = (one.misses_error for one in (first, second) if math.isfinite(one.misses_error))
        misfit = math.sqrt(max(apart**2 - sum(error**2 for error in noise), 0.0))
    own, others = first.errors(1.0 / units[0]), second.errors(1.0 / units[1])
    others.append((misfit, math.inf))
    step = math.log(b / a) if is_log else b - a
    reach, chance = _reach([*own, *others], step)
    if is_log:
        low, high = (math.exp(min(end, _MOST_LOG)) - 1.0 for end in (step - reach, step + reach))
        share = reach
        numbers = (a * low, a * high, 100.0 * (b / a - 1.0), 100.0 * low, 100.0 * high)
    else:
        scale = first.scale if math.isfinite(first.scale) else a
        percent = share = math.nan
        if scale:
            # The first number is the denominator too: its error counts 1 + share times.
            of_both = [*first.errors(1.0 + step / scale), *others]
            percent, share = 100.0 * step / scale, _reach(of_both)[0] / abs(scale)
        if subject.kind == "parameter":  # an offset may pass zero: per cent of it say nothing
            percent = math.nan
        ends = (percent - 100.0 * share, percent + 100.0 * share)
        numbers = (step - reach, step + reach, percent, *ends)
    verdict = Sameness.UNDETERMINED
    if not reason and not math.isfinite(reach):
        reason = "no errors are known"
    elif not reason and abs(step) > reach:
        verdict = Sameness.DIFFERENT
    elif not reason and share > SEEN:
        # At its passage through zero a force has no per cent to speak of: newtons say it.
        reason = f"a difference of {100.0 * share:.2g} % would go unnoticed"
    elif not reason:
        verdict = Sameness.SAME
    return Difference(subject, first, second, *numbers, chance, verdict, reason)


def surely_different(lines: Sequence[Difference]) -> tuple[Difference, ...]:
    """Return the lines with `Difference.is_sure` set, by Holm's procedure over all of them.

    Among many lines one in twenty differs by chance. What is left here is so in one comparison of
    twenty, however the lines hang together.
    """
    known = [k for k, line in enumerate(lines) if math.isfinite(line.chance)]
    sure = set()
    for rank, k in enumerate(sorted(known, key=lambda k: lines[k].chance)):
        if lines[k].chance > _LEVEL / (len(known) - rank):
            break
        sure.add(k)
    return tuple(
        replace(line, is_sure=k in sure and line.verdict is Sameness.DIFFERENT)
        for k, line in enumerate(lines)
    )


# Lines in words: what differs, by how much, or why nothing can be said.


def outcome_of(lines: Sequence[Difference], words: str, units: ShownUnits = SI) -> str:
    """Say how many differ, which most, and what chance would do."""
    n_measured = sum(one.is_measured for one in lines) if lines[0].subject.kind == "force" else 0
    if n_measured:
        part = f" ({n_measured} of {len(lines)} as measured)"
        words += " as measured" if n_measured == len(lines) else part
    known = [line for line in lines if line.verdict is not Sameness.UNDETERMINED]
    if not known:
        return f"{words}: cannot be determined ({lines[0].reason})"
    different = [line for line in known if line.verdict is Sameness.DIFFERENT]
    sure = [line for line in different if line.is_sure]
    undetermined = len(lines) - len(known)
    beside = f"; {undetermined} cannot be determined" if undetermined else ""
    if not different:
        return f"{words}: all {len(known)} the same within errors{beside}"
    if not sure:
        return (
            f"{words}: no significant difference: {len(different)} of {len(known)} lie outside "
            f"their 95 % interval, where chance alone puts {0.05 * len(known):.2g}{beside}"
        )
    worst = max(
        sure, key=lambda one: abs(one.difference if math.isnan(one.percent) else one.percent)
    )
    how_many = "all" if len(sure) == len(different) else str(len(sure))
    return (
        f"{words}: {len(different)} of {len(known)} differ, {how_many} of them significantly; most "
        f"{worst.subject.place(units)}: {difference_of(worst, units)}{beside}"
    )


def difference_of(line: Difference, units: ShownUnits = SI) -> str:
    """Say how large a difference is, with its interval."""
    if math.isnan(line.percent):
        text = units.write(line.difference, line.subject.unit, "+.4g")
        low, high = (units.show(end, line.subject.unit) for end in (line.low, line.high))
        return f"{text} ({low:+.3g} to {high:+.3g})" if math.isfinite(low) else text
    text = f"{line.percent:+.2f} %"
    if math.isfinite(line.percent_low):
        text += f" ({line.percent_low:+.2f} to {line.percent_high:+.2f} %)"
    if line.subject.kind == "force":
        form = "+.1f" if units.of("N") == "N" else "+.3g"
        text += f", {units.write(line.difference, 'N', form)}"
    return text


def verdict_of(line: Difference, units: ShownUnits = SI, *, says_measured: bool = True) -> str:
    """Say the verdict of a line in words, and of a force whether it was measured."""
    subject, a, b = line.subject, line.first.value, line.second.value
    if subject.name.startswith("hysteresis") and a * b > 0.0:
        # Its sign is the way round the loop: -54 N after -57 N is a narrower loop.
        size = units.write(abs(abs(b) - abs(a)), subject.unit, ".2g")
        how = f"the loop is {size} {'wider' if abs(b) > abs(a) else 'narrower'}"
    elif math.isnan(line.percent):
        size = units.write(abs(line.difference), subject.unit, ".3g")
        how = f"{size} {'more' if line.difference > 0.0 else 'less'}"
    else:
        words = ("harder", "softer") if subject.kind == "force" else ("more", "less")
        two_digits = f"{float(f'{abs(line.percent):.2g}'):.15g}"  # without a power of ten
        how = f"{two_digits} % {words[0] if line.percent > 0 else words[1]}"
    said = (
        line.words
        or {
            Sameness.UNDETERMINED: f"cannot be determined: {line.reason}",
            Sameness.SAME: "same within errors",
            Sameness.DIFFERENT: f"different{'' if line.is_sure else ', perhaps by chance'}: {how}",
        }[line.verdict]
    )
    is_told = says_measured and subject.kind == "force" and line.is_measured
    return f"{said} (measured)" if is_told else said


# What was measured: mean cycles of steady segments, how tests repeat, the zero shift.

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
    tests = []
    rows = (signals.displacement, signals.velocity, signals.force_measured)
    interval = float(np.median(np.diff(signals.time))) if len(signals.time) >= _FEWEST else math.nan
    for facts in segments:
        rate, amplitude = (_size(facts.get(name)) for name in ("frequency_Hz", "amplitude_m"))
        # Without cycles in which the filter still holds another motion; older runs have one a log.
        whole = {"start": signals.time[:1], "stop": signals.time[-1:] + interval}
        start, stop = (
            _size(facts.get(f"figures_{name}_s", facts.get(f"{name}_s", float(end.sum()))))
            for name, end in whole.items()
        )
        if facts.get("kind") == "moving" or math.isnan(rate + start + stop + interval):
            continue
        n = round((stop - start) * rate)
        # Between segments samples may be left out.
        ends = [start - 0.5 * interval, stop - 0.5 * interval]
        window = slice(*np.searchsorted(signals.time, ends))
        velocity, force = signals.velocity[window], signals.force_measured[window]
        if n < 1 or len(force) < _FEWEST * n:
            continue
        # The edges of whole cycles are rounded to samples: the frequency is of their whole length.
        times = start + (stop - start) * np.arange(n * _PHASES) / (n * _PHASES)
        cycles = [np.interp(times, signals.time, row).reshape(n, _PHASES) for row in rows]
        mean = [cycle.mean(axis=0) for cycle in cycles]
        peak = float(min(mean[1].max(), -mean[1].min()))
        shares = {round(share * peak, 6) for share in _SHARES}
        speeds = sorted(shares | {speed for speed in NAMED_SPEEDS if speed < peak})
        counts, means, squares = in_both_strokes(velocity, force[None], speeds)
        variances = np.full(counts.shape, math.nan)
        np.divide(squares[..., 0], counts * (counts - 1.0), out=variances, where=counts > 1.0)
        forces, errors = means[..., 0].mean(axis=1), 0.5 * np.sqrt(variances.sum(axis=1))
        test = MeasuredTest(
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
        tests.append(test)
    return tuple(tests)


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
                repeat = share * _damping(group, speed)
                for stroke in STROKES:
                    topic = Topic(kind, name, "force", "N", setting, speed, stroke)
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
