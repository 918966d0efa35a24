"""Plots as files for a report or a paper, by matplotlib; equal tables give equal bytes."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from damperfit.reporting.plots import Line, Panel, Plot

_COLOURS = {"ink": "#000000", "muted": "#7d8796"}
_OPEN: dict[str, Any] = {"linestyle": "none", "markerfacecolor": "none"}
_STYLES: dict[str, dict[str, Any]] = {
    "solid": {"linewidth": 1.6},
    "wide": {"linewidth": 2.6, "alpha": 0.7},
    "thin": {"linewidth": 0.7},
    "dashed": {"linewidth": 1.2, "linestyle": "--"},
    "dotted": {"linewidth": 1.6, "linestyle": ":"},
    "points": {"linestyle": "none", "marker": "o"},
    "triangles": {**_OPEN, "marker": "^"},
    "rings": {**_OPEN, "marker": "o", "markersize": 11.0},
    "dot_line": {"linewidth": 0.8, "marker": "o", "markersize": 4.0},
    "triangle_line": _OPEN
    | {"linewidth": 0.8, "linestyle": "--", "marker": "^", "markersize": 7.0},
}
# Nothing of the time or the machine in the files; text stays text in SVG and PDF.
_FIXED: Any = {
    "svg.hashsalt": "damperfit",
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "path.simplify": False,
    "text.usetex": False,
    "text.parse_math": False,  # a log may be called $x_1$
}
FIXED_METADATA: dict[str, dict[str, Any]] = {
    # Who made it, so that a later run may know and replace it; no date, no version.
    "png": {"Software": "damperfit"},
    "svg": {"Date": None, "Creator": "damperfit"},
    "pdf": {"CreationDate": None, "Creator": "damperfit", "Producer": None},
}
_BEHIND = {"pale", "faint"}  # settings between the bold ones: on a page they can be chosen
_ABOVE: Any = {
    "loc": "lower left", "bbox_to_anchor": (-0.01, 0.99), "ncols": 3, "fontsize": 7,
    "frameon": False, "borderaxespad": 0.1,
}  # fmt: skip
_BESIDE: Any = {"loc": "upper left", "fontsize": 7, "frameon": False}
_MANY = 60  # points: beyond it they are drawn small
_FEW = 6  # entries of a legend: more stand beside the axes
_KEY_ROWS = 20


def matplotlib_of_files() -> Any:
    """Return matplotlib, also where MPLBACKEND names a backend of a notebook that is not here."""
    try:
        import matplotlib as mpl
    except ValueError:
        for name in [module for module in sys.modules if module.partition(".")[0] == "matplotlib"]:
            del sys.modules[name]  # half of it is there
        backend = os.environ.pop("MPLBACKEND", "")
        try:
            import matplotlib as mpl
        finally:
            os.environ["MPLBACKEND"] = backend
    return mpl


@contextmanager
def fixed_style() -> Iterator[None]:
    """Draw the same everywhere: a reader's own matplotlibrc must not change the bytes."""
    mpl = matplotlib_of_files()
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_FIXED)
        yield


def draw_plot(path: Path, plot: Plot, *, kind: str, dpi: float = 160.0) -> None:
    """Draw one plot into a file of a kind: "png", of so many dots per inch, "svg" or "pdf"."""
    with fixed_style():
        figure = compose(plot, dpi=dpi)
        figure.savefig(path, format=kind, dpi=dpi, metadata=FIXED_METADATA[kind])


def compose(plot: Plot, *, dpi: float = 160.0) -> Figure:
    """Return the figure of a plot, not yet drawn; to be called and drawn inside `fixed_style`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    n = len(plot.panels)
    entries = [sum(line.in_legend for line in panel.lines) for panel in plot.panels]
    is_wide = bool(plot.key) or max(entries) > _FEW
    size = 6.4 if is_wide else 5.4, 3.8 if n == 1 else 4.8  # inch
    figure = Figure(figsize=size, dpi=dpi, layout="constrained")
    FigureCanvasAgg(figure)
    is_shared = len({panel.x_label for panel in plot.panels}) == 1
    heights = [2.0 if is_shared else 1.0, *(1.0 for _ in range(n - 1))]
    rows = figure.subplots(n, 1, sharex=is_shared, squeeze=False, height_ratios=heights)
    for axes, panel in zip(rows[:, 0], plot.panels, strict=True):
        _draw_panel(axes, panel)
        if panel is plot.panels[-1] or not is_shared:
            axes.set_xlabel(_label(panel.x_label, panel.x_unit))
    top = rows[0, 0]
    if plot.key:
        _draw_key(top, plot)
    elif entries[0] > _FEW:  # where it hides nothing: above a few lines, beside many
        top.legend(**_BESIDE, bbox_to_anchor=(1.01, 1.0), labelspacing=0.3)
    elif entries[0] > 1:
        top.legend(**_ABOVE)
    # Above a legend, or a key of styles, that stands on the axes.
    is_above = bool(plot.key) or 1 < max(entries) <= _FEW
    top.set_title(plot.title, fontsize=10, loc="left", pad=18.0 if is_above else 6.0)
    figure.align_ylabels()
    return figure


def _label(name: str, unit: str) -> str:
    return f"{name}, {unit}" if unit else name


def _draw_panel(axes: Any, panel: Panel) -> None:
    if panel.is_log:
        from matplotlib.ticker import FormatStrFormatter

        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
    for begin, end in panel.bands:
        axes.axvspan(begin, end, color="#d55e00", alpha=0.2, linewidth=0.0)
    for line in panel.lines:
        if line.style not in _BEHIND:
            _draw_line(axes, line)
    for value, word in panel.rules:
        axes.axhline(value, color=_COLOURS["muted"], linewidth=0.8, linestyle=":")
        if word:
            place = axes.get_yaxis_transform()
            axes.text(0.99, value, word, transform=place, ha="right", va="bottom", fontsize=7)
    axes.set_ylabel(_label(panel.y_label, panel.y_unit))
    axes.grid(visible=True, color="#e3e7ed", linewidth=0.6)
    axes.set_axisbelow(True)
    if panel.ticks:
        axes.set_xticks(panel.ticks, panel.tick_labels)
    if panel.x_range:
        axes.set_xlim(panel.x_range)
    if longest := max((len(line.tag) for line in panel.lines), default=0):
        axes.margins(x=0.04 + 0.012 * longest)  # room for what stands at the ends
    if panel.x_unit == "s" or panel.x_label == "absolute velocity":
        axes.margins(x=0.02)


def _draw_key(axes: Any, plot: Plot) -> None:
    """Draw what the styles are, and the settings in their order where no line is labelled."""
    from matplotlib.lines import Line2D

    lines = [line for panel in plot.panels for line in panel.lines]
    if not any(line.tag for line in lines):
        colours = {
            line.setting: line.colour
            for line in lines
            if line.setting is not None and line.colour not in _COLOURS
        }
        key = axes.legend(
            handles=[
                Line2D([], [], color=colour, linewidth=4.0, label=str(setting))
                for setting, colour in sorted(colours.items())
            ],
            title="setting",
            title_fontsize=7,
            bbox_to_anchor=(1.01, 1.02),
            ncols=1 + (len(colours) - 1) // _KEY_ROWS,
            labelspacing=0.25,
            handlelength=1.4,
            columnspacing=1.0,
            **_BESIDE,
        )
        axes.add_artist(key)
        key.set_clip_on(False)  # it stands outside of the axes
    styles = [
        Line2D([], [], color=_COLOURS["ink"], label=word, **_STYLES[style])
        for word, style in plot.key
    ]
    axes.legend(handles=styles, **_ABOVE)


def _draw_line(axes: Any, line: Line) -> None:
    colour = _COLOURS.get(line.colour, line.colour)
    style = dict(_STYLES[line.style])
    if "marker" in style:
        style.setdefault("markersize", 5.0 if len(line.x) <= _MANY else 1.0)
    style |= {"color": colour, "label": line.label if line.in_legend else "_" + line.label}
    if line.tag:
        end = int(line.x.argmax())
        axes.annotate(
            line.tag, (line.x[end], line.y[end]), (6, 0), textcoords="offset points",
            color=colour, fontsize=7, va="center",
        )  # fmt: skip
    if line.low is not None and line.high is not None and "marker" in style:
        reach = [line.y - line.low, line.high - line.y]
        axes.errorbar(line.x, line.y, yerr=reach, capsize=2.5, **style)
        return
    axes.plot(line.x, line.y, **style)
    if line.low is not None and line.high is not None:
        axes.fill_between(line.x, line.low, line.high, color=colour, alpha=0.2, linewidth=0.0)
