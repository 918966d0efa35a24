"""Runs compared: forces, parameters, energy and hysteresis, and the whole story of two of them.

What was measured is compared first. At a setting where a model misses the measured force of any
run by more than it may, the measured forces of all are compared, at every speed: a model that
misses one is not asked for the next, and a difference must be of one kind. Where every run knows
the offset of its rig, which is tared before each test, forces are without it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from statistics import fmean, stdev
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtri

from damperfit.adjustment.force_at import (
    REPEATS,
    STROKES,
    force_at,
    named_speeds,
    said_offsets,
)
from damperfit.comparison.circumstances import (
    Circumstance,
    circumstances,
    have_common_logs,
    identical_settings,
)
from damperfit.comparison.reading import (
    Difference,
    Reading,
    Sameness,
    Topic,
    compared,
    outcome_of,
    place_of,
    surely_different,
)
from damperfit.comparison.runs import SAME_MOTION, MeasuredTest, same_motion
from damperfit.errors import ConfigurationError, mishap_of
from damperfit.identification import Status
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.problem import Option
from damperfit.simulation import NAMED_SPEEDS
from damperfit.units.shown_units import SI

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from damperfit.adjustment.force_at import Force, Sine
    from damperfit.comparison.runs import ComparedRun
    from damperfit.damper.quantity import Quantity
    from damperfit.errors import OnError
    from damperfit.problem import Failure
    from damperfit.results import Run
    from damperfit.tested.setting import Setting
    from damperfit.units.shown_units import ShownUnits

__all__ = [
    "ComparisonOptions",
    "RunComparison",
    "common_tests",
    "compare_runs",
    "force_readings",
    "measured_readings",
    "repeat_scatter",
]

_EACH, _CONSTANT = "the motion of each test", "constant speed"
_FEW_REPEATS = 3  # fewer tell little of a scatter
_Tables = tuple[dict[Topic, Reading], ...]
_Group = tuple[MeasuredTest, ...]


@dataclass(frozen=True, slots=True)
class ComparisonOptions:
    """What is compared.

    Attributes
    ----------
    sine : Sine or None
        Whose peak speed the named test speeds go up to; None: the slower test's.
    speeds : tuple of float
        m/s, positive; none: the named test speeds.
    is_measured : bool
        Measured curves alone, without a model.
    jobs : int
        Threads.
    units : ShownUnits
        In which forces and speeds are told in words; every number stays SI.
    names : mapping of pathlib.Path to str
        What runs are called whose folders mean nothing to a reader.
    """

    sine: Sine | None = None
    speeds: tuple[float, ...] = ()
    is_measured: bool = False
    jobs: int = 1
    units: ShownUnits = SI
    names: Mapping[Path, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class RunComparison:
    """Two runs beside each other.

    Attributes
    ----------
    first, second : ComparedRun
        The reference and the other.
    repeats : tuple of ComparedRun
        Of the reference, whose scatter is the measure; empty: the errors of both are.
    circumstances : tuple of Circumstance
        What they differ in besides.
    settings : tuple of Setting
        That both have.
    motion : str
        At which forces are compared, for people.
    lines : tuple of Difference
        Measured forces, forces, parameters, figures.
    identical : tuple of Setting
        At which both have the same logs, byte for byte.
    notes : tuple of str
        What a reader must know; nothing is missing.
    remarks : tuple of str
        What could not be compared.
    traces : tuple of str
        Where internal errors happened.
    units : ShownUnits
        In which people want it told.
    """

    first: ComparedRun
    second: ComparedRun
    repeats: tuple[ComparedRun, ...]
    circumstances: tuple[Circumstance, ...]
    settings: tuple[Setting, ...]
    motion: str
    lines: tuple[Difference, ...]
    identical: tuple[Setting, ...] = ()
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    traces: tuple[str, ...] = ()
    units: ShownUnits = SI

    def of(self, kind: str) -> tuple[Difference, ...]:
        """Return the lines of a kind: "measured", "force", "parameter" or "figure"."""
        return tuple(line for line in self.lines if line.subject.kind == kind)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The outcome in words: what was measured first, then forces and parameters."""
        measured: tuple[Difference, ...] = self.of("measured")
        if measured:
            measured += tuple(one for one in self.of("figure") if one.is_measured)
        groups = [
            (measured, "measured forces and energies"),
            (self.of("force"), "forces"),
            (self.of("parameter"), "parameters"),
        ]
        told = []
        if self.identical and len(self.identical) == len(self.settings):
            told = ["measured: identical, both have the same logs, byte for byte"]
            groups = groups[1:]
        told += [outcome_of(lines, words, self.units) for lines, words in groups if lines]
        return tuple(told)

    @property
    def is_without_model(self) -> bool:
        """Whether measured curves alone are compared."""
        return self.motion == _EACH

    @property
    def forces_title(self) -> str:
        """What forces are compared, as in "forces as measured at the motion of each test"."""
        forces = self.of("force")
        is_measured = bool(forces) and all(line.is_measured for line in forces)
        motion = self.units.say_lengths(self.motion)
        return f"forces {'as measured ' if is_measured else ''}at {motion}"

    @property
    def differing(self) -> tuple[str, ...]:
        """Sentences of what else differs, which may be the reason."""
        return tuple(one.sentence for one in self.circumstances if not one.is_alike)

    @property
    def to_know(self) -> tuple[str, ...]:
        """Sentences of what both have in common, and the notes."""
        alike = tuple(one.sentence for one in self.circumstances if one.is_alike)
        return (*alike, *self.notes)


def compare_runs(
    first: ComparedRun,
    second: ComparedRun,
    options: ComparisonOptions = ComparisonOptions(),
    *,
    repeats: Sequence[ComparedRun] = (),
) -> RunComparison:
    """Return a run beside the reference.

    Parameters
    ----------
    first, second : ComparedRun
        The reference and the other.
    options : ComparisonOptions
        What is compared.
    repeats : sequence of ComparedRun
        Further runs of the reference: their scatter is then the measure.

    Raises
    ------
    ConfigurationError
        They have no setting in common, or no motion reaches the speeds that were asked for.
    """
    runs = (first, *repeats, second)
    settings = _common(runs)
    mishaps: list[Failure] = []

    def take(setting: Setting, error: Exception) -> None:
        mishaps.append(mishap_of(error, f"simulating setting {setting}"))

    fitted = [run.fitted for run in runs if run.fitted is not None]
    if options.is_measured or len(fitted) < len(runs):
        motion = _EACH
        forces = measured_readings(runs, settings, speeds=options.speeds)
        measured: _Tables = tuple({} for _ in runs)
        is_same = True
        parameters: _Tables = tuple({} for _ in runs)
        of_figures: Iterator[Difference] = iter(())
    else:
        motion = _CONSTANT
        speeds = _speeds(fitted, options)
        forces = force_readings(runs, settings, speeds=speeds, on_error=take)
        measured = measured_readings(runs, settings, kind="measured")
        parameters = _parameter_readings(fitted, settings)
        is_same = _is_one_test(fitted)
        of_figures = _figure_lines(fitted[0], fitted[-1], settings)
    figures = _figure_readings(runs, settings)
    merged: _Tables = tuple(
        {**a, **b, **c, **d}
        for a, b, c, d in zip(measured, forces, parameters, figures, strict=True)
    )
    if not any(merged[0]):
        raise ConfigurationError(
            f"{first.place} and {second.place}: nothing can be compared at setting "
            f"{listed_settings(settings)}: no motion is common to both"
        )
    identical = tuple(identical_settings(runs, settings))
    lines = tuple(_identical(one, identical) for one in _lines(merged, is_same_motion=is_same))
    return RunComparison(
        first,
        second,
        tuple(repeats),
        circumstances(first, second, options.units),
        settings,
        motion,
        (*lines, *of_figures),
        identical,
        notes=(
            *_on_repeats(repeats),
            *_not_compared(settings, lines),
            *_untested(fitted, lines, options.units),
            *_notes(runs, forces, lines, options.units),
        ),
        remarks=tuple(dict.fromkeys(one.message for one in mishaps)),
        traces=tuple(one.trace for one in mishaps if one.trace),
        units=options.units,
    )


def _lines(tables: _Tables, *, is_same_motion: bool) -> tuple[Difference, ...]:
    *reference, other = tables
    means = reference[0]
    if len(reference) > 1:
        means, other = _by_repeats(reference, other)
    found = [
        compared(subject, means[subject], second, is_same_motion=is_same_motion)
        for subject, second in other.items()
        if subject in means
    ]
    kinds = dict.fromkeys(line.subject.kind for line in found)
    # What is asked of the forces and of the parameters are two questions.
    return tuple(
        line
        for kind in kinds
        for line in surely_different([one for one in found if one.subject.kind == kind])
    )


def _identical(line: Difference, settings: Sequence[Setting]) -> Difference:
    """Return what was measured of the same logs as the same, whatever a filter has made of it."""
    if not line.is_measured or line.subject.setting not in settings:
        return line
    return replace(line, verdict=Sameness.SAME, is_sure=False, words="identical: the same logs")


def _common(runs: Sequence[ComparedRun]) -> tuple[Setting, ...]:
    known = [set(run.settings) for run in runs]
    common = tuple(setting for setting in runs[0].settings if all(setting in s for s in known))
    if not common:
        said = "; ".join(f"{run.place} has {_listed(run)}" for run in runs[:3])
        raise ConfigurationError(f"no setting is common to all: {said}")
    return common


def _listed(run: ComparedRun) -> str:
    return of_settings(run.settings) if run.settings else "none"


def _is_near(a: Sine, b: Sine) -> bool:
    ratios = (a.amplitude / b.amplitude, a.frequency / b.frequency)
    return all(abs(ratio - 1.0) <= SAME_MOTION for ratio in ratios)


def _is_one_test(fitted: Sequence[Run]) -> bool:
    """Whether all were tested with one motion: what each model misses there was measured."""
    return all(_is_near(one.motion, fitted[0].motion) for one in fitted)


def _speeds(fitted: Sequence[Run], options: ComparisonOptions) -> tuple[float, ...]:
    """Return the speeds asked for, else the named ones that the sine or all tests have reached."""
    if options.speeds:
        return options.speeds
    top = min(run.motion.peak_speed for run in fitted)
    if options.sine is not None:
        top = options.sine.peak_speed
    if not (speeds := named_speeds(top)):
        raise ConfigurationError(
            f"none is reached by {top:.3g} m/s; give {{velocity}}",
            velocity=Option("velocity"),
            subject="the named test speeds",
        )
    return speeds


def _on_repeats(repeats: Sequence[ComparedRun]) -> Iterator[str]:
    if 0 < len(repeats) < _FEW_REPEATS:
        n = len(repeats) + 1
        yield (
            f"the scatter of A is that of {n} runs, {n - 1} degree{'s' * (n > 2)} of freedom: "
            f"intervals are {'six times' if n == 2 else 'twice'} as wide as those of many would be"
        )


def _not_compared(settings: Sequence[Setting], lines: Sequence[Difference]) -> Iterator[str]:
    compared = {line.subject.setting for line in lines if line.subject.kind == "force"}
    lost = [one for one in settings if compared and one not in compared]
    if lost:
        yield f"{of_settings(lost)}: no motion is common to both: not compared"


def _untested(
    fitted: Sequence[Run], lines: Sequence[Difference], units: ShownUnits
) -> Iterator[str]:
    """Say which forces are at a speed that not every run has tested."""
    top = min((stage.top_speed for run in fitted for stage in run.settings), default=math.inf)
    speeds = {line.subject.speed for line in lines if not line.is_measured} - {None}
    beyond = sorted(speed for speed in speeds if speed and speed > (1.0 + REPEATS) * top)
    if beyond:
        listed = ", ".join(units.write_speed(speed) for speed in beyond)
        reached = units.write_speed(float(f"{top:.3g}"))
        yield (
            f"{listed} was never tested (tested: up to {reached}): the forces there are the "
            "models', extrapolated"
        )


def _notes(
    runs: Sequence[ComparedRun], tables: _Tables, lines: Sequence[Difference], units: ShownUnits
) -> Iterator[str]:
    for run in runs:
        yield from (f"{run.name}: {note}" for note in run.notes)
        share, freedom = repeat_scatter(run)
        if share:
            yield (
                f"{run.name}: tests of one setting differ by {100.0 * share:.2g} % of the damping "
                f"beyond their noise ({freedom:.0f} degrees of freedom): counted in the errors of "
                "forces, energy and hysteresis, not in those of parameters"
            )
        if run.fitted is not None and not run.fitted.speed_forces:
            yield (
                f"{run.name}: the lack of fit to the measured force is not known (an older "
                "version, or no motion repeats): it is not in the errors of forces"
            )
    fitted = [run.fitted for run in runs if run.fitted is not None]
    forces = [line for line in lines if line.subject.kind == "force"]
    if len(fitted) == len(runs) and forces:
        yield from _missed_notes(runs, tables, forces, units)
        yield from _tare_notes(runs, [one.subject.setting for one in forces if one.subject.setting])
        if not _comparable_quantities(fitted):
            yield "fitted with different models: no parameter is common to both"


# Measured forces and figures of runs at one motion: means over logs, how tests repeat.

_AT = (0.3, 0.6, 0.9)  # shares of the peak speed at which tests are compared with one another
_SURE = 0.01  # of tests that repeat to their noise so many are said not to
_FIGURES = {
    "energy": ("energy per cycle", "J"),
    "hysteresis_rebound": ("hysteresis, rebound", "N"),
    "hysteresis_bump": ("hysteresis, bump", "N"),
}
_ROUNDING = 1e-6  # of the force
_LEAST = 0.05  # of the largest force: below it a force has no per cent to speak of


def common_tests(runs: Sequence[ComparedRun], setting: Setting) -> tuple[_Group, ...]:
    """Return the tests of each run at the fastest motion that all ran; nothing where none is."""
    for one in runs[0].at(setting):
        groups = tuple(
            tuple(test for test in run.at(setting) if same_motion(test, one)) for run in runs
        )
        if all(groups):
            return groups
    return ()


def measured_readings(
    runs: Sequence[ComparedRun],
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float] = (),
    kind: str = "force",
) -> _Tables:
    """Return measured forces by setting, speed and stroke, of each run.

    Parameters
    ----------
    runs : sequence of ComparedRun
        To be compared.
    settings : sequence of Setting
        That all have.
    speeds : sequence of float
        m/s; none: the named test speeds that all reach.
    kind : str
        Of the subjects: "force", or "measured" beside the model's forces.
    """
    found: _Tables = tuple({} for _ in runs)
    scatters = [repeat_scatter(run) for run in runs]
    name = "force" if kind == "force" else "measured_force"
    for setting in settings:
        groups = common_tests(runs, setting)
        top = min((test.peak_speed for group in groups for test in group), default=0.0)
        for speed in speeds or [one for one in NAMED_SPEEDS if one <= top]:
            for stroke in STROKES:
                subject = Topic(kind, name, "force", "N", setting, speed, stroke)
                for table, group, scatter in zip(found, groups, scatters, strict=False):
                    table[subject] = _force(group, speed, stroke, scatter)
    return found


def _force(group: _Group, speed: float, stroke: str, scatter: tuple[float, float]) -> Reading:
    one = _pooled(group, [test.force_at(speed, stroke) for test in group])
    largest = max(float(np.nanmax(np.abs(test.strokes[stroke][0]))) for test in group)
    has_size = math.isnan(one.value) or abs(one.value) >= _LEAST * largest
    return replace(
        one,
        repeat=scatter[0] * _damping(group, speed) / math.sqrt(len(group)),
        repeat_freedom=scatter[1],
        scale=one.value if has_size else 0.0,
    )


def _figure_readings(runs: Sequence[ComparedRun], settings: Sequence[Setting]) -> _Tables:
    """Return energy and hysteresis by setting, of each run, where all ran one motion."""
    found: _Tables = tuple({} for _ in runs)
    scatters = [repeat_scatter(run) for run in runs]
    for setting in settings:
        groups = common_tests(runs, setting)
        for name, (label, unit) in _FIGURES.items():
            if not all(name in test.figures for group in groups for test in group):
                continue
            subject = Topic("figure", name, label, unit, setting)
            for table, group, (share, freedom) in zip(found, groups, scatters, strict=False):
                one = _pooled(group, [test.figures[name] for test in group])
                ranges = [0.5 * float(np.ptp(test.force)) for test in group]
                table[subject] = replace(
                    one,
                    repeat=share * abs(one.value) / math.sqrt(len(group)),
                    repeat_freedom=freedom,
                    scale=one.value if name == "energy" else fmean(ranges),
                )
    return found


def _pooled(group: _Group, values: Sequence[tuple[float, float]]) -> Reading:
    """Return the mean over tests, with the error that the scatter of their cycles gives it."""
    error = math.sqrt(sum(e**2 for _, e in values)) / len(group)
    freedom = sum(max(test.n_cycles - 1, 0) for test in group)
    return Reading(
        fmean(value for value, _ in values), error, freedom or math.inf, is_measured=True
    )


def repeat_scatter(run: ComparedRun) -> tuple[float, float]:
    """Return how far tests of one setting differ beyond their noise, and its degrees of freedom.

    As a share of the damping, one standard deviation, over all settings that were tested more than
    once; (0, inf) where none was, or where they repeat to their noise.
    """
    excess, noises, scatters, freedom = 0.0, 0.0, 0.0, 0
    for setting in run.settings:
        tests = run.at(setting)
        group = tuple(one for one in tests if same_motion(one, tests[0]))
        if len(group) < 2:
            continue
        variances, quiet, sizes = np.array(list(_scatter_of(group))).T
        known = np.isfinite(quiet) & (sizes > 0.0)
        if not known.any():
            continue
        quiet = np.maximum(quiet, (_ROUNDING * sizes) ** 2)  # synthetic cycles may be all alike
        more = len(group) - 1
        excess += more * float(np.mean((variances - quiet)[known] / sizes[known] ** 2))
        # Each point counts alike, whatever its force.
        scatters += more * float(np.mean((variances / quiet)[known]))
        noises += more
        freedom += more
    if not freedom or scatters / noises <= float(chdtri(freedom, _SURE)) / freedom:
        return 0.0, math.inf
    return math.sqrt(max(excess / freedom, 0.0)), float(freedom)


def _scatter_of(group: _Group) -> Iterator[tuple[float, float, float]]:
    """Yield the variance of force between tests, that of their noise, and the force, by point."""
    top = min(test.peak_speed for test in group)
    for share in _AT:
        for stroke in STROKES:
            forces = np.array([test.force_at(share * top, stroke) for test in group])
            noise = float(np.mean(forces[:, 1] ** 2))
            yield float(np.var(forces[:, 0], ddof=1)), noise, _damping(group, share * top)


def _damping(group: _Group, speed: float) -> float:
    """Return half the force between the strokes at a speed, N: without the gas force."""
    ends = [[test.force_at(speed, stroke)[0] for test in group] for stroke in STROKES]
    return 0.5 * abs(float(np.mean(ends[0])) - float(np.mean(ends[1])))


_Key = tuple["Setting", float, str]


def force_readings(
    runs: Sequence[ComparedRun],
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float],
    on_error: OnError | None = None,
) -> tuple[dict[Topic, Reading], ...]:
    """Return the forces of each run at some speeds.

    Parameters
    ----------
    runs : sequence of ComparedRun
        All of them fitted.
    settings : sequence of Setting
        That all have.
    speeds : sequence of float
        m/s.
    on_error : callable, optional
        Told of a setting and the error that it met; without it such an error is raised.
    """
    bare = _known_tares(runs, settings)
    tables = [
        {
            key: one if key[0] in bare else one.with_tare
            for key, one in _forces(run, settings, speeds=speeds, on_error=on_error).items()
        }
        for run in runs
    ]
    common = [key for key in tables[0] if all(key in table for table in tables)]
    doubted = {key[0] for key in common if any(table[key].disagrees for table in tables)}
    missed = {
        key
        for key in common
        if key[0] in doubted and all(table[key].measured is not None for table in tables)
    }
    found = []
    for run, table in zip(runs, tables, strict=True):
        scatter = repeat_scatter(run)
        found.append(
            {
                Topic("force", "force", "force", "N", *key): _reading(
                    run, table[key].as_read if key in missed else table[key], scatter
                )
                for key in common
            }
        )
    return tuple(found)


def _tare_notes(runs: Sequence[ComparedRun], settings: Sequence[Setting]) -> Iterator[str]:
    """Yield what became of the rigs' force offsets in the forces of fitted runs."""
    bare = _known_tares(runs, settings)
    stages = [[one for one in run.model.settings if one.setting in bare] for run in runs]
    if any(one.offset for mine in stages for one in mine):
        each = "; ".join(
            f"{run.name}: {said_offsets([one.offset for one in mine])}"
            for run, mine in zip(runs, stages, strict=True)
        )
        yield f"the rigs' force offsets, their tares, are left out of the forces ({each})"
    for run in runs:
        rest = [
            one.offset
            for one in run.model.settings
            if one.setting in settings and one.setting not in bare and one.offset
        ]
        if rest and _knows_gas(run.model):
            yield (
                f"{run.name}: its force offset ({said_offsets(rest)}), the rig's tare, is in its "
                "forces, for not every run has a known one: so much of a difference may be the tare"
            )


def _known_tares(runs: Sequence[ComparedRun], settings: Sequence[Setting]) -> set[Setting]:
    """Return the settings at which all of several runs know the offset of their rig."""
    if len(runs) < 2 or not all(_knows_gas(run.model) for run in runs):
        return set()
    known = [{one.setting for one in run.model.settings if one.knows_offset} for run in runs]
    return {one for one in settings if all(one in mine for mine in known)}


def _knows_gas(run: Run) -> bool:
    """Without a gas of its own a model holds the gas force in its offset."""
    return run.damper.rest_force(0.0) is not None


def _forces(
    run: ComparedRun,
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float],
    on_error: OnError | None,
) -> dict[_Key, Force]:
    fitted = run.model
    stages = {stage.setting: stage for stage in fitted.settings}
    found = force_at(
        [stages[setting] for setting in settings if setting in stages],
        fitted.damper,
        speeds,
        measured=fitted.speed_forces,
        on_error=on_error,
    )
    by_place = {(one.setting, one.speed, one.stroke): one for one in found}
    order = [(a, b, c) for a in settings for b in speeds for c in STROKES]
    return {key: by_place[key] for key in order if key in by_place}


def _reading(run: ComparedRun, level: Force, scatter: tuple[float, float]) -> Reading:
    fitted = run.model
    damping = level.force - (0.0 if math.isnan(level.gas) else level.gas)
    share, freedom = scatter
    n_logs = fitted.row(level.setting).get("n_logs") or 1
    return Reading(
        level.force,
        level.error,
        _freedom_of(fitted, level.setting),
        repeat=share * abs(damping) / math.sqrt(n_logs),
        repeat_freedom=freedom,
        misfit=level.misfit,
        misses=level.difference,
        misses_error=level.measured_error,
        disagrees=level.disagrees,
        scale=damping,
        is_measured=level.is_measured,
    )


def _freedom_of(fitted: Run, setting: Setting) -> float:
    """Return the degrees of freedom of a setting's errors: its cycles less one for each log.

    Infinite where the cycles are not known, or nothing repeated.
    """
    row = fitted.row(setting)
    cycles, logs = row.get("n_cycles"), row.get("n_logs") or 1
    return float(max(cycles - logs, 1)) if cycles else math.inf


# Parameters of fitted runs of one model, MSE and distance from cavitation, to be compared.

_OBJECTIONS = {
    Status.AT_BOUND.value: "it ended at the edge of its range",
    Status.NOT_IDENTIFIABLE.value: "the logs do not determine it",
    Status.ABSENT.value: "the law is fitted without it there",
}


def _comparable_quantities(runs: Sequence[Run]) -> tuple[Quantity, ...]:
    """Return the quantities that all runs have: none where they are of different models."""
    if len({run.damper.name for run in runs}) > 1:
        return ()
    known = [{one.name: one.unit for one in run.quantities} for run in runs[1:]]
    return tuple(
        one for one in runs[0].quantities if all(table.get(one.name) == one.unit for table in known)
    )


def _parameter_readings(
    runs: Sequence[Run], settings: Sequence[Setting]
) -> tuple[dict[Topic, Reading], ...]:
    """Return the parameters of each run that was fitted in at least one of them.

    What all settings share is one number, and stands once.
    """
    found: tuple[dict[Topic, Reading], ...] = tuple({} for _ in runs)
    for one in _comparable_quantities(runs):
        is_shared = all(_is_shared(run, one.name, settings) for run in runs)
        for setting in settings[:1] if is_shared else settings:
            rows = [run.row(setting) for run in runs]
            if all(row.get(f"{one.name}_status") == Status.FIXED.value for row in rows):
                continue
            subject = Topic(
                *("parameter", one.name, one.symbol, one.unit),
                setting=None if is_shared else setting,
                is_logarithmic=one.is_logarithmic,
            )
            for table, run, row in zip(found, runs, rows, strict=True):
                counted = settings if is_shared else (setting,)
                freedom = sum(_freedom_of(run, setting) for setting in counted)
                table[subject] = _parameter_reading(row, one, freedom)
    return found


def _is_shared(run: Run, name: str, settings: Sequence[Setting]) -> bool:
    rows = [run.row(setting) for setting in settings]
    values = {row.get(name) for row in rows}
    once = {Status.SHARED.value, Status.FIXED.value, Status.NOT_IDENTIFIABLE.value}
    return len(values) == 1 and {row.get(f"{name}_status") for row in rows} <= once


def _parameter_reading(row: Mapping[str, Any], quantity: Quantity, freedom: float) -> Reading:
    name = quantity.name
    value, error = row.get(name), row.get(f"{name}_se")
    status = str(row.get(f"{name}_status"))
    if value is None:
        return Reading(math.nan, objection="it has no value")
    if status == Status.FIXED.value:
        error = 0.0
    return Reading(
        float(value),
        math.nan if error is None else float(error),
        freedom,
        misfit=float(row.get(f"{name}_misfit_se") or 0.0),
        scale=math.nan if quantity.is_logarithmic else quantity.size,
        objection=_OBJECTIONS.get(status, ""),
    )


def _figure_lines(first: Run, second: Run, settings: Sequence[Setting]) -> Iterator[Difference]:
    """Yield MSE and distance from cavitation by setting: numbers without errors, told in words."""
    for setting in settings:
        rows = (first.row(setting), second.row(setting))
        yield _in_words(
            Topic("figure", "mse", "MSE", "%", setting),
            *(_number(row.get("mse_percent")) for row in rows),
            words=[str(row.get("grade") or "no grade") for row in rows],
        )
        margins = [_number(row.get("r_m3_cavitation_margin"), 100.0) for row in rows]
        if any(map(math.isfinite, margins)) or any(row.get("cavitation_fraction") for row in rows):
            yield _in_words(
                Topic("figure", "cavitation_margin", "R_m3 below cavitation", "%", setting),
                *margins,
                words=["cavitates" if row.get("cavitation_fraction") else "full" for row in rows],
            )


def _number(value: Any, factor: float = 1.0) -> float:
    return math.nan if value is None else factor * float(value)


def _in_words(subject: Topic, a: float, b: float, *, words: Sequence[str]) -> Difference:
    line = compared(subject, Reading(a), Reading(b))
    is_same = words[0] == words[1]
    said = f"both {words[0]}" if is_same else f"{words[0]}, now {words[1]}"
    return Difference(
        subject,
        line.first,
        line.second,
        line.difference,
        verdict=Sameness.SAME if is_same else Sameness.DIFFERENT,
        words=said,
    )


# The scatter over repeats of the reference as the measure of a difference.
#
# A damper taken off the rig and put on again differs by more than its cycles do. With n runs of
# the reference, itself among them, a further one falls within t s sqrt(1 + 1/n) of their mean in
# 95 of 100, where s is their standard deviation and t has n - 1 degrees of freedom.


def _by_repeats(
    reference: Sequence[Mapping[Topic, Reading]], other: Mapping[Topic, Reading]
) -> tuple[dict[Topic, Reading], dict[Topic, Reading]]:
    """Return the reference's mean with its scatter as error, and the other run without errors."""
    means, bare = {}, {}
    for subject, second in other.items():
        if not all(subject in table for table in reference):
            continue
        means[subject] = _mean(subject, [table[subject] for table in reference])
        bare[subject] = replace(second, error=0.0, repeat=0.0, misfit=0.0, misses=math.nan)
    return means, bare


def _mean(subject: Topic, readings: Sequence[Reading]) -> Reading:
    values, n = [one.value for one in readings], len(readings)
    objection = next((one.objection for one in readings if one.objection), "")
    wider = math.sqrt(1.0 + 1.0 / n)
    if not all(map(math.isfinite, values)):
        return replace(readings[0], value=math.nan, objection=objection)
    if subject.is_logarithmic and min(values) > 0.0:
        logs = [math.log(value) for value in values]
        mean = math.exp(fmean(logs))
        error = mean * stdev(logs) * wider
    else:
        mean, error = fmean(values), stdev(values) * wider
    return replace(
        readings[0],
        value=mean,
        error=error,
        freedom=float(n - 1),
        repeat=0.0,
        misfit=0.0,
        misses=math.nan,
        scale=fmean([one.scale for one in readings]),
        objection=objection,
    )


def _missed_notes(
    runs: Sequence[ComparedRun],
    tables: Sequence[Mapping[Topic, Reading]],
    lines: Sequence[Difference],
    units: ShownUnits = SI,
) -> Iterator[str]:
    """Yield why forces of fitted runs are compared as measured; nothing where none is."""
    measured = [line.subject for line in lines if line.subject.kind == "force" and line.is_measured]
    if not measured:
        return
    for run, table in zip(runs, tables, strict=True):
        missed = {topic: one for topic, one in table.items() if one.disagrees}
        if not missed or run.fitted is None:
            continue
        topic, worst = max(missed.items(), key=lambda item: abs(item[1].misses))
        share = f" ({abs(worst.misses / worst.scale):.1%} of the damping)" if worst.scale else ""
        yield (
            f"{run.name}: its model ({run.fitted.damper.name}) misses the measured force at "
            f"{_where(missed)}, most {place_of(topic, units)}: "
            f"by {units.write(abs(worst.misses), 'N', '.3g')}{share}"
        )
    said = "they show how the tests differ and say nothing about the models"
    if have_common_logs(runs[0], runs[-1]):
        said = "both are based on the same logs, so this says nothing about the models"
    yield f"at {_where(measured)} the measured forces of both are compared: {said}"


def _where(topics: Sequence[Topic] | Mapping[Topic, Reading]) -> str:
    return of_settings(dict.fromkeys(one.setting for one in topics if one.setting))
