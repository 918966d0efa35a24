"""Results as named tables with units, and the files that hold them.

`columns` declares every column once; the Arrow field metadata (``unit``, ``description``), the
order of columns and the schema in run.json all come from there. `results` lays campaigns and
responses out, `files` writes and reads. Tables are Arrow tables; ``Tables.frame`` gives pandas.
"""

from damperfit.tables.characteristics import characteristic_rows
from damperfit.tables.columns import SCHEMA_VERSION, column_names, describe_tables, table_schema
from damperfit.tables.files import (
    read_facts,
    read_known_numbers,
    read_parameters,
    safe_cell,
    table_quantities,
    write_responses,
    write_table,
)
from damperfit.tables.in_units import table_in_units
from damperfit.tables.quantities import (
    PAPER_QUANTITIES,
    quantities_in,
    quantity_records,
    values_from,
)
from damperfit.tables.reading import LogSignals, Results, read_results
from damperfit.tables.results import (
    MISSING,
    WITHHELD,
    Tables,
    adjustment_rows,
    grade,
    lay_out,
    make_tables,
    profiles_table,
    time_series_table,
)
from damperfit.tables.valves import valve_rows

__all__ = [
    "MISSING",
    "PAPER_QUANTITIES",
    "SCHEMA_VERSION",
    "WITHHELD",
    "LogSignals",
    "Results",
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
    "read_parameters",
    "read_results",
    "safe_cell",
    "table_in_units",
    "table_quantities",
    "table_schema",
    "time_series_table",
    "values_from",
    "valve_rows",
    "write_responses",
    "write_table",
]
