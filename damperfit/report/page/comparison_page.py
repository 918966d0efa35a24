"""Comparisons as one HTML file: verdicts and tables, and the runs' loops over one another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from damperfit import __version__
from damperfit.report.comparison_report import tolerance_outcome
from damperfit.report.page.plot_data import Figure, PlotData, plotly_script
from damperfit.report.page.templating import asset, draw
from damperfit.report.plots.colours import setting_colours
from damperfit.report.plots.compared_runs import difference_plots, loop_plots
from damperfit.report.plots.in_units import plot_in_units
from damperfit.report.sheets.comparison_sheet import (
    comparison_figure_sheet,
    comparison_force_sheet,
    comparison_parameter_sheet,
    tolerance_sheet,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.comparison import Point, RunComparison
    from damperfit.report.sheets.sheet import Sheet
    from damperfit.tested.setting import Setting

__all__ = ["comparison_page"]


@dataclass(frozen=True, slots=True)
class _Pair:
    """What the page tells of one comparison."""

    title: str
    comparison: RunComparison
    tables: tuple[tuple[str, Sheet], ...]


@dataclass(frozen=True, slots=True)
class _Section:
    """One setting of the runs that have one reference."""

    setting: Setting
    title: str
    figures: tuple[Figure, ...]


def comparison_page(
    comparisons: Sequence[RunComparison],
    points: Sequence[Point] = (),
    *,
    source: str = "",
    alone: Sequence[str] = (),
) -> str:
    """Return comparisons, and forces held against bands, as one self-contained HTML page.

    Parameters
    ----------
    comparisons : sequence of RunComparison
        One a pair.
    points : sequence of Point
        Forces held against bands.
    source : str
        The bands, as they were given.
    alone : sequence of str
        What has no partner.

    Raises
    ------
    InstallationError
        plotly is not installed.
    """
    data = PlotData()
    groups = _by_reference(comparisons)
    settings = sorted({setting for one in comparisons for setting in one.settings})
    colours = setting_colours(settings)
    overall: list[Figure] = []
    sections: list[_Section] = []
    for k, group in enumerate(groups):
        more = f"_{k + 1}" if len(groups) > 1 else ""
        whose = f" ({group[0].first.name})" if len(groups) > 1 else ""
        overall += [
            data.add(replace(plot, name=plot.name + more, title=plot.title + whose))
            for plot in difference_plots(group)
        ]
        sections += _sections(group, data, more=more, whose=whose)
    return draw(
        "comparison.html",
        title=" | ".join(_title(one) for one in comparisons[:3]) or "tolerance",
        version=__version__,
        style=asset("page.css"),
        colours=colours,
        pairs=[_pair(one) for one in comparisons],
        tolerance=(tolerance_outcome(points), tolerance_sheet(points)) if points else None,
        source=source,
        alone=list(alone),
        overall=overall,
        sections=sections,
        data=data.script(colours),
        plotly=plotly_script(),
        script=asset("page.js"),
    )


def _sections(
    group: Sequence[RunComparison], data: PlotData, *, more: str, whose: str
) -> Iterator[_Section]:
    """Yield the settings of the runs that have one reference."""
    runs = [group[0].first, *(one.second for one in group)]
    for setting in sorted({setting for one in group for setting in one.settings}):
        having = [run for run in runs if setting in run.settings]
        plots = loop_plots(having, setting, name=f"setting_{setting.slug}{more}")
        units = group[0].units
        figures = tuple(data.add(plot_in_units(plot, units)) for plot in plots)
        yield _Section(setting, f"Setting {setting}{whose}", figures)


def _by_reference(comparisons: Sequence[RunComparison]) -> list[list[RunComparison]]:
    groups: dict[str, list[RunComparison]] = {}
    for one in comparisons:
        groups.setdefault(one.first.place, []).append(one)
    return list(groups.values())


def _title(one: RunComparison) -> str:
    return f"{one.second.name} beside {one.first.name}"


def _pair(one: RunComparison) -> _Pair:
    tables = (
        (one.forces_title[0].upper() + one.forces_title[1:], comparison_force_sheet(one)),
        ("Parameters", comparison_parameter_sheet(one)),
        ("Energy, hysteresis, MSE, cavitation", comparison_figure_sheet(one)),
    )
    return _Pair(_title(one), one, tuple((name, sheet) for name, sheet in tables if sheet.rows))
