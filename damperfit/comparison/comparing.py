"""Runs compared: what was measured first, then forces, parameters, energy and hysteresis.

Two runs are two tests, so that their errors add. What both have in common does not: at the same
motion a wrong model misses the same force in both, and only by how much it misses them differently
is an error of the difference (`Reading.misses`).

At a setting where a model misses the measured force of any run by more than it may, the measured
forces of all are compared, at every speed: a model that misses one is not asked for the next, and a
difference must be of one kind. Where every run knows the offset of its rig, which is tared before
each test, forces are without it. Beside the numbers stands what the runs differ in besides, which
may be the reason.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from statistics import fmean, median, stdev
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.adjustment.force_at import (
    REPEATS,
    STROKES,
    Sine,
    force_at,
    named_speeds,
    offsets_in_words,
)
from damperfit.comparison.measured import (
    SAME_MOTION,
    Reading,
    Topic,
    measured_readings,
    reach_of,
    repeat_scatter,
    tests_at,
    zero_shift,
)
from damperfit.errors import ConfigurationError, failure_of
from damperfit.identification.outcome import Status
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.problem import Failure, Problem, counted, distinct, listed_names, note
from damperfit.statistics import NORMAL_95
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.damper.model import Quantity
    from damperfit.errors import OnError
    from damperfit.results import Run
    from damperfit.tested.setting import Setting

    Readings = dict[Topic, Reading]

# "Same" is said only where a difference of so much of the damping, or of the value, would be seen.
SEEN = 0.05
_LEVEL = 0.05  # of all verdicts of a comparison together
_MOST_LOG = 700.0  # beyond it exp overflows
_EACH, _CONSTANT = "the motion of each test", "constant speed"
_KINDS = ("measured", "force", "parameter", "figure")
_FEW_REPEATS = 3  # fewer show little of a scatter
_OBJECTIONS = {
    Status.AT_BOUND.value: "it is at a bound of its range",
    Status.NOT_IDENTIFIABLE.value: "the logs do not determine it",
    Status.ABSENT.value: "the model is fitted without it there",
}
_ONCE = {Status.SHARED.value, Status.FIXED.value, Status.NOT_IDENTIFIABLE.value}


# Two numbers beside each other

SAME, DIFFERENT, UNDETERMINED = "same", "different", "undetermined"  # verdicts, for scripts


class Difference(NamedTuple):
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
    verdict: str = UNDETERMINED  # at 95 %, each line by itself
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


def compared(
    subject: Topic, first: Reading, second: Reading, *, is_same_motion: bool = False
) -> Difference:
    """Return the difference of two readings; of one model and motion, common misfit cancels."""
    a, b = first.value, second.value
    reason = first.objection or second.objection
    if not (math.isfinite(a) and math.isfinite(b)):
        return Difference(subject, first, second, reason=reason or "not known for both")
    is_log = subject.is_logarithmic and a > 0.0 and b > 0.0
    units = (a, b) if is_log else (1.0, 1.0)
    misfits = [reading.misfit / unit for reading, unit in zip((first, second), units, strict=True)]
    misfit, miss_change = math.hypot(*misfits), second.misses - first.misses
    if first.is_measured and second.is_measured:
        misfit = 0.0
    elif is_same_motion and any(misfits) and math.isnan(miss_change):
        misfit = abs(misfits[1] - misfits[0])
    elif is_same_motion and any(misfits):
        noise = (r.misses_error for r in (first, second) if math.isfinite(r.misses_error))
        misfit = math.sqrt(max(miss_change**2 - sum(error**2 for error in noise), 0.0))
    second_errors = [*second.errors(1.0 / units[1]), (misfit, math.inf)]
    errors = [*first.errors(1.0 / units[0]), *second_errors]
    step = math.log(b / a) if is_log else b - a
    reach, chance = reach_of(errors, step)
    if is_log:
        percent = 100.0 * (b / a - 1.0)
        low, high = (math.exp(min(log, _MOST_LOG)) - 1.0 for log in (step - reach, step + reach))
        share = reach
        numbers = (a * low, a * high, percent, 100.0 * low, 100.0 * high)
    else:
        scale = first.scale if math.isfinite(first.scale) else a
        percent = share = math.nan
        if scale:
            # The first number is the denominator too: its error counts 1 + share times.
            percent = 100.0 * step / scale
            share = reach_of([*first.errors(1.0 + step / scale), *second_errors])[0] / abs(scale)
        if subject.kind == "parameter":  # an offset may pass zero: per cent of it say nothing
            percent = math.nan
        limits = (percent - 100.0 * share, percent + 100.0 * share)
        numbers = (step - reach, step + reach, percent, *limits)
    verdict = UNDETERMINED
    if not reason and not math.isfinite(reach):
        reason = "no errors are known"
    elif not reason and abs(step) > reach:
        verdict = DIFFERENT
    elif not reason and share > SEEN:
        # At its passage through zero a force has no per cent to speak of: newtons say it.
        size = f"{reach:.2g} {subject.unit}" if math.isnan(percent) else f"{100.0 * share:.2g} %"
        reason = f"a difference of {size} would go unnoticed"
    elif not reason:
        verdict = SAME
    return Difference(subject, first, second, *numbers, chance, verdict, reason)


def surely_different(lines: Sequence[Difference]) -> tuple[Difference, ...]:
    """Return the lines with `Difference.is_sure` set, by Holm's procedure over all of them.

    Among many lines one in twenty differs by chance. What is left here is so in one comparison of
    twenty, however the lines are correlated.
    """
    chances = sorted(line.chance for line in lines if math.isfinite(line.chance))
    limit = -1.0  # the largest chance of those that are sure
    for rank, chance in enumerate(chances):
        if chance > _LEVEL / (len(chances) - rank):
            break
        limit = chance
    return tuple(
        line._replace(is_sure=line.chance <= limit and line.verdict == DIFFERENT) for line in lines
    )


# Lines in words: what differs, by how much, or why nothing can be said.


def outcome_of(lines: Sequence[Difference], words: str, units: ShownUnits = SI) -> str:
    """Say how many differ, which most, and what chance would do."""
    n_measured = sum(line.is_measured for line in lines) if lines[0].subject.kind == "force" else 0
    if n_measured:
        share = f" ({n_measured} of {len(lines)} as measured)"
        words += " as measured" if n_measured == len(lines) else share
    clear, n = [line for line in lines if line.verdict != UNDETERMINED], len(lines)
    if not clear:
        return f"{words}: cannot be determined ({lines[0].reason})"
    different = [line for line in clear if line.verdict == DIFFERENT]
    sure = [line for line in different if line.is_sure]
    unclear = f"; {n - len(clear)} cannot be determined" if n > len(clear) else ""
    if not different:
        which = f"{len(clear)} of {n}" if unclear else f"all {n}"
        return f"{words}: {which} the same within errors{unclear}"
    if not sure:
        return (
            f"{words}: no significant difference: {len(different)} of {n} lie outside "
            f"their 95 % interval, where chance alone puts {0.05 * len(clear):.2g}{unclear}"
        )
    worst = max(
        sure, key=lambda line: abs(line.difference if math.isnan(line.percent) else line.percent)
    )
    how_many = "all" if len(sure) == len(different) else str(len(sure))
    return (
        f"{words}: {len(different)} of {n} differ, {how_many} of them significantly; most "
        f"{worst.subject.place(units)}: {difference_of(worst, units)}{unclear}"
    )


def difference_of(line: Difference, units: ShownUnits = SI) -> str:
    """Say how large a difference is, with its interval."""
    unit = line.subject.unit
    if math.isnan(line.percent):
        text = units.write(line.difference, unit, "+.4g")
        low, high = (units.show(end, unit) for end in (line.low, line.high))
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
    text = line.words or "same within errors"
    if not line.words and line.verdict == UNDETERMINED:
        text = f"cannot be determined: {line.reason}"
    elif not line.words and line.verdict == DIFFERENT:
        if subject.name.startswith("hysteresis") and a * b > 0.0:
            # Its sign is the way round the loop: -54 N after -57 N is a narrower loop.
            size = units.write(abs(abs(b) - abs(a)), subject.unit, ".2g")
            change = f"the loop is {size} {'wider' if abs(b) > abs(a) else 'narrower'}"
        elif math.isnan(line.percent):
            size = units.write(abs(line.difference), subject.unit, ".3g")
            change = f"{size} {'more' if line.difference > 0.0 else 'less'}"
        else:
            words = ("softer", "harder") if subject.kind == "force" else ("less", "more")
            two_digits = f"{float(f'{abs(line.percent):.2g}'):.15g}"  # without a power of ten
            change = f"{two_digits} % {words[line.percent > 0.0]}"
        text = f"different{'' if line.is_sure else ', perhaps by chance'}: {change}"
    is_marked = says_measured and subject.kind == "force" and line.is_measured
    return f"{text} (measured)" if is_marked else text


# Two runs


@dataclass(frozen=True, slots=True)
class ComparisonOptions:
    """What is compared."""

    # Whose peak speed the named test speeds go up to; None: the slower test's.
    sine: Sine | None = None
    speeds: tuple[float, ...] = ()  # m/s, positive; none: the named test speeds
    is_measured: bool = False  # measured curves alone, without a model
    jobs: int = 1  # threads
    units: ShownUnits = SI  # of forces and speeds in sentences; every number stays SI


class Circumstance(NamedTuple):
    """One thing that two runs differ in, or have in common, with the value of each."""

    kind: str  # logs, identity, settings, model, damper, gas, motion, temperature, rig, filter, ...
    first: str
    second: str
    sentence: str


@dataclass(frozen=True, slots=True, eq=False)
class RunComparison:
    """What differs between two runs."""

    first: Run  # the reference
    second: Run
    repeats: tuple[Run, ...]  # of the reference: their scatter, not the errors, is the measure
    circumstances: tuple[Circumstance, ...]  # what they differ in besides
    settings: tuple[Setting, ...]  # that both have
    is_without_model: bool  # measured curves alone are compared
    lines: tuple[Difference, ...]  # measured forces, forces, parameters, figures
    identical: tuple[Setting, ...] = ()  # at which both have the same logs, byte for byte
    units: ShownUnits = SI  # of its sentences
    notes: tuple[Problem, ...] = ()  # what a reader must know; nothing is missing
    remarks: tuple[Problem, ...] = ()  # what could not be compared
    traces: tuple[str, ...] = ()  # where internal errors happened

    def of(self, kind: str) -> tuple[Difference, ...]:
        """Return the lines of a kind: "measured", "force", "parameter" or "figure"."""
        return tuple(line for line in self.lines if line.subject.kind == kind)

    @property
    def motion(self) -> str:
        """At which forces are compared, for people."""
        return _EACH if self.is_without_model else _CONSTANT

    @property
    def sentences(self) -> tuple[str, ...]:
        """The outcome in words: what was measured first, then forces and parameters."""
        measured = self.of("measured")
        if measured:
            measured += tuple(line for line in self.of("figure") if line.is_measured)
        first = []
        if self.identical and len(self.identical) == len(self.settings):
            first = ["measured: identical, both have the same logs, byte for byte"]
            measured = ()
        groups = [
            (measured, "measured forces and energies"),
            (self.of("force"), "forces"),
            (self.of("parameter"), "parameters"),
        ]
        return (*first, *(outcome_of(lines, words, self.units) for lines, words in groups if lines))

    @property
    def forces_title(self) -> str:
        """What forces are compared, as in "Forces as measured at the motion of each test"."""
        forces = self.of("force")
        is_measured = bool(forces) and all(line.is_measured for line in forces)
        return f"Forces {'as measured ' if is_measured else ''}at {self.motion}"

    @property
    def differing(self) -> tuple[str, ...]:
        """Sentences of what else differs, which may be the reason."""
        return tuple(fact.sentence for fact in self.circumstances if fact.kind != "logs")

    @property
    def to_know(self) -> tuple[str, ...]:
        """Sentences of what both have in common, and the notes."""
        of_logs = tuple(fact.sentence for fact in self.circumstances if fact.kind == "logs")
        return (*of_logs, *map(str, self.notes))


def compare_runs(
    first: Run,
    second: Run,
    options: ComparisonOptions = ComparisonOptions(),
    *,
    repeats: Sequence[Run] = (),
) -> RunComparison:
    """Return a run beside the reference; of `repeats`, its further runs, scatter is the measure.

    A ConfigurationError: they have no setting in common, or no motion reaches the speeds that
    were asked for.
    """
    runs = (first, *repeats, second)
    is_bare = options.is_measured or not all(run.settings for run in runs)
    tested = [settings_of(run, is_bare=is_bare) for run in runs]
    settings = tuple(s for s in tested[0] if all(s in of_run for of_run in tested))
    if not settings:
        pairs = list(zip(runs, tested, strict=True))[:3]
        listed = "; ".join(f"{r.shown_as} has {of_settings(s) if s else 'none'}" for r, s in pairs)
        text = f"no setting is common to all: {listed}; damperfit settings shows the forces of each"
        raise ConfigurationError(text, code="nothing-in-common")
    failures: list[Failure] = []

    def add_failure(setting: Setting, error: Exception) -> None:
        failures.append(failure_of(error, f"simulating setting {setting}"))

    is_same_motion = True
    if is_bare:
        tables = measured_readings(runs, settings, speeds=options.speeds)
    else:
        forces = force_readings(
            runs, settings, speeds=_speeds_reached(runs, options), on_error=add_failure
        )
        measured = measured_readings(runs, settings, kind="measured")
        parameters = parameter_readings(runs, settings)
        tables = tuple(a | b | c for a, b, c in zip(measured, forces, parameters, strict=True))
        motions = [(run.motion.amplitude, run.motion.frequency) for run in runs]
        is_same_motion = all(  # what each model misses there was measured
            abs(value / reference - 1.0) <= SAME_MOTION
            for motion in motions
            for value, reference in zip(motion, motions[0], strict=True)
        )
    if not any(tables[0]):
        raise ConfigurationError(
            f"{first.shown_as} and {second.shown_as}: nothing can be compared at setting "
            f"{listed_settings(settings)}: no motion is common to both",
            code="nothing-in-common",
        )
    # Where the declared gas differs, it is known what shifts the forces.
    is_other_gas = not is_bare and len(set(map(_gas_force, runs))) > 1
    shifts = [(0.0, 0.0) if is_other_gas else zero_shift(first, run, settings) for run in runs]
    bare = set() if is_bare else known_tares(runs, settings)
    *references, other = (
        _unshifted(table, bare, *shift) for table, shift in zip(tables, shifts, strict=True)
    )
    identical = tuple(setting for setting in settings if _has_one_set_of_logs(runs, setting))
    lines: list[Difference] = []
    for kind in _KINDS:  # what is asked of the forces and of the parameters are two questions
        group = []
        for topic, reading in other.items():
            readings = [table[topic] for table in references if topic in table]
            if topic.kind != kind or len(readings) < len(references):
                continue
            line = compared(topic, readings[0], reading, is_same_motion=is_same_motion)
            group.append(compared(topic, _mean(topic, readings), reading.bare) if repeats else line)
        lines += surely_different(group)
    lines = [
        # What was measured of the same logs is the same, whatever a filter has made of it.
        line._replace(verdict=SAME, is_sure=False, words="identical: the same logs")
        if line.is_measured and line.subject.setting in identical
        else line
        for line in lines
    ]
    if not is_bare:
        lines += figure_lines(first, second, settings)
    besides = circumstances(first, second, options.units, is_bare=is_bare)
    comparison = RunComparison(
        *(first, second, tuple(repeats), besides, settings, is_bare),
        *(tuple(lines), identical, options.units),
        remarks=distinct(failure.problem for failure in failures),
        traces=tuple(failure.trace for failure in failures if failure.trace),
    )
    return replace(comparison, notes=tuple(_notes(comparison, runs, tables, shifts)))


def settings_of(run: Run, *, is_bare: bool) -> tuple[Setting, ...]:
    """Return the settings that were measured, or those that have parameters."""
    if is_bare:
        return tuple(sorted({test.setting for test in run.tests}))
    return tuple(stage.setting for stage in run.settings)


def _speeds_reached(runs: Sequence[Run], options: ComparisonOptions) -> tuple[float, ...]:
    """The speeds that were asked for, else the named ones that the sine or all tests reach."""
    top = min(run.motion.peak_speed for run in runs)
    top = top if options.sine is None else options.sine.peak_speed
    speeds = options.speeds or named_speeds(top)
    if not speeds:
        raise ConfigurationError(
            f"none is reached by {top:.3g} m/s; give {{--velocity}}",
            subject="the named test speeds",
            code="no-speed",
        )
    return speeds


def _unshifted(table: Readings, bare: set[Setting], shift: float, error: float) -> Readings:
    """Readings with the zero shift taken off the forces, but off those without their tare."""
    # A model without an offset absorbs between none and all of a zero shift.
    of_model = math.hypot(0.5 * error, shift / math.sqrt(12.0))
    shifted = dict(table)
    for topic, reading in table.items() if shift else ():
        if topic.speed is not None and not (topic.kind == "force" and topic.setting in bare):
            size, unsure = (shift, error) if reading.is_measured else (0.5 * shift, of_model)
            repeat = math.hypot(reading.repeat, unsure)
            shifted[topic] = reading._replace(value=reading.value - size, repeat=repeat)
    return shifted


def _has_one_set_of_logs(runs: Sequence[Run], setting: Setting) -> bool:
    """Whether all have the same logs of a setting, byte for byte."""
    digests, *others = (
        {digest for digest, log in _inputs(run) if log["setting"] == setting.cell} for run in runs
    )
    return bool(digests) and all(other == digests for other in others)


def _mean(topic: Topic, readings: Sequence[Reading]) -> Reading:
    """Return the mean of repeats of the reference, with their scatter as its error."""
    # A damper taken off the rig and put on again differs by more than its cycles do. Of n runs with
    # standard deviation s a further one falls within t s sqrt(1 + 1/n) of their mean in 95 of 100;
    # t has n - 1 degrees of freedom.
    values, n = [reading.value for reading in readings], len(readings)
    objection = next((reading.objection for reading in readings if reading.objection), "")
    if not all(map(math.isfinite, values)):
        return readings[0]._replace(value=math.nan, objection=objection)
    mean, error = fmean(values), stdev(values)
    if topic.is_logarithmic and min(values) > 0.0:
        logs = [math.log(value) for value in values]
        mean = math.exp(fmean(logs))
        error = mean * stdev(logs)
    return readings[0].bare._replace(
        value=mean,
        error=error * math.sqrt(1.0 + 1.0 / n),
        freedom=float(n - 1),
        scale=fmean(reading.scale for reading in readings),
        objection=objection,
    )


# What was fitted, as readings


def force_readings(
    runs: Sequence[Run],
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float],
    on_error: OnError | None = None,
) -> tuple[Readings, ...]:
    """Return the forces of fitted runs at speeds, m/s, of settings that all have.

    Without `on_error` an error that a setting has met is raised.
    """
    bare = known_tares(runs, settings)
    tables = []
    for run in runs:
        stages = [stage for stage in run.settings if stage.setting in settings]
        forces = force_at(stages, run.damper, speeds, measured=run.speed_forces, on_error=on_error)
        tables.append({
            (f.setting, f.speed, f.stroke): f if f.setting in bare else f.with_tare for f in forces
        })  # fmt: skip
    order = product(settings, speeds, STROKES)
    common = [key for key in order if all(key in table for table in tables)]
    doubted = {key[0] for key in common if any(table[key].disagrees for table in tables)}
    readings: tuple[Readings, ...] = tuple({} for _ in runs)
    for run, table, row in zip(runs, tables, readings, strict=True):
        share, repeat_freedom = repeat_scatter(run)
        for key in common:
            force = table[key]
            if key[0] in doubted and all(other[key].measured is not None for other in tables):
                force = force.as_read
            n_logs = run.row(force.setting).get("n_logs") or 1
            row[Topic("force", "force", "force", "N", *key)] = Reading(
                force.force,
                force.error,
                freedom_of(run, force.setting),
                repeat=share * abs(force.damping) / math.sqrt(n_logs),
                repeat_freedom=repeat_freedom,
                misfit=force.misfit,
                misses=force.difference,
                misses_error=math.nan if force.measured is None else force.measured.error,
                disagrees=force.disagrees,
                scale=force.damping,
                is_measured=force.is_measured,
            )
    return readings


def known_tares(runs: Sequence[Run], settings: Sequence[Setting]) -> set[Setting]:
    """Return the settings at which all of several runs know the offset of their rig."""
    if len(runs) < 2 or not all(map(_knows_gas, runs)):
        return set()
    with_offset = [{stage.setting for stage in run.settings if stage.knows_offset} for run in runs]
    return set(settings).intersection(*with_offset)


def _knows_gas(run: Run) -> bool:
    """Without a gas of its own a model holds the gas force in its offset."""
    return run.damper.rest_force(0.0) is not None


def _gas_force(run: Run) -> float:
    """Return the force of the declared gas at mid-stroke, N, to nine digits; NaN: none is known."""
    force = run.damper.rest_force(0.0)
    return math.nan if force is None else float(f"{float(force):.9g}")


def freedom_of(run: Run, setting: Setting) -> float:
    """Degrees of freedom of a setting's errors: its cycles less one a log; infinite: not known."""
    row = run.row(setting)
    cycles, logs = row.get("n_cycles"), row.get("n_logs") or 1
    return float(max(cycles - logs, 1)) if cycles else math.inf


def comparable_quantities(runs: Sequence[Run]) -> tuple[Quantity, ...]:
    """Return the quantities that all runs have: none where they are of different models."""
    if len({run.damper.name for run in runs}) > 1:
        return ()
    units = [{q.name: q.unit for q in run.quantities} for run in runs[1:]]
    return tuple(
        q for q in runs[0].quantities if all(by_name.get(q.name) == q.unit for by_name in units)
    )


def parameter_readings(runs: Sequence[Run], settings: Sequence[Setting]) -> tuple[Readings, ...]:
    """Return the parameters of each run that was fitted in at least one of them.

    What all settings share is one number, and stands once.
    """
    tables: tuple[Readings, ...] = tuple({} for _ in runs)
    by_run = [[run.row(setting) for setting in settings] for run in runs]
    for quantity in comparable_quantities(runs):
        name, status = quantity.name, f"{quantity.name}_status"
        is_shared = all(
            len({row.get(name) for row in rows}) == 1 and {row.get(status) for row in rows} <= _ONCE
            for rows in by_run
        )
        for k, setting in enumerate(settings[:1] if is_shared else settings):
            rows = [rows[k] for rows in by_run]
            if all(row.get(status) == Status.FIXED.value for row in rows):
                continue
            topic = Topic(
                *("parameter", name, quantity.symbol, quantity.unit_after.strip()),
                setting=None if is_shared else setting,
                is_logarithmic=quantity.is_logarithmic,
            )
            for table, run, row in zip(tables, runs, rows, strict=True):
                if row.get(name) is None:
                    table[topic] = Reading(math.nan, objection="it has no value")
                    continue
                is_fixed = row.get(status) == Status.FIXED.value
                pooled = settings if is_shared else (setting,)
                table[topic] = Reading(
                    float(row[name]),
                    0.0 if is_fixed else _number(row.get(f"{name}_se")),
                    sum(freedom_of(run, s) for s in pooled),
                    misfit=float(row.get(f"{name}_misfit_se") or 0.0),
                    scale=math.nan if quantity.is_logarithmic else quantity.size,
                    objection=_OBJECTIONS.get(str(row.get(status)), ""),
                )
    return tables


def figure_lines(first: Run, second: Run, settings: Sequence[Setting]) -> Iterator[Difference]:
    """Yield MSE and distance from cavitation by setting: numbers without errors, in words."""
    for setting in settings:
        rows = (first.row(setting), second.row(setting))
        misfits = [_number(row.get("mse_percent")) for row in rows]
        grades = [str(row.get("grade") or "no grade") for row in rows]
        figures = [("mse", "MSE", misfits, grades)]
        margins = [100.0 * _number(row.get("r_m3_cavitation_margin")) for row in rows]
        is_empty = [bool(row.get("cavitation_fraction")) for row in rows]
        if any(map(math.isfinite, margins)) or any(is_empty):
            chambers = ["cavitates" if is_dry else "full" for is_dry in is_empty]
            figures.append(("cavitation_margin", "R_m3 below cavitation", margins, chambers))
        for name, label, values, (a, b) in figures:
            first_value, second_value = map(Reading, values)
            verdict, words = (SAME, f"both {a}") if a == b else (DIFFERENT, f"{a}, now {b}")
            topic = Topic("figure", name, label, "%", setting)
            yield Difference(topic, first_value, second_value, verdict=verdict, words=words)


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


# What a reader must know


def _notes(  # noqa: C901, PLR0912 - all that was compared, one thing after the other
    comparison: RunComparison,
    runs: Sequence[Run],
    tables: Sequence[Readings],
    shifts: Sequence[tuple[float, float]],
) -> Iterator[Problem]:
    is_bare, units, forces = comparison.is_without_model, comparison.units, comparison.of("force")
    if 0 < (n := len(comparison.repeats)) < _FEW_REPEATS:
        text = (
            f"the scatter of A is that of {n + 1} runs, {counted(n, 'degree')} of freedom: "
            f"intervals are {'six times' if n == 1 else 'twice'} as wide as those of many would be"
        )
        yield note("few-repeats", text)
    with_forces = {line.subject.setting for line in forces}
    at = [setting for setting in comparison.settings if setting in with_forces]
    if missing := [setting for setting in comparison.settings if forces and setting not in at]:
        yield note("no-motion", "no motion is common to both: not compared", of_settings(missing))
    top = min((stage.top_speed for run in runs for stage in run.settings), default=math.inf)
    speeds = {line.subject.speed or 0.0 for line in forces if not line.is_measured}
    if beyond := sorted(speed for speed in speeds if speed > (1.0 + REPEATS) * top):
        listed = ", ".join(map(units.write_speed, beyond))
        text = (
            f"{listed} was never tested (tested: up to {units.write_speed(float(f'{top:.3g}'))}): "
            "the forces there are the models', extrapolated"
        )
        yield note("never-tested", text)
    for run, (shift, error) in zip(runs, shifts, strict=True):
        if shift:
            of_models = (
                "; half of it (± half) off the forces of a model fitted without an offset, whose "
                "parameters absorb the rest: free f_0 in both runs to compare them"
            )
            text = (
                f"its measured forces lie {units.write(shift, 'N', '+.3g')} (± "
                f"{units.write(NORMAL_95 * error, 'N', '.2g')}) from those of {runs[0].name} in "
                "both strokes and at all speeds, as another tare or gas pressure makes them: so "
                f"much is taken off{'' if is_bare else of_models}"
            )
            yield note("zero-shift", text, run.name)
    for run in runs:
        yield from (problem.of(run.name) for problem in _own_notes(run, is_bare=is_bare))
    if is_bare or not forces:
        return
    # Why forces of fitted runs are compared as measured.
    if measured := dict.fromkeys(line.subject.setting for line in forces if line.is_measured):
        for run, table in zip(runs, tables, strict=True):
            if missed := {topic: reading for topic, reading in table.items() if reading.disagrees}:
                topic, worst = max(missed.items(), key=lambda item: abs(item[1].misses))
                miss, settings = abs(worst.misses), dict.fromkeys(topic.setting for topic in missed)
                of_it = f" ({miss / abs(worst.scale):.1%} of the damping)" if worst.scale else ""
                text = (
                    f"its model ({run.damper.name}) misses the measured force at "
                    f"{of_settings(filter(None, settings))}, most {topic.place(units)}: "
                    f"by {units.write(miss, 'N', '.3g')}{of_it}"
                )
                yield note("model-misses", text, run.name)
        reason = "they show how the tests differ and say nothing about the models"
        if not dict(_inputs(runs[0])).keys().isdisjoint(dict(_inputs(runs[-1]))):
            reason = "both are based on the same logs, so this says nothing about the models"
        where_measured = of_settings(filter(None, measured))
        text = "at {settings} the measured forces of both are compared: {why}"
        yield note("as-measured", text, settings=where_measured, why=reason)
    # What became of the rigs' force offsets.
    bare = known_tares(runs, at)
    offsets = [[stage.offset for stage in run.settings if stage.setting in bare] for run in runs]
    if any(map(any, offsets)):
        pairs = zip(runs, offsets, strict=True)
        listed_offsets = "; ".join(f"{run.name}: {offsets_in_words(tares)}" for run, tares in pairs)
        text = "the rigs' force offsets, their tares, are left out of the forces ({offsets})"
        yield note("offset", text, offsets=listed_offsets)
    for run in () if any(shift for shift, _ in shifts) else runs:
        stages = [stage for stage in run.settings if stage.setting in {*at} - bare]
        if (tares := [stage.offset for stage in stages if stage.offset]) and _knows_gas(run):
            text = (
                f"its forces include its rig's tare ({offsets_in_words(tares)}), because that "
                "of another run is not known: so much of a difference may be tare"
            )
            yield note("offset", text, run.name)
    if not comparable_quantities(runs):
        yield note("other-model", "fitted with different models: no parameter is common to both")


def _own_notes(run: Run, *, is_bare: bool) -> Iterator[Problem]:
    of_record = (note("as-read", text) for text in run.record.get("notes", ()))
    yield from of_record if is_bare else run.notes
    share, freedom = repeat_scatter(run)
    if share:
        text = (
            f"tests of one setting differ by {100.0 * share:.2g} % of the damping beyond their "
            f"noise ({freedom:.0f} degrees of freedom): counted in the errors of forces, energy "
            "and hysteresis, not in those of parameters"
        )
        yield note("tests-differ", text)
    if not is_bare and not run.speed_forces:
        text = (
            "the lack of fit to the measured force is not known (an older version, or no motion "
            "repeats): it is not in the errors of forces"
        )
        yield note("no-misfit", text)


# What two runs differ in besides their numbers

_TEMPERATURES_DIFFER = 2.0  # degC; forces fall as the oil thins
_WHOSE = ("damper", "serial", "customer", "operator", "date", "rig")
# Keys of the run's configuration, with words for people, that change what comes of the same logs.
_HOW = {
    ("rig", "filter"): ("filter", "filter in the rig"),
    ("rig", "filter_corner"): ("filter", "corner of the filter in the rig"),
    ("rig", "filter_order"): ("filter", "order of the filter in the rig"),
    ("rig", "centre"): ("rig", "x = 0"),
    ("rig", "skew"): ("rig", "declared delay of the force"),
    ("conditioning", "filter"): ("filter", "damperfit's filter"),
    ("conditioning", "filter_corner"): ("filter", "corner of damperfit's filter"),
    ("conditioning", "filter_order"): ("filter", "order of damperfit's filter"),
    ("identification", "procedure"): ("procedure", "procedure"),
    ("identification", "free"): ("procedure", "free parameters"),
    ("identification", "fix"): ("procedure", "held parameters"),
    ("identification", "share"): ("procedure", "shared parameters"),
    ("identification", "bulk_modulus"): ("procedure", "bulk modulus"),
}
# Kinds of what differs, what matters most first.
_ORDER = (
    *("logs", "rig", "identity", "settings", "model", "damper", "gas", "motion", "temperature"),
    *("filter", "procedure", "version"),
)


def circumstances(
    first: Run, second: Run, units: ShownUnits = SI, *, is_bare: bool = False
) -> tuple[Circumstance, ...]:
    """Return what two runs differ in, what matters most first; is_bare: measured curves alone."""
    runs = (first, second)
    listed = [*_of_logs(first, second)]

    def differs(kind: str, name: str, a: str, b: str, consequence: str = "") -> None:
        listed.append(Circumstance(kind, a, b, f"{name}: {a}, then {b}{consequence}"))

    of_one_model = not is_bare and first.damper.name == second.damper.name
    facts, other_facts = (
        {
            name: fact
            for name, *fact in _facts(run, units, is_bare=is_bare, of_one_model=of_one_model)
        }
        for run in runs
    )
    for name, (kind, text, consequence) in facts.items():
        if name in other_facts and other_facts[name][1] != text:
            differs(kind, name, text, other_facts[name][1], consequence)
    tested = [settings_of(run, is_bare=is_bare) for run in runs]
    alone = [[setting for setting in tested[k] if setting not in tested[1 - k]] for k in (0, 1)]
    for run, settings in zip(runs, alone, strict=True):
        if settings:
            sentence = f"{of_settings(settings)} only in {run.name}: not compared"
            a, b = map(listed_settings, alone)
            listed.append(Circumstance("settings", a, b, sentence))
    common = [setting for setting in tested[0] if setting in tested[1]]
    motions = [
        [(test.amplitude, test.frequency) for s in common for test in tests_at(run, s)[:1]]
        for run in runs
    ]
    if not all(motions) and not is_bare:
        motions = [[(run.motion.amplitude, run.motion.frequency)] for run in runs]
    if all(motions):
        medians = [list(map(median, zip(*of_run, strict=True))) for of_run in motions]
        if any(abs(b / a - 1.0) > SAME_MOTION for a, b in zip(*medians, strict=True)):
            a, b = (
                f"{units.write_length(amplitude, '.4g')} at {frequency:.4g} Hz"
                for amplitude, frequency in medians
            )
            differs("motion", "motion", a, b, ": what a model misses does not cancel")
    logged = [[t.temperature for t in run.tests if math.isfinite(t.temperature)] for run in runs]
    means = [fmean(temperatures) for temperatures in logged if temperatures]
    if len(means) == len(runs) and abs(means[0] - means[1]) > _TEMPERATURES_DIFFER:
        differs("temperature", "temperature", *(f"{mean:.1f} degC" for mean in means))
    return tuple(sorted(listed, key=lambda fact: _ORDER.index(fact.kind)))


def _facts(  # noqa: C901, PLR0912 - one kind after the other
    run: Run, units: ShownUnits, *, is_bare: bool, of_one_model: bool
) -> Iterator[tuple[str, str, str, str]]:
    """Yield what may differ between runs: its name, kind and value, and what follows from it."""
    for key in _WHOSE:
        if owner := run.identity.get(key):
            yield key, "identity", str(owner), ""
    if not is_bare:  # of measured curves the damper need not be known
        yield "model", "model", run.damper.name, ": only forces are compared, not parameters"
    if of_one_model:
        damper = run.damper
        consequence = ": those with the same name are compared"
        yield f"quantities of {damper.name}", "model", ", ".join(damper.names), consequence
        for quantity in run.quantities:
            yield f"unit of {quantity.name}", "model", quantity.unit, ": it is not compared"
        for name, (_, _, unit) in damper.ranges.items():
            if isinstance(size := getattr(damper, name, None), float):
                kind = "gas" if name.startswith("gas_") else "damper"
                yield f"damper.{name}", kind, f"{size:.6g} {unit}".strip(), ""
    if not is_bare and math.isfinite(gas := _gas_force(run)):
        force = units.write(gas, "N", ".1f" if units.of("N") == "N" else ".3g")
        consequence = ": this difference is part of every difference of force"
        yield "gas force at mid-stroke", "gas", force, consequence
    document = run.record.get("configuration")
    for (section, key), (kind, words) in _HOW.items():
        keys = document.get(section) if isinstance(document, dict) else None
        value: Any = keys.get(key) if isinstance(keys, dict) else None
        if isinstance(value, dict):
            value = [f"{name} = {_plain(entry)}" for name, entry in value.items()]
        if isinstance(value, list):
            value = ", ".join(map(_plain, value)) or "none"
        if value is not None:
            yield words, kind, _plain(value), ""
    consequence = "; what the older run lacks is not compared"
    for name, words, suffix in (
        ("version", "damperfit", ""), ("schema_version", "schema of the results", consequence),
    ):  # fmt: skip
        if (number := run.record.get(name)) is not None:
            yield words, "version", str(number), suffix


def _plain(value: object) -> str:
    """A value of a configuration: 60 and 60.0 are one."""
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _inputs(run: Run) -> list[tuple[str, dict[str, Any]]]:
    """Return the hash of each log that a run is based on, and the log as its record has it."""
    logs = [log for log in run.inputs if log.get("sha256") and log.get("setting") is not None]
    return [(str(log["sha256"]), log) for log in logs]


def _of_logs(first: Run, second: Run) -> Iterator[Circumstance]:
    """Yield that logs are in both, and which of these were read with other signs."""
    by_digest = [dict(_inputs(run)) for run in (first, second)]
    common = by_digest[0].keys() & by_digest[1].keys()

    def named(digests: Sequence[str]) -> str:
        return listed_names(sorted(str(by_digest[0][digest].get("log")) for digest in digests))

    if common:
        all_logs = f"both are based on the same logs ({named([*common])})"
        some_logs = f"some logs are in both ({named([*common])}), where"
        is_all = by_digest[0].keys() == by_digest[1].keys()
        sentence = (
            f"{f'{all_logs}:' if is_all else some_logs} differences come from the evaluation only, "
            "and the errors, which assume two tests, are too large"
        )
        yield Circumstance("logs", first.name, second.name, sentence)
    turned: dict[tuple[str, str], list[str]] = {}
    for digest in common:
        signs = [logs[digest].get("reversed") for logs in by_digest]
        if all(isinstance(channels, list) for channels in signs) and signs[0] != signs[1]:
            a, b = (" and ".join(map(str, channels or ())) or "none" for channels in signs)
            turned.setdefault((a, b), []).append(digest)
    for (a, b), digests in sorted(turned.items()):
        is_stroke = ("displacement" in a) is not ("displacement" in b)
        words = ("rebound", "compression") if is_stroke else ("positive", "negative")
        yield Circumstance(
            "rig",
            a,
            b,
            f"reversed channels: {a} in {first.name}, {b} in {second.name} ({named(digests)}), so "
            f"that {words[0]} in one is {words[1]} in the other; "
            "declare rig.reverse_displacement and rig.reverse_force",
        )
