"""The report as one HTML file: text and tables by us, plots by plotly.js, everything inlined.

Everything that may have come from a log or a configuration is escaped by the templates, and in
plot descriptions by `page_text`. The page forbids itself every network request
(Content-Security-Policy).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit import __version__
from damperfit.report.page.log_section import log_section
from damperfit.report.page.plot_data import PlotData, plotly_script
from damperfit.report.page.summary import summary
from damperfit.report.page.tables import page_tables
from damperfit.report.page.templating import asset, draw

if TYPE_CHECKING:
    from damperfit.report.plots.report_plots import ReportPlots

__all__ = ["html_report"]


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
    logs = [
        log_section(
            log,
            [data.add(plot) for plot in plots],
            rows.get(log.signals.setting),
            shown.results.quantities,
        )
        for log, plots in shown.by_log
    ]
    return draw(
        "page.html",
        title=title,
        version=__version__,
        style=asset("page.css"),
        colours=shown.colours,
        places=list(dict.fromkeys(section.setting for section in logs)),
        summary=summary(shown.results, [log for log, _ in shown.by_log]),
        overall=overall,
        tables=page_tables(shown.results),
        logs=logs,
        data=data.script(shown.colours),
        plotly=plotly_script(),
        script=asset("page.js"),
    )
