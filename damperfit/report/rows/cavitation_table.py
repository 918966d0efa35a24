"""The tables of the page: parameters, MSE, force by click, and how near to cavitation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.ladder import with_reach
from damperfit.report.page_tables import table_html
from damperfit.report.rows import NOTHING, Sheet, mse_sheet, number, parameter_sheet
from damperfit.report.run_record import told_clicks
from damperfit.tables import table_schema

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pyarrow as pa

    from damperfit.report.run_record import ToldClick
    from damperfit.tables import Results

__all__ = ["cavitation_sheet", "click_sheet", "result_tables"]

_BAR = 1e5  # Pa


def result_tables(results: Results) -> str:
    """Return the tables of a results folder as HTML, those without rows left out."""
    settings = {row["setting"] for row in results.parameters}
    rows = [row | {"outcome": row["outcome"] or "unknown"} for row in results.parameters]
    errors = [
        row | {"grade": row["grade"] or "-", "log": row["log"] or ""}
        for row in results.mse
        if row["setting"] in settings
    ]
    parameters = _arrow("parameters", rows)
    sheets = [
        ("Parameters", parameter_sheet(parameters)),
        ("MSE by setting and log", mse_sheet(_arrow("mse", errors), parameters)),
        ("Change of force by click", click_sheet(told_clicks(results.record))),
        ("How near to cavitation", cavitation_sheet(results.parameters)),
    ]
    return "".join(f"<h3>{title}</h3>{table_html(sheet)}" for title, sheet in sheets if sheet.rows)


def click_sheet(clicks: Sequence[ToldClick]) -> Sheet:
    """Return one row per click: the change of force at the highest speed told, by stroke."""
    fastest = max((click.speed for click in clicks), default=0.0)
    shown = [click for click in clicks if click.speed == fastest]
    steps = sorted({(click.first, click.second) for click in shown})
    cells = {(click.first, click.second, click.stroke): click for click in shown}

    def told(step: tuple[int, int], stroke: str) -> str:
        click = cells.get((*step, stroke))
        return NOTHING if click is None else with_reach(click.change, click.high, plus="+")

    return Sheet(
        headings=("click", "rebound", "bump"),
        units=("", "N", "N"),
        rows=tuple(
            (f"{step[0]} to {step[1]}", told(step, "rebound"), told(step, "bump")) for step in steps
        ),
        is_number=(False, True, True),
        notes=(f"At {fastest:g} m/s, simulated, with 95 % intervals.",) if steps else (),
    )


def cavitation_sheet(rows: Sequence[Mapping[str, Any]]) -> Sheet:
    """Return one row per setting: lowest pressure, share of the cycle, and what may still change.

    Columns of another version may be missing; a setting that tells nothing has no row.
    """
    known = [
        row
        for row in rows
        if row.get("lowest_pressure") is not None or row.get("r_m3_cavitation_margin") is not None
    ]
    return Sheet(
        headings=("setting", "lowest pressure", "in chamber", "cavitates", "R_m3 margin", "gas"),
        units=("", "bar", "", "% of cycle", "%", "bar at least"),
        rows=tuple(
            (
                str(row["setting"]),
                number(_times(row.get("lowest_pressure"), 1.0 / _BAR), digits=3),
                str(row.get("lowest_pressure_chamber") or "-"),
                number(_times(row.get("cavitation_fraction"), 100.0), digits=3),
                number(_times(row.get("r_m3_cavitation_margin"), 100.0), digits=3),
                number(_times(row.get("safe_gas_pressure"), 1.0 / _BAR), digits=3),
            )
            for row in known
        ),
        is_number=(True,) * 6,
        notes=("Absolute pressures, of the simulation on the motion of the logs.",),
    )


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor


def _arrow(name: str, rows: Iterable[Mapping[str, Any]]) -> pa.Table:
    import pyarrow as pa

    return pa.Table.from_pylist([dict(row) for row in rows], schema=table_schema(name, {}))
