"""Measured forces and figures of runs at one motion: means over logs, how tests repeat."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from damperfit.adjustment.force_at import STROKES
from damperfit.comparison.reading import Reading, Topic
from damperfit.comparison.run import MeasuredTest, same_motion
from damperfit.simulation import NAMED_SPEEDS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from damperfit.comparison.run import ComparedRun
    from damperfit.tested.setting import Setting

__all__ = ["SAME_MOTION", "common_tests", "figure_readings", "measured_readings", "repeat_scatter"]

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
