"""Runs compared: what was measured first, then forces, parameters, energy and hysteresis.

At a setting where a model misses the measured force of any run by more than it may, the measured
forces of all are compared, at every speed: a model that misses one is not asked for the next, and a
difference must be of one kind. Where every run knows the offset of its rig, which is tared before
each test, forces are without it. Beside the numbers stands what the runs differ in besides, which
may be the reason.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import StringIO
from itertools import product
from pathlib import Path
from statistics import fmean, median, stdev
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.adjustment.force_at import (
    REPEATS,
    STROKES,
    Sine,
    force_at,
    named_speeds,
    said_offsets,
)
from damperfit.comparison.measured import (
    SAME_MOTION,
    Difference,
    Reading,
    Sameness,
    Topic,
    compared,
    measured_readings,
    outcome_of,
    repeat_scatter,
    surely_different,
    tests_at,
    zero_shift,
)
from damperfit.damper.quantity import Quantity
from damperfit.errors import ConfigurationError, failure_of
from damperfit.identification import Status
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.io.files import read_text
from damperfit.problem import Failure, Option
from damperfit.statistics import NORMAL_95
from damperfit.tables.columns import SCHEMA_VERSION
from damperfit.tested.setting import Setting
from damperfit.units.quantities import parse_quantity
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from damperfit.errors import OnError
    from damperfit.results import Run

    Readings = dict[Topic, Reading]
    Shift = tuple[float, float]

_EACH, _CONSTANT = "the motion of each test", "constant speed"
_KINDS = ("measured", "force", "parameter", "figure")
_FEW_REPEATS = 3  # fewer tell little of a scatter
_OBJECTIONS = {
    Status.AT_BOUND.value: "it is at a bound of its range",
    Status.NOT_IDENTIFIABLE.value: "the logs do not determine it",
    Status.ABSENT.value: "the law is fitted without it there",
}
_ONCE = {Status.SHARED.value, Status.FIXED.value, Status.NOT_IDENTIFIABLE.value}


@dataclass(frozen=True, slots=True)
class ComparisonOptions:
    """What is compared."""

    # Whose peak speed the named test speeds go up to; None: the slower test's.
    sine: Sine | None = None
    speeds: tuple[float, ...] = ()  # m/s, positive; none: the named test speeds
    is_measured: bool = False  # measured curves alone, without a model
    jobs: int = 1  # threads
    units: ShownUnits = SI  # in which forces and speeds are told in words; every number stays SI
    # What runs are called whose folders mean nothing to a reader.
    names: Mapping[Path, str] = field(default_factory=dict)


class Circumstance(NamedTuple):
    """One thing that two runs differ in, or have in common, with the value of each."""

    kind: str  # logs, identity, settings, model, damper, gas, motion, temperature, rig, filter, ...
    first: str
    second: str
    sentence: str


@dataclass(frozen=True, slots=True, eq=False)
class RunComparison:
    """Two runs beside each other."""

    first: Run  # the reference
    second: Run
    repeats: tuple[Run, ...]  # of the reference: their scatter, not the errors, is the measure
    circumstances: tuple[Circumstance, ...]  # what they differ in besides
    settings: tuple[Setting, ...]  # that both have
    motion: str  # at which forces are compared, for people
    lines: tuple[Difference, ...]  # measured forces, forces, parameters, figures
    identical: tuple[Setting, ...] = ()  # at which both have the same logs, byte for byte
    notes: tuple[str, ...] = ()  # what a reader must know; nothing is missing
    remarks: tuple[str, ...] = ()  # what could not be compared
    traces: tuple[str, ...] = ()  # where internal errors happened
    units: ShownUnits = SI  # in which people want it told

    def of(self, kind: str) -> tuple[Difference, ...]:
        """Return the lines of a kind: "measured", "force", "parameter" or "figure"."""
        return tuple(line for line in self.lines if line.subject.kind == kind)

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
    def is_without_model(self) -> bool:
        """Whether measured curves alone are compared."""
        return self.motion == _EACH

    @property
    def forces_title(self) -> str:
        """What forces are compared, as in "Forces as measured at the motion of each test"."""
        forces = self.of("force")
        is_measured = bool(forces) and all(line.is_measured for line in forces)
        motion = self.units.say_lengths(self.motion)
        return f"Forces {'as measured ' if is_measured else ''}at {motion}"

    @property
    def differing(self) -> tuple[str, ...]:
        """Sentences of what else differs, which may be the reason."""
        return tuple(one.sentence for one in self.circumstances if one.kind != "logs")

    @property
    def to_know(self) -> tuple[str, ...]:
        """Sentences of what both have in common, and the notes."""
        alike = tuple(one.sentence for one in self.circumstances if one.kind == "logs")
        return (*alike, *self.notes)


def compare_runs(  # noqa: C901, PLR0912, PLR0915 - one step after the other
    first: Run,
    second: Run,
    options: ComparisonOptions = ComparisonOptions(),
    *,
    repeats: Sequence[Run] = (),
) -> RunComparison:
    """Return a run beside the reference; of `repeats`, its further runs, scatter is the measure.

    A ConfigurationError tells that they have no setting in common, or no motion reaches the speeds
    that were asked for.
    """
    runs = (first, *repeats, second)
    is_bare = options.is_measured or not all(run.settings for run in runs)
    known = [settings_of(run, is_bare=is_bare) for run in runs]
    settings = tuple(setting for setting in known[0] if all(setting in own for own in known))
    if not settings:
        pairs = list(zip(runs, known, strict=True))[:3]
        listed = "; ".join(f"{r.shown_as} has {of_settings(s) if s else 'none'}" for r, s in pairs)
        raise ConfigurationError(f"no setting is common to all: {listed}", code="nothing-in-common")
    failure_log: list[Failure] = []

    def take(setting: Setting, error: Exception) -> None:
        failure_log.append(failure_of(error, f"simulating setting {setting}"))

    # Where the gas is declared, and not alike, it is known what shifts the forces.
    is_other_gas = not is_bare and len(set(map(_gas_force, runs))) > 1
    shifts = [(0.0, 0.0) if is_other_gas else zero_shift(first, run, settings) for run in runs]
    forces: tuple[Readings, ...] = tuple({} for _ in runs)
    parameters, bare, is_same_motion = forces, set(), True
    if is_bare:
        measured = measured_readings(runs, settings, speeds=options.speeds)
    else:
        measured = measured_readings(runs, settings, kind="measured")
        top = min(run.motion.peak_speed for run in runs)
        top = top if options.sine is None else options.sine.peak_speed
        # The named ones that the sine or all tests have reached.
        speeds = options.speeds or named_speeds(top)
        if not speeds:
            raise ConfigurationError(
                f"none is reached by {top:.3g} m/s; give {{velocity}}",
                velocity=Option("velocity"),
                subject="the named test speeds",
                code="no-speed",
            )
        forces = force_readings(runs, settings, speeds=speeds, on_error=take)
        parameters = parameter_readings(runs, settings)
        bare = known_tares(runs, settings)
        motions = [(run.motion.amplitude, run.motion.frequency) for run in runs]
        is_same_motion = all(  # what each model misses there was measured
            abs(one / own - 1.0) <= SAME_MOTION
            for motion in motions
            for one, own in zip(motion, motions[0], strict=True)
        )
    tables: list[Readings] = []
    for tests, models, values, (shift, its_error) in zip(
        measured, forces, parameters, shifts, strict=True
    ):
        tables.append(table := tests | models | values)
        for topic, one in table.items():
            if topic.speed is None or (topic.kind == "force" and topic.setting in bare):
                continue
            size, error = shift, its_error
            if size and not one.is_measured:
                # A model without an offset took up between none of a zero shift and all.
                size, error = 0.5 * size, math.hypot(0.5 * error, size / math.sqrt(12.0))
            repeat = math.hypot(one.repeat, error)
            table[topic] = replace(one, value=one.value - size, repeat=repeat)
    if not any(tables[0]):
        raise ConfigurationError(
            f"{first.shown_as} and {second.shown_as}: nothing can be compared at setting "
            f"{listed_settings(settings)}: no motion is common to both",
            code="nothing-in-common",
        )
    hashes = {
        setting: [
            {digest for digest, log in _inputs(run) if log["setting"] == setting.cell}
            for run in runs
        ]
        for setting in settings
    }
    identical = tuple(one for one, (a, *more) in hashes.items() if a and all(b == a for b in more))
    lines: list[Difference] = []
    *references, other = tables
    for kind in _KINDS:  # what is asked of the forces and of the parameters are two questions
        group = []
        for topic, reading in other.items():
            mine = [table[topic] for table in references if topic in table]
            if topic.kind != kind or len(mine) < len(references):
                continue
            if repeats:
                line = compared(topic, _mean(topic, mine), _bare(reading))
            else:
                line = compared(topic, mine[0], reading, is_same_motion=is_same_motion)
            group.append(line)
        lines += surely_different(group)
    lines = [
        # What was measured of the same logs is the same, whatever a filter has made of it.
        replace(line, verdict=Sameness.SAME, is_sure=False, words="identical: the same logs")
        if line.is_measured and line.subject.setting in identical
        else line
        for line in lines
    ]
    if not is_bare:
        lines += figure_lines(first, second, settings)
    return RunComparison(
        *(first, second, tuple(repeats)),
        circumstances(first, second, options.units, is_bare=is_bare),
        settings,
        _EACH if is_bare else _CONSTANT,
        tuple(lines),
        identical,
        tuple(_notes(runs, settings, forces, lines, shifts, options.units, is_bare=is_bare)),
        tuple(dict.fromkeys(one.message for one in failure_log)),
        tuple(one.trace for one in failure_log if one.trace),
        options.units,
    )


def settings_of(run: Run, *, is_bare: bool) -> tuple[Setting, ...]:
    """Return the settings that were measured, or those that have parameters."""
    if is_bare:
        return tuple(sorted({test.setting for test in run.tests}))
    return tuple(stage.setting for stage in run.settings)


def _mean(topic: Topic, readings: Sequence[Reading]) -> Reading:
    """Return the mean of repeats of the reference, with their scatter as its error.

    A damper taken off the rig and put on again differs by more than its cycles do. With n runs of
    the reference, itself among them, a further one falls within t s sqrt(1 + 1/n) of their mean in
    95 of 100, where s is their standard deviation and t has n - 1 degrees of freedom.
    """
    values, n = [one.value for one in readings], len(readings)
    objection = next((one.objection for one in readings if one.objection), "")
    if not all(map(math.isfinite, values)):
        return replace(readings[0], value=math.nan, objection=objection)
    mean, error = fmean(values), stdev(values)
    if topic.is_logarithmic and min(values) > 0.0:
        logs = [math.log(value) for value in values]
        mean = math.exp(fmean(logs))
        error = mean * stdev(logs)
    return replace(
        _bare(readings[0]),
        value=mean,
        error=error * math.sqrt(1.0 + 1.0 / n),
        freedom=float(n - 1),
        scale=fmean(one.scale for one in readings),
        objection=objection,
    )


def _bare(reading: Reading) -> Reading:
    """Return a reading without errors: the scatter of repeats is the measure."""
    return replace(reading, error=0.0, repeat=0.0, misfit=0.0, misses=math.nan)


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
        at_place = {(one.setting, one.speed, one.stroke): one for one in forces}
        tables.append({k: one if k[0] in bare else one.with_tare for k, one in at_place.items()})
    order = product(settings, speeds, STROKES)
    common = [key for key in order if all(key in table for table in tables)]
    doubted = {key[0] for key in common if any(table[key].disagrees for table in tables)}
    readings: tuple[Readings, ...] = tuple({} for _ in runs)
    for run, table, mine in zip(runs, tables, readings, strict=True):
        share, repeat_freedom = repeat_scatter(run)
        for key in common:
            force = table[key]
            if key[0] in doubted and all(other[key].measured is not None for other in tables):
                force = force.as_read
            n_logs = run.row(force.setting).get("n_logs") or 1
            mine[Topic("force", "force", "force", "N", *key)] = Reading(
                force.force,
                force.error,
                freedom_of(run, force.setting),
                repeat=share * abs(force.damping) / math.sqrt(n_logs),
                repeat_freedom=repeat_freedom,
                misfit=force.misfit,
                misses=force.difference,
                misses_error=force.measured_error,
                disagrees=force.disagrees,
                scale=force.damping,
                is_measured=force.is_measured,
            )
    return readings


def known_tares(runs: Sequence[Run], settings: Sequence[Setting]) -> set[Setting]:
    """Return the settings at which all of several runs know the offset of their rig."""
    if len(runs) < 2 or not all(map(_knows_gas, runs)):
        return set()
    known = [{stage.setting for stage in run.settings if stage.knows_offset} for run in runs]
    return set(settings).intersection(*known)


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
    units = [{one.name: one.unit for one in run.quantities} for run in runs[1:]]
    return tuple(
        one for one in runs[0].quantities if all(known.get(one.name) == one.unit for known in units)
    )


def parameter_readings(runs: Sequence[Run], settings: Sequence[Setting]) -> tuple[Readings, ...]:
    """Return the parameters of each run that was fitted in at least one of them.

    What all settings share is one number, and stands once.
    """
    tables: tuple[Readings, ...] = tuple({} for _ in runs)
    for quantity in comparable_quantities(runs):
        name, status = quantity.name, f"{quantity.name}_status"
        by_run = [[run.row(setting) for setting in settings] for run in runs]
        is_shared = all(
            len({row.get(name) for row in rows}) == 1 and {row.get(status) for row in rows} <= _ONCE
            for rows in by_run
        )
        for k, setting in enumerate(settings[:1] if is_shared else settings):
            rows = [rows[k] for rows in by_run]
            if all(row.get(status) == Status.FIXED.value for row in rows):
                continue
            topic = Topic(
                *("parameter", name, quantity.symbol, quantity.unit),
                setting=None if is_shared else setting,
                is_logarithmic=quantity.is_logarithmic,
            )
            for table, run, row in zip(tables, runs, rows, strict=True):
                if row.get(name) is None:
                    table[topic] = Reading(math.nan, objection="it has no value")
                    continue
                is_fixed = row.get(status) == Status.FIXED.value
                counted = settings if is_shared else (setting,)
                table[topic] = Reading(
                    float(row[name]),
                    0.0 if is_fixed else _number(row.get(f"{name}_se")),
                    sum(freedom_of(run, one) for one in counted),
                    misfit=float(row.get(f"{name}_misfit_se") or 0.0),
                    scale=math.nan if quantity.is_logarithmic else quantity.size,
                    objection=_OBJECTIONS.get(str(row.get(status)), ""),
                )
    return tables


def figure_lines(first: Run, second: Run, settings: Sequence[Setting]) -> Iterator[Difference]:
    """Yield MSE and distance from cavitation by setting: numbers without errors, told in words."""
    for setting in settings:
        rows = (first.row(setting), second.row(setting))
        figures = [
            (
                Topic("figure", "mse", "MSE", "%", setting),
                [_number(row.get("mse_percent")) for row in rows],
                [str(row.get("grade") or "no grade") for row in rows],
            )
        ]
        margins = [100.0 * _number(row.get("r_m3_cavitation_margin")) for row in rows]
        is_empty = [bool(row.get("cavitation_fraction")) for row in rows]
        if any(map(math.isfinite, margins)) or any(is_empty):
            topic = Topic("figure", "cavitation_margin", "R_m3 below cavitation", "%", setting)
            figures.append((topic, margins, ["cavitates" if one else "full" for one in is_empty]))
        for topic, values, (a, b) in figures:
            verdict, words = Sameness.DIFFERENT, f"{a}, now {b}"
            if a == b:
                verdict, words = Sameness.SAME, f"both {a}"
            a_value, b_value = map(Reading, values)
            yield Difference(topic, a_value, b_value, verdict=verdict, words=words)


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)


# What a reader must know


def _notes(  # noqa: C901, PLR0912, PLR0913 - all that was compared, one thing after the other
    runs: Sequence[Run],
    settings: Sequence[Setting],
    tables: Sequence[Readings],
    lines: Sequence[Difference],
    shifts: Sequence[Shift],
    units: ShownUnits,
    *,
    is_bare: bool,
) -> Iterator[str]:
    if 0 < (n := len(runs) - 2) < _FEW_REPEATS:
        yield (
            f"the scatter of A is that of {n + 1} runs, {n} degree{'s' * (n > 1)} of freedom: "
            f"intervals are {'six times' if n == 1 else 'twice'} as wide as those of many would be"
        )
    forces = [line for line in lines if line.subject.kind == "force"]
    at = [one for one in settings if one in {line.subject.setting for line in forces}]
    if lost := [setting for setting in settings if forces and setting not in at]:
        yield f"{of_settings(lost)}: no motion is common to both: not compared"
    top = min((stage.top_speed for run in runs for stage in run.settings), default=math.inf)
    speeds = {line.subject.speed or 0.0 for line in lines if not line.is_measured}
    beyond = sorted(speed for speed in speeds if speed > (1.0 + REPEATS) * top)
    if beyond and not is_bare:
        listed = ", ".join(units.write_speed(speed) for speed in beyond)
        yield (
            f"{listed} was never tested (tested: up to {units.write_speed(float(f'{top:.3g}'))}): "
            "the forces there are the models', extrapolated"
        )
    for run, (shift, error) in zip(runs, shifts, strict=True):
        if shift:
            of_models = (
                "; of those of a model that was fitted without an offset half of it, give or take "
                "half. Its parameters hold the rest: free f_0 in both runs to compare them"
            )
            yield (
                f"{run.name}: its measured forces lie {units.write(shift, 'N', '+.3g')} (± "
                f"{units.write(NORMAL_95 * error, 'N', '.2g')}) from those of {runs[0].name} in "
                "both strokes and at all speeds, as another tare or gas pressure makes them: so "
                f"much is taken off{'' if is_bare else of_models}"
            )
    for run in runs:
        notes = run.record.get("notes", ()) if is_bare else run.notes
        yield from (f"{run.name}: {note}" for note in notes)
        share, freedom = repeat_scatter(run)
        if share:
            yield (
                f"{run.name}: tests of one setting differ by {100.0 * share:.2g} % of the damping "
                f"beyond their noise ({freedom:.0f} degrees of freedom): counted in the errors of "
                "forces, energy and hysteresis, not in those of parameters"
            )
        if not is_bare and not run.speed_forces:
            yield (
                f"{run.name}: the lack of fit to the measured force is not known (an older "
                "version, or no motion repeats): it is not in the errors of forces"
            )
    if is_bare or not forces:
        return
    # Why forces of fitted runs are compared as measured.
    if measured := dict.fromkeys(line.subject.setting for line in forces if line.is_measured):
        for run, table in zip(runs, tables, strict=True):
            if missed := {topic: one for topic, one in table.items() if one.disagrees}:
                topic, worst = max(missed.items(), key=lambda item: abs(item[1].misses))
                miss, where = abs(worst.misses), dict.fromkeys(one.setting for one in missed)
                of_it = f" ({miss / abs(worst.scale):.1%} of the damping)" if worst.scale else ""
                yield (
                    f"{run.name}: its model ({run.damper.name}) misses the measured force at "
                    f"{of_settings(filter(None, where))}, most {topic.place(units)}: "
                    f"by {units.write(miss, 'N', '.3g')}{of_it}"
                )
        why = "they show how the tests differ and say nothing about the models"
        if not dict(_inputs(runs[0])).keys().isdisjoint(dict(_inputs(runs[-1]))):
            why = "both are based on the same logs, so this says nothing about the models"
        where_measured = of_settings(filter(None, measured))
        yield f"at {where_measured} the measured forces of both are compared: {why}"
    # What became of the rigs' force offsets.
    bare = known_tares(runs, at)
    known = [[one.offset for one in run.settings if one.setting in bare] for run in runs]
    if any(map(any, known)):
        pairs = zip(runs, known, strict=True)
        each = "; ".join(f"{run.name}: {said_offsets(mine)}" for run, mine in pairs)
        yield f"the rigs' force offsets, their tares, are left out of the forces ({each})"
    for run in () if any(shift for shift, _ in shifts) else runs:
        left = [one for one in run.settings if one.setting in at and one.setting not in bare]
        if (rest := [one.offset for one in left if one.offset]) and _knows_gas(run):
            yield (
                f"{run.name}: its force offset ({said_offsets(rest)}), the rig's tare, is in its "
                "forces, for not every run has a known one: so much of a difference may be the tare"
            )
    if not comparable_quantities(runs):
        yield "fitted with different models: no parameter is common to both"


# What two runs differ in besides their numbers

_SAME = 1e-9  # 4.6bara and 460000 are one pressure, but for the last digit
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


def circumstances(  # noqa: C901, PLR0912, PLR0915 - one thing after the other
    first: Run, second: Run, units: ShownUnits = SI, *, is_bare: bool = False
) -> tuple[Circumstance, ...]:
    """Return what two runs differ in, what matters most first; is_bare: measured curves alone."""
    runs = (first, second)
    differences = [*_of_logs(first, second)]

    def differs(kind: str, what: str, a: object, b: object, more: str = "") -> None:
        sentence = f"{what}: {a}, then {b}{more}"
        differences.append(Circumstance(kind, str(a), str(b), sentence))

    for key in _WHOSE:
        a, b = (run.identity.get(key) for run in runs)
        if a and b and a != b:
            differs("identity", key, a, b)
    known = [settings_of(run, is_bare=is_bare) for run in runs]
    alone = [[one for one in known[k] if one not in known[1 - k]] for k in (0, 1)]
    for run, own in zip(runs, alone, strict=True):
        if own:
            sentence = f"{of_settings(own)} only in {run.name}: not compared"
            a, b = map(listed_settings, alone)
            differences.append(Circumstance("settings", a, b, sentence))
    # Of measured curves the damper need not be known.
    models = [] if is_bare else [run.damper for run in runs]
    if models and models[0].name != models[1].name:
        more = ": only forces are compared, not parameters"
        differs("model", "model", models[0].name, models[1].name, more)
    elif models:
        names = [", ".join(model.names) for model in models]
        if names[0] != names[1]:
            sentence = "the models have different quantities: those with the same name are compared"
            differences.append(Circumstance("model", names[0], names[1], sentence))
        units_of = {one.name: one.unit for one in second.quantities}
        for one in first.quantities:
            if one.unit != (unit := units_of.get(one.name, one.unit)):
                differs("model", f"unit of {one.name}", one.unit, unit, ": it is not compared")
        for name, (_, _, unit) in models[0].ranges.items():
            sizes: list[Any] = [getattr(model, name, None) for model in models]
            is_known = all(isinstance(size, float) for size in sizes)
            if is_known and not math.isclose(*sizes, rel_tol=_SAME):
                kind = "gas" if name.startswith("gas_") else "damper"
                differs(kind, f"damper.{name}", *(f"{one:.6g} {unit}".strip() for one in sizes))
        forces = [_gas_force(run) for run in runs]
        if math.isfinite(sum(forces)) and not math.isclose(*forces, rel_tol=_SAME):
            form = ".1f" if units.of("N") == "N" else ".3g"
            apart = units.write(forces[1] - forces[0], "N", f"+{form}")
            more = f": {apart} of every difference of force is the declared gas"
            gas, other = (units.write(force, "N", form) for force in forces)
            differs("gas", "gas force at mid-stroke", gas, other, more)
    common = [setting for setting in known[0] if setting in known[1]]
    motions = [
        [(one.amplitude, one.frequency) for setting in common for one in tests_at(run, setting)[:1]]
        for run in runs
    ]
    if not all(motions) and not is_bare:
        motions = [[(run.motion.amplitude, run.motion.frequency)] for run in runs]
    if all(motions):
        middle = [tuple(median(one[k] for one in own) for k in (0, 1)) for own in motions]
        (size, rate), (other_size, faster) = middle
        if max(abs(other_size / size - 1.0), abs(faster / rate - 1.0)) > SAME_MOTION:
            here, there = (
                units.say_lengths(f"{1e3 * amplitude:.4g} mm at {frequency:.4g} Hz")
                for amplitude, frequency in middle
            )
            differs("motion", "motion", here, there, ": what a model misses does not cancel")
    heat = [[t.temperature for t in run.tests if math.isfinite(t.temperature)] for run in runs]
    if all(heat) and abs(fmean(heat[0]) - fmean(heat[1])) > _TEMPERATURES_DIFFER:
        differs("temperature", "temperature", *(f"{fmean(one):.1f} degC" for one in heat))

    def listed(value: object) -> str:
        if isinstance(value, dict):
            value = [f"{key} = {one}" for key, one in value.items()]
        return (", ".join(map(str, value)) or "none") if isinstance(value, list) else str(value)

    for (section, key), (kind, words) in _HOW.items():
        values: list[Any] = []
        for run in runs:
            document = run.record.get("configuration")
            own_keys = document.get(section) if isinstance(document, dict) else None
            values.append(own_keys.get(key) if isinstance(own_keys, dict) else None)
        if None not in values and values[0] != values[1]:
            differs(kind, words, *map(listed, values))
    for key, words in (("version", "damperfit"), ("schema_version", "schema of the results")):
        values = [run.record.get(key) for run in runs]
        if None not in values and values[0] != values[1]:
            old = min((one for one in values if isinstance(one, int)), default=SCHEMA_VERSION)
            is_older = key == "schema_version" and old < SCHEMA_VERSION
            more = "; what the older run lacks is not compared" if is_older else ""
            differs("version", words, values[0], values[1], more)
    return tuple(differences)


def _inputs(run: Run) -> list[tuple[str, dict[str, Any]]]:
    """Return the hash of each log that a run is based on, and the log as its record has it."""
    inputs = run.record.get("inputs")
    return [
        (str(log["sha256"]), log)
        for log in (inputs if isinstance(inputs, list) else ())
        if isinstance(log, dict) and log.get("sha256") and log.get("setting") is not None
    ]


def _of_logs(first: Run, second: Run) -> Iterator[Circumstance]:
    """Yield that logs are in both, and which of these were read with other signs."""

    def first_names(logs: Sequence[Mapping[str, Any]]) -> str:
        names = sorted(str(log.get("log")) for log in logs)
        return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")

    known = [dict(_inputs(run)) for run in (first, second)]
    common = known[0].keys() & known[1].keys()
    if not common:
        return
    yield Circumstance(
        "logs",
        first.name,
        second.name,
        f"both are based on the same logs ({first_names([known[0][one] for one in common])}): "
        "differences come from the evaluation only, and the errors, which assume two tests, are "
        "too large",
    )
    turned: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for one in common:
        signs = [logs[one].get("reversed") for logs in known]
        if all(isinstance(channels, list) for channels in signs) and signs[0] != signs[1]:
            a, b = (" and ".join(map(str, channels or ())) or "nothing" for channels in signs)
            turned.setdefault((a, b), []).append(known[0][one])
    for (a, b), logs in sorted(turned.items()):
        is_stroke = ("displacement" in a) is not ("displacement" in b)
        words = ("rebound", "bump") if is_stroke else ("positive", "negative")
        yield Circumstance(
            "rig",
            a,
            b,
            f"reversed, as positive in compression: {a} in {first.name}, {b} in {second.name} "
            f"({first_names(logs)}): what is {words[0]} in one is {words[1]} in the other; "
            "declare rig.reverse_displacement and rig.reverse_force",
        )


def _gas_force(run: Run) -> float:
    """Return the force of the declared gas at mid-stroke, N, to nine digits; NaN: none is known."""
    force = run.damper.rest_force(0.0)
    return math.nan if force is None else float(f"{float(force):.9g}")


# Forces held against bands: around those of the reference, or nominal ones

_UNIT = re.compile(r"(_n|_m_per_s|_m/s)$")  # of a column's name, in lower case
_PER_CENT = re.compile(r"\s*([0-9.]+(?:[eE][-+]?\d+)?)\s*%\s*")


class Band(NamedTuple):
    """Where a force may lie, N, positive in rebound."""

    setting: str  # its label; empty: every one
    speed: float  # m/s, positive
    stroke: str
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far forces may be from those of the reference, or which bands they must keep."""

    source: str  # as it was given, for people
    share: float = 0.0  # of the reference's damping,
    newtons: float = 0.0  # and N; the larger of the two counts
    bands: tuple[Band, ...] = ()  # nominal forces in place of a reference's


@dataclass(frozen=True, slots=True)
class Point:
    """A force held against its band, N, positive in rebound."""

    run: str  # whose
    setting: Setting | str
    speed: float  # m/s; NaN where a whole setting is missing
    stroke: str
    force: float  # NaN where it is not known
    low: float
    high: float
    reach: float = math.nan  # half of the 95 % interval of the force; NaN: not known
    reason: str = ""  # why it could not be looked at
    is_measured: bool = False
    units: ShownUnits = SI  # in which people want it told

    @property
    def margin(self) -> float:
        """How far inside the band, N; negative: outside."""
        return min(self.force - self.low, self.high - self.force)

    @property
    def is_met(self) -> bool:
        """Whether the force is inside; one that could not be looked at is not."""
        return self.margin >= 0.0

    @property
    def words(self) -> str:
        """The result in words."""
        if math.isnan(self.margin):
            return f"not evaluated: {self.reason}"
        near = ", no further than its error" if abs(self.margin) <= self.reach else ""
        mark = " (measured)" if self.is_measured else ""
        side, where = ("passes", "inside") if self.is_met else ("FAILS", "outside")
        return f"{side}, {self.units.write(abs(self.margin), 'N', '.3g')} {where}{near}{mark}"


def _refused(given: str | Path, why: str) -> ConfigurationError:
    return ConfigurationError(why, where=Option("tolerance", given), code="bad-tolerance")


def parse_tolerance(text: str) -> Tolerance:
    """Return a tolerance from text: per cent of the damping, newtons, or both.

    Examples
    --------
    >>> parse_tolerance("5%, 10N")
    Tolerance(source='5%, 10N', share=0.05, newtons=10.0, bands=())
    """
    share = newtons = 0.0
    for part in text.split(","):
        if per_cent := _PER_CENT.fullmatch(part):
            share = float(per_cent[1]) / 100.0
            continue
        try:
            newtons = parse_quantity(part.strip(), "force")
        except ConfigurationError as error:
            why = (
                "expected per cent, newtons, both as in 5%,10N, or the name of a file with "
                "nominal forces"
            )
            raise _refused(text, why) from error
    if not (share > 0.0 or newtons > 0.0) or newtons < 0.0:
        raise _refused(text, "expected a tolerance above zero")
    return Tolerance(text, share, newtons)


def parse_bands(text: str | None) -> Tolerance | None:
    """Return the tolerance that the text of a command line means: a file, or per cent and newtons.

    A file is CSV with the columns speed, stroke, and force with tolerance (5% or 20N), or low and
    high; setting may be missing or empty, the row is then of every setting. Makers write bump as
    positive numbers: such a force is taken as negative.
    """
    if text is None:
        return None
    path = Path(text)
    # "2.5%" has a suffix too, as pathlib sees it.
    if not (path.is_file() or path.suffix[1:2].isalpha()):
        return parse_tolerance(text)
    try:
        lines = StringIO(read_text(path), newline="")
    except (OSError, UnicodeDecodeError) as error:
        why = f"cannot be read: {getattr(error, 'strerror', None) or error}"
        raise _refused(path, why) from error
    reader = csv.DictReader(line for line in lines if line.strip() and not line.startswith("#"))
    names = {_UNIT.sub("", (name or "").strip().lower()): name for name in reader.fieldnames or ()}
    has_band = {"force", "tolerance"} <= names.keys() or {"low", "high"} <= names.keys()
    if not {"speed", "stroke"} <= names.keys() or not has_band:
        why = "expected the columns speed, stroke, and force with tolerance, or low and high; found"
        raise _refused(path, f"{why} {', '.join(reader.fieldnames or ()) or 'nothing'}")
    bands = []
    for number, row in enumerate(reader, start=2):
        try:
            bands.append(_band({key: (row.get(name) or "").strip() for key, name in names.items()}))
        except (ConfigurationError, ValueError) as error:
            raise _refused(path, f"row {number}: {error}") from error
    if not bands:
        raise _refused(path, "no row below the headings")
    return Tolerance(str(path), bands=tuple(bands))


def _band(cells: Mapping[str, str]) -> Band:
    stroke = cells["stroke"].lower()
    if stroke not in STROKES:
        raise ValueError(f"stroke {cells['stroke']!r}: expected {' or '.join(STROKES)}")
    speed = abs(parse_quantity(cells["speed"], "velocity"))
    if speed == 0.0:
        raise ValueError("speed 0: expected a speed above zero")
    if cells.get("low") and cells.get("high"):
        low, high = (parse_quantity(cells[name], "force") for name in ("low", "high"))
    else:
        force = parse_quantity(cells.get("force", ""), "force")
        may = parse_tolerance(cells.get("tolerance", ""))
        reach = max(may.share * abs(force), may.newtons)
        low, high = force - reach, force + reach
    if stroke == "bump" and low + high > 0.0:
        low, high = -high, -low
    if low > high:
        raise ValueError(f"low {low:g} N is above high {high:g} N")
    return Band(cells.get("setting", ""), speed, stroke, low, high)


def tolerated(comparison: RunComparison, tolerance: Tolerance) -> tuple[Point, ...]:
    """Return the forces of a run held against those of the reference.

    A setting of the reference that the run does not have could not be looked at.
    """
    name, units = comparison.second.name, comparison.units
    points = []
    for line in comparison.of("force"):
        first, topic = line.first, line.subject
        size = first.scale if first.scale and math.isfinite(first.scale) else first.value
        reach = max(tolerance.share * abs(size), tolerance.newtons)
        points.append(
            Point(
                *(name, topic.setting or "", topic.speed or math.nan, topic.stroke),
                *(line.second.value, first.value - reach, first.value + reach),
                line.high - line.difference,
                *(line.reason, line.is_measured, units),
            )
        )
    nowhere = (math.nan, "", math.nan, math.nan, math.nan)  # speed, stroke, force and band
    points += [
        Point(name, setting, *nowhere, reason="not tested", units=units)
        for setting in settings_of(comparison.first, is_bare=comparison.is_without_model)
        if setting not in comparison.settings
    ]
    return tuple(points)


def bands_met(run: Run, tolerance: Tolerance, options: ComparisonOptions) -> tuple[Point, ...]:
    """Return the forces of a run held against nominal bands."""
    is_bare = options.is_measured or not run.settings
    settings = settings_of(run, is_bare=is_bare)
    speeds = sorted({band.speed for band in tolerance.bands})
    if is_bare:
        (table,) = measured_readings((run,), settings, speeds=speeds)
    else:
        top = (options.sine or run.motion).peak_speed
        reached = [speed for speed in speeds if speed <= (1.0 + REPEATS) * top]
        (table,) = force_readings((run,), settings, speeds=reached) if reached else ({},)
    known: dict[Any, Reading] = {(t.setting, t.speed, t.stroke): one for t, one in table.items()}
    points = []
    for band in tolerance.bands:
        mine: list[Any] = [one for one in settings if band.setting in {"", str(one)}]
        why = "the test does not reach the speed" if mine else "the setting was not tested"
        for setting in mine or [band.setting]:
            reading = known.get((setting, band.speed, band.stroke))
            if reading is None or math.isnan(reading.value):
                reading = Reading(math.nan, objection=why)
            points.append(
                Point(
                    *(run.name, setting, band.speed, band.stroke),
                    *(reading.value, band.low, band.high, reading.half_interval),
                    *(reading.objection, reading.is_measured, options.units),
                )
            )
    return tuple(points)
