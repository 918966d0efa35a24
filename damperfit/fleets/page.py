"""A fleet as one HTML file: dampers far off, bands over the settings, every damper a line.

Its size does not grow with the fleet: a picture has one band and a bounded number of points, tables
show the worst, the rest stands in CSV files.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import date, timedelta
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from damperfit import __version__
from damperfit.fleets.parts import COLLECTED
from damperfit.fleets.survey import (
    CAPABILITY_COLUMNS,
    FAR_OFF,
    LEAST_DAMPERS,
    RULE_COLUMNS,
    Rows,
    Series,
    Survey,
    capability_sheet,
)
from damperfit.problem import counted
from damperfit.reporting.compared import tolerance_sheet, tolerance_table
from damperfit.reporting.page import PlotData, asset, draw, plotly_script
from damperfit.reporting.plots import RUN_COLOURS, Line, Panel, Plot, setting_panel
from damperfit.reporting.plots import setting_places as places_of
from damperfit.reporting.sheet import NOTHING, Column, Sheet, laid_out, number
from damperfit.store import file_set
from damperfit.tables.files import write_table

_NAMED = 6  # dampers of one picture that have a colour and a name of their own
_MOST_POINTS = 500  # of the others that are far off
_MOST_GROUPS = 60  # of dates
_MOST_SHIFTS = 20
_LONG = 1e4  # a number from here on is long beside an axis
MOST_LINES = 200  # of a table on the page


# Pictures


def series_plots(fleet: Survey) -> tuple[Plot, ...]:
    """Return one picture a series: median and distribution by setting, and dampers far off.

    Where there are enough dampers a second panel shows the differences from the median: of forces
    in newtons, as these may be zero, of parameters in per cent.
    """
    by_setting = places_of(fleet.settings)
    places = np.array([by_setting[setting] for setting in fleet.settings])
    ranks = {name: k for k, name in enumerate(fleet.outliers["damper"].unique())}
    plots = []
    for series in fleet.series:
        values = fleet.values[fleet.values["series"] == series.name]
        values = values.assign(x=places[values["setting"]])
        far = fleet.outliers[fleet.outliers["series"] == series.name]
        far = far.assign(x=places[far["setting"]])
        medians = values.drop_duplicates("setting")
        bands = medians[medians["n_dampers"] >= LEAST_DAMPERS]
        single = values[values["n_dampers"] < LEAST_DAMPERS]
        # The power of ten, a multiple of three, that an axis of long numbers is given in.
        largest = float(medians["median"].abs().max())
        is_long = not series.stroke and _LONG <= largest < math.inf
        power = 3 * math.floor(math.log10(largest) / 3.0) if is_long else 0
        numbers = ["value", "median", "low", "high"]
        bands_scaled, single_scaled, far_scaled = (
            rows.assign(**{name: rows[name] / 10.0**power for name in numbers})
            for rows in (bands, single, far)
        )
        lines = (*_middle(bands_scaled), *_single(single_scaled), *_far(far_scaled, ranks))
        unit = f"1e{power} {series.unit}" if power else series.unit
        panels = [setting_panel(fleet.settings, _label(series), unit, lines)]
        if not series.stroke:
            bands, far = bands[bands["median"] != 0.0], far[far["median"] != 0.0]
        if not bands.empty:
            style = "solid" if len(bands) > 1 else "points"
            below = [
                Line(
                    *(bands["x"].to_numpy(), np.zeros(len(bands)), label, "ink"),
                    style=style,
                    low=_from_median(series, bands, bands[low]).to_numpy(),
                    high=_from_median(series, bands, bands[high]).to_numpy(),
                    in_legend=False,
                )
                for label, low, high in (
                    ("middle 90 %", "low", "high"),
                    ("middle half", "quarter", "three_quarters"),
                )
            ]
            relative = far.assign(value=_from_median(series, far, far["value"]))
            below += [replace(line, in_legend=False) for line in _far(relative, ranks)]
            unit = series.unit if series.stroke else "%"
            panels.append(setting_panel(fleet.settings, "from median", unit, below))
        plots.append(Plot(f"fleet_{series.name}", _title(series), tuple(panels)))
    return tuple(plots)


def _label(series: Series) -> str:
    return "force" if series.stroke else series.label


def _title(series: Series) -> str:
    return f"{series.label[0].upper()}{series.label[1:]}" if series.stroke else series.label


def _from_median(series: Series, rows: pd.DataFrame, values: pd.Series) -> pd.Series:
    """Return the difference from the medians: of a force in newtons, else in per cent."""
    return (values - rows["median"]) * (1.0 if series.stroke else 100.0 / rows["median"].abs())


def _middle(bands: pd.DataFrame) -> Iterator[Line]:
    """Yield the median with its band; bars where no band has a width."""
    if not bands.empty:
        x, y, low, high = bands[["x", "median", "low", "high"]].to_numpy(dtype=float).T
        style = "solid" if len(bands) > 1 else "points"
        yield Line(x, y, "median, middle 90 %", "ink", style=style, low=low, high=high)


def _single(values: pd.DataFrame) -> Iterator[Line]:
    """Yield the dampers themselves at settings that few have."""
    groups = list(values.groupby("damper", sort=False))
    if len(groups) > _NAMED:
        groups = [("settings that few have", values.iloc[:_MOST_POINTS])]
    for (name, rows), colour in zip(groups, cycle(RUN_COLOURS[1:]), strict=False):
        x, y = rows[["x", "value"]].to_numpy(dtype=float).T
        yield Line(x, y, str(name) or "unknown", colour, style="points")


def _far(far: pd.DataFrame, ranks: dict[str, int]) -> Iterator[Line]:
    """Yield the dampers far off, the farthest by name, each in one colour where possible."""
    names = list(far["damper"].unique())
    unnamed = far[far["damper"].isin(names[_NAMED:])]
    if not unnamed.empty:
        x, y = unnamed[["x", "value"]].to_numpy(dtype=float)[:_MOST_POINTS].T
        yield Line(x, y, f"{len(names) - _NAMED} more far off", "muted", style="points")
    free = list(RUN_COLOURS[1:])
    for name in sorted(names[:_NAMED], key=lambda name: ranks[name]):
        preferred = RUN_COLOURS[1 + ranks[name] % _NAMED]
        colour = preferred if preferred in free else free[0]
        free.remove(colour)
        x, y = far.loc[far["damper"] == name, ["x", "value"]].to_numpy(dtype=float).T
        yield Line(x, y, f"{name or 'unknown'}, far off", colour, style="triangles")


def trend_plots(fleet: Survey) -> tuple[Plot, ...]:
    """Return one picture a series over the date of the test; none with fewer than two dates.

    A test is the median, over its settings, of the difference from the setting's median. Many dates
    are joined in equal spans.
    """
    days = fleet.rows["day"].dropna()
    if days.nunique() < 2:
        return ()
    start = date(1970, 1, 1) + timedelta(days=float(days.min()))
    plots = []
    for series in fleet.series:
        values = fleet.values[fleet.values["series"] == series.name].dropna(subset=["day"])
        values = values[(values["n_dampers"] > 1) & (values["median"] != 0.0)]
        shares = 100.0 * (values["value"] - values["median"]) / values["median"].abs()
        rows = pd.DataFrame({"day": values["day"] - days.min(), "damper": values["damper"]})
        tests = shares.groupby([rows["day"], rows["damper"]]).median().reset_index(name="share")
        span: Any = tests["day"]
        if span.nunique() > _MOST_GROUPS:
            edges = np.linspace(0.0, np.nextafter(span.max(), np.inf), _MOST_GROUPS + 1)
            span = np.digitize(span, edges)
        groups = [group for _, group in tests.groupby(span)]
        if len(groups) < 2:
            continue
        large = [group for group in groups if len(group) >= LEAST_DAMPERS]
        small = [group for group in groups if len(group) < LEAST_DAMPERS]
        lines = []
        if small:
            x = np.concatenate([np.full(len(group), group["day"].mean()) for group in small])
            y = np.concatenate([group["share"] for group in small])
            lines.append(Line(x, y, "a damper", "muted", style="points"))
        shares_of = [(group["day"].mean(), group["share"]) for group in large]
        bands = [(day, *np.percentile(column, (50.0, 5.0, 95.0))) for day, column in shares_of]
        lines += _middle(pd.DataFrame(bands, columns=["x", "median", "low", "high"]))
        label = f"days since {start.isoformat()}"
        panel = Panel(label, "", "from the median", "%", tuple(lines), rules=((0.0, ""),))
        title = f"{_title(series)} over the date"
        plots.append(Plot(f"fleet_trend_{series.name}", title, (panel,)))
    return tuple(plots)


# The page and its tables


def write_page(folder: Path, fleet: Survey) -> Path:
    """Write ``fleet.html``, and beside it the whole tables of which it shows the worst.

    An InstallationError: plotly is not installed; an OutputError: the files cannot be written.
    """
    page = fleet_page(fleet, title=f"Fleet {folder.resolve().parent.name}")
    names = ["damper", "series", "setting", "value", "median", "low", "high", "distance"]
    settings = [str(fleet.settings[k]) for k in fleet.outliers["setting"]]
    outliers = fleet.outliers.assign(setting=settings)[names].astype({"setting": str})
    tables = {
        "dampers": pa.Table.from_pylist([damper._asdict() for damper in fleet.dampers]),
        "outliers": pa.Table.from_pandas(outliers, preserve_index=False),
        "run_rules": _table(fleet.rules, RULE_COLUMNS),
    }
    if fleet.check is not None:
        tables["capability"] = _table(fleet.capability, CAPABILITY_COLUMNS)
        tables["tolerance"] = tolerance_table(fleet.check.missed)
    with file_set(folder) as files:
        files.path("fleet.html").write_bytes(page.encode("utf-8", "backslashreplace"))
        files.path("plotly.min.js").write_text(plotly_script(), encoding="utf-8")
        for name, table in tables.items():
            write_table(files.path(f"{COLLECTED}_{name}.csv"), table, suffix=".csv")
    return folder / "fleet.html"


def _table(rows: Rows, names: Sequence[str]) -> pa.Table:
    return pa.Table.from_pandas(pd.DataFrame(rows, columns=list(names)), preserve_index=False)


def fleet_page(fleet: Survey, *, title: str) -> str:
    """Return a fleet, with its comparison with a tolerance, as one self-contained HTML page."""
    data = PlotData()
    plots = list(zip(fleet.series, series_plots(fleet), strict=True))
    forces = [data.add(plot) for series, plot in plots if series.stroke]
    groups = [
        ("Force at named speeds by setting", forces),
        ("Parameters by setting", [data.add(plot) for series, plot in plots if not series.stroke]),
        ("Over the date of the test", [data.add(plot) for plot in trend_plots(fleet)]),
    ]
    tolerance = None
    if (check := fleet.check) is not None:
        note = "Shown is the worst point of each damper; all are in fleet_tolerance.csv."
        worst = replace(tolerance_sheet(check.worst[:MOST_LINES]), notes=(note,))
        tolerance = (check.source, check.sentence, worst)
    return draw(
        "fleet.html",
        title=title,
        version=__version__,
        style=asset("page.css"),
        sentences=_sentences(fleet),
        tolerance=tolerance,
        capability=capability_sheet(fleet.capability, MOST_LINES) if fleet.capability else None,
        shifts=fleet.shifts[:_MOST_SHIFTS],
        outliers=outlier_sheet(fleet),
        groups=groups,
        dampers=damper_sheet(fleet.dampers),
        data=data.script({}),
        script=asset("page.js"),
    )


def _sentences(fleet: Survey) -> list[str]:
    n_failed = sum(bool(damper.n_failures) for damper in fleet.dampers)
    n_poor = sum(damper.grade in {"poor", "withheld"} for damper in fleet.dampers)
    n_far = sum(bool(damper.n_outliers) for damper in fleet.dampers)
    first = (
        f"{counted(len(fleet.dampers), 'damper')}, {counted(len(fleet.rows), 'setting')} with a "
        f"fit; {n_failed or 'none'} with failures, {n_poor or 'none'} with a poor or withheld "
        f"grade, {n_far or 'none'} far from the others."
    )
    sentences = [first]
    if not (fleet.values["n_dampers"] >= LEAST_DAMPERS).any():
        sentences.append(
            f"No setting has {LEAST_DAMPERS} dampers, so none is called far off: the pictures show "
            "them one by one."
        )
    return sentences


def outlier_sheet(fleet: Survey) -> Sheet:
    """Return the first of the dampers that are far off, each with its farthest value."""
    series = {column.name: column for column in fleet.series}
    n_values = fleet.outliers["damper"].value_counts()
    columns = [
        Column("damper", "", lambda far: far.damper or "unknown", is_number=False),
        Column("farthest in", "", lambda far: series[far.series].label, is_number=False),
        Column("set", "", lambda far: str(fleet.settings[far.setting])),
        Column("value", "", lambda far: number(far.value)),
        Column("unit", "", lambda far: series[far.series].unit, is_number=False),
        Column("median", "", lambda far: number(far.median)),
        Column("5 % to 95 %", "", lambda far: f"{number(far.low)} to {number(far.high)}"),
        Column("distance", "", lambda far: f"{far.distance:+.1f}"),
        Column("more values", "", lambda far: str(n_values[far.damper] - 1 or NOTHING)),
    ]
    note = (
        f"Far off: more than {FAR_OFF:g} median absolute deviations from the median of its setting "
        f"(distance), which at least {LEAST_DAMPERS} dampers have. Shown is the farthest value of "
        f"each damper; all {len(fleet.outliers)} are in fleet_outliers.csv."
    )
    farthest = fleet.outliers.drop_duplicates("damper")
    return laid_out(list(farthest.itertuples())[:MOST_LINES], columns, note)


def damper_sheet(dampers: Sequence[Any], *, most: int = MOST_LINES) -> Sheet:
    """Return a line a damper; of many those with failures, far off, or with the largest MSE."""

    def badness(damper: Any) -> tuple[int, int, float]:
        error = damper.worst_mse if math.isfinite(damper.worst_mse) else math.inf
        return -damper.n_failures, -damper.n_outliers, -error

    rows, notes = list(dampers), []
    if len(rows) > most:
        rows = sorted(rows, key=badness)[:most]
        notes.append(
            f"The worst {most} of {len(dampers)}: failures, values far off, largest MSE. All are "
            "in fleet_dampers.csv."
        )
    columns = [
        Column("damper", "", lambda damper: damper.damper or "unknown", is_number=False),
        Column("settings", "", lambda damper: str(damper.n_settings)),
        Column("worst MSE", "%", lambda damper: number(damper.worst_mse, digits=3)),
        Column("at set", "", lambda damper: damper.worst_setting or NOTHING),
        Column("grade", "", lambda damper: damper.grade or NOTHING, is_number=False),
        Column("failures", "", lambda damper: str(damper.n_failures or NOTHING)),
        Column("far off", "", lambda damper: str(damper.n_outliers or NOTHING)),
        Column("date", "", lambda damper: damper.date or NOTHING, is_number=False),
        Column("first failure", "", lambda damper: damper.error, is_number=False),
    ]
    return laid_out(rows, columns, *notes)
