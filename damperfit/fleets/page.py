"""A fleet as one HTML file: who is far off, bands over the settings, every damper a line.

Its size does not grow with the fleet: tables show the worst, the rest stands in CSV files.
"""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from datetime import date, timedelta
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa

from damperfit import __version__
from damperfit.fleets.parts import COLLECTED
from damperfit.fleets.survey import FAR_OFF, LEAST_DAMPERS
from damperfit.reporting.compared import tolerance_rows, tolerance_sheet, tolerance_table
from damperfit.reporting.figures import (
    RUN_COLOURS,
    Line,
    Panel,
    Plot,
    setting_axis,
    setting_names,
    setting_places,
)
from damperfit.reporting.page import PlotData, asset, draw, plotly_script
from damperfit.reporting.sheet import NOTHING, Column, laid_out, number
from damperfit.store import file_set
from damperfit.tables.files import write_table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.fleets.survey import DamperLine, FarOff, HeldFleet, Series, Survey
    from damperfit.reporting.sheet import Sheet
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

# Pictures of a fleet: medians and bands over the settings, who is far off, change by date.
#
# However many dampers there are, a picture has one band and a bounded number of points.

_NAMED = 6  # dampers of one picture that have a colour and a name of their own
_MOST_POINTS = 500  # of the others that are far off
_MOST_GROUPS = 60  # of dates
_EDGES = (5.0, 25.0, 75.0, 95.0)  # per cent
_LONG = 1e4  # a number from here on is long beside an axis


def series_plots(found: Survey) -> tuple[Plot, ...]:
    """Return one picture a series: median and distribution by setting, and who is far off."""
    far: dict[str, list[FarOff]] = {}
    for one in found.outliers:
        far.setdefault(one.series, []).append(one)
    settings = sorted(set(found.settings))
    ranks = {name: k for k, name in enumerate(dict.fromkeys(o.damper for o in found.outliers))}
    return tuple(
        _series_plot(one, settings, far.get(one.name, ()), found.names, ranks)
        for one in found.series
    )


def _series_plot(
    series: Series,
    settings: Sequence[Setting],
    far: Sequence[FarOff],
    names: NDArray[np.object_],
    ranks: dict[str, int],
) -> Plot:
    places = setting_places(settings)
    ticks, shown = setting_axis(settings)
    power = _power(series)
    lines = [
        _over(line, 10.0**power)
        for line in (
            *_middle(series, places),
            *_single(series, places, names),
            *_far(far, places, ranks),
        )
    ]
    unit = f"1e{power} {series.unit}" if power else series.unit
    panel = Panel(
        *("setting", "", "force" if series.stroke else series.label, unit, tuple(lines)),
        ticks=ticks,
        names=setting_names(settings),
        x_range=shown,
    )
    title = series.label[0].upper() + series.label[1:] if series.stroke else series.label
    beside = tuple(_beside(series, far, places, ranks))
    if not beside:
        return Plot(f"fleet_{series.name}", title, (panel,))
    unit = series.unit if series.stroke else "%"
    below = replace(panel, lines=beside, y_label="from median", y_unit=unit)
    return Plot(f"fleet_{series.name}", title, (panel, below))


def _power(series: Series) -> int:
    """Return the power of ten, a multiple of three, that an axis of long numbers is given in."""
    largest = max(abs(band.median) for band in series.bands)
    is_long = not series.stroke and _LONG <= largest < math.inf
    return 3 * math.floor(math.log10(largest) / 3.0) if is_long else 0


def _over(line: Line, factor: float) -> Line:
    low, high = (None if one is None else one / factor for one in (line.low, line.high))
    return replace(line, y=line.y / factor, low=low, high=high)


def _beside(
    series: Series, far: Sequence[FarOff], places: dict[Setting, float], ranks: dict[str, int]
) -> Iterator[Line]:
    """Yield how values are distributed around the median, which hardly shows where that rises.

    Forces stay in their unit, as they go through nothing; parameters are shares of the median.
    """
    known = {
        band.setting: 1.0 if series.stroke else 100.0 / abs(band.median)
        for band in series.bands
        if band.n_dampers >= LEAST_DAMPERS and (series.stroke or band.median)
    }
    spread = [
        known[band.setting] * (np.percentile(series.values[band.rows], _EDGES) - band.median)
        for band in series.bands
        if band.setting in known
    ]
    if not spread:
        return
    x = np.array([places[setting] for setting in known])
    lowest, low, high, highest = np.array(spread).T
    style = "solid" if len(known) > 1 else "points"
    zero = np.zeros(len(x))
    for words, ends in (("middle 90 %", (lowest, highest)), ("middle half", (low, high))):
        yield Line(
            *(x, zero, words, "ink"), style=style, low=ends[0], high=ends[1], in_legend=False
        )
    moved = [
        replace(one, value=known[one.setting] * (one.value - one.median))
        for one in far
        if one.setting in known
    ]
    yield from (replace(line, in_legend=False) for line in _far(moved, places, ranks))


def _middle(series: Series, places: dict[Setting, float]) -> Iterator[Line]:
    """Yield the median with its band, where there are enough dampers for one."""
    many = [band for band in series.bands if band.n_dampers >= LEAST_DAMPERS]
    if many:
        x = np.array([places[band.setting] for band in many])
        median, low, high = np.array([(band.median, band.low, band.high) for band in many]).T
        # Bars where no band has a width.
        style = "solid" if len(many) > 1 else "points"
        yield Line(x, median, "median, middle 90 %", "ink", style=style, low=low, high=high)


def _single(
    series: Series, places: dict[Setting, float], names: NDArray[np.object_]
) -> Iterator[Line]:
    """Yield the dampers themselves at settings that few have."""
    few = [band for band in series.bands if band.n_dampers < LEAST_DAMPERS]
    points: dict[str, list[tuple[float, float]]] = {}
    for band in few:
        for row in band.rows:
            point = (places[band.setting], float(series.values[row]))
            points.setdefault(str(names[row]), []).append(point)
    if len(points) > _NAMED:
        together = [point for own in points.values() for point in own][:_MOST_POINTS]
        points = {"settings that few have": together}
    colours = cycle(RUN_COLOURS[1:])
    for (name, own), colour in zip(points.items(), colours, strict=False):
        x, y = np.array(own).T
        yield Line(x, y, name or "unknown", colour, style="points")


def _far(
    far: Sequence[FarOff], places: dict[Setting, float], ranks: dict[str, int]
) -> Iterator[Line]:
    """Yield who is far off, the farthest by name and in one colour wherever that can be."""
    points: dict[str, list[tuple[float, float]]] = {}
    for one in far:
        points.setdefault(one.damper, []).append((places[one.setting], one.value))
    named = dict(list(points.items())[:_NAMED])
    rest = [point for name, own in points.items() if name not in named for point in own]
    if rest:
        x, y = np.array(rest[:_MOST_POINTS]).T
        yield Line(x, y, f"{len(points) - len(named)} more far off", "muted", style="points")
    free = list(RUN_COLOURS[1:])
    for name in sorted(named, key=lambda name: ranks[name]):
        wanted = RUN_COLOURS[1 + ranks[name] % _NAMED]
        colour = wanted if wanted in free else free[0]
        free.remove(colour)
        x, y = np.array(named[name]).T
        yield Line(x, y, f"{name or 'unknown'}, far off", colour, style="triangles")


def trend_plots(found: Survey) -> tuple[Plot, ...]:
    """Return one picture a series over the date of the test; none where fewer than two are known.

    Shown is the difference from the median of the setting, the median of each test's settings.
    """
    known = found.days[np.isfinite(found.days)]
    if len(np.unique(known)) < 2:
        return ()
    first = date(1970, 1, 1) + timedelta(days=float(known.min()))
    plots = []
    for series in found.series:
        groups = _groups(found, series, found.days - known.min())
        if len(groups) < 2:
            continue
        panel = Panel(
            f"days since {first.isoformat()}",
            "",
            "from the median",
            "%",
            tuple(_over_time(groups)),
            rules=((0.0, ""),),
        )
        title = f"{series.label[0].upper()}{series.label[1:]}" if series.stroke else series.label
        plots.append(Plot(f"fleet_trend_{series.name}", f"{title} over the date", (panel,)))
    return tuple(plots)


def _groups(found: Survey, series: Series, days: FloatArray) -> list[tuple[float, FloatArray]]:
    """Return days, or equal spans of them where there are many, and the change of each damper.

    In per cent of the median of its setting; of several settings of a day the median.
    """
    shares = np.full(len(series.values), np.nan)
    for band in series.bands:
        if band.median and band.n_dampers > 1:
            mine = series.values[band.rows]
            shares[band.rows] = 100.0 * (mine - band.median) / abs(band.median)
    rows = pd.DataFrame({"day": days, "damper": found.names, "share": shares}).dropna()
    tests = rows.groupby(["day", "damper"])["share"].median().reset_index()
    span: Any = tests["day"]
    if span.nunique() > _MOST_GROUPS:
        edges = np.linspace(0.0, np.nextafter(span.max(), np.inf), _MOST_GROUPS + 1)
        span = np.digitize(span, edges)
    return [(float(own["day"].mean()), own["share"].to_numpy()) for _, own in tests.groupby(span)]


def _over_time(groups: Sequence[tuple[float, FloatArray]]) -> Iterator[Line]:
    many = [(day, *np.percentile(own, (50.0, 5.0, 95.0))) for day, own in groups if _is_many(own)]
    few = [(day, value) for day, own in groups if not _is_many(own) for value in own]
    if few:
        x, y = np.array(few).T
        yield Line(x, y, "a damper", "muted", style="points")
    if many:
        x, y, low, high = np.array(many).T
        style = "solid" if len(many) > 1 else "points"
        yield Line(x, y, "median, middle 90 %", "ink", style=style, low=low, high=high)


def _is_many(values: FloatArray) -> bool:
    return len(values) >= LEAST_DAMPERS


_OUTLIERS = pa.schema(
    [
        *(pa.field(name, pa.string()) for name in ("damper", "series", "setting")),
        *(pa.field(name, pa.float64()) for name in ("value", "median", "low", "high", "distance")),
    ]
)
MOST_LINES = 200  # of a table on the page


def fleet_page(found: Survey, held: HeldFleet | None = None, *, title: str) -> str:
    """Return a fleet as one self-contained HTML page.

    Parameters
    ----------
    found : Survey
        What its table tells.
    held : HeldFleet, optional
        Its forces held against a tolerance.
    title : str
        Heading, as a rule the name of the folder; escaped here.

    Raises
    ------
    InstallationError
        plotly is not installed.
    """
    data = PlotData()
    by_setting = series_plots(found)
    is_force = [bool(one.stroke) for one in found.series]
    groups = [
        (
            f"{heading} by setting",
            [
                data.add(plot)
                for plot, force in zip(by_setting, is_force, strict=True)
                if force is f
            ],
        )
        for heading, f in (("Force at named speeds", True), ("Parameters", False))
    ]
    groups.append(("Over the date of the test", [data.add(one) for one in trend_plots(found)]))
    tolerance = None
    if held is not None:
        worst = tolerance_sheet(held.worst[:MOST_LINES])
        note = "Shown is the worst point of each damper; all are in fleet_tolerance.csv."
        tolerance = (held.source, held.sentence, replace(worst, notes=(note,)))
    return draw(
        "fleet.html",
        title=title,
        version=__version__,
        style=asset("page.css"),
        sentences=_sentences(found),
        tolerance=tolerance,
        outliers=outlier_sheet(found, most=MOST_LINES),
        groups=groups,
        dampers=damper_sheet(found.dampers, most=MOST_LINES),
        data=data.script({}),
        script=asset("page.js"),
    )


def write_page(folder: Path, found: Survey, held: HeldFleet | None = None) -> None:
    """Write ``fleet.html``, and beside it whole tables of what it shows the worst of.

    Parameters
    ----------
    folder : pathlib.Path
        Inside that of the fleet.
    found : Survey
        What its table tells.
    held : HeldFleet, optional
        Its forces held against a tolerance.

    Raises
    ------
    InstallationError
        plotly is not installed.
    OutputError
        The files cannot be written.
    """
    page = fleet_page(found, held, title=folder.resolve().parent.name)
    tables = {
        "dampers": pa.Table.from_pylist([asdict(one) for one in found.dampers]),
        "outliers": pa.Table.from_pylist(
            [{**asdict(one), "setting": str(one.setting)} for one in found.outliers], _OUTLIERS
        ),
    }
    if held is not None:
        tables["tolerance"] = tolerance_table(tolerance_rows(held.missed))
    with file_set(folder) as files:
        files.path("fleet.html").write_bytes(page.encode("utf-8", "backslashreplace"))
        files.path("plotly.min.js").write_text(plotly_script(), encoding="utf-8")
        for name, table in tables.items():
            write_table(files.path(f"{COLLECTED}_{name}.csv"), table, suffix=".csv")


def _sentences(found: Survey) -> list[str]:
    n_failed = sum(bool(one.n_failures) for one in found.dampers)
    n_poor = sum(one.grade in {"poor", "withheld"} for one in found.dampers)
    n_far = sum(bool(one.n_outliers) for one in found.dampers)
    first = (
        f"{_counted(len(found.dampers), 'damper')}, {_counted(len(found.settings), 'setting')} "
        f"with a fit; {n_failed or 'none'} with failures, {n_poor or 'none'} with a poor or "
        f"withheld grade, {n_far or 'none'} far from the others."
    )
    said = [first]
    if not any(b.n_dampers >= LEAST_DAMPERS for one in found.series for b in one.bands):
        few = f"No setting has {LEAST_DAMPERS} dampers, so none is called far off"
        said.append(f"{few}: the pictures show them one by one.")
    return said


def _counted(number_of: int, word: str) -> str:
    return f"{number_of} {word}{'' if number_of == 1 else 's'}"


def outlier_sheet(found: Survey, *, most: int | None = None) -> Sheet:
    """Return the dampers that are far off, each with its farthest value.

    Parameters
    ----------
    found : Survey
        Of the fleet.
    most : int, optional
        Lines; all of them by default.
    """
    series = {one.name: one for one in found.series}
    own: dict[str, list[FarOff]] = {}
    for one in found.outliers:
        own.setdefault(one.damper, []).append(one)
    columns = [
        Column("damper", "", lambda far: far[0].damper or "unknown", is_number=False),
        Column("farthest in", "", lambda far: series[far[0].series].label, is_number=False),
        Column("set", "", lambda far: str(far[0].setting)),
        Column("value", "", lambda far: number(far[0].value)),
        Column("unit", "", lambda far: series[far[0].series].unit, is_number=False),
        Column("median", "", lambda far: number(far[0].median)),
        Column("5 % to 95 %", "", lambda far: f"{number(far[0].low)} to {number(far[0].high)}"),
        Column("distance", "", lambda far: f"{far[0].distance:+.1f}"),
        Column("more values", "", lambda far: str(len(far) - 1 or NOTHING)),
    ]
    note = (
        f"Far off: more than {FAR_OFF:g} median absolute deviations from the median of its setting "
        f"(distance), which at least {LEAST_DAMPERS} dampers have. Shown is the farthest value of "
        f"each damper; all {len(found.outliers)} are in fleet_outliers.csv."
    )
    return laid_out(list(own.values())[:most], columns, note)


def damper_sheet(dampers: Sequence[DamperLine], *, most: int | None = None) -> Sheet:
    """Return every damper in a line; of many those with failures, far off, or the worst MSE.

    Parameters
    ----------
    dampers : sequence of DamperLine
        By serial number, which they keep where all are shown.
    most : int, optional
        Lines; all of them by default.
    """
    shown = list(dampers)
    notes: tuple[str, ...] = ()
    if most is not None and len(shown) > most:
        shown = sorted(shown, key=_badness)[:most]
        note = (
            f"The worst {most} of {len(dampers)}: failures, values far off, largest MSE. All are "
            "in fleet_dampers.csv."
        )
        notes = (note,)
    columns = [
        Column("damper", "", lambda one: one.damper or "unknown", is_number=False),
        Column("settings", "", lambda one: str(one.n_settings)),
        Column("worst MSE", "%", lambda one: number(one.worst_mse, digits=3)),
        Column("at set", "", lambda one: one.worst_setting or NOTHING),
        Column("grade", "", lambda one: one.grade or NOTHING, is_number=False),
        Column("failures", "", lambda one: str(one.n_failures or NOTHING)),
        Column("far off", "", lambda one: str(one.n_outliers or NOTHING)),
        Column("date", "", lambda one: one.date or NOTHING, is_number=False),
        Column("first failure", "", lambda one: one.error, is_number=False),
    ]
    return laid_out(shown, columns, *notes)


def _badness(one: DamperLine) -> tuple[int, int, float]:
    error = one.worst_mse if math.isfinite(one.worst_mse) else math.inf
    return -one.n_failures, -one.n_outliers, -error
