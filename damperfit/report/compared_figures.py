"""Runs over one another: loops of a setting with their differences below, and all settings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from damperfit.comparison import common_tests
from damperfit.report.figures import (
    Line,
    Panel,
    Plot,
    setting_axis,
    setting_names,
    setting_places,
)
from damperfit.report.forces import STROKE_WORDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.comparison import ComparedRun, MeasuredTest, RunComparison
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["RUN_COLOURS", "difference_plots", "loop_plots"]

# Okabe and Ito (2008), readable on white and on black; the reference is in ink.
RUN_COLOURS = ("ink", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def loop_plots(runs: Sequence[ComparedRun], setting: Setting, *, name: str) -> tuple[Plot, ...]:
    """Return force against velocity and displacement of a setting, where all ran one motion.

    Parameters
    ----------
    runs : sequence of ComparedRun
        The reference first.
    setting : Setting
        Which.
    name : str
        What the names of the plots begin with.
    """
    groups = common_tests(runs, setting)
    if groups is None:
        return ()
    if any(not len(test.displacement) for group in groups for test in group):
        return (_points(runs, groups, setting, name),)
    loops = [_mean_loop(group) for group in groups]
    # One phase is one motion: forces are taken from each other there.
    apart = [loop[2] - loops[0][2] for loop in loops[1:]]
    plots = []
    for row, (axis, unit, factor, word) in enumerate(
        (("velocity", "m/s", 1.0, "velocity"), ("displacement", "mm", 1e3, "displacement"))
    ):
        place = 1 - row
        upper = tuple(
            Line(
                *_closed(factor * loop[place], loop[2]),
                run.name,
                _colour(k),
                setting=setting,
                style="thin" if k == 0 else "wide",
            )
            # The reference last and thin: it would else be hidden where nothing differs.
            for k, (run, loop) in reversed(list(enumerate(zip(runs, loops, strict=True))))
        )
        lower = tuple(
            Line(
                *_closed(factor * loops[0][place], difference),
                f"{run.name} less {runs[0].name}",
                _colour(k),
                setting=setting,
                style="thin",
                in_legend=False,
            )
            for k, (run, difference) in enumerate(zip(runs[1:], apart, strict=True), start=1)
        )
        panels = (
            Panel(axis, unit, "force", "N", upper),
            Panel(axis, unit, "difference", "N", lower, rules=((0.0, ""),)),
        )
        plots.append(
            Plot(
                f"{name}_force_{word}",
                f"Setting {setting}: force against {word}",
                panels,
                f"Mean measured cycles. Below: less {runs[0].name}, phase by phase.",
            )
        )
    return tuple(plots)


def _points(
    runs: Sequence[ComparedRun],
    groups: Sequence[tuple[MeasuredTest, ...]],
    setting: Setting,
    name: str,
) -> Plot:
    """Return force over velocity of curves without time."""
    lines = tuple(
        Line(
            test.velocity,
            test.force,
            run.name,
            _colour(k),
            setting=setting,
            style="points" if k == 0 else "triangles",
        )
        for k, (run, group) in enumerate(zip(runs, groups, strict=True))
        for test in group[:1]
    )
    panel = Panel("velocity", "m/s", "force", "N", lines)
    return Plot(
        f"{name}_force_velocity", f"Setting {setting}: force against velocity", (panel,), ""
    )


def _colour(k: int) -> str:
    return RUN_COLOURS[k % len(RUN_COLOURS)]


def _mean_loop(group: Sequence[MeasuredTest]) -> FloatArray:
    """Return x, v and force of the mean of several tests, begun where x passes its middle."""
    return np.asarray(np.mean([_aligned(test) for test in group], axis=0))


def _aligned(test: MeasuredTest) -> FloatArray:
    """Return x, v and force over one cycle from the rising passage of mid-stroke."""
    x = test.displacement - 0.5 * (test.displacement.max() + test.displacement.min())
    n = len(x)
    later = np.roll(x, -1)
    rises = np.flatnonzero((x < 0.0) & (later >= 0.0))
    start = 0.0
    if len(rises):
        at = int(rises[np.argmax(test.velocity[rises])])
        start = at + float(x[at] / (x[at] - later[at]))
    phases = start + np.arange(n)
    rows = (x, test.velocity, test.force)
    return np.stack([np.interp(phases, np.arange(n), row, period=n) for row in rows])


def _closed(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.append(x, x[0]), np.append(y, y[0])


def difference_plots(comparisons: Sequence[RunComparison]) -> tuple[Plot, ...]:
    """Return the difference of force over the settings, at the fastest speed of each pair.

    Parameters
    ----------
    comparisons : sequence of RunComparison
        With one reference.
    """
    plots = []
    settings = sorted({s for one in comparisons for s in one.settings})
    places = setting_places(settings)
    ticks, shown = setting_axis(settings)
    is_bare = any(one.is_without_model for one in comparisons)
    whole = "measured force" if is_bare else "damping"
    for stroke in ("rebound", "bump"):
        lines, speeds = [], []
        for k, one in enumerate(comparisons, start=1):
            known = [
                line
                for line in one.of("force")
                if line.subject.stroke == stroke and math.isfinite(line.percent)
            ]
            top = max((line.subject.speed or 0.0 for line in known), default=0.0)
            known = [line for line in known if line.subject.speed == top]
            if not known:
                continue
            speeds.append(top)
            x = np.array([places[line.subject.setting] for line in known if line.subject.setting])
            y, low, high = np.array(
                [(line.percent, line.percent_low, line.percent_high) for line in known]
            ).T
            has_errors = bool(np.isfinite(low).all())
            lines.append(
                Line(
                    x,
                    y,
                    f"{one.second.name}, {one.units.write_speed(top)}",
                    _colour(k),
                    style="points",
                    low=low if has_errors else None,
                    high=high if has_errors else None,
                )
            )
        if lines:
            panel = Panel(
                *("setting", "", "difference", f"% of {whole}", tuple(lines)),
                rules=((0.0, ""),),
                ticks=ticks,
                names=setting_names(settings),
                x_range=shown,
            )
            title = f"Difference of force in {STROKE_WORDS[stroke]}, with 95 % intervals"
            name = comparisons[0].first.name
            at = " and ".join(map(comparisons[0].units.write_speed, dict.fromkeys(speeds)))
            caption = f"At {at}. Above zero: harder than {name}."
            plots.append(Plot(f"difference_{stroke}", title, (panel,), caption))
    return tuple(plots)
