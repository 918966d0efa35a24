"""The report as one HTML file: text and tables by us, plots by plotly.js, everything inlined.

Everything that may have come from a log or a configuration is escaped by the templates, and in
plot descriptions by `page_text`. The page forbids itself every network request
(Content-Security-Policy).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit import __version__
from damperfit.report.evaluated_log import peak_points
from damperfit.report.log_in_units import log_in_units
from damperfit.report.page.log_section import log_section
from damperfit.report.page.plot_data import PlotData, plotly_script
from damperfit.report.page.summary import identity_of_test, summary
from damperfit.report.page.tables import page_tables
from damperfit.report.page.templating import asset, draw
from damperfit.report.sheets.parameter_sheet import shared_sentence

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.report.plots.report_plots import ReportPlots
    from damperfit.tested.setting import Setting

__all__ = ["html_report"]

_FIRST = "fan"  # force against velocity: what a damper engineer looks for


def html_report(shown: ReportPlots, *, title: str) -> str:
    """Return the report as one self-contained HTML page.

    Parameters
    ----------
    shown : ReportPlots
        What to show.
    title : str
        Heading, as a rule the name of the folder; escaped here.

    Raises
    ------
    InstallationError
        plotly is not installed.
    """
    data = PlotData()
    overall = [data.add(plot) for plot in shown.overall]
    rows = {row["setting"]: row for row in shown.results.parameters}
    anchors = _anchors([log.signals.setting for log, _ in shown.by_log])
    logs = [
        log_section(
            log,
            [data.add(plot) for plot in plots],
            rows.get(log.signals.setting),
            shown.results.quantities,
            anchor=anchor,
            units=shown.units,
        )
        for (log, plots), anchor in zip(shown.by_log, anchors, strict=True)
    ]
    views = [log for log, _ in shown.by_log]
    firsts = [one for one in overall if one.name == _FIRST]
    return draw(
        "page.html",
        title=title,
        version=__version__,
        style=asset("page.css"),
        colours=shown.colours,
        places=list(dict.fromkeys(section.setting for section in logs)),
        entries={section.setting: section.anchor for section in reversed(logs)},
        identity=identity_of_test(shown.results.record),
        summary=summary(shown.results, views, shown.units),
        first=firsts,
        shared=shared_sentence(shown.results.parameters, shown.results.quantities),
        overall=[one for one in overall if one not in firsts],
        tables=page_tables(
            shown.results,
            peak_points([log_in_units(view, shown.units) for view in views]),
            shown.units,
        ),
        logs=logs,
        data=data.script(shown.colours),
        plotly=plotly_script(),
        script=asset("page.js"),
    )


def _anchors(settings: Sequence[Setting]) -> Iterator[str]:
    """Yield where each log is found: ``setting-12``, a second of the setting ``setting-12-log-2``.

    Settings whose labels differ in signs alone count on likewise.
    """
    seen: dict[str, int] = {}
    for setting in settings:
        name = str(setting.cell) if isinstance(setting.cell, int) else setting.slug
        seen[name] = seen.get(name, 0) + 1
        yield f"setting-{name}" + (f"-log-{seen[name]}" if seen[name] > 1 else "")
