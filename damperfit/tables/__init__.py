"""Results as named tables with units, and the files that hold them.

`columns` declares every column once; the Arrow field metadata (``unit``, ``description``), the
order of columns and the schema in run.json all come from there. `results` lays campaigns and
responses out, `files` writes and reads. Tables are Arrow tables; ``Tables.frame`` gives pandas.

A name is looked up when it is first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damperfit.tables.columns import (
        PAPER_QUANTITIES,
        SCHEMA_VERSION,
        column_names,
        describe_tables,
        quantities_in,
        quantity_records,
        table_schema,
        unknown_schema,
        values_from,
    )
    from damperfit.tables.files import (
        read_facts,
        read_known_numbers,
        safe_cell,
        table_in_units,
        table_quantities,
        write_responses,
        write_table,
    )
    from damperfit.tables.reading import LogSignals
    from damperfit.tables.results import (
        MISSING,
        WITHHELD,
        Tables,
        adjustment_rows,
        characteristic_rows,
        grade,
        lay_out,
        make_tables,
        profiles_table,
        time_series_table,
        valve_rows,
    )

__all__ = [
    "MISSING",
    "PAPER_QUANTITIES",
    "SCHEMA_VERSION",
    "WITHHELD",
    "LogSignals",
    "Tables",
    "adjustment_rows",
    "characteristic_rows",
    "column_names",
    "describe_tables",
    "grade",
    "lay_out",
    "make_tables",
    "profiles_table",
    "quantities_in",
    "quantity_records",
    "read_facts",
    "read_known_numbers",
    "safe_cell",
    "table_in_units",
    "table_quantities",
    "table_schema",
    "time_series_table",
    "unknown_schema",
    "unlimited_names",
    "values_from",
    "valve_rows",
    "write_responses",
    "write_table",
]

_LATE = {
    "LogSignals": "reading",
    "MISSING": "results",
    "PAPER_QUANTITIES": "columns",
    "SCHEMA_VERSION": "columns",
    "Tables": "results",
    "WITHHELD": "results",
    "adjustment_rows": "results",
    "characteristic_rows": "results",
    "column_names": "columns",
    "describe_tables": "columns",
    "grade": "results",
    "lay_out": "results",
    "make_tables": "results",
    "profiles_table": "results",
    "quantities_in": "columns",
    "quantity_records": "columns",
    "read_facts": "files",
    "read_known_numbers": "files",
    "safe_cell": "files",
    "table_in_units": "files",
    "table_quantities": "files",
    "table_schema": "columns",
    "time_series_table": "results",
    "unknown_schema": "columns",
    "unlimited_names": "files",
    "values_from": "columns",
    "valve_rows": "results",
    "write_responses": "files",
    "write_table": "files",
}


def __getattr__(name: str) -> Any:
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_LATE[name]}"), name)
