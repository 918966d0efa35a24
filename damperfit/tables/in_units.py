"""A table in the units people want, for files that they open; programs read SI from Parquet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow as pa

if TYPE_CHECKING:
    from damperfit.units.shown_units import ShownUnits

__all__ = ["table_in_units"]

_ENDS = {"_N": "N", "_m_per_s": "m/s", "_m": "m"}


def table_in_units(table: pa.Table, units: ShownUnits) -> pa.Table:
    """Return a table whose columns name their units, with these units and numbers converted.

    Columns that do not end with a unit, as the parameters', stay in SI.
    """
    if units.is_si:
        return table
    import pyarrow.compute as pc  # as long in loading as two logs take, and for other units alone

    names, columns = [], []
    for name, column in zip(table.column_names, table.columns, strict=True):
        unit = next((si for end, si in _ENDS.items() if name.endswith(end)), "")
        is_number = pa.types.is_floating(column.type)
        names.append(units.column(name, unit) if unit and is_number else name)
        factor = units.show(1.0, unit) if names[-1] != name else 1.0
        columns.append(column if factor == 1.0 else pc.multiply(column, factor))
    return pa.table(columns, names=names)
