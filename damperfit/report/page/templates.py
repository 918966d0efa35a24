"""Sheets and lists as HTML; every text is escaped here, by `page_text`."""

from __future__ import annotations

from html import escape as html_escape
from typing import TYPE_CHECKING

from damperfit.report.rows import Sheet, number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.report.views import LogView

__all__ = ["details_html", "log_table", "page_text", "table_html", "words_html"]


_LOOKS = {"excellent": "well", "passed": "well", "poor": "ill", "FAILED": "ill"}


def page_text(text: object) -> str:
    r"""Return text that a page and a plot show as it is, control characters as escapes.

    Examples
    --------
    >>> print(page_text("<b>run_1\x1b[0m"))
    &lt;b&gt;run_1\x1b[0m
    """
    shown = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in str(text))
    return html_escape(shown)


def words_html(title: str, items: Sequence[object], *, kind: str = "") -> str:
    """Return a titled list, or nothing when it would be empty."""
    if not items:
        return ""
    lines = "".join(f"<li>{page_text(str(item))}</li>" for item in items)
    return f'<div class="words {page_text(kind)}"><h3>{page_text(title)}</h3><ul>{lines}</ul></div>'


def details_html(title: str, items: Sequence[object]) -> str:
    """Return a titled list that opens on demand, and in print; nothing when it would be empty."""
    if not items:
        return ""
    lines = "".join(f"<li>{page_text(str(item))}</li>" for item in items)
    return f'<details class="words"><summary>{page_text(title)}</summary><ul>{lines}</ul></details>'


def table_html(sheet: Sheet, *, kind: str = "") -> str:
    """Return a sheet as an HTML table, its notes below; cells with a grade or verdict stand out."""

    def row(cells: Sequence[str], tag: str) -> str:
        done = (
            f"<{tag}{_mark(cell, is_number=is_number)}>{page_text(cell)}</{tag}>"
            for cell, is_number in zip(cells, sheet.is_number, strict=True)
        )
        return f"<tr>{''.join(done)}</tr>"

    heads = row(sheet.headings, "th") if any(sheet.headings) else ""
    heads += row(sheet.units, "th") if any(sheet.units) else ""
    body = "".join(row(cells, "td") for cells in sheet.rows)
    notes = "".join(f'<p class="note">{page_text(note)}</p>' for note in sheet.notes)
    table = f"<table><thead>{heads}</thead><tbody>{body}</tbody></table>"
    return f'<div class="table {page_text(kind)}">{table}</div>{notes}'


def _mark(cell: str, *, is_number: bool) -> str:
    if is_number:
        return " class=n"
    return f" class={_LOOKS[cell]}" if cell in _LOOKS else ""


def log_table(view: LogView) -> str:
    """Return forces at named speeds, peaks, hysteresis and ratio, measured beside simulated.

    Instead a word when the log has no whole cycle.
    """
    measured, simulated = view.measured, view.simulated
    if measured is None or simulated is None:
        return '<p class="note">No whole cycle: no figures.</p>'
    rows = [
        *(
            _force_row(f"at {a.speed:g} m/s", (a.rebound, b.rebound), (a.bump, b.bump))
            for a, b in zip(measured.speed_forces, simulated.speed_forces, strict=True)
        ),
        _force_row(
            "peak",
            (measured.peak_force_rebound, simulated.peak_force_rebound),
            (measured.peak_force_bump, simulated.peak_force_bump),
        ),
        (
            f"hysteresis, {measured.hysteresis_speed:.2g} m/s",
            number(measured.hysteresis_rebound, digits=4),
            number(simulated.hysteresis_rebound, digits=4),
            number(measured.hysteresis_bump, digits=4),
            number(simulated.hysteresis_bump, digits=4),
            *("", ""),
        ),
    ]
    sheet = Sheet(
        headings=("force, N", "rebound", "rebound", "bump", "bump", "ratio", "ratio"),
        units=("", *("measured", "simulated") * 3),
        rows=tuple(rows),
        is_number=(False, *(True,) * 6),
        notes=(_energy(view), _READING),
    )
    return table_html(sheet, kind="forces")


def _energy(view: LogView) -> str:
    if view.measured is None or view.simulated is None:
        return ""
    warmth = "not logged" if view.temperature is None else f"{view.temperature:.1f} degC"
    energies = f"{view.measured.energy:.4g} J measured, {view.simulated.energy:.4g} J simulated"
    return f"Energy per cycle: {energies}. Temperature: {warmth}."


_READING = (
    "Force at a speed: mean of the opening and the closing branch. Hysteresis: opening less "
    "closing. Ratio: rebound over bump; none where the gas pushes both to one side."
)


def _force_row(
    name: str, rebound: tuple[float, float], bump: tuple[float, float]
) -> tuple[str, ...]:
    """Return a row; pairs are measured and simulated."""
    forces = (number(force, digits=4) for force in (*rebound, *bump))
    return (name, *forces, *map(_ratio, rebound, bump))


def _ratio(rebound: float, bump: float) -> str:
    # At low speed the gas pushes both strokes to one side: then no ratio.
    return number(-rebound / bump if rebound > 0.0 > bump else None, digits=3)
