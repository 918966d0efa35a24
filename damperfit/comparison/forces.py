"""Forces by setting, speed and stroke of fitted runs, as model or measurement tells.

At a setting where a model misses the measured force of any run by more than it may, the measured
forces of all are compared, at every speed: a model that misses one is not asked for the next, and a
difference must be of one kind. Where every run knows the offset of its rig, which is tared before
each test, forces are without it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import fmean, stdev
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtri

from damperfit.adjustment.force_at import STROKES, force_at, said_offsets
from damperfit.comparison.reading import Difference, Reading, Sameness, Topic, compared
from damperfit.comparison.run import MeasuredTest, same_motion
from damperfit.identification import Status
from damperfit.simulation import NAMED_SPEEDS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from damperfit.adjustment.force_at import Force
    from damperfit.comparison.run import ComparedRun
    from damperfit.damper.quantity import Quantity
    from damperfit.errors import OnError
    from damperfit.results import Run
    from damperfit.tested.setting import Setting

__all__ = [
    "SAME_MOTION",
    "by_repeats",
    "common_tests",
    "comparable_quantities",
    "figure_lines",
    "figure_readings",
    "force_readings",
    "freedom_of",
    "measured_readings",
    "parameter_readings",
    "repeat_scatter",
    "tare_notes",
]


# Measured forces and figures of runs at one motion: means over logs, how tests repeat.

SAME_MOTION = 0.05  # rigs repeat stroke and speed to 1 %
_AT = (0.3, 0.6, 0.9)  # shares of the peak speed at which tests are compared with one another
_SURE = 0.01  # of tests that repeat to their noise so many are said not to
_FIGURES = {
    "energy": ("energy per cycle", "J"),
    "hysteresis_rebound": ("hysteresis, rebound", "N"),
    "hysteresis_bump": ("hysteresis, bump", "N"),
}
_ROUNDING = 1e-6  # of the force
_LEAST = 0.05  # of the largest force: below it a force has no per cent to speak of

_Group = tuple[MeasuredTest, ...]


def common_tests(runs: Sequence[ComparedRun], setting: Setting) -> tuple[_Group, ...] | None:
    """Return the tests of each run at the fastest motion that all ran; None where there is none."""
    for one in runs[0].at(setting):
        groups = tuple(
            tuple(test for test in run.at(setting) if same_motion(test, one, within=SAME_MOTION))
            for run in runs
        )
        if all(groups):
            return groups
    return None


def measured_readings(
    runs: Sequence[ComparedRun],
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float] = (),
    kind: str = "force",
) -> tuple[dict[Topic, Reading], ...]:
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
    found: tuple[dict[Topic, Reading], ...] = tuple({} for _ in runs)
    scatters = [repeat_scatter(run) for run in runs]
    for setting in settings:
        groups = common_tests(runs, setting)
        if groups is None:
            continue
        top = min(test.peak_speed for group in groups for test in group)
        for speed in speeds or [one for one in NAMED_SPEEDS if one <= top]:
            for stroke in STROKES:
                name = "force" if kind == "force" else "measured_force"
                subject = Topic(kind, name, "force", "N", setting, speed, stroke)
                for table, group, scatter in zip(found, groups, scatters, strict=True):
                    table[subject] = _force(group, speed, stroke, scatter)
    return found


def _force(group: _Group, speed: float, stroke: str, scatter: tuple[float, float]) -> Reading:
    one = _pooled(group, lambda test: test.force_at(speed, stroke))
    largest = max(float(np.nanmax(np.abs(test.strokes[stroke][0]))) for test in group)
    share, freedom = scatter
    has_size = abs(one.value) >= _LEAST * largest
    return Reading(
        one.value,
        one.error,
        one.freedom,
        repeat=share * _damping(group, speed) / math.sqrt(len(group)),
        repeat_freedom=freedom,
        scale=one.value if has_size else math.nan if math.isnan(one.value) else 0.0,
        is_measured=True,
    )


def figure_readings(
    runs: Sequence[ComparedRun], settings: Sequence[Setting]
) -> tuple[dict[Topic, Reading], ...]:
    """Return energy and hysteresis by setting, of each run, where all ran one motion."""
    found: tuple[dict[Topic, Reading], ...] = tuple({} for _ in runs)
    scatters = [repeat_scatter(run) for run in runs]
    for setting in settings:
        groups = common_tests(runs, setting)
        if groups is None:
            continue
        for name, (label, unit) in _FIGURES.items():
            if not all(name in test.figures for group in groups for test in group):
                continue
            subject = Topic("figure", name, label, unit, setting)
            for table, group, (share, freedom) in zip(found, groups, scatters, strict=True):
                one = _pooled(group, _figure(name))
                table[subject] = Reading(
                    one.value,
                    one.error,
                    one.freedom,
                    repeat=share * abs(one.value) / math.sqrt(len(group)),
                    repeat_freedom=freedom,
                    scale=one.value if name == "energy" else _half_range(group),
                    is_measured=True,
                )
    return found


def _half_range(group: _Group) -> float:
    return float(np.mean([0.5 * np.ptp(test.force) for test in group]))


def _figure(name: str) -> Callable[[MeasuredTest], tuple[float, float]]:
    return lambda test: test.figures[name]


def _pooled(group: _Group, of: Callable[[MeasuredTest], tuple[float, float]]) -> Reading:
    """Return the mean over tests, with the error that the scatter of their cycles gives it."""
    values = [of(test) for test in group]
    n = len(group)
    error = math.sqrt(sum(e**2 for _, e in values)) / n
    freedom = sum(max(test.n_cycles - 1, 0) for test in group)
    return Reading(sum(value for value, _ in values) / n, error, freedom or math.inf)


def repeat_scatter(run: ComparedRun) -> tuple[float, float]:
    """Return how far tests of one setting differ beyond their noise, and its degrees of freedom.

    As a share of the damping, one standard deviation, over all settings that were tested more than
    once; (0, inf) where none was, or where they repeat to their noise.
    """
    excess, noises, scatters, freedom = 0.0, 0.0, 0.0, 0
    for group in _repeated(run):
        variances, quiet, sizes = np.array(list(_scatter_of(group))).T
        known = np.isfinite(quiet) & (sizes > 0.0)
        if not known.any():
            continue
        quiet = np.maximum(quiet, (_ROUNDING * sizes) ** 2)  # made-up cycles may be all alike
        more = len(group) - 1
        excess += more * float(np.mean((variances - quiet)[known] / sizes[known] ** 2))
        # Each point counts alike, whatever its force.
        scatters += more * float(np.mean((variances / quiet)[known]))
        noises += more
        freedom += more
    if not freedom or scatters / noises <= float(chdtri(freedom, _SURE)) / freedom:
        return 0.0, math.inf
    return math.sqrt(max(excess / freedom, 0.0)), float(freedom)


def _repeated(run: ComparedRun) -> Iterator[_Group]:
    """Yield the tests of each setting at its fastest motion, where there are several."""
    for setting in run.settings:
        tests = run.at(setting)
        group = tuple(one for one in tests if same_motion(one, tests[0], within=SAME_MOTION))
        if len(group) > 1:
            yield group


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


def tare_notes(runs: Sequence[ComparedRun], settings: Sequence[Setting]) -> Iterator[str]:
    """Yield what became of the rigs' force offsets in the forces of fitted runs."""
    bare = _known_tares(runs, settings)
    stages = [[one for one in _fitted(run).settings if one.setting in bare] for run in runs]
    if any(one.offset for mine in stages for one in mine):
        each = "; ".join(
            f"{run.name}: {said_offsets([one.offset for one in mine])}"
            for run, mine in zip(runs, stages, strict=True)
        )
        yield f"the rigs' force offsets, their tares, are left out of the forces ({each})"
    for run in runs:
        rest = [
            one.offset
            for one in _fitted(run).settings
            if one.setting in settings and one.setting not in bare and one.offset
        ]
        if rest and _knows_gas(run):
            yield (
                f"{run.name}: its force offset ({said_offsets(rest)}), the rig's tare, is in its "
                "forces, for not every run has a known one: so much of a difference may be the tare"
            )


def _known_tares(runs: Sequence[ComparedRun], settings: Sequence[Setting]) -> set[Setting]:
    """Return the settings at which all of several runs know the offset of their rig."""
    if len(runs) < 2 or not all(_knows_gas(run) for run in runs):
        return set()
    known = [{one.setting for one in _fitted(run).settings if one.knows_offset} for run in runs]
    return {one for one in settings if all(one in mine for mine in known)}


def _knows_gas(run: ComparedRun) -> bool:
    """Without a gas of its own a model holds the gas force in its offset."""
    return _fitted(run).damper.rest_force(0.0) is not None


def _forces(
    run: ComparedRun,
    settings: Sequence[Setting],
    *,
    speeds: Sequence[float],
    on_error: OnError | None,
) -> dict[_Key, Force]:
    fitted = _fitted(run)
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


def _fitted(run: ComparedRun) -> Run:
    assert run.fitted is not None
    return run.fitted


def _reading(run: ComparedRun, level: Force, scatter: tuple[float, float]) -> Reading:
    fitted = _fitted(run)
    damping = level.force - (0.0 if math.isnan(level.gas) else level.gas)
    share, freedom = scatter
    n_logs = fitted.row(level.setting).get("n_logs") or 1
    return Reading(
        level.force,
        level.error,
        freedom_of(fitted, level.setting),
        repeat=share * abs(damping) / math.sqrt(n_logs),
        repeat_freedom=freedom,
        misfit=level.misfit,
        misses=level.difference,
        misses_error=level.measured_error,
        disagrees=level.disagrees,
        scale=damping,
        is_measured=level.is_measured,
    )


def freedom_of(fitted: Run, setting: Setting) -> float:
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


def comparable_quantities(runs: Sequence[Run]) -> tuple[Quantity, ...]:
    """Return the quantities that all runs have: none where they are of different models."""
    if len({run.damper.name for run in runs}) > 1:
        return ()
    known = [{one.name: one.unit for one in run.quantities} for run in runs[1:]]
    return tuple(
        one for one in runs[0].quantities if all(table.get(one.name) == one.unit for table in known)
    )


def parameter_readings(
    runs: Sequence[Run], settings: Sequence[Setting]
) -> tuple[dict[Topic, Reading], ...]:
    """Return the parameters of each run that was fitted in at least one of them.

    What all settings share is one number, and stands once.

    Parameters
    ----------
    runs : sequence of Run
        To be compared.
    settings : sequence of Setting
        That all have.
    """
    found: tuple[dict[Topic, Reading], ...] = tuple({} for _ in runs)
    for one in comparable_quantities(runs):
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
                freedom = sum(freedom_of(run, setting) for setting in counted)
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


def figure_lines(first: Run, second: Run, settings: Sequence[Setting]) -> Iterator[Difference]:
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


def by_repeats(
    reference: Sequence[Mapping[Topic, Reading]], other: Mapping[Topic, Reading]
) -> tuple[dict[Topic, Reading], dict[Topic, Reading]]:
    """Return the reference's mean with its scatter as error, and the other run without errors.

    Parameters
    ----------
    reference : sequence of mapping
        Readings of the reference and of its repeats, at least two.
    other : mapping
        Readings of the run that is compared.
    """
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
