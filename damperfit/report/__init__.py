"""Tables to people: rows of strings first (`rows`), then Markdown and the terminal."""

from damperfit.report.facts import Failure, ReportFacts
from damperfit.report.markdown import markdown_report
from damperfit.report.rows import Sheet, log_sheet, parameter_sheet
from damperfit.report.terminal import terminal_table

__all__ = [
    "Failure",
    "ReportFacts",
    "Sheet",
    "log_sheet",
    "markdown_report",
    "parameter_sheet",
    "terminal_table",
]
