"""Plots as plain descriptions, whatever draws them.

A `Plot` has one or more `Panel` under one another, a panel has `Line`. The web page and the static
figures draw the same descriptions, so a number cannot differ between them. Displacement is in mm,
velocity in m/s, force in N, pressure in bar; positive in rebound.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.damper.model import PRESSURES
from damperfit.tested.setting import Place, Setting
from damperfit.units.shown_units import ShownUnits

if TYPE_CHECKING:
    Range = tuple[float, float]

_MOST_TICKS = 20
_BUCKETS = 500  # of one cycle: 3000 samples are drawn as they are
# Every setting has one colour, on a ramp from blue (lowest) over purple to red (highest). It was
# laid by equal steps of the smallest difference that readers with full sight and the three kinds of
# dichromats see, gets darker all the way, and stands out 3 to 1 on white and on the dark page.
# "ink" and "muted" are the text colour and a grey.
_RAMP = np.array(
    [
        *((104, 113, 251), (119, 110, 218), (132, 108, 189), (145, 105, 161), (157, 97, 132)),
        *((169, 89, 104), (180, 80, 77), (188, 67, 48), (199, 51, 14)),
    ],
    dtype=float,
)
# Okabe and Ito (2008), readable on white and on black.
CHAMBER_COLOURS = ("#0072b2", "#d55e00", "#009e73")
# Blue and green come close for a reader without blue cones: the gas chamber is dashed as well.
CHAMBER_STYLES = ("solid", "solid", "dashed")
RUN_COLOURS = ("ink", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
SPEED_COLOURS = ("#56b4e9", "#0072b2", "#009e73", "#e69f00", "#d55e00", "#cc79a7", "ink")


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One trace, in the panel's units.

    ``colour`` is "#rrggbb", "ink" or "muted"; ``style`` is "solid", "wide", "thin", "dashed",
    "dotted", of lines in the background "pale" or "faint", of marks "points", "triangles", "rings",
    and of joined ones "dot_line", "triangle_line".
    """

    x: FloatArray  # shape (n,)
    y: FloatArray
    label: str  # for the legend and the hover text; plain text, not yet escaped
    colour: str
    setting: Setting | None = None  # whose trace it is; None belongs to all
    style: str = "solid"
    in_legend: bool = True
    low: FloatArray | None = None  # interval around y: bars at marks, a band along a line
    high: FloatArray | None = None
    tag: str = ""  # what stands at the end of the line, where x is largest


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One pair of axes: its lines, the last one on top."""

    x_label: str
    x_unit: str
    y_label: str
    y_unit: str
    lines: tuple[Line, ...]
    rules: tuple[tuple[float, str], ...] = ()  # horizontal lines with a word at each
    bands: tuple[Range, ...] = ()  # ranges of x that are shaded
    is_log: bool = False  # the y axis
    ticks: tuple[float, ...] = ()  # where x is numbered; left to the renderer when empty
    names: tuple[str, ...] = ()  # what stands at x = 1, 2, ... where these are no numbers
    x_range: Range | None = None  # what is shown; everything when None

    @property
    def tick_labels(self) -> tuple[str, ...]:
        """What stands at each tick."""
        if not self.names:
            return tuple(f"{tick:g}" for tick in self.ticks)
        return tuple(self.names[round(tick) - 1] for tick in self.ticks)


@dataclass(frozen=True, slots=True, eq=False)
class Plot:
    """A figure with a name, unique in a report; its panels from top to bottom share x.

    ``key`` are words and styles of a plot whose colours are the settings; the page has a key of the
    settings at its top, a static figure gets one of its own. Then `Line.in_legend` is not heeded.
    """

    name: str
    title: str
    panels: tuple[Panel, ...]
    caption: str = ""
    key: tuple[tuple[str, str], ...] = ()


def plot_in_units(plot: Plot, units: ShownUnits) -> Plot:
    """Return a figure with forces, speeds and displacements scaled; other axes stay."""
    if units.is_si:
        return plot

    def scale(unit: str) -> tuple[float, str]:
        if unit != "mm":
            return units.show(1.0, unit), units.of(unit)
        chosen = units.of("m")  # figures have displacements in mm
        return (1.0, unit) if chosen == "m" else (1e-3 * units.show(1.0, "m"), chosen)

    def scaled(panel: Panel) -> Panel:
        (x, x_unit), (y, y_unit) = scale(panel.x_unit), scale(panel.y_unit)
        lines = []
        for line in panel.lines:
            ends = (None if end is None else y * end for end in (line.low, line.high))
            lines.append(replace(line, x=x * line.x, y=y * line.y, low=next(ends), high=next(ends)))
        rules = tuple((y * at, word) for at, word in panel.rules)
        bands = tuple((x * begin, x * end) for begin, end in panel.bands)
        axes: Any = {"x_unit": x_unit, "y_unit": y_unit}  # numbered axes are of settings
        return replace(panel, lines=tuple(lines), rules=rules, bands=bands, **axes)

    return replace(plot, panels=tuple(map(scaled, plot.panels)))


# Colours and axes of settings


def setting_colours(settings: Iterable[Setting | Place]) -> Mapping[Setting, str]:
    """Return a colour for each setting, along the ramp in the order of the settings."""
    ordered = sorted(set(map(Setting.of, settings)))
    places = np.linspace(0.0, len(_RAMP) - 1.0, len(ordered))
    channels = [np.interp(places, np.arange(len(_RAMP)), row) for row in _RAMP.T]
    return {
        setting: "#" + "".join(f"{round(float(channel[k])):02x}" for channel in channels)
        for k, setting in enumerate(ordered)
    }


def setting_places(settings: Iterable[Setting | Place]) -> dict[Setting, float]:
    """Return where each setting stands on an axis: at its number, or one after the other."""
    ordered = sorted(set(map(Setting.of, settings)))
    places = {s: number for s in ordered if (number := s.number()) is not None}
    return places if len(places) == len(ordered) else {s: 1.0 + k for k, s in enumerate(ordered)}


def setting_names(settings: Iterable[Setting | Place]) -> tuple[str, ...]:
    """Return what stands at 1, 2, ... of an axis whose settings are no numbers; else nothing."""
    places = setting_places(settings)
    is_numbered = all(setting.number() is not None for setting in places)
    return () if is_numbered else tuple(setting.label for setting in places)


def setting_panel(
    settings: Iterable[Setting | Place], label: str, unit: str, lines: Iterable[Line], **fields: Any
) -> Panel:
    """Return a panel over the settings, with more fields of `Panel`.

    Numbers stand at settings only, not at all where they would touch.

    Examples
    --------
    >>> panel = setting_panel([0, 25, 26, 100], "force", "N", ())
    >>> panel.ticks, panel.x_range
    ((0.0, 25.0, 100.0), (-4.0, 104.0))
    """
    ordered = sorted(setting_places(settings := list(settings)).values())
    ticks, span = ordered[:1], ordered[-1] - ordered[0] if ordered else 0.0
    for place in ordered[1:]:
        if place - ticks[-1] >= span / _MOST_TICKS:
            ticks.append(place)
    if ordered:
        edge = max(0.6, 0.04 * span)
        fields["x_range"] = (ordered[0] - edge, ordered[-1] + edge)
    axis: Any = {"ticks": tuple(ticks), "names": setting_names(settings)}
    return Panel("setting", "", label, unit, tuple(lines), **axis, **fields)


# Signals over a cycle


def thin(n_buckets: int, *signals: FloatArray) -> NDArray[np.intp]:
    """Return the indices of samples that keep every peak of every signal.

    From each of ``n_buckets`` runs of equal length the lowest and the highest value of each signal
    are kept, and the first and last sample of all. The signals have one length; NaN is passed over.
    """
    n = len(signals[0])
    if n <= 2 * n_buckets * len(signals) + 2:
        return np.arange(n)
    edges = np.linspace(0, n, n_buckets + 1).astype(np.intp)
    indices = {0, n - 1}
    for signal in signals:
        low = np.where(np.isnan(signal), np.inf, signal)
        high = np.where(np.isnan(signal), -np.inf, signal)
        for start, stop in pairwise(edges):
            indices.add(int(start + np.argmin(low[start:stop])))
            indices.add(int(start + np.argmax(high[start:stop])))
    return np.array(sorted(indices), dtype=np.intp)


def loop(x: FloatArray, y: FloatArray, cycle: slice) -> tuple[FloatArray, FloatArray]:
    """Return the samples of a cycle that are drawn of one signal against another."""
    indices = thin(_BUCKETS, x[cycle], y[cycle])
    return x[cycle][indices], y[cycle][indices]


def pressure_panel(
    time: FloatArray, pressures: FloatArray, cycle: slice, *, setting: Setting | None = None
) -> Panel:
    """Return the chamber pressures over one cycle, cavitation shaded.

    Shapes: time (n,), s; pressures (3, n), Pa absolute.
    """
    time, pressures = time[cycle] - time[cycle.start], pressures[:, cycle]
    indices = thin(_BUCKETS, *pressures)
    looks = zip(PRESSURES, pressures, CHAMBER_COLOURS, CHAMBER_STYLES, strict=True)
    lines = tuple(
        Line(time[indices], 1e-5 * pressure[indices], chamber.label, colour, setting, style)
        for chamber, pressure, colour, style in looks
    )
    is_dry = np.concatenate(([False], np.any(pressures <= 0.0, axis=0), [False]))
    begins, ends = np.flatnonzero(np.diff(is_dry)).reshape(-1, 2).T
    bands = tuple((float(time[a]), float(time[b - 1])) for a, b in zip(begins, ends, strict=True))
    return Panel("time", "s", "absolute pressure", "bar", lines, bands=bands)
