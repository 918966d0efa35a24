"""Which tables stand on the page, and under which title; each is laid out in `report/sheets`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.report.evaluated_log import has_several_speeds
from damperfit.report.json_records import clicks_in, law_in, sentences_in
from damperfit.report.sheets.cavitation_sheet import cavitation_sheet
from damperfit.report.sheets.click_sheet import click_sheet
from damperfit.report.sheets.in_units import clicks_in_units, sheet_in_units
from damperfit.report.sheets.law_sheet import rival_sheet, tried_laws_sheet
from damperfit.report.sheets.mse_sheet import mse_sheet
from damperfit.report.sheets.parameter_sheet import parameter_sheet
from damperfit.report.sheets.peak_sheet import peak_sheet
from damperfit.units.shown_units import SI, ShownUnits

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.report.sheets.peak_sheet import PeakPoint
    from damperfit.report.sheets.sheet import Sheet
    from damperfit.tables import Results

__all__ = ["page_tables"]


def page_tables(
    results: Results, points: Sequence[PeakPoint] = (), units: ShownUnits = SI
) -> list[tuple[str, Sheet]]:
    """Return the tables of a results folder by title, those without rows left out.

    Parameters
    ----------
    results : Results
        The folder.
    points : sequence of PeakPoint
        What its logs give to peak force against peak speed, in these units.
    units : ShownUnits
        Of forces and speeds.
    """
    rows = [row | {"outcome": row["outcome"] or "unknown"} for row in results.parameters]
    settings = {row["setting"] for row in rows}
    errors = [row for row in results.mse if row["setting"] in settings]
    clicks = clicks_in_units(clicks_in(results.record), units)
    of_offset = sentences_in(results.record, "force_offset")
    sheets = [
        *(
            [("Peak force against peak speed (PVP)", sheet_in_units(peak_sheet(points), units))]
            if has_several_speeds(points)
            else []
        ),
        ("Parameters", parameter_sheet(rows, results.quantities, says_shared_once=True)),
        ("MSE by setting and log", mse_sheet(errors, rows, results.quantities)),
        ("Laws that were tried", tried_laws_sheet(law_in(results.record))),
        ("Models from the literature on the same logs", rival_sheet(law_in(results.record))),
        ("Change of force by click", sheet_in_units(click_sheet(clicks, of_offset), units)),
        ("How near to cavitation", cavitation_sheet(results.parameters)),
    ]
    return [(title, sheet) for title, sheet in sheets if sheet.rows]
