"""What goes into files: rows as Arrow tables, in Parquet with page checksums and CSV; JSON.

What is written depends on the results alone, never on the clock, the machine or the number of
workers, so equal inputs give equal bytes. `damperfit.store` makes files appear whole or not at
all; the functions here write to whatever path they are given.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from damperfit.damper.quantity import Quantity
from damperfit.errors import ConfigurationError
from damperfit.tables.columns import setting_cells, table_schema
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from damperfit.simulation import Response
    from damperfit.tables.reading import LogSignals
    from damperfit.units.shown_units import ShownUnits


def finite(value: Any) -> Any:
    """Return a cell; None for a number that no table and no JSON knows (NaN, infinity)."""
    return None if isinstance(value, float) and not isfinite(value) else value


# Arrow arrays from their buffers: `pyarrow.array` imports pandas, which every run would wait for.


def _floats(values: NDArray[np.float64]) -> pa.Array:
    data = np.ascontiguousarray(values, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), len(data), [None, pa.py_buffer(data)])


def _column(cells: Iterable[Any], kind: pa.DataType) -> pa.Array:
    """Return an Arrow array of type ``kind`` (float64, int64 or string); None and NaN are null."""
    values = [finite(cell) for cell in cells]
    is_valid = np.array([value is not None for value in values], dtype=np.bool_)
    validity = None if is_valid.all() else pa.py_buffer(np.packbits(is_valid, bitorder="little"))
    if kind == pa.string():
        shown = ["" if value is None else str(value) for value in values]
        texts = [text.encode("utf-8", "backslashreplace") for text in shown]
        offsets = np.cumsum([0, *map(len, texts)], dtype=np.int32)
        buffers = [validity, pa.py_buffer(offsets), pa.py_buffer(b"".join(texts))]
    else:
        dtype = np.int64 if kind == pa.int64() else np.float64
        data = np.array([0 if value is None else value for value in values], dtype=dtype)
        buffers = [validity, pa.py_buffer(data)]
    return pa.Array.from_buffers(kind, len(values), buffers)


def lay_out(
    name: str,
    rows: Sequence[Mapping[str, Any]],
    *,
    facts: Mapping[str, Any] | None = None,
    settings: Collection[Setting] = (),
    quantities: Sequence[Quantity] = (),
) -> pa.Table:
    """Return rows as a table of `columns`; cells that a row has not, or not finite, are null.

    Each row has its setting; the facts go into the ``damperfit`` entry of the schema.
    """
    schema = table_schema(name, facts or {}, settings=settings, quantities=quantities)
    is_whole = schema.field("setting").type == pa.int64()
    cells = [{**row, **setting_cells(row["setting"], is_whole=is_whole)} for row in rows]
    named = zip(schema.names, schema.types, strict=True)
    arrays = [_column([row.get(name) for row in cells], kind) for name, kind in named]
    return pa.Table.from_arrays(arrays, schema=schema)


def time_series_table(response: Response) -> pa.Table:
    """Return a simulated response as a table with one row a sample."""
    signals = (response.time, response.displacement, response.velocity, response.force)
    arrays = [_floats(one) for one in (*signals, *response.pressures)]
    return pa.Table.from_arrays(arrays, schema=table_schema("time_series", {}))


def write_responses(
    path: Path, logs: Iterable[LogSignals], facts: Mapping[str, Any] | None = None, **of: Any
) -> int:
    """Write measured and simulated signals, one row group per log, and return the rows written.

    The logs are taken one by one, so that memory need not grow with their number; the rest is as
    of `lay_out`.
    """
    schema = table_schema("responses", facts or {}, **of)
    n_rows = 0
    # A dictionary of numbers that never repeat costs twice the time and a sixth more space; to pack
    # them takes three tenths of the time, for a sixth less. Row groups are found by setting and
    # log; nobody looks for one by the range of its signals.
    repeating = ["setting", "log"]
    how: Any = {"write_page_checksum": True, "use_dictionary": repeating}
    how["compression"] = {n: "SNAPPY" if n in repeating else "NONE" for n in schema.names}
    how["write_statistics"] = schema.names[: schema.get_field_index("time_s")]
    with pq.ParquetWriter(path, schema, **how) as writer:
        for log in logs:
            table = _signals_table(schema, log)
            writer.write_table(table, row_group_size=max(table.num_rows, 1))
            n_rows += table.num_rows
    pa.default_memory_pool().release_unused()
    return n_rows


def responses_table(
    logs: Iterable[LogSignals], facts: Mapping[str, Any] | None = None, **of: Any
) -> pa.Table:
    """Return what `write_responses` writes as one table."""
    schema = table_schema("responses", facts or {}, **of)
    return pa.concat_tables([_signals_table(schema, log) for log in logs])


def _signals_table(schema: pa.Schema, log: LogSignals) -> pa.Table:
    is_whole = schema.field("setting").type == pa.int64()
    named = setting_cells(log.setting, is_whole=is_whole) | {"log": log.log}
    arrays = [
        pa.repeat(_column([cell], schema.field(name).type)[0], len(log.time))
        for name, cell in named.items()
    ]
    signals = (log.time, log.displacement, log.velocity, log.force_measured, log.force)
    arrays += map(_floats, (*signals, *log.pressures))
    return pa.Table.from_arrays(arrays, schema=schema)


def write_table(path: Path, table: pa.Table, *, suffix: str | None = None) -> None:
    """Write a table as Parquet (with page checksums) or CSV, by the suffix of the path or given."""
    suffix = (suffix or path.suffix).lower()
    if suffix == ".parquet":
        pq.write_table(table, path, write_page_checksum=True)
        return
    if suffix != ".csv":
        raise ConfigurationError(
            "tables are written as .csv or .parquet", subject=path.name, code="wrong-suffix"
        )
    columns = []
    for column in table.columns:
        cells = column.to_pylist()
        if not (pa.types.is_floating(column.type) or pa.types.is_integer(column.type)):
            cells = [safe_cell(c) if isinstance(c, str) else c and repr(c) for c in cells]
        columns.append(cells)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.column_names)
        writer.writerows(zip(*columns, strict=True))  # a number as its repr, None empty


def safe_cell(text: str) -> str:
    """Return text that no spreadsheet takes for a formula: an apostrophe before ``= + - @``."""
    return "'" + text if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


_ENDS = {"_N": "N", "_m_per_s": "m/s", "_m": "m"}


def table_in_units(table: pa.Table, units: ShownUnits) -> pa.Table:
    """Return a table whose columns name their units, with these units and numbers converted.

    For files that people open; programs read SI from Parquet. Columns that do not end with a unit,
    as the parameters', stay in SI.
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


# JSON documents

_PLAIN = frozenset({int, str, bool, type(None)})
_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False)


def json_values(value: Any) -> Any:
    """Return the value with every number that JSON does not know (NaN, infinity) as None."""
    if type(value) in _PLAIN:  # with numbers, lists and dictionaries of them nearly all there is
        return value
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): json_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(item) for item in value]
    return value.cell if isinstance(value, Setting) else value


def json_pieces(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield JSON values as text, piece by piece: what is listed has a line for each entry.

    Of some hundred settings the usual layout, every number on a line, costs more time than all else
    that is in the file; as one text it would take more memory than all else.

    Examples
    --------
    >>> print("".join(json_pieces({"a": [{"b": 1, "c": [2]}, {"b": 3}], "d": {"e": [4]}})), end="")
    {
      "a": [
        {"b": 1, "c": [2]},
        {"b": 3}
      ],
      "d": {
        "e": [4]
      }
    }
    """
    yield from _laid_out(document, "\n")
    yield "\n"


def _laid_out(value: Any, line: str) -> Iterator[str]:
    deeper = line + "  "
    if isinstance(value, dict) and value:
        for place, (key, item) in enumerate(value.items()):
            yield ("," if place else "{") + deeper + f"{_ENCODER.encode(key)}: "
            yield from _laid_out(item, deeper)
        yield line + "}"
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for place, item in enumerate(value):
            yield ("," if place else "[") + deeper + _ENCODER.encode(item)
        yield line + "]"
    else:
        yield _ENCODER.encode(value)
