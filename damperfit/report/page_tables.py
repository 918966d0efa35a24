"""Sheets and lists as HTML; every text is escaped here."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from damperfit.report.rows import Sheet, number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.characteristics import Characteristics
    from damperfit.report.views import LogView

__all__ = ["log_table", "table_html", "words_html"]


def words_html(title: str, items: Sequence[object], *, kind: str = "") -> str:
    """Return a titled list, or nothing when it would be empty."""
    if not items:
        return ""
    lines = "".join(f"<li>{escape(str(item))}</li>" for item in items)
    return f'<div class="words {escape(kind)}"><h3>{escape(title)}</h3><ul>{lines}</ul></div>'


def table_html(sheet: Sheet) -> str:
    """Return a sheet as an HTML table, its notes below."""

    def row(cells: Sequence[str], tag: str) -> str:
        done = (
            f"<{tag}{' class=n' if is_number else ''}>{escape(cell)}</{tag}>"
            for cell, is_number in zip(cells, sheet.is_number, strict=True)
        )
        return f"<tr>{''.join(done)}</tr>"

    heads = row(sheet.headings, "th") + (row(sheet.units, "th") if any(sheet.units) else "")
    body = "".join(row(cells, "td") for cells in sheet.rows)
    notes = "".join(f'<p class="note">{escape(note)}</p>' for note in sheet.notes)
    table = f"<table><thead>{heads}</thead><tbody>{body}</tbody></table>"
    return f'<div class="table">{table}</div>{notes}'


def log_table(view: LogView) -> str:
    """Return forces at named speeds, peaks, hysteresis, ratio and energy, measured and simulated.

    An empty string when the log has no whole cycle.
    """
    measured, simulated = view.measured, view.simulated
    if measured is None or simulated is None:
        return '<p class="note">No whole cycle: no figures.</p>'
    rows = [
        *(
            _force_row(f"force at {a.speed:g} m/s", (a.rebound, a.bump), (b.rebound, b.bump))
            for a, b in zip(measured.speed_forces, simulated.speed_forces, strict=True)
        ),
        _force_row("peak force", _peaks(measured), _peaks(simulated)),
        (
            f"hysteresis at {measured.hysteresis_speed:.3g} m/s",
            "N",
            *_hysteresis(measured),
            *_hysteresis(simulated),
        ),
        (
            "energy per cycle",
            "J",
            *(number(measured.energy, digits=4), "", ""),
            *(number(simulated.energy, digits=4), "", ""),
        ),
    ]
    sheet = Sheet(
        headings=("", "", "measured", "measured", "ratio", "simulated", "simulated", "ratio"),
        units=("", "", "rebound", "bump", "rebound/bump", "rebound", "bump", "rebound/bump"),
        rows=tuple(rows),
        is_number=(False, False, *(True,) * 6),
    )
    return table_html(sheet)


def _hysteresis(figures: Characteristics) -> tuple[str, str, str]:
    rebound, bump = figures.hysteresis_rebound, figures.hysteresis_bump
    return number(rebound, digits=4), number(bump, digits=4), ""


def _peaks(figures: Characteristics) -> tuple[float, float]:
    return figures.peak_force_rebound, figures.peak_force_bump


def _force_row(
    name: str, measured: tuple[float, float], simulated: tuple[float, float]
) -> tuple[str, ...]:
    return (name, "N", *_cells(measured), *_cells(simulated))


def _cells(pair: tuple[float, float]) -> tuple[str, str, str]:
    rebound, bump = pair
    # At low speed the gas pushes both strokes to one side: then no ratio.
    ratio = -rebound / bump if rebound > 0.0 > bump else None
    return number(rebound, digits=4), number(bump, digits=4), number(ratio, digits=3)
