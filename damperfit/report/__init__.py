"""Tables to people: rows of strings first (`rows`), then Markdown, terminal, HTML and figures.

Names that draw are looked up when they are first used: `identify` alone needs none of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.alike import short_listing
from damperfit.report.failures_and_warnings import Failure, ReportFacts, failure_lines
from damperfit.report.mse_report import markdown_report
from damperfit.report.rows.check_table import check_lines
from damperfit.report.rows.force_by_setting_table import (
    force_by_setting_sheet,
    force_by_speed_sheet,
    measured_force_sheet,
)
from damperfit.report.rows.held_out_table import held_out_sheet
from damperfit.report.rows.identify_summary_table import summary_sheet
from damperfit.report.rows.inspection_table import (
    VERDICT_COLOURS,
    finding_lines,
    inspection_sheet,
    stretch_sheet,
)
from damperfit.report.rows.parameter_table import parameter_sheet
from damperfit.report.rows.sheet import Sheet
from damperfit.report.rows.sparkline import ASCII_LEVELS, BLOCK_LEVELS, sparkline
from damperfit.report.terminal_table import terminal_table

if TYPE_CHECKING:
    from damperfit.report.json_records import read_back, to_record
    from damperfit.report.page.page import html_report
    from damperfit.report.plots.description import Plot
    from damperfit.report.plots.figure_files import draw_plot
    from damperfit.report.plots.report_plots import ReportPlots, report_plots
    from damperfit.report.plots.simulated_cycle import draw_loops
    from damperfit.report.plots.sweep import sweep_plot, sweep_pressure_plot
    from damperfit.report.rows.curve_table import curve_forces_sheet, curve_sheet
    from damperfit.report.rows.cycle_table import (
        cycle_force_sheet,
        cycle_pressure_sheet,
        cycle_sparklines,
    )
    from damperfit.report.rows.law_table import (
        chosen_records,
        chosen_sheet,
        ladder_records,
        ladder_sheet,
        rival_records,
        rival_sheet,
    )
    from damperfit.report.rows.sweep_table import (
        SweepMember,
        sweep_records,
        sweep_sentence,
        sweep_sheet,
    )

__all__ = [
    "ASCII_LEVELS",
    "BLOCK_LEVELS",
    "VERDICT_COLOURS",
    "Failure",
    "Plot",
    "ReportFacts",
    "ReportPlots",
    "Sheet",
    "SweepMember",
    "check_lines",
    "chosen_records",
    "chosen_sheet",
    "curve_forces_sheet",
    "curve_sheet",
    "cycle_force_sheet",
    "cycle_pressure_sheet",
    "cycle_sparklines",
    "draw_loops",
    "draw_plot",
    "failure_lines",
    "finding_lines",
    "force_by_setting_sheet",
    "force_by_speed_sheet",
    "held_out_sheet",
    "html_report",
    "inspection_sheet",
    "ladder_records",
    "ladder_sheet",
    "markdown_report",
    "measured_force_sheet",
    "parameter_sheet",
    "read_back",
    "report_plots",
    "rival_records",
    "rival_sheet",
    "short_listing",
    "sparkline",
    "stretch_sheet",
    "summary_sheet",
    "sweep_plot",
    "sweep_pressure_plot",
    "sweep_records",
    "sweep_sentence",
    "sweep_sheet",
    "terminal_table",
    "to_record",
]

_LATE = {
    "Plot": "plots.description",
    "ReportPlots": "plots.report_plots",
    "SweepMember": "rows.sweep_table",
    "chosen_records": "rows.law_table",
    "chosen_sheet": "rows.law_table",
    "curve_forces_sheet": "rows.curve_table",
    "curve_sheet": "rows.curve_table",
    "cycle_force_sheet": "rows.cycle_table",
    "cycle_pressure_sheet": "rows.cycle_table",
    "cycle_sparklines": "rows.cycle_table",
    "draw_loops": "plots.simulated_cycle",
    "draw_plot": "plots.figure_files",
    "html_report": "page.page",
    "ladder_records": "rows.law_table",
    "ladder_sheet": "rows.law_table",
    "rival_records": "rows.law_table",
    "rival_sheet": "rows.law_table",
    "read_back": "json_records",
    "report_plots": "plots.report_plots",
    "sweep_plot": "plots.sweep",
    "sweep_pressure_plot": "plots.sweep",
    "sweep_records": "rows.sweep_table",
    "sweep_sentence": "rows.sweep_table",
    "sweep_sheet": "rows.sweep_table",
    "to_record": "json_records",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
