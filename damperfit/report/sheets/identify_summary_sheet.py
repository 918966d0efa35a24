"""The rows that `identify` ends with: all of a run in a table of 80 columns.

Parameters stand as value and standard error in the last digits, ``14.005(11)`` for 14.005 ± 0.011.
What is the same at all settings moves below the table. Where 80 columns are not enough, the errors
go first (values stay rounded by them), then the grade, which the MSE tells too.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from damperfit.damper.quantity import SETTING
from damperfit.report.sheets.notes_below import errors_and_flags, units_and_marks
from damperfit.report.sheets.parameter_sheet import (
    PARAMETER_MARKS,
    limit_text,
    scale_of,
    scaled_units,
    shown_quantities,
    total_error,
)
from damperfit.report.sheets.rounding import NOTHING, percent, rounded_by_error
from damperfit.report.sheets.sheet import Sheet, sheet_width
from damperfit.report.sheets.sparkline import BLOCK_LEVELS, setting_sparklines
from damperfit.tables import PAPER_QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.damper.quantity import Quantity

    Row = Mapping[str, Any]

__all__ = ["summary_sheet"]

_SAME = 1e-12


@dataclass(frozen=True, slots=True)
class _Look:
    """What a table shows of what it could."""

    has_errors: bool
    has_grade: bool
    has_flags: bool


_LOOKS = (
    _Look(has_errors=True, has_grade=True, has_flags=True),
    _Look(has_errors=False, has_grade=True, has_flags=True),
    _Look(has_errors=False, has_grade=False, has_flags=True),
    _Look(has_errors=False, has_grade=False, has_flags=False),
)


def summary_sheet(
    rows: Sequence[Row],
    *,
    columns: int = 80,
    levels: str = BLOCK_LEVELS,
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> Sheet:
    """Return one row per setting: parameters, MSE, grade, outcome, flags; sparklines below.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table of parameters.
    columns : int
        Room for a row.
    levels : str
        Characters of the sparklines, from low to high.
    quantities : sequence of Quantity
        What the rows are of.
    """
    shown = shown_quantities(rows, quantities)
    # What is each setting's own has a column, equal at all settings or not.
    common = [q for q in shown if _is_common(rows, q.name) and not _is_own(q, rows)]
    shown = [one for one in shown if one not in common]
    units = scaled_units(quantities)
    notes = (*_common_notes(rows, common), *setting_sparklines(rows, shown, levels))
    sheets = [
        _sheet(rows, shown, look, (*notes, *_legend(rows, shown, look, units))) for look in _LOOKS
    ]
    turned = _turned(rows, shown, (*notes, *_legend(rows, shown, _LOOKS[-1], "")))
    fitting = (one for one in (*sheets, turned) if sheet_width(one, gap=1) <= columns)
    return next(fitting, sheets[-1])


def _is_own(quantity: Quantity, rows: Sequence[Row]) -> bool:
    is_shared = all(row[f"{quantity.name}_status"] == "shared" for row in rows)
    return quantity.scope == SETTING and quantity.default is None and not is_shared


def _is_common(rows: Sequence[Row], name: str) -> bool:
    """Whether all settings have one value, and not by fits of their own."""
    values = [row[name] for row in rows if row[name] is not None]
    held = {row[f"{name}_status"] for row in rows} <= {"fixed", "shared", None}
    return bool(values) and held and max(values) - min(values) <= _SAME * abs(values[0])


def _sheet(
    rows: Sequence[Row], shown: Sequence[Quantity], look: _Look, notes: tuple[str, ...]
) -> Sheet:
    scales = [scale_of(one) for one in shown]
    has = (look.has_grade, True, look.has_flags)

    def last(cells: tuple[str, str, str]) -> tuple[str, ...]:
        return tuple(cell for cell, is_wanted in zip(cells, has, strict=True) if is_wanted)

    return Sheet(
        headings=(
            *("set", *(scale.symbol for scale in scales), "MSE"),
            *last(("grade", "outcome", "flags")),
        ),
        units=("", *(scale.short_unit for scale in scales), "%", *last(("", "", ""))),
        rows=tuple(
            (
                str(row["setting"]),
                *(_cell(row, one, has_error=look.has_errors) for one in shown),
                percent(row["mse_percent"]),
                *last((row["grade"] or NOTHING, row["outcome"].replace("_", " "), _flags(row))),
            )
            for row in rows
        ),
        is_number=(True, *(True for _ in shown), True, *(False for _ in last(("", "", "")))),
        notes=notes,
    )


def _turned(rows: Sequence[Row], shown: Sequence[Quantity], notes: tuple[str, ...]) -> Sheet:
    """Return a column for each setting: for models of many quantities, where settings are few."""
    lines = [
        (scale.symbol, scale.unit_with_power, *(_cell(row, one, has_error=False) for row in rows))
        for one, scale in ((one, scale_of(one)) for one in shown)
    ]
    lines += [
        ("MSE", "%", *(percent(row["mse_percent"]) for row in rows)),
        ("grade", "", *(row["grade"] or NOTHING for row in rows)),
        ("outcome", "", *(row["outcome"].replace("_", " ") for row in rows)),
        ("flags", "", *(_flags(row) for row in rows)),
    ]
    filled = tuple(line for line in lines if any(line[2:]))
    return Sheet(
        headings=("set", "", *(str(row["setting"]) for row in rows)),
        units=("",) * (len(rows) + 2),
        rows=filled,
        is_number=(False, False, *(True for _ in rows)),
        notes=notes,
    )


def _cell(row: Row, quantity: Quantity, *, has_error: bool) -> str:
    name = quantity.name
    value, error, status = row[name], total_error(row, name), row[f"{name}_status"]
    if status in {"absent", "not_identifiable"}:
        return PARAMETER_MARKS[status]
    factor = scale_of(quantity).factor
    at_edge = status == "at_bound" and value is not None and limit_text(quantity, value, factor)
    text = at_edge or rounded_by_error(
        None if value is None else factor * value,
        None if error is None else factor * error,
        has_error=has_error,
    )
    mark = PARAMETER_MARKS.get(status or "", "")
    return f"{text} {mark}" if mark else text


def _flags(row: Row) -> str:
    """Return what else to know of a setting, in a few characters."""
    share = row.get("cavitation_fraction")
    return f"cav. {100.0 * share:.0f} %" if share else ""


def _common_notes(rows: Sequence[Row], shown: Sequence[Quantity]) -> Iterator[str]:
    for one in shown:
        name, scale = one.name, scale_of(one)
        row = next(row for row in rows if row[name] is not None)
        error = total_error(row, name)
        text = rounded_by_error(
            scale.factor * row[name], None if error is None else scale.factor * error
        )
        how = {"shared": "shared by all settings", "fixed": "fixed"}[row[f"{name}_status"]]
        yield f"{scale.symbol} = {scale.say(text)}, {how}"


def _legend(
    rows: Sequence[Row], shown: Sequence[Quantity], look: _Look, units: str
) -> tuple[str, ...]:
    names = [one.name for one in shown]
    cells = (_cell(row, one, has_error=True) for row in rows for one in shown)
    example = next((cell for cell in cells if re.fullmatch(r"-?[\d.]+\([\d.]+\)\S*", cell)), "")
    said = errors_and_flags(rows, names, shows_errors=look.has_errors, example=example)
    return (*units_and_marks(rows, names, units), *said)
