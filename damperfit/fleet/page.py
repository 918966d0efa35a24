"""A fleet as one HTML file: who is far off, bands over the settings, every damper a line.

Its size does not grow with the fleet: tables show the worst, the rest stands in CSV files.
"""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import pyarrow as pa

from damperfit import __version__
from damperfit.fleet.parts import COLLECTED
from damperfit.fleet.survey import FAR_OFF, LEAST_DAMPERS
from damperfit.fleet.survey_plots import series_plots, trend_plots
from damperfit.report.compared import tolerance_rows, tolerance_sheet, tolerance_table
from damperfit.report.page import PlotData, asset, draw, plotly_script
from damperfit.report.rounding import NOTHING, number
from damperfit.report.sheet import Sheet
from damperfit.store import file_set
from damperfit.tables import write_table

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from damperfit.fleet.bands import HeldFleet
    from damperfit.fleet.survey import DamperLine, FarOff, Survey

__all__ = ["damper_sheet", "fleet_page", "outlier_sheet", "write_page"]

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
        plotly=plotly_script(),
        script=asset("page.js"),
    )


def write_page(folder: Path, found: Survey, held: HeldFleet | None = None) -> None:
    """Write ``fleet.html``, and beside it whole tables of what it shows the worst of.

    Parameters
    ----------
    folder : pathlib.Path
        Of the fleet.
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
    page = fleet_page(found, held, title=folder.resolve().name)
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
    shown = list(own.values())[:most]
    note = (
        f"Far off: more than {FAR_OFF:g} median absolute deviations from the median of its setting "
        f"(distance), which at least {LEAST_DAMPERS} dampers have. Shown is the farthest value of "
        f"each damper; all {len(found.outliers)} are in fleet_outliers.csv."
    )
    return Sheet(
        headings=(
            *("damper", "farthest in", "set", "value", "unit", "median", "5 % to 95 %", "distance"),
            "more values",
        ),
        units=("",) * 9,
        rows=tuple(
            (
                one.damper or "unknown",
                series[one.series].label,
                str(one.setting),
                number(one.value),
                series[one.series].unit,
                number(one.median),
                f"{number(one.low)} to {number(one.high)}",
                f"{one.distance:+.1f}",
                str(len(rest) or NOTHING),
            )
            for one, *rest in shown
        ),
        is_number=(False, False, True, True, False, True, True, True, True),
        notes=(note,),
    )


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
    return Sheet(
        headings=(
            *("damper", "settings", "worst MSE", "at set", "grade", "failures", "far off"),
            *("date", "first failure"),
        ),
        units=("", "", "%", "", "", "", "", "", ""),
        rows=tuple(
            (
                one.damper or "unknown",
                str(one.n_settings),
                number(one.worst_mse, digits=3),
                one.worst_setting or NOTHING,
                one.grade or NOTHING,
                str(one.n_failures or NOTHING),
                str(one.n_outliers or NOTHING),
                one.date or NOTHING,
                one.error,
            )
            for one in shown
        ),
        is_number=(False, True, True, True, False, True, True, False, False),
        notes=notes,
    )


def _badness(one: DamperLine) -> tuple[int, int, float]:
    error = one.worst_mse if math.isfinite(one.worst_mse) else math.inf
    return -one.n_failures, -one.n_outliers, -error
