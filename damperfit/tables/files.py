"""Tables to files and back: Parquet with page checksums, CSV that spreadsheets read safely.

What is written depends on the results alone, never on the clock, the machine or the number of
workers, so equal inputs give equal bytes. `damperfit.store` makes files appear whole or not at
all; the functions here write to whatever path they are given.
"""

from __future__ import annotations

import csv
import json
from contextlib import suppress
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.identification.outcome import Status
from damperfit.io.files import read_text, regular
from damperfit.store import settle
from damperfit.tables.columns import (
    PAPER_QUANTITIES,
    adjusters_in,
    quantities_in,
    read_setting,
    setting_cells,
    table_schema,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Campaign, SimulatedLog
    from damperfit.recording import Trace
    from damperfit.tested.setting import Place, Setting
    from damperfit.units.shown_units import ShownUnits

__all__ = [
    "column",
    "float_array",
    "read_facts",
    "read_known_numbers",
    "read_parameter_rows",
    "repeated",
    "safe_cell",
    "table_in_units",
    "table_quantities",
    "unlimited_names",
    "write_responses",
    "write_table",
]


# Arrow arrays from plain values and numpy arrays, straight from their buffers.
#
# `pyarrow.array` would do the same but imports pandas first, which every run would wait for.


def float_array(values: NDArray[np.float64]) -> pa.Array:
    """Return an Arrow array of the same numbers, without a copy where that is possible."""
    data = np.ascontiguousarray(values, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), len(data), [None, pa.py_buffer(data)])


def repeated(value: float | str, n: int) -> pa.Array:
    """Return an Arrow array of one number or text, ``n`` times."""
    if isinstance(value, int):
        return pa.Array.from_buffers(
            pa.int64(), n, [None, pa.py_buffer(np.full(n, value, dtype=np.int64))]
        )
    if isinstance(value, float):
        return float_array(np.full(n, value))
    data = _encoded(value)
    offsets = np.arange(n + 1, dtype=np.int32) * np.int32(len(data))
    return pa.Array.from_buffers(
        pa.string(), n, [None, pa.py_buffer(offsets), pa.py_buffer(data * n)]
    )


def column(values: Sequence[float | str | None], kind: pa.DataType) -> pa.Array:
    """Return an Arrow array of type ``kind`` (float64, int64 or string); None is null."""
    is_valid = np.array([value is not None for value in values], dtype=np.bool_)
    validity = None if is_valid.all() else pa.py_buffer(np.packbits(is_valid, bitorder="little"))
    if kind == pa.string():
        texts = [b"" if value is None else _encoded(str(value)) for value in values]
        offsets = np.cumsum([0, *(len(text) for text in texts)], dtype=np.int32)
        buffers = [validity, pa.py_buffer(offsets), pa.py_buffer(b"".join(texts))]
    else:
        dtype = np.int64 if kind == pa.int64() else np.float64
        data = np.array([0 if value is None else value for value in values], dtype=dtype)
        buffers = [validity, pa.py_buffer(data)]
    return pa.Array.from_buffers(kind, len(values), buffers)


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "backslashreplace")


def write_responses(
    path: Path,
    campaign: Campaign,
    comparisons: Iterable[SimulatedLog | None],
    *,
    provenance: Mapping[str, Any] | None = None,
) -> int:
    """Write measured and simulated signals of every setting, one row group per log.

    Parameters
    ----------
    path : pathlib.Path
        Where to write.
    campaign : Campaign
        The fits.
    comparisons : iterable of SimulatedLog or None
        What `damperfit.identification.compare` gives for each log of each fit, in their order; a
        log with None is left out. It is taken one by one, so that memory need not grow with the
        number of logs.
    provenance : mapping, optional
        Facts for the schema's ``damperfit`` entry, as JSON values.

    Returns
    -------
    int
        Rows written.
    """
    settings = [fit.setting for fit in campaign.fits]
    quantities = campaign.quantities or PAPER_QUANTITIES
    schema = table_schema("responses", provenance or {}, settings=settings, quantities=quantities)
    logs = ((fit.setting, log.trace) for fit in campaign.fits for log in fit.logs)
    n_rows = 0
    # A dictionary of numbers that never repeat costs twice the time and a sixth more space; to pack
    # them takes three tenths of the time, for a sixth less.
    repeating = ["setting", "log"]
    packed = {name: "SNAPPY" if name in repeating else "NONE" for name in schema.names}
    # Row groups are found by setting and log; nobody looks for one by the range of its signals.
    named = schema.names[: schema.get_field_index("time_s")]
    with pq.ParquetWriter(
        path,
        schema,
        write_page_checksum=True,
        use_dictionary=repeating,
        compression=packed,
        write_statistics=named,
    ) as writer:
        for (setting, trace), seen in zip(logs, comparisons, strict=True):
            if seen is None:
                continue
            table = _response_table(schema, setting, trace, seen)
            writer.write_table(table, row_group_size=max(table.num_rows, 1))
            n_rows += table.num_rows
    pa.default_memory_pool().release_unused()
    return n_rows


def _response_table(
    schema: pa.Schema, setting: Setting, trace: Trace, seen: SimulatedLog
) -> pa.Table:
    part = trace.compared
    n = trace.n_samples
    is_whole = schema.field("setting").type == pa.int64()
    arrays = [
        *(
            repeated(_as(place, schema.field(name).type), n)
            for name, place in setting_cells(setting, is_whole=is_whole).items()
        ),
        repeated(trace.name, n),
        float_array(seen.response.time[part]),
        float_array(trace.displacement[part]),
        float_array(trace.velocity[part]),
        float_array(trace.force[part]),
        float_array(seen.force[part]),
        *(float_array(pressure[part]) for pressure in seen.response.pressures),
    ]
    return pa.Table.from_arrays(arrays, schema=schema)


def _as(place: Place, kind: pa.DataType) -> Place:
    """Return where an adjuster stands as its column holds it."""
    if kind == pa.string():
        return str(place)
    return float(place) if kind == pa.float64() else place


def write_table(path: Path, table: pa.Table, *, suffix: str | None = None) -> None:
    """Write a table as Parquet (with page checksums) or CSV, chosen by the suffix.

    Parameters
    ----------
    path : pathlib.Path
        Where to write; see `damperfit.store` for writing whole or not at all.
    table : pyarrow.Table
        The table.
    suffix : str, optional
        ".parquet" or ".csv" when the path itself does not end so.

    Raises
    ------
    ConfigurationError
        The suffix is neither.
    """
    suffix = (suffix or path.suffix).lower()
    if suffix == ".parquet":
        pq.write_table(table, path, write_page_checksum=True)
    elif suffix == ".csv":
        _write_csv(path, table)
    else:
        raise ConfigurationError("tables are written as .csv or .parquet", subject=path.name)


def _write_csv(path: Path, table: pa.Table) -> None:
    columns = [column.to_pylist() for column in table.columns]
    for place, kind in enumerate(table.schema.types):
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            columns[place] = [_csv_cell(value) for value in columns[place]]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table.column_names)
        writer.writerows(zip(*columns, strict=True))  # a number as its repr, None empty


def _csv_cell(value: object) -> str:
    if value is None:
        return ""
    return safe_cell(value) if isinstance(value, str) else repr(value)


def safe_cell(text: str) -> str:
    """Return text that no spreadsheet takes for a formula.

    A cell that starts with ``= + - @``, tab or carriage return gets a leading apostrophe.
    Numbers are never touched.

    Examples
    --------
    >>> safe_cell("=1+1"), safe_cell("run.csv")
    ("'=1+1", 'run.csv')
    """
    return "'" + text if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


def read_known_numbers(path: Path) -> dict[Setting, dict[str, float]]:
    """Read what a parameters table tells of its own model's quantities, by setting and name.

    Empty cells are left out, and so are settings without a number.

    Parameters
    ----------
    path : pathlib.Path
        As of `read_parameter_rows`.

    Raises
    ------
    ConfigurationError, OutputError
        As `read_parameter_rows`.
    """
    known = _by_setting(path, table_quantities(path), needed=("setting",))
    return {setting: numbers for setting, numbers in known.items() if numbers}


def read_parameter_rows(
    path: Path, quantities: Sequence[Quantity], kinds: Mapping[str, type]
) -> tuple[dict[str, Any], ...]:
    """Return the rows of a parameters table, by column; None where a cell or a column is missing.

    Parameters
    ----------
    path : pathlib.Path
        A table written by `write_table`, or any table with the columns ``setting`` and those of the
        quantities in SI, as ``r_m1``, ``r_m2``, ``r_m3``, ``k_e``, ``f_f`` and perhaps ``f_0``.
    quantities : sequence of Quantity
        Of the model; a quantity that has a default may be absent.
    kinds : mapping of str to type
        The columns, and what stands in them.

    Raises
    ------
    ConfigurationError
        The file is missing, is no table, or lacks a column.
    OutputError
        Writing was interrupted in its folder, and the earlier table cannot be put back.
    """
    names = [name for name in kinds if name != "setting"]
    known = _rows_by_setting(path, quantities, needed=_without_default(quantities), more=names)
    try:
        return tuple(
            {"setting": setting}
            | {
                name: None if row.get(name) in (None, "") else kinds[name](row[name])
                for name in names
            }
            for setting, row in known.items()
        )
    except (ValueError, TypeError) as error:
        raise ConfigurationError(f"not a parameters table: {error}", subject=path) from error


def unlimited_names(row: Mapping[str, Any], quantities: Sequence[Quantity]) -> tuple[str, ...]:
    """Return the parameters of a row that the logs do not determine, and give no upper limit.

    Rigid oil is none of them: any stiffness above its limit gives the same force.
    """
    return tuple(
        one.name
        for one in quantities
        if not one.is_open
        and row.get(f"{one.name}_status") == Status.NOT_IDENTIFIABLE
        and row.get(f"{one.name}_ci_high") in (None, "")
    )


def _by_setting(
    path: Path, quantities: Sequence[Quantity], *, needed: Sequence[str]
) -> dict[Setting, dict[str, float]]:
    """Return the numbers of each row that tells its setting; empty cells are left out."""
    try:
        return {
            setting: {
                one.name: float(row[one.name])
                for one in quantities
                if row.get(one.name) not in (None, "")
            }
            for setting, row in _rows_by_setting(path, quantities, needed=needed).items()
        }
    except (ValueError, TypeError) as error:
        raise ConfigurationError(f"not a parameters table: {error}", subject=path) from error


def _rows_by_setting(
    path: Path,
    quantities: Sequence[Quantity],
    *,
    needed: Sequence[str],
    more: Sequence[str] = (),
) -> dict[Setting, dict[str, Any]]:
    """Return the cells of the quantities, and more of them, of each row that tells its setting."""
    settle(path.parent)
    wanted = tuple(dict.fromkeys(("setting", *(one.name for one in quantities), *more)))
    try:
        return {
            setting: row
            for row in _read_rows(path, quantities, needed, wanted)
            if (setting := read_setting(row, adjusters_in(tuple(row), quantities))) is not None
        }
    except OSError as error:
        raise ConfigurationError(
            f"cannot be read: {error.strerror or error}", subject=path
        ) from error
    except KeyError as error:
        raise ConfigurationError(
            f"not a parameters table: it has no column {error}", subject=path
        ) from error
    except (ValueError, TypeError, csv.Error, pa.ArrowException) as error:
        raise ConfigurationError(f"not a parameters table: {error}", subject=path) from error


def _without_default(quantities: Sequence[Quantity]) -> tuple[str, ...]:
    return ("setting", *(one.name for one in quantities if one.default is None))


def table_quantities(path: Path) -> tuple[Quantity, ...]:
    """Return the quantities that a table of parameters is of: as it, or run.json beside it, tells.

    Older tables are of the paper's model.
    """
    facts = read_facts(path)
    if "quantities" not in facts:
        with suppress(OSError, ValueError, RecursionError):
            record = json.loads(read_text(path.parent / "run.json"))
            facts = record if isinstance(record, dict) else {}
    return quantities_in(facts)


def read_facts(path: Path) -> dict[str, Any]:
    """Return what a Parquet table tells of the run that wrote it; empty where it tells nothing."""
    try:
        entry = (pq.read_schema(regular(path)).metadata or {}).get(b"damperfit", b"{}")
        facts = json.loads(entry)
    except (OSError, ValueError, RecursionError, pa.ArrowException):
        return {}
    return facts if isinstance(facts, dict) else {}


def _read_rows(
    path: Path, quantities: Sequence[Quantity], needed: Sequence[str], wanted: Sequence[str]
) -> list[dict[str, Any]]:
    if path.suffix.lower() == ".parquet":
        with pq.ParquetFile(regular(path), page_checksum_verification=True) as file:
            table = file.read()
        rows: list[dict[str, Any]] = table.select(
            [
                *(name for name in wanted[:1] if name in table.column_names),
                *adjusters_in(table.column_names, quantities),
                *(name for name in wanted[1:] if name in table.column_names),
            ]
        ).to_pylist()
        return _complete(rows, table.column_names, needed)
    lines = StringIO(read_text(path), newline="")
    reader = csv.DictReader(line for line in lines if not line.startswith("#"))
    return _complete(list(reader), reader.fieldnames or (), needed)


def _complete(
    rows: list[dict[str, Any]], names: Sequence[str], needed: Sequence[str]
) -> list[dict[str, Any]]:
    for name in needed:
        if name not in names:
            raise KeyError(name)
    return rows


# A table in the units people want, for files that they open; programs read SI from Parquet.

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
