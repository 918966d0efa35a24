"""The figures of one log (the paper's Figs 7, 11, 12), of a setting's valves and of a sweep.

Displacement in mm, velocity in m/s, force in N, pressure in bar; positive in rebound. A road drawn
sample by sample is a tangle of strands: where nothing repeats, means of both branches by velocity
and of both strokes by place are drawn, with the range of the forces that the speeds spread.
"""

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
from damperfit.report.rounding import number

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.report.forces import SweepMember
    from damperfit.report.logs import LogView
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]
    Row = Mapping[str, Any]

__all__ = [
    "LOG_FIGURES",
    "Branch",
    "mean_branches",
    "sweep_plot",
    "sweep_pressure_plot",
    "valve_plots",
]

_BUCKETS = 200  # of a whole log: peaks of every cycle survive
_CYCLE_BUCKETS = 500  # of one cycle: 3000 samples and more are drawn as they are
_SWEEP_BUCKETS = 300  # a cycle at 1000 Hz stays whole
_CLOUD = 800  # points of a residual plot, besides the peaks
_GAP = 1.5  # sample intervals
_BINS = 24  # of velocity, from the lowest to the highest
_FEW = 3  # samples: no mean of fewer
_FEW_IN_RANGE = 20  # no range of fewer: each end would be one sample
_RANGE = (5.0, 95.0)  # per cent of the samples that lie below
_BAR, _CM3 = 1e5, 1e-6
_DIRECTIONS = "rebound to the right and up, compression to the left and down"


class Branch(NamedTuple):
    """Means of one branch: "opening", where the speed grows, or "closing"."""

    word: str
    velocity: FloatArray
    mean: FloatArray


def mean_branches(velocity: FloatArray, values: FloatArray) -> Iterator[Branch]:
    """Yield the means of both branches by velocity, at the middles of the bins.

    Parameters
    ----------
    velocity, values : numpy.ndarray
        Shape (n,), samples in order of time.
    """
    if len(velocity) < _BINS or np.ptp(velocity) == 0.0:
        return
    middle, place = _binned(velocity)
    is_opening = np.gradient(np.abs(velocity)) > 0.0
    for part, word in ((is_opening, "opening"), (~is_opening, "closing")):
        count = np.bincount(place[part], minlength=_BINS)
        total = np.bincount(place[part], weights=values[part], minlength=_BINS)
        seen = count >= _FEW
        if seen.any():
            yield Branch(word, middle[seen], total[seen] / count[seen])


def _binned(signal: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the middles of the bins, and the bin of each sample."""
    edges = np.linspace(signal.min(), signal.max(), _BINS + 1)
    return 0.5 * (edges[1:] + edges[:-1]), np.clip(np.digitize(signal, edges) - 1, 0, _BINS - 1)


def _both(view: LogView, colour: str) -> Iterator[tuple[str, FloatArray, str, str]]:
    """Yield word, force, colour and style: simulated in colour, measured thin on top of it."""
    yield "simulated", view.signals.force, colour, "wide"
    yield "measured", view.signals.force_measured, "ink", "thin"


def _loops(view: LogView, signal: FloatArray, colour: str) -> Iterator[Line]:
    """Yield the last cycle of each steady segment."""
    cycles = view.cycles or (view.cycle,)
    for word, force, ink, style in _both(view, colour):
        for cycle in cycles:
            x, y = signal[cycle], force[cycle]
            kept = thin(_CYCLE_BUCKETS, x, y)
            is_first = cycle is cycles[0]
            yield Line(x[kept], y[kept], word, ink, view.setting, style, in_legend=is_first)


def _force_velocity(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    if view.is_moving:
        lines = [
            Line(
                *(branch.velocity, branch.mean, word, ink, view.setting, style),
                in_legend=branch.word == "opening",
            )
            for word, force, ink, style in _both(view, colour)
            for branch in mean_branches(view.signals.velocity, force)
        ]
        begins = "Mean of the opening and of the closing branch"
    else:
        lines, begins = [*_loops(view, view.signals.velocity, colour)], _last_cycle(view)
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    title = f"Setting {view.setting}: force against velocity"
    yield Plot(f"{name}_force_velocity", title, (panel,), f"{begins}; {_DIRECTIONS}.")


def _last_cycle(view: LogView) -> str:
    if not view.has_segments:
        return "Last cycle"
    is_steady = all(row["cycles"] for row in view.peaks)
    return "Last cycle of each segment" if is_steady else "Last cycle of each steady segment"


def _force_displacement(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    fastest = view.fastest
    if view.is_moving:
        lines = [*_stroke_forces(view, colour)]
        caption = (
            "Mean over the samples of each stroke, rebound above and compression below; nine of "
            "ten samples lie within the shaded range, for the speeds differ that pass a place."
        )
    else:
        lines = [*_loops(view, 1e3 * view.signals.displacement, colour)]
        caption = f"{_last_cycle(view)}."
        if fastest and not view.has_segments:
            energy = [number(fastest[f"{w}_energy_J"], digits=4) for w in ("measured", "simulated")]
            caption += f" Energy per cycle: {energy[0]} J measured, {energy[1]} J simulated."
    panel = Panel("displacement", "mm", "force", "N", tuple(lines))
    title = f"Setting {view.setting}: force against displacement"
    yield Plot(f"{name}_force_displacement", title, (panel,), caption)


def _stroke_forces(view: LogView, colour: str) -> Iterator[Line]:
    """Yield mean and range of the force by place: a band simulated, dotted lines measured."""
    x, v = 1e3 * view.signals.displacement, view.signals.velocity
    if len(x) < _FEW_IN_RANGE or np.ptp(x) == 0.0:
        return
    middle, place = _binned(x)
    for word, force, ink, style in _both(view, colour):
        for part, is_first in ((v > 0.0, True), (v < 0.0, False)):
            groups = [force[part & (place == k)] for k in range(_BINS)]
            seen = [k for k, group in enumerate(groups) if len(group) >= _FEW_IN_RANGE]
            if not seen:
                continue
            low, high = np.array([np.percentile(groups[k], _RANGE) for k in seen]).T
            at, mean = middle[seen], np.array([groups[k].mean() for k in seen])
            is_band = word == "simulated"
            yield Line(
                *(at, mean, word, ink, view.setting, style),
                in_legend=is_first,
                low=low if is_band else None,
                high=high if is_band else None,
            )
            for end in () if is_band else (low, high):
                is_named = is_first and end is low
                label = "measured, 5 and 95 %"
                yield Line(at, end, label, ink, view.setting, "dotted", in_legend=is_named)


def _peaks(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    """Peak force against peak speed, where more than one speed was run."""
    steady = [row for row in view.peaks if row["cycles"]]
    if len(steady) < 2:
        return
    lines = []
    for stroke, sign in (("rebound", 1.0), ("bump", -1.0)):
        for word, ink, style in (("simulated", colour, "rings"), ("measured", "ink", "points")):
            names = (f"speed_{stroke}_m_per_s", f"{word}_{stroke}_N")
            x, y = np.array(sorted(tuple(row[one] for one in names) for row in steady), float).T
            is_first = stroke == "rebound"
            lines.append(Line(sign * x, y, word, ink, view.setting, style, in_legend=is_first))
    panel = Panel("peak velocity", "m/s", "peak force", "N", tuple(lines))
    caption = "One point a segment and stroke: mean of its cycles."
    title = f"Setting {view.setting}: peak force against peak velocity"
    yield Plot(f"{name}_peaks", title, (panel,), caption)


def _force_time(view: LogView, name: str, colour: str) -> Iterator[Plot]:
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
    forces = (
        Line(time, simulated, "simulated", colour, view.setting, "wide"),
        Line(time, measured, "measured", "ink", view.setting, "thin"),
    )
    left = Line(time, residual, "residual", colour, view.setting, "thin", in_legend=False)
    panels = (
        Panel("time", "s", "force", "N", forces),
        Panel("time", "s", "residual", "N", (left,)),
    )
    title = f"Setting {view.setting}: force over time"
    yield Plot(f"{name}_force_time", title, panels, "Below: measured less simulated.")


def _residual(view: LogView, name: str, colour: str) -> Iterator[Plot]:
    signals = view.signals
    residual = signals.force_measured - signals.force
    # Peaks alone would make the cloud wider than it is.
    some = np.arange(0, len(residual), max(1, len(residual) // _CLOUD))
    kept = np.union1d(some, thin(_BUCKETS // 8, residual))
    cloud = Line(
        *(signals.velocity[kept], residual[kept], "residual", colour, view.setting, "points")
    )
    styles = {"opening": "solid", "closing": "dashed"}
    means = [
        Line(
            *(branch.velocity, branch.mean, f"mean, {branch.word} branch", "ink"),
            *(view.setting, styles[branch.word]),
        )
        for branch in mean_branches(signals.velocity, residual)
    ]
    panel = Panel("velocity", "m/s", "residual", "N", (cloud, *means), rules=((0.0, ""),))
    caption = (
        "Measured less simulated. A cloud around zero is noise; where a mean leaves zero, "
        "the model lacks something."
    )
    title = f"Setting {view.setting}: residual against velocity"
    yield Plot(f"{name}_residual", title, (panel,), caption)


def _pressures(view: LogView, name: str, _: str) -> Iterator[Plot]:
    signals = view.signals
    time = signals.time[view.cycle] - signals.time[view.cycle.start]
    pressures = signals.pressures[:, view.cycle]
    panel = _pressure_panel(time, pressures, setting=view.setting)
    shares = [100.0 * float(np.mean(pressure <= 0.0)) for pressure in pressures]
    dry = [f"chamber {i} for {share:.1f} %" for i, share in enumerate(shares, start=1) if share]
    caption = "No chamber cavitates."
    if dry:
        caption = f"Shaded: cavitation, {' and '.join(dry)} of the cycle."
    caption += f" Lowest pressure of this cycle {pressures.min() / _BAR:.3g} bar."
    if view.has_segments and view.cycles:
        caption = f"Last cycle of the fastest segment. {caption}"
    title = f"Setting {view.setting}: chamber pressures, simulated"
    yield Plot(f"{name}_pressures", title, (panel,), caption)


def _pressure_panel(
    time: FloatArray, pressures: FloatArray, *, setting: Setting | None = None
) -> Panel:
    """Return the chamber pressures over one cycle, cavitation shaded."""
    kept = thin(_CYCLE_BUCKETS, *pressures)
    looks = zip(PRESSURES, pressures, CHAMBER_COLOURS, CHAMBER_STYLES, strict=True)
    lines = tuple(
        Line(time[kept], pressure[kept] / _BAR, one.label, colour, setting=setting, style=style)
        for one, pressure, colour, style in looks
    )
    is_dry = np.concatenate(([False], np.any(pressures <= 0.0, axis=0), [False]))
    begins = np.flatnonzero(~is_dry[:-1] & is_dry[1:])
    ends = np.flatnonzero(is_dry[:-1] & ~is_dry[1:]) - 1
    bands = tuple((float(time[a]), float(time[b])) for a, b in zip(begins, ends, strict=True))
    return Panel("time", "s", "absolute pressure", "bar", lines, bands=bands)


# What is drawn of each log, with the first part of the figure's name and the setting's colour.
LOG_FIGURES: tuple[Callable[[LogView, str, str], Iterator[Plot]], ...] = (
    _force_velocity,
    _force_displacement,
    _peaks,
    _force_time,
    _residual,
    _pressures,
)


def valve_plots(rows: Sequence[Row], setting: Setting, *, colour: str) -> tuple[Plot, ...]:
    """Return a setting's valves, flow against pressure, or nothing where the table has none.

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
    lines: list[Line] = []
    openings = []
    for stroke, sign in (("rebound", 1.0), ("bump", -1.0)):
        is_first = not lines
        law = _curve(own, stroke, "law")
        for curve, ink, style in (("measured", "ink", "points"), ("law", colour, "wide")):
            x, y = sign * _curve(own, stroke, curve)
            if len(x):
                lines.append(Line(x, y, curve, ink, setting, style, in_legend=is_first))
        for row in (row for row in own if row["stroke"] == stroke and row["curve"] == "opening"):
            if row["pressure_Pa"] is None:
                continue
            pressure = row["pressure_Pa"] / _BAR
            is_reached = len(law[0]) > 0 and pressure <= law[0].max()
            if is_reached:
                at = np.array([pressure])
                flow = sign * np.interp(at, *law)
                label = "blow-off opens"
                is_named = all(line.label != label for line in lines)
                lines.append(
                    Line(sign * at, flow, label, "muted", setting, "rings", in_legend=is_named)
                )
            if row["valve_force_N"] is not None:
                word = "rebound" if sign > 0.0 else "compression"
                more = "" if is_reached else ", which these logs do not reach"
                openings.append(
                    f"{word} at {pressure:.3g} bar ({row['valve_force_N']:.3g} N){more}"
                )
    if not lines:
        return ()
    order = {"points": 0, "wide": 1, "rings": 2}
    lines.sort(key=lambda line: order[line.style])
    panel = Panel("pressure across the valve", "bar", "flow", "cm³/s", tuple(lines))
    caption = (
        f"{_DIRECTIONS.capitalize()}. Points: what the piston displaces less what gives way, read "
        "off the loops without a law of the valve; where they leave the law, the law lacks "
        "something."
    )
    if openings:
        caption += f" Blow-offs open in {'; in '.join(openings)}."
    title = f"Setting {setting}: the valves, flow against pressure"
    return (Plot(f"setting_{setting.slug}_valves", title, (panel,), caption),)


def _curve(rows: Sequence[Row], stroke: str, curve: str) -> FloatArray:
    """Return pressure in bar and flow in cm3/s, shape (2, n)."""
    points = [
        (row["pressure_Pa"] / _BAR, row["flow_m3_per_s"] / _CM3)
        for row in rows
        if row["stroke"] == stroke and row["curve"] == curve
        if row["pressure_Pa"] is not None and row["flow_m3_per_s"] is not None
    ]
    return np.array(points, dtype=np.float64).reshape(-1, 2).T


def sweep_plot(name: str, members: Sequence[SweepMember], *, file_name: str, title: str) -> Plot:
    """Return the force-velocity loops of a sweep's members; x1 in the text colour."""
    colours = tuple(setting_colours(range(len(members))).values())
    lines = []
    for member, colour in zip(members, colours, strict=True):
        cycle = _last_cycle_of(member)
        v, f = member.response.velocity[cycle], member.response.force[cycle]
        kept = thin(_SWEEP_BUCKETS, v, f)
        ink = "ink" if member.factor == 1.0 else colour
        lines.append(Line(v[kept], f[kept], f"{name} x{member.factor:g}", ink))
    panel = Panel("velocity", "m/s", "force", "N", tuple(lines))
    return Plot(file_name, title, (panel,), sweep_sentence(name, members))


def sweep_pressure_plot(member: SweepMember, *, file_name: str, title: str) -> Plot:
    """Return the chamber pressures of one member, cavitation shaded."""
    cycle = _last_cycle_of(member)
    time = member.response.time[cycle] - member.response.time[cycle.start]
    panel = _pressure_panel(time, member.response.pressures[:, cycle])
    return Plot(file_name, title, (panel,), "Shaded: cavitation." if panel.bands else "")


def _last_cycle_of(member: SweepMember) -> slice:
    time = member.response.time
    start = time[-1] - 1.0 / member.frequency
    return slice(max(0, int(np.searchsorted(time, start)) - 1), len(time))
