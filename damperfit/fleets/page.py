"""A fleet as one HTML file: who is far off, bands over the settings, every damper a line.

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
from damperfit.reporting.compared import tolerance_sheet, tolerance_table
from damperfit.reporting.figures import RUN_COLOURS, Line, Panel, Plot, setting_panel
from damperfit.reporting.figures import setting_places as places_of
from damperfit.reporting.page import PlotData, asset, draw, plotly_script
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


def series_plots(found: Survey) -> tuple[Plot, ...]:
    """Return one picture a series: median and distribution by setting, and who is far off.

    Where there are enough dampers the panel below shows how values lie around the median, which
    hardly shows where that rises. Forces stay in their unit there, as they go through nothing;
    parameters are shares of the median.
    """
    by_setting = places_of(found.settings)
    places = np.array([by_setting[one] for one in found.settings])
    ranks = {name: k for k, name in enumerate(found.outliers["damper"].unique())}
    plots = []
    for one in found.series:
        values = found.values[found.values["series"] == one.name]
        values = values.assign(x=places[values["setting"]])
        far = found.outliers[found.outliers["series"] == one.name]
        far = far.assign(x=places[far["setting"]])
        bands = values.drop_duplicates("setting")
        many = bands[bands["n_dampers"] >= LEAST_DAMPERS]
        few = values[values["n_dampers"] < LEAST_DAMPERS]
        # The power of ten, a multiple of three, that an axis of long numbers is given in.
        largest = float(bands["median"].abs().max())
        is_long = not one.stroke and _LONG <= largest < math.inf
        power = 3 * math.floor(math.log10(largest) / 3.0) if is_long else 0
        numbers = ["value", "median", "low", "high"]
        many_shown, few_shown, far_shown = (
            rows.assign(**{name: rows[name] / 10.0**power for name in numbers})
            for rows in (many, few, far)
        )
        lines = (*_middle(many_shown), *_single(few_shown), *_far(far_shown, ranks))
        unit = f"1e{power} {one.unit}" if power else one.unit
        panels = [setting_panel(found.settings, _label(one), unit, lines)]
        if not one.stroke:
            many, far = many[many["median"] != 0.0], far[far["median"] != 0.0]
        if not many.empty:
            style = "solid" if len(many) > 1 else "points"
            below = [
                Line(
                    *(many["x"].to_numpy(), np.zeros(len(many)), words, "ink"),
                    style=style,
                    low=_beside(one, many, many[ends[0]]).to_numpy(),
                    high=_beside(one, many, many[ends[1]]).to_numpy(),
                    in_legend=False,
                )
                for words, ends in (
                    ("middle 90 %", ("low", "high")),
                    ("middle half", ("quarter", "three_quarters")),
                )
            ]
            moved = far.assign(value=_beside(one, far, far["value"]))
            below += [replace(line, in_legend=False) for line in _far(moved, ranks)]
            unit = one.unit if one.stroke else "%"
            panels.append(setting_panel(found.settings, "from median", unit, below))
        plots.append(Plot(f"fleet_{one.name}", _title(one), tuple(panels)))
    return tuple(plots)


def _label(one: Series) -> str:
    return "force" if one.stroke else one.label


def _title(one: Series) -> str:
    return f"{one.label[0].upper()}{one.label[1:]}" if one.stroke else one.label


def _beside(one: Series, rows: pd.DataFrame, values: pd.Series) -> pd.Series:
    """Return how far values lie from the medians: of a force in newtons, else in per cent."""
    return (values - rows["median"]) * (1.0 if one.stroke else 100.0 / rows["median"].abs())


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
    for (name, own), colour in zip(groups, cycle(RUN_COLOURS[1:]), strict=False):
        x, y = own[["x", "value"]].to_numpy(dtype=float).T
        yield Line(x, y, str(name) or "unknown", colour, style="points")


def _far(far: pd.DataFrame, ranks: dict[str, int]) -> Iterator[Line]:
    """Yield who is far off, the farthest by name and in one colour wherever that can be."""
    names = list(far["damper"].unique())
    rest = far[far["damper"].isin(names[_NAMED:])]
    if not rest.empty:
        x, y = rest[["x", "value"]].to_numpy(dtype=float)[:_MOST_POINTS].T
        yield Line(x, y, f"{len(names) - _NAMED} more far off", "muted", style="points")
    free = list(RUN_COLOURS[1:])
    for name in sorted(names[:_NAMED], key=lambda name: ranks[name]):
        wanted = RUN_COLOURS[1 + ranks[name] % _NAMED]
        colour = wanted if wanted in free else free[0]
        free.remove(colour)
        x, y = far.loc[far["damper"] == name, ["x", "value"]].to_numpy(dtype=float).T
        yield Line(x, y, f"{name or 'unknown'}, far off", colour, style="triangles")


def trend_plots(found: Survey) -> tuple[Plot, ...]:
    """Return one picture a series over the date of the test; none where fewer than two are known.

    Shown is the difference from the median of the setting, the median of each test's settings; of
    many dates equal spans.
    """
    known = found.rows["day"].dropna()
    if known.nunique() < 2:
        return ()
    first = date(1970, 1, 1) + timedelta(days=float(known.min()))
    plots = []
    for one in found.series:
        values = found.values[found.values["series"] == one.name].dropna(subset=["day"])
        values = values[(values["n_dampers"] > 1) & (values["median"] != 0.0)]
        shares = 100.0 * (values["value"] - values["median"]) / values["median"].abs()
        rows = pd.DataFrame({"day": values["day"] - known.min(), "damper": values["damper"]})
        tests = shares.groupby([rows["day"], rows["damper"]]).median().reset_index(name="share")
        span: Any = tests["day"]
        if span.nunique() > _MOST_GROUPS:
            edges = np.linspace(0.0, np.nextafter(span.max(), np.inf), _MOST_GROUPS + 1)
            span = np.digitize(span, edges)
        groups = [own for _, own in tests.groupby(span)]
        if len(groups) < 2:
            continue
        many = [own for own in groups if len(own) >= LEAST_DAMPERS]
        few = [own for own in groups if len(own) < LEAST_DAMPERS]
        lines = []
        if few:
            x = np.concatenate([np.full(len(own), own["day"].mean()) for own in few])
            y = np.concatenate([own["share"] for own in few])
            lines.append(Line(x, y, "a damper", "muted", style="points"))
        lines += _middle(
            pd.DataFrame(
                [
                    (own["day"].mean(), *np.percentile(own["share"], (50.0, 5.0, 95.0)))
                    for own in many
                ],
                columns=["x", "median", "low", "high"],
            )
        )
        label = f"days since {first.isoformat()}"
        panel = Panel(label, "", "from the median", "%", tuple(lines), rules=((0.0, ""),))
        plots.append(Plot(f"fleet_trend_{one.name}", f"{_title(one)} over the date", (panel,)))
    return tuple(plots)


# The page and its tables


def write_page(folder: Path, found: Survey) -> Path:
    """Write ``fleet.html``, and beside it whole tables of what it shows the worst of.

    An InstallationError: plotly is not installed; an OutputError: the files cannot be written.
    """
    page = fleet_page(found, title=folder.resolve().parent.name)
    names = ["damper", "series", "setting", "value", "median", "low", "high", "distance"]
    settings = [str(found.settings[k]) for k in found.outliers["setting"]]
    outliers = found.outliers.assign(setting=settings)[names].astype({"setting": str})
    tables = {
        "dampers": pa.Table.from_pylist([one._asdict() for one in found.dampers]),
        "outliers": pa.Table.from_pandas(outliers, preserve_index=False),
        "run_rules": _table(found.rules, RULE_COLUMNS),
    }
    if found.held is not None:
        tables["capability"] = _table(found.capability, CAPABILITY_COLUMNS)
        tables["tolerance"] = tolerance_table(found.held.missed)
    with file_set(folder) as files:
        files.path("fleet.html").write_bytes(page.encode("utf-8", "backslashreplace"))
        files.path("plotly.min.js").write_text(plotly_script(), encoding="utf-8")
        for name, table in tables.items():
            write_table(files.path(f"{COLLECTED}_{name}.csv"), table, suffix=".csv")
    return folder / "fleet.html"


def _table(rows: Rows, names: Sequence[str]) -> pa.Table:
    return pa.Table.from_pandas(pd.DataFrame(rows, columns=list(names)), preserve_index=False)


def fleet_page(found: Survey, *, title: str) -> str:
    """Return a fleet, and its forces held against a tolerance, as one self-contained HTML page."""
    data = PlotData()
    plots = list(zip(found.series, series_plots(found), strict=True))
    forces = [data.add(plot) for one, plot in plots if one.stroke]
    groups = [
        ("Force at named speeds by setting", forces),
        ("Parameters by setting", [data.add(plot) for one, plot in plots if not one.stroke]),
        ("Over the date of the test", [data.add(one) for one in trend_plots(found)]),
    ]
    tolerance = None
    if (held := found.held) is not None:
        note = "Shown is the worst point of each damper; all are in fleet_tolerance.csv."
        worst = replace(tolerance_sheet(held.worst[:MOST_LINES]), notes=(note,))
        tolerance = (held.source, held.sentence, worst)
    return draw(
        "fleet.html",
        title=title,
        version=__version__,
        style=asset("page.css"),
        sentences=_sentences(found),
        tolerance=tolerance,
        capability=capability_sheet(found.capability, MOST_LINES) if found.capability else None,
        shifts=found.shifts[:_MOST_SHIFTS],
        outliers=outlier_sheet(found, most=MOST_LINES),
        groups=groups,
        dampers=damper_sheet(found.dampers, most=MOST_LINES),
        data=data.script({}),
        script=asset("page.js"),
    )


def _sentences(found: Survey) -> list[str]:
    def counted(n: int, word: str) -> str:
        return f"{n} {word}{'' if n == 1 else 's'}"

    n_failed = sum(bool(one.n_failures) for one in found.dampers)
    n_poor = sum(one.grade in {"poor", "withheld"} for one in found.dampers)
    n_far = sum(bool(one.n_outliers) for one in found.dampers)
    first = (
        f"{counted(len(found.dampers), 'damper')}, {counted(len(found.rows), 'setting')} with a "
        f"fit; {n_failed or 'none'} with failures, {n_poor or 'none'} with a poor or withheld "
        f"grade, {n_far or 'none'} far from the others."
    )
    sentences = [first]
    if not (found.values["n_dampers"] >= LEAST_DAMPERS).any():
        sentences.append(
            f"No setting has {LEAST_DAMPERS} dampers, so none is called far off: the pictures show "
            "them one by one."
        )
    return sentences


def outlier_sheet(found: Survey, *, most: int | None = None) -> Sheet:
    """Return the dampers that are far off, so many at most, each with its farthest value."""
    series = {one.name: one for one in found.series}
    n_values = found.outliers["damper"].value_counts()
    columns = [
        Column("damper", "", lambda far: far.damper or "unknown", is_number=False),
        Column("farthest in", "", lambda far: series[far.series].label, is_number=False),
        Column("set", "", lambda far: str(found.settings[far.setting])),
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
        f"each damper; all {len(found.outliers)} are in fleet_outliers.csv."
    )
    farthest = found.outliers.drop_duplicates("damper")
    return laid_out(list(farthest.itertuples())[:most], columns, note)


def damper_sheet(dampers: Sequence[Any], *, most: int | None = None) -> Sheet:
    """Return every damper in a line; of many those with failures, far off, or the worst MSE."""

    def badness(one: Any) -> tuple[int, int, float]:
        error = one.worst_mse if math.isfinite(one.worst_mse) else math.inf
        return -one.n_failures, -one.n_outliers, -error

    shown, notes = list(dampers), []
    if most is not None and len(shown) > most:
        shown = sorted(shown, key=badness)[:most]
        notes.append(
            f"The worst {most} of {len(dampers)}: failures, values far off, largest MSE. All are "
            "in fleet_dampers.csv."
        )
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
