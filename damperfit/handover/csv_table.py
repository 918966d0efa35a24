"""Force by setting and speed as CSV, every table of the results and what it is about beside it.

With a decimal comma the cells stand between semicolons, as spreadsheets of those countries read
and write them.
"""

from __future__ import annotations

import csv
import io
import math
from typing import TYPE_CHECKING, Any

from damperfit.handover.force_table import force_tables
from damperfit.handover.plain_tables import stored_tables
from damperfit.handover.provenance import gas_line, provenance_lines
from damperfit.tables import safe_cell

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

__all__ = ["write_csv"]

_SIGN = "forces, displacement and velocity are positive in rebound (rod out)"
_NEAR = 1.0 + 1e-9  # the tested speed itself is tested


def write_csv(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return a file with a row for each setting and speed, without gas force, and the tables.

    What other targets say in a comment stands in a text file: CSV has no comments.
    """
    shown, mark = options.units, options.decimal
    tables = force_tables(handed, extend=options.extend)
    rows = [
        (
            str(table.setting),
            f"{speed:.6g}".replace(".", mark),
            f"{force:.3f}".replace(".", mark),
            "tested" if abs(at) <= _NEAR * table.tested_speed else "untested",
        )
        for table in tables
        for at, speed, force in zip(
            table.speeds,
            shown.show(table.speeds, "m/s"),
            shown.show(table.forces, "N"),
            strict=True,
        )
    ]
    head = ("setting", shown.column("speed_m_per_s", "m/s"), shown.column("force_N", "N"), "range")
    gas = gas_line(tables[0], place="add it to the force")
    about = "\n".join(provenance_lines(handed, tables, sign=_SIGN, gas=gas)) + "\n"
    files = {
        f"{options.stem}.csv": _text(head, rows, mark),
        f"{options.stem}_about.txt": about.encode("utf-8", "backslashreplace"),
    }
    for table in stored_tables(handed, shown):
        named = [_heading(*pair) for pair in zip(table.headings, table.units, strict=True)]
        cells = ([_cell(one, mark) for one in row] for row in zip(*table.columns, strict=True))
        files[f"{options.stem}_{table.name}.csv"] = _text(named, cells, mark)
    return files


def _text(head: Sequence[str], rows: Iterable[Sequence[str]], mark: str) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, delimiter=";" if mark == "," else ",", lineterminator="\n")
    writer.writerow(head)
    writer.writerows([_safe(cell) for cell in row] for row in rows)
    return text.getvalue().encode("utf-8", "backslashreplace")


def _heading(name: str, unit: str) -> str:
    """Return the name with its unit, where it does not end with it already."""
    return (
        name if not unit or name.endswith("_" + unit.replace("/", "_per_")) else f"{name} [{unit}]"
    )


def _cell(cell: Any, mark: str) -> str:
    if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
        return ""
    return repr(cell).replace(".", mark) if isinstance(cell, float) else str(cell)


def _safe(cell: str) -> str:
    """Return a cell that no spreadsheet takes for a formula; numbers stay numbers."""
    digits = cell.replace(",", ".")
    try:
        float(digits)
    except ValueError:
        return safe_cell(cell)
    return cell
