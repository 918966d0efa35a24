"""What is drawn, before anything draws it: plots as plain descriptions, their colours and units.

A `Plot` has one or more `Panel` under one another, a panel has `Line`. The web page and the static
figures draw the same descriptions, so a number cannot differ between them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.damper.model import PRESSURES
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from damperfit.tested.setting import Place
    from damperfit.units.shown_units import ShownUnits

    FloatArray = NDArray[np.float64]
    Range = tuple[float, float]

_MOST_TICKS = 20
_BUCKETS = 500  # of one cycle: 3000 samples are drawn as they are


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """One trace, in the panel's units.

    ``colour`` is "#rrggbb", "ink" or "muted"; ``style`` is "solid", "wide", "thin", "dashed",
    "dotted", for what stands back "pale" or "faint", of marks "points", "triangles", "rings", and
    of joined ones "dot_line", "triangle_line".
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
        lines = tuple(
            replace(
                line,
                x=x * line.x,
                y=y * line.y,
                low=None if line.low is None else y * line.low,
                high=None if line.high is None else y * line.high,
            )
            for line in panel.lines
        )
        return replace(
            panel,
            x_unit=x_unit,
            y_unit=y_unit,
            lines=lines,
            rules=tuple((y * at, word) for at, word in panel.rules),
            bands=tuple((x * begin, x * end) for begin, end in panel.bands),
        )  # numbered axes are of settings

    return replace(plot, panels=tuple(map(scaled, plot.panels)))


# Axes of settings


def setting_places(settings: Iterable[Setting | Place]) -> dict[Setting, float]:
    """Return where each setting stands on an axis: at its number, or one after the other.

    Examples
    --------
    >>> setting_places([3, 1]), list(setting_places(["soft", "hard"]).values())
    ({Setting(places=(('setting', 1),)): 1.0, Setting(places=(('setting', 3),)): 3.0}, [1.0, 2.0])
    """
    known = sorted(set(map(Setting.of, settings)))
    places = {one: number for one in known if (number := one.number()) is not None}
    return places if len(places) == len(known) else {one: 1.0 + k for k, one in enumerate(known)}


def setting_names(settings: Iterable[Setting | Place]) -> tuple[str, ...]:
    """Return what stands at 1, 2, ... of an axis whose settings are no numbers; else nothing."""
    places = setting_places(settings)
    is_numbered = all(one.number() is not None for one in places)
    return () if is_numbered else tuple(one.label for one in places)


def setting_axis(settings: Iterable[Setting | Place]) -> tuple[tuple[float, ...], Range | None]:
    """Return where an axis of settings is numbered, and what it shows.

    Numbers stand at settings only, not at all where they would touch.

    Examples
    --------
    >>> setting_axis([3, 1, 2])
    ((1.0, 2.0, 3.0), (0.4, 3.6))
    >>> setting_axis([0, 25, 26, 100])[0]
    (0.0, 25.0, 100.0)
    """
    known = sorted(setting_places(settings).values())
    if not known:
        return (), None
    span = known[-1] - known[0]
    ticks = known[:1]
    for setting in known[1:]:
        if setting - ticks[-1] >= span / _MOST_TICKS:
            ticks.append(setting)
    edge = max(0.6, 0.04 * span)
    return tuple(ticks), (known[0] - edge, known[-1] + edge)


def setting_panel(
    settings: Iterable[Setting | Place], label: str, unit: str, lines: Iterable[Line], **more: Any
) -> Panel:
    """Return a panel over the settings, with more fields of `Panel`."""
    known = list(settings)
    ticks, x_range = setting_axis(known)
    axis: Any = {"ticks": ticks, "names": setting_names(known), "x_range": x_range}
    return Panel("setting", "", label, unit, tuple(lines), **axis, **more)


# Signals over a cycle


def thin(n_buckets: int, *signals: FloatArray) -> NDArray[np.intp]:
    """Return the indices of samples that keep every peak of every signal.

    From each of ``n_buckets`` runs of equal length the lowest and the highest value of each signal
    are kept, and the first and last sample of all. The signals have one length; NaN is passed over.

    Examples
    --------
    >>> spike = np.zeros(1000); spike[777] = 5.0
    >>> 777 in thin(10, spike)
    True
    """
    n = len(signals[0])
    if n <= 2 * n_buckets * len(signals) + 2:
        return np.arange(n)
    edges = np.linspace(0, n, n_buckets + 1).astype(np.intp)
    kept = {0, n - 1}
    for signal in signals:
        low = np.where(np.isnan(signal), np.inf, signal)
        high = np.where(np.isnan(signal), -np.inf, signal)
        for start, stop in pairwise(edges):
            kept.add(int(start + np.argmin(low[start:stop])))
            kept.add(int(start + np.argmax(high[start:stop])))
    return np.array(sorted(kept), dtype=np.intp)


def loop(x: FloatArray, y: FloatArray, cycle: slice) -> tuple[FloatArray, FloatArray]:
    """Return the samples of a cycle that are drawn of one signal against another."""
    kept = thin(_BUCKETS, x[cycle], y[cycle])
    return x[cycle][kept], y[cycle][kept]


def pressure_panel(
    time: FloatArray, pressures: FloatArray, cycle: slice, *, setting: Setting | None = None
) -> Panel:
    """Return the chamber pressures over one cycle, cavitation shaded.

    Shapes: time (n,), s; pressures (3, n), Pa absolute.
    """
    time, pressures = time[cycle] - time[cycle.start], pressures[:, cycle]
    kept = thin(_BUCKETS, *pressures)
    looks = zip(PRESSURES, pressures, CHAMBER_COLOURS, CHAMBER_STYLES, strict=True)
    lines = tuple(
        Line(time[kept], 1e-5 * pressure[kept], one.label, colour, setting, style)
        for one, pressure, colour, style in looks
    )
    is_dry = np.concatenate(([False], np.any(pressures <= 0.0, axis=0), [False]))
    begins, ends = np.flatnonzero(np.diff(is_dry)).reshape(-1, 2).T
    bands = tuple((float(time[a]), float(time[b - 1])) for a, b in zip(begins, ends, strict=True))
    return Panel("time", "s", "absolute pressure", "bar", lines, bands=bands)


# Every setting has one colour, on a ramp from blue (lowest) over purple to red (highest). It was
# laid by equal steps of the smallest difference that readers with full sight and the three kinds of
# dichromats see, gets darker all the way, and stands out 3 to 1 on white and on the dark page;
# `tests/test_colours.py` computes this. "ink" and "muted" are the text colour and a grey.
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


def setting_colours(settings: Iterable[Setting | Place]) -> Mapping[Setting, str]:
    """Return a colour for each setting, along the ramp in the order of the settings.

    Examples
    --------
    >>> list(setting_colours([1, 20]).values())
    ['#6871fb', '#c7330e']
    """
    known = sorted(set(map(Setting.of, settings)))
    places = np.linspace(0.0, len(_RAMP) - 1.0, len(known))
    channels = [np.interp(places, np.arange(len(_RAMP)), row) for row in _RAMP.T]
    return {
        setting: "#" + "".join(f"{round(float(channel[k])):02x}" for channel in channels)
        for k, setting in enumerate(known)
    }
