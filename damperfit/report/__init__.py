"""Tables to people: rows of strings first (`rows`), then Markdown, terminal, HTML and figures.

Names that draw are looked up when they are first used: `identify` alone needs none of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.terminal_table import terminal_table

if TYPE_CHECKING:
    from damperfit.report.alike import short_listing
    from damperfit.report.comparison_records import (
        comparison_record,
        comparison_rows,
        comparison_table,
        tolerance_rows,
        tolerance_table,
    )
    from damperfit.report.comparison_report import comparison_markdown, tolerance_outcome
    from damperfit.report.failures_and_warnings import Failure, ReportFacts, failure_lines
    from damperfit.report.json_records import read_back, to_record
    from damperfit.report.junit import junit_report
    from damperfit.report.mse_report import markdown_report
    from damperfit.report.page.comparison_page import comparison_page
    from damperfit.report.page.page import html_report
    from damperfit.report.plots.description import Plot
    from damperfit.report.plots.figure_files import draw_plot
    from damperfit.report.plots.report_plots import ReportPlots, report_plots
    from damperfit.report.plots.simulated_cycle import draw_loops
    from damperfit.report.plots.sweep import sweep_plot, sweep_pressure_plot
    from damperfit.report.sheets.check_sheet import check_lines
    from damperfit.report.sheets.comparison_sheet import (
        comparison_figure_sheet,
        comparison_force_sheet,
        comparison_parameter_sheet,
        tolerance_sheet,
    )
    from damperfit.report.sheets.curve_sheet import curve_forces_sheet, curve_sheet
    from damperfit.report.sheets.cycle_sheet import (
        cycle_force_sheet,
        cycle_pressure_sheet,
        cycle_sparklines,
    )
    from damperfit.report.sheets.force_by_setting_sheet import (
        force_by_setting_sheet,
        force_by_speed_sheet,
        measured_force_sheet,
    )
    from damperfit.report.sheets.held_out_sheet import held_out_sheet
    from damperfit.report.sheets.identify_summary_sheet import summary_sheet
    from damperfit.report.sheets.in_units import (
        parameters_in_units,
        rows_in_units,
        sheet_in_units,
    )
    from damperfit.report.sheets.inspection_sheet import (
        VERDICT_COLOURS,
        finding_lines,
        inspection_sheet,
        stretch_sheet,
    )
    from damperfit.report.sheets.law_sheet import (
        chosen_records,
        chosen_sheet,
        law_sentences,
        rival_records,
        rival_sheet,
        tried_law_records,
        tried_laws_sheet,
    )
    from damperfit.report.sheets.parameter_sheet import parameter_sheet
    from damperfit.report.sheets.sheet import Sheet
    from damperfit.report.sheets.sparkline import ASCII_LEVELS, BLOCK_LEVELS, sparkline
    from damperfit.report.sheets.sweep_sheet import (
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
    "comparison_figure_sheet",
    "comparison_force_sheet",
    "comparison_markdown",
    "comparison_page",
    "comparison_parameter_sheet",
    "comparison_record",
    "comparison_rows",
    "comparison_table",
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
    "junit_report",
    "law_sentences",
    "markdown_report",
    "measured_force_sheet",
    "parameter_sheet",
    "parameters_in_units",
    "read_back",
    "report_plots",
    "rival_records",
    "rival_sheet",
    "rows_in_units",
    "sheet_in_units",
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
    "tolerance_outcome",
    "tolerance_rows",
    "tolerance_sheet",
    "tolerance_table",
    "tried_law_records",
    "tried_laws_sheet",
]

_LATE = {
    "ASCII_LEVELS": "sheets.sparkline",
    "BLOCK_LEVELS": "sheets.sparkline",
    "Failure": "failures_and_warnings",
    "Plot": "plots.description",
    "ReportFacts": "failures_and_warnings",
    "ReportPlots": "plots.report_plots",
    "Sheet": "sheets.sheet",
    "SweepMember": "sheets.sweep_sheet",
    "VERDICT_COLOURS": "sheets.inspection_sheet",
    "check_lines": "sheets.check_sheet",
    "chosen_records": "sheets.law_sheet",
    "chosen_sheet": "sheets.law_sheet",
    "comparison_figure_sheet": "sheets.comparison_sheet",
    "comparison_force_sheet": "sheets.comparison_sheet",
    "comparison_markdown": "comparison_report",
    "comparison_page": "page.comparison_page",
    "comparison_parameter_sheet": "sheets.comparison_sheet",
    "comparison_record": "comparison_records",
    "comparison_rows": "comparison_records",
    "comparison_table": "comparison_records",
    "curve_forces_sheet": "sheets.curve_sheet",
    "curve_sheet": "sheets.curve_sheet",
    "cycle_force_sheet": "sheets.cycle_sheet",
    "cycle_pressure_sheet": "sheets.cycle_sheet",
    "cycle_sparklines": "sheets.cycle_sheet",
    "draw_loops": "plots.simulated_cycle",
    "draw_plot": "plots.figure_files",
    "failure_lines": "failures_and_warnings",
    "finding_lines": "sheets.inspection_sheet",
    "force_by_setting_sheet": "sheets.force_by_setting_sheet",
    "force_by_speed_sheet": "sheets.force_by_setting_sheet",
    "held_out_sheet": "sheets.held_out_sheet",
    "html_report": "page.page",
    "inspection_sheet": "sheets.inspection_sheet",
    "junit_report": "junit",
    "tried_law_records": "sheets.law_sheet",
    "tried_laws_sheet": "sheets.law_sheet",
    "law_sentences": "sheets.law_sheet",
    "markdown_report": "mse_report",
    "measured_force_sheet": "sheets.force_by_setting_sheet",
    "parameter_sheet": "sheets.parameter_sheet",
    "parameters_in_units": "sheets.in_units",
    "read_back": "json_records",
    "report_plots": "plots.report_plots",
    "rival_records": "sheets.law_sheet",
    "rival_sheet": "sheets.law_sheet",
    "rows_in_units": "sheets.in_units",
    "sheet_in_units": "sheets.in_units",
    "short_listing": "alike",
    "sparkline": "sheets.sparkline",
    "stretch_sheet": "sheets.inspection_sheet",
    "summary_sheet": "sheets.identify_summary_sheet",
    "sweep_plot": "plots.sweep",
    "sweep_pressure_plot": "plots.sweep",
    "sweep_records": "sheets.sweep_sheet",
    "sweep_sentence": "sheets.sweep_sheet",
    "sweep_sheet": "sheets.sweep_sheet",
    "to_record": "json_records",
    "tolerance_outcome": "comparison_report",
    "tolerance_rows": "comparison_records",
    "tolerance_sheet": "sheets.comparison_sheet",
    "tolerance_table": "comparison_records",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
