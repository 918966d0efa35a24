"""Force by setting and speed as CSV, for spreadsheets and scripts."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from damperfit.export.force_table import force_tables
from damperfit.tables import safe_cell

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.export.handed_over import HandedOver
    from damperfit.export.targets import ExportOptions

__all__ = ["write_csv"]


def write_csv(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return one file with a row for each setting and speed; the gas force is not in it."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["setting", "speed_m_per_s", "force_N"])
    for table in force_tables(handed, extend=options.extend):
        label = safe_cell(str(table.setting))
        rows.writerows(
            [label, f"{speed:.6g}", f"{force:.3f}"]
            for speed, force in zip(table.speeds, table.forces, strict=True)
        )
    return {f"{options.stem}.csv": text.getvalue().encode("utf-8", "backslashreplace")}
