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
from statistics import fmean, stdev
from typing import TYPE_CHECKING, Any

from damperfit.adjustment.force_at import (
    REPEATS,
    STROKES,
    Sine,
    force_at,
    named_speeds,
    offsets_in_words,
)
from damperfit.comparison.circumstances import (
    Circumstance,
    circumstances,
    gas_force,
    inputs_of,
    settings_of,
)
from damperfit.comparison.differences import (
    DIFFERENT,
    SAME,
    Difference,
    compared,
    outcome_of,
    surely_different,
)
from damperfit.comparison.measured import (
    SAME_MOTION,
    Reading,
    Topic,
    measured_readings,
    repeat_scatter,
    zero_shift,
)
from damperfit.errors import ConfigurationError, failure_of
from damperfit.identification.outcome import Status
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.problem import Failure, Problem, counted, distinct, note
from damperfit.statistics import NORMAL_95
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.damper.model import Quantity
    from damperfit.errors import OnError
    from damperfit.results import Run
    from damperfit.tested.setting import Setting

    Readings = dict[Topic, Reading]

_EACH, _CONSTANT = "the motion of each test", "constant speed"
_KINDS = ("measured", "force", "parameter", "figure")
_FEW_REPEATS = 3  # fewer show little of a scatter
_OBJECTIONS = {
    Status.AT_BOUND.value: "it is at a bound of its range",
    Status.NOT_IDENTIFIABLE.value: "the logs do not determine it",
    Status.ABSENT.value: "the model is fitted without it there",
}
_ONCE = {Status.SHARED.value, Status.FIXED.value, Status.NOT_IDENTIFIABLE.value}


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
            (measured, "measured forces and energies (% of A's as logged)"),
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
    is_other_gas = not is_bare and len(set(map(gas_force, runs))) > 1
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
        {digest for digest, log in inputs_of(run) if log["setting"] == setting.cell} for run in runs
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
        if not dict(inputs_of(runs[0])).keys().isdisjoint(dict(inputs_of(runs[-1]))):
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
