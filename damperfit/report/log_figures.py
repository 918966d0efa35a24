"""The figures of one log, of a setting's valves and of a sweep."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.damper.signals import PRESSURES
from damperfit.report.figures import (
    CHAMBER_COLOURS,
    CHAMBER_STYLES,
    Line,
    Panel,
    Plot,
    setting_colours,
    thin,
)
from damperfit.report.forces import sweep_sentence

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from damperfit.report.logs import EvaluatedLog

    FloatArray = NDArray[np.float64]
    from collections.abc import Mapping, Sequence

    from damperfit.report.forces import SweepMember
    from damperfit.tested.setting import Setting

__all__ = [
    "Branch",
    "Stroke",
    "cavitation_bands",
    "is_moving",
    "mean_branches",
    "mean_strokes",
    "pressure_panel",
    "setting_plots",
    "sweep_plot",
    "sweep_pressure_plot",
    "valve_plots",
]


# Force where nothing repeats: means of both branches by velocity, of both strokes by place.
#
# A road drawn sample by sample is a tangle of strands; what the damper does at a velocity is the
# mean
# of those that pass there, faster on one branch and slower on the other. At a place of the stroke
# the
# speeds that pass spread the forces, so that a range stands beside their mean.

_BINS = 24  # of velocity, from the lowest to the highest
_FEW = 3  # samples: no mean of fewer
_FEW_IN_RANGE = 20  # no range of fewer: each end would be one sample
_RANGE = (5.0, 95.0)  # per cent of the samples that lie below


class Branch(NamedTuple):
    """Means of one branch: "opening", where the speed grows, or "closing"."""

    word: str
    velocity: FloatArray
    mean: FloatArray


class Stroke(NamedTuple):
    """Forces of one stroke by place: "rebound", where the rod comes out, or "bump".

    Nine of ten samples lie between `low` and `high`.
    """

    word: str
    displacement: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray


def is_moving(view: EvaluatedLog) -> bool:
    """Whether nothing in a log repeats.

    Parameters
    ----------
    view : EvaluatedLog
        The log.
    """
    return bool(view.stretches) and not any(one.n_cycles for one in view.stretches)


def mean_branches(velocity: FloatArray, values: FloatArray) -> Iterator[Branch]:
    """Yield the means of both branches by velocity, at the middles of the bins.

    Parameters
    ----------
    velocity, values : numpy.ndarray
        Shape (n,), samples in order of time.
    """
    if len(velocity) < _BINS or np.ptp(velocity) == 0.0:
        return
    edges = np.linspace(velocity.min(), velocity.max(), _BINS + 1)
    place = np.clip(np.digitize(velocity, edges) - 1, 0, _BINS - 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    is_opening = np.gradient(np.abs(velocity)) > 0.0
    for part, word in ((is_opening, "opening"), (~is_opening, "closing")):
        count = np.bincount(place[part], minlength=_BINS)
        total = np.bincount(place[part], weights=values[part], minlength=_BINS)
        seen = count >= _FEW
        if seen.any():
            yield Branch(word, middle[seen], total[seen] / count[seen])


def mean_strokes(
    displacement: FloatArray, velocity: FloatArray, values: FloatArray
) -> Iterator[Stroke]:
    """Yield mean and range of both strokes by displacement, at the middles of the bins.

    Parameters
    ----------
    displacement, velocity, values : numpy.ndarray
        Shape (n,).
    """
    if len(displacement) < _FEW_IN_RANGE or np.ptp(displacement) == 0.0:
        return
    edges = np.linspace(displacement.min(), displacement.max(), _BINS + 1)
    place = np.clip(np.digitize(displacement, edges) - 1, 0, _BINS - 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for part, word in ((velocity > 0.0, "rebound"), (velocity < 0.0, "bump")):
        groups = [values[part & (place == k)] for k in range(_BINS)]
        seen = [k for k, group in enumerate(groups) if len(group) >= _FEW_IN_RANGE]
        if seen:
            low, high = np.array([np.percentile(groups[k], _RANGE) for k in seen]).T
            mean = np.array([groups[k].mean() for k in seen])
            yield Stroke(word, middle[seen], mean, low, high)


# The plots of one log: the two loops, force and residual, pressures (the paper's Figs 7, 11, 12).
#
# Displacement in mm, velocity in m/s, force in N, pressure in bar; positive in rebound.

_BUCKETS = 200  # of a whole log: peaks of every cycle survive
_CYCLE_BUCKETS = 500  # of one cycle: 3000 samples and more are drawn as they are
_CLOUD = 800  # points of a residual plot, besides the peaks
_GAP = 1.5  # sample intervals
_BAR = 1e5  # Pa


def setting_plots(view: EvaluatedLog, *, name: str, colour: str) -> tuple[Plot, ...]:
    """Return the plots of one log.

    Parameters
    ----------
    view : EvaluatedLog
        The log.
    name : str
        Prefix of the plots' names.
    colour : str
        Colour of the setting.
    """
    return (
        _force_velocity(view, name, colour),
        _force_displacement(view, name, colour),
        *_peaks(view, name, colour),
        _force_time(view, name, colour),
        _residual(view, name, colour),
        _pressures(view, name),
    )


def _title(view: EvaluatedLog, words: str) -> str:
    return f"Setting {view.signals.setting}: {words}"


def _loops(view: EvaluatedLog, signal: FloatArray, colour: str) -> tuple[Line, ...]:
    """Return the last cycle: simulated in the setting's colour, measured thin on top of it.

    Of a log with several stretches the last cycle of each that is steady: what does not repeat
    beside them would cover their loops.
    """
    cycles = [one.cycle for one in view.stretches if one.n_cycles] or [view.cycle]
    simulated: list[Line] = []
    measured: list[Line] = []
    for cycle in cycles:
        x, f, f_measured = (
            values[cycle] for values in (signal, view.signals.force, view.signals.force_measured)
        )
        part = thin(_CYCLE_BUCKETS, x, f, f_measured)
        is_first = cycle is cycles[0]
        for lines, y, word, ink, style in (
            (simulated, f, "simulated", colour, "wide"),
            (measured, f_measured, "measured", "ink", "thin"),
        ):
            lines.append(
                Line(
                    *(x[part], y[part], word, ink),
                    setting=view.signals.setting,
                    style=style,
                    in_legend=is_first,
                )
            )
    return (*simulated, *measured)


def _mean_forces(view: EvaluatedLog, colour: str) -> tuple[Line, ...]:
    """Return the mean force by velocity where nothing repeats, simulated below measured."""
    lines = []
    for word, force, ink, style in (
        ("simulated", view.signals.force, colour, "wide"),
        ("measured", view.signals.force_measured, "ink", "thin"),
    ):
        for branch in mean_branches(view.signals.velocity, force):
            line = Line(
                *(branch.velocity, branch.mean, word, ink),
                setting=view.signals.setting,
                style=style,
                in_legend=branch.word == "opening",
            )
            lines.append(line)
    return tuple(lines)


def _stroke_forces(view: EvaluatedLog, colour: str) -> tuple[Line, ...]:
    """Return mean and range of the force by place where nothing repeats, simulated below measured.

    The range is the simulated one; the ends of the measured one are dotted lines on top of it.
    """
    signals = view.signals
    setting = signals.setting
    where = 1e3 * signals.displacement, signals.velocity
    simulated = [
        Line(
            *(one.displacement, one.mean, "simulated", colour),
            setting=setting,
            style="wide",
            in_legend=one.word == "rebound",
            low=one.low,
            high=one.high,
        )
        for one in mean_strokes(*where, signals.force)
    ]
    measured = []
    for one in mean_strokes(*where, signals.force_measured):
        for y, word, style in (
            (one.mean, "measured", "thin"),
            (one.low, "measured, 5 and 95 %", "dotted"),
            (one.high, "measured, 5 and 95 %", "dotted"),
        ):
            is_first = one.word == "rebound" and y is not one.high
            line = Line(one.displacement, y, word, "ink", setting, style, in_legend=is_first)
            measured.append(line)
    return (*simulated, *measured)


def _last_cycle(view: EvaluatedLog) -> str:
    if not view.stretches:
        return "Last cycle"
    is_steady = all(one.n_cycles for one in view.stretches)
    return "Last cycle of each stretch" if is_steady else "Last cycle of each steady stretch"


def _peaks(view: EvaluatedLog, name: str, colour: str) -> tuple[Plot, ...]:
    """Return peak force against peak speed, where more than one speed was run."""
    steady = [one for one in view.stretches if one.n_cycles]
    if len(steady) < 2:
        return ()
    setting = view.signals.setting
    lines = []
    for side, sign in (("rebound", 1.0), ("bump", -1.0)):
        for word, ink, style in (("simulated", colour, "rings"), ("measured", "ink", "points")):
            peaks = sorted(
                (
                    sign * getattr(getattr(one, word), f"peak_speed_{side}"),
                    getattr(getattr(one, word), f"peak_force_{side}"),
                )
                for one in steady
            )
            x, y = np.array(peaks).T
            is_first = side == "rebound"
            lines.append(Line(x, y, word, ink, setting=setting, style=style, in_legend=is_first))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    caption = "One point a stretch and stroke: mean of its cycles."
    title = _title(view, "peak force against peak velocity")
    return (Plot(f"{name}_peaks", title, (panel,), caption),)


def _force_velocity(view: EvaluatedLog, name: str, colour: str) -> Plot:
    lines, begins = _loops(view, view.signals.velocity, colour), _last_cycle(view)
    if is_moving(view):
        lines, begins = _mean_forces(view, colour), "Mean of the opening and of the closing branch"
    panel = Panel("velocity", "m/s", "force", "N", lines)
    caption = f"{begins}; rebound to the right and up, bump to the left and down."
    title = _title(view, "force against velocity")
    return Plot(f"{name}_force_velocity", title, (panel,), caption)


def _force_displacement(view: EvaluatedLog, name: str, colour: str) -> Plot:
    if is_moving(view):
        lines = _stroke_forces(view, colour)
        caption = (
            "Mean over the samples of each stroke, rebound above and bump below; nine of ten "
            "samples lie within the shaded range, for the speeds differ that pass a place."
        )
    else:
        lines = _loops(view, 1e3 * view.signals.displacement, colour)
        caption = f"{_last_cycle(view)}."
    panel = Panel("displacement", "mm", "force", "N", lines)
    if view.measured and view.simulated and not view.stretches:
        caption = (
            f"Last cycle. Energy per cycle: {view.measured.energy:.4g} J measured, "
            f"{view.simulated.energy:.4g} J simulated."
        )
    title = _title(view, "force against displacement")
    return Plot(f"{name}_force_displacement", title, (panel,), caption)


def _force_time(view: EvaluatedLog, name: str, colour: str) -> Plot:
    signals = view.signals
    residual = signals.force_measured - signals.force
    kept = thin(_BUCKETS, signals.force_measured, signals.force, residual)
    time = signals.time - signals.time[0]
    # A line across what was not compared would show a motion that nobody ran.
    gaps = np.flatnonzero(np.diff(time) > _GAP * float(np.median(np.diff(time)))) + 1
    kept = np.union1d(kept, np.concatenate([gaps - 1, gaps]))
    time, simulated, measured, residual = (
        np.insert(values[kept], np.searchsorted(kept, gaps), np.nan)
        for values in (time, signals.force, signals.force_measured, residual)
    )
    setting = signals.setting
    forces = (
        Line(time, simulated, "simulated", colour, setting=setting, style="wide"),
        Line(time, measured, "measured", "ink", setting=setting, style="thin"),
    )
    left = Line(time, residual, "residual", colour, setting=setting, style="thin", in_legend=False)
    panels = (
        Panel("time", "s", "force", "N", forces),
        Panel("time", "s", "residual", "N", (left,)),
    )
    caption = "Below: measured less simulated."
    return Plot(f"{name}_force_time", _title(view, "force over time"), panels, caption)


def _residual(view: EvaluatedLog, name: str, colour: str) -> Plot:
    signals = view.signals
    residual = signals.force_measured - signals.force
    # Peaks alone would make the cloud wider than it is.
    some = np.arange(0, len(residual), max(1, len(residual) // _CLOUD))
    kept = np.union1d(some, thin(_BUCKETS // 8, residual))
    cloud = Line(
        signals.velocity[kept],
        residual[kept],
        "residual",
        colour,
        setting=signals.setting,
        style="points",
    )
    lines = (cloud, *_mean_residuals(view, residual))
    panel = Panel("velocity", "m/s", "residual", "N", lines, rules=((0.0, ""),))
    caption = (
        "Measured less simulated. A cloud around zero is noise; where a mean leaves zero, "
        "the model lacks something."
    )
    return Plot(f"{name}_residual", _title(view, "residual against velocity"), (panel,), caption)


def _mean_residuals(view: EvaluatedLog, residual: FloatArray) -> tuple[Line, ...]:
    """Return the mean of all samples by velocity, on the opening and on the closing branch."""
    styles = {"opening": "solid", "closing": "dashed"}
    return tuple(
        Line(
            *(branch.velocity, branch.mean, f"mean, {branch.word} branch", "ink"),
            setting=view.signals.setting,
            style=styles[branch.word],
        )
        for branch in mean_branches(view.signals.velocity, residual)
    )


def _pressures(view: EvaluatedLog, name: str) -> Plot:
    signals = view.signals
    time = signals.time[view.cycle] - signals.time[view.cycle.start]
    pressures = signals.pressures[:, view.cycle]
    panel = pressure_panel(time, pressures, setting=signals.setting)
    caption = "No chamber cavitates."
    if panel.bands:
        parts = [
            f"chamber {i} for {100.0 * float(np.mean(pressure <= 0.0)):.1f} %"
            for i, pressure in enumerate(pressures, start=1)
            if (pressure <= 0.0).any()
        ]
        caption = f"Shaded: cavitation, {' and '.join(parts)} of the cycle."
    caption += f" Lowest pressure of this cycle {pressures.min() / _BAR:.3g} bar."
    if view.stretches and np.isfinite(view.frequency):
        caption = f"Last cycle of the fastest stretch. {caption}"
    title = _title(view, "chamber pressures, simulated")
    return Plot(f"{name}_pressures", title, (panel,), caption)


def pressure_panel(
    time: FloatArray, pressures: FloatArray, *, setting: Setting | None = None
) -> Panel:
    """Return the chamber pressures over one cycle, cavitation shaded.

    Parameters
    ----------
    time : numpy.ndarray
        Shape (n,), s.
    pressures : numpy.ndarray
        Shape (3, n), Pa.
    setting : Setting, optional
        Whose they are.
    """
    kept = thin(_CYCLE_BUCKETS, *pressures)
    looks = zip(pressures, CHAMBER_COLOURS, CHAMBER_STYLES, strict=True)
    words = [one.label for one in PRESSURES]
    lines = tuple(
        Line(time[kept], pressure[kept] / _BAR, word, colour, setting=setting, style=style)
        for word, (pressure, colour, style) in zip(words, looks, strict=True)
    )
    bands = cavitation_bands(time, pressures)
    return Panel("time", "s", "absolute pressure", "bar", lines, bands=bands)


def cavitation_bands(time: FloatArray, pressures: FloatArray) -> tuple[tuple[float, float], ...]:
    """Return begin and end of each stretch with a chamber at zero pressure.

    Parameters
    ----------
    time : numpy.ndarray
        Shape (n,).
    pressures : numpy.ndarray
        Shape (3, n).
    """
    is_inside = np.any(pressures <= 0.0, axis=0)
    padded = np.concatenate(([False], is_inside, [False]))
    begins = np.flatnonzero(~padded[:-1] & padded[1:])
    ends = np.flatnonzero(padded[:-1] & ~padded[1:]) - 1
    return tuple((float(time[a]), float(time[b])) for a, b in zip(begins, ends, strict=True))


# The valves of a setting: flow against pressure, as the loops show it and as the law has it.

_BAR_VALVES, _CM3 = 1e5, 1e-6
# Bump is drawn to the left and down, as in every other figure.
_SIDES = (("rebound", 1.0), ("bump", -1.0))


def valve_plots(
    rows: Sequence[Mapping[str, Any]], setting: Setting, *, colour: str
) -> tuple[Plot, ...]:
    """Return the figure of a setting's valves, or nothing where the table has none of them.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table of valves.
    setting : Setting
        Whose.
    colour : str
        Colour of the setting.
    """
    own = [row for row in rows if row["setting"] == setting]
    lines = [line for side in _SIDES for line in _valve(own, *side, setting, colour)]
    if not lines:
        return ()
    order = {"points": 0, "wide": 1, "rings": 2}
    lines.sort(key=lambda line: order[line.style])
    labels: set[str] = set()
    shown = []
    for line in lines:
        is_first = line.label not in labels
        labels.add(line.label)
        shown.append(_with_legend(line, is_first=is_first))
    panel = Panel("pressure across the valve", "bar", "flow", "cm³/s", tuple(shown))
    caption = (
        "Rebound to the right and up, bump to the left and down. Points: what the piston displaces "
        "less what gives way, read off the loops without a law of the valve; where they leave the "
        f"law, the law lacks something. {_openings(own)}"
    ).rstrip()
    title = f"Setting {setting}: the valves, flow against pressure"
    return (Plot(f"setting_{setting.slug}_valves", title, (panel,), caption),)


def _with_legend(line: Line, *, is_first: bool) -> Line:
    return Line(
        line.x, line.y, line.label, line.colour,
        setting=line.setting, style=line.style, in_legend=is_first,
    )  # fmt: skip


def _valve(
    rows: Sequence[Mapping[str, Any]], stroke: str, sign: float, setting: Setting, colour: str
) -> list[Line]:
    lines = []
    law = _points(rows, stroke, "law")
    for curve, ink, style in (("measured", "ink", "points"), ("law", colour, "wide")):
        x, y = _points(rows, stroke, curve)
        if len(x):
            lines.append(
                Line(
                    sign * x / _BAR_VALVES,
                    sign * y / _CM3,
                    curve,
                    ink,
                    setting=setting,
                    style=style,
                )
            )
    opening = _opening(rows, stroke)
    if opening is not None and len(law[0]) and opening <= law[0].max():
        at = np.array([opening])
        flow = np.interp(at, *law)
        lines.append(
            Line(sign * at / _BAR_VALVES, sign * flow / _CM3, "blow-off opens", "muted",
                 setting=setting, style="rings")
        )  # fmt: skip
    return lines


def _points(
    rows: Sequence[Mapping[str, Any]], stroke: str, curve: str
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    points = [
        (row["pressure_Pa"], row["flow_m3_per_s"])
        for row in rows
        if row["stroke"] == stroke
        and row["curve"] == curve
        and row["pressure_Pa"] is not None
        and row["flow_m3_per_s"] is not None
    ]
    x, y = np.array(points, dtype=np.float64).reshape(-1, 2).T
    return x, y


def _opening(rows: Sequence[Mapping[str, Any]], stroke: str) -> float | None:
    found = [r["pressure_Pa"] for r in rows if r["stroke"] == stroke and r["curve"] == "opening"]
    return found[0] if found else None


def _openings(rows: Sequence[Mapping[str, Any]]) -> str:
    """Where the blow-offs open, in words."""
    said = []
    for stroke, _ in _SIDES:
        for row in rows:
            if row["stroke"] != stroke or row["curve"] != "opening":
                continue
            if row["pressure_Pa"] is None or row["valve_force_N"] is None:
                continue
            pressed, _ = _points(rows, stroke, "law")
            is_reached = len(pressed) > 0 and row["pressure_Pa"] <= pressed.max()
            more = "" if is_reached else ", which these logs do not reach"
            said.append(
                f"{stroke} at {row['pressure_Pa'] / _BAR_VALVES:.3g} bar "
                f"({row['valve_force_N']:.3g} N){more}"
            )
    return f"Blow-offs open in {'; in '.join(said)}." if said else ""


# The figures of a sweep: its force-velocity loops, and the pressures of one test.

_BUCKETS_SWEEP = 300  # a cycle at 1000 Hz stays whole


def sweep_plot(name: str, members: Sequence[SweepMember], *, file_name: str, title: str) -> Plot:
    """Return the force-velocity loops of a members; x1 in the text colour."""
    colours = tuple(setting_colours(range(len(members))).values())
    lines = []
    for k, member in enumerate(members):
        cycle = _last_cycle_sweep(member)
        v, f = member.response.velocity[cycle], member.response.force[cycle]
        kept = thin(_BUCKETS_SWEEP, v, f)
        colour = "ink" if member.factor == 1.0 else colours[k]
        lines.append(Line(v[kept], f[kept], f"{name} x{member.factor:g}", colour))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    return Plot(file_name, title, (panel,), sweep_sentence(name, members))


def sweep_pressure_plot(member: SweepMember, *, file_name: str, title: str) -> Plot:
    """Return the chamber pressures of one member, cavitation shaded."""
    cycle = _last_cycle_sweep(member)
    time = member.response.time[cycle] - member.response.time[cycle.start]
    panel = pressure_panel(time, member.response.pressures[:, cycle])
    return Plot(file_name, title, (panel,), "Shaded: cavitation." if panel.bands else "")


def _last_cycle_sweep(member: SweepMember) -> slice:
    time = member.response.time
    start = time[-1] - 1.0 / member.frequency
    return slice(max(0, int(np.searchsorted(time, start)) - 1), len(time))
