"""Tables to people: rows of strings first (`rows`), then Markdown, terminal, HTML and figures.

Names that draw are looked up when they are first used: `identify` alone needs none of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.closing import closing_sheet
from damperfit.report.facts import Failure, ReportFacts
from damperfit.report.held_out import held_out_sheet
from damperfit.report.inspection import VERDICT_COLOURS, finding_lines, log_sheet
from damperfit.report.ladder import check_lines, ladder_sheet, stroke_sheet
from damperfit.report.markdown import markdown_report
from damperfit.report.rows import Sheet, parameter_sheet
from damperfit.report.spark import ASCII_LEVELS, BLOCK_LEVELS, sparkline
from damperfit.report.terminal import terminal_table

if TYPE_CHECKING:
    from damperfit.report.family import (
        Kin,
        family_plot,
        family_records,
        family_sentence,
        family_sheet,
        kin_pressures,
    )
    from damperfit.report.figures import draw_plot
    from damperfit.report.page import Portfolio, html_report, portfolio
    from damperfit.report.plots import Plot

__all__ = [
    "ASCII_LEVELS",
    "BLOCK_LEVELS",
    "VERDICT_COLOURS",
    "Failure",
    "Kin",
    "Plot",
    "Portfolio",
    "ReportFacts",
    "Sheet",
    "check_lines",
    "closing_sheet",
    "draw_plot",
    "family_plot",
    "family_records",
    "family_sentence",
    "family_sheet",
    "finding_lines",
    "held_out_sheet",
    "html_report",
    "kin_pressures",
    "ladder_sheet",
    "log_sheet",
    "markdown_report",
    "parameter_sheet",
    "portfolio",
    "sparkline",
    "stroke_sheet",
    "terminal_table",
]

_LATE = {
    "Kin": "damperfit.report.family",
    "family_plot": "damperfit.report.family",
    "family_records": "damperfit.report.family",
    "family_sentence": "damperfit.report.family",
    "family_sheet": "damperfit.report.family",
    "kin_pressures": "damperfit.report.family",
    "Plot": "damperfit.report.plots",
    "Portfolio": "damperfit.report.page",
    "draw_plot": "damperfit.report.figures",
    "html_report": "damperfit.report.page",
    "portfolio": "damperfit.report.page",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_LATE[name]), name)
