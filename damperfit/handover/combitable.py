"""Text file of Modelica's CombiTable1D and CombiTable2D: ``#1``, then matrices with their sizes.

One matrix for each setting (velocity, force), one with all settings (first row the settings, first
column the velocity; the corner is ignored), and the gas force by displacement. Both grids rise
strictly. Settings that are no numbers count 1, 2, ...; a comment says which is which.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from damperfit.handover.force_table import force_tables
from damperfit.handover.provenance import commented, gas_line, provenance_lines

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.handover.force_table import ForceTable
    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

    FloatArray = NDArray[np.float64]

__all__ = ["matrix_name", "setting_numbers", "write_combitable"]

_SIGN = "velocity in m/s and force in N are positive in rebound; displacement in m likewise"


def write_combitable(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return one file with the matrices of all settings."""
    tables = force_tables(handed, extend=options.extend)
    gas = gas_line(tables[0], place="matrix gas, by displacement; add it to the table's force")
    text = "#1\n" + commented(provenance_lines(handed, tables, sign=_SIGN, gas=gas), "#")
    for table in tables:
        pairs = np.column_stack([table.speeds, table.forces])
        said = f"setting {table.setting}: velocity m/s, force N"
        text += _matrix(matrix_name("force", table), pairs, said)
    axis = setting_numbers(tables)
    if len(tables) > 1:
        grid = np.empty((len(tables[0].speeds) + 1, len(tables) + 1))
        grid[0, 0] = 0.0
        grid[0, 1:], grid[1:, 0] = axis, tables[0].speeds
        grid[1:, 1:] = np.column_stack([table.forces for table in tables])
        listing = "".join(
            f"# column {at:g} is setting {table.setting}\n"
            for at, table in zip(axis, tables, strict=True)
            if str(table.setting) != f"{at:g}"
        )
        text += listing + _matrix("force", grid, "first row settings, first column velocity m/s; N")
    table = tables[0]
    pairs = np.column_stack([table.gas_displacements, table.gas_forces])
    if len(pairs) == 1:  # a table needs two points
        pairs = np.array([[-table.stroke, table.level], [table.stroke, table.level]])
    text += _matrix("gas", pairs, "displacement m, force at rest N")
    return {f"{options.stem}.txt": text.encode("utf-8", "replace")}


def setting_numbers(tables: Sequence[ForceTable]) -> FloatArray:
    """Return a number for each setting, rising: where it stands, else 1, 2, ..."""
    known = [table.setting.number() for table in tables]
    numbers = np.array([np.nan if one is None else one for one in known])
    if np.isfinite(numbers).all() and (np.diff(numbers) > 0.0).all():
        return numbers
    return np.arange(1.0, len(tables) + 1.0)


def matrix_name(stem: str, table: ForceTable) -> str:
    """Return a name that programs take as an identifier: ``force_s10``, ``force_s_3``."""
    return f"{stem}_s" + re.sub(r"[^A-Za-z0-9]", "_", table.slug)


def _matrix(name: str, rows: FloatArray, said: str) -> str:
    said = "".join(letter if letter.isprintable() else " " for letter in said)
    lines = "\n".join(" ".join(f"{cell:.9g}" for cell in row) for row in rows)
    return f"double {name}({rows.shape[0]},{rows.shape[1]})   # {said}\n{lines}\n"
