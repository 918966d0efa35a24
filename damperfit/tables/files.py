"""Tables in files, written and read: Parquet with page checksums, and CSV; JSON.

What is written depends on the results alone, never on the clock, the machine or the number of
workers, so equal inputs give equal bytes. `damperfit.store` makes files appear whole or not at
all; the functions here write to whatever path they are given.
"""

from __future__ import annotations

import csv
import json
import re
from base64 import b64decode, b64encode
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from io import StringIO
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote
from zlib import compress, decompress
from zlib import error as zlib_error

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.damper.model import Quantity
from damperfit.errors import ConfigurationError
from damperfit.io.files import read_text, regular, sha256_of, why_unread
from damperfit.problem import Option, Problem, listed_names, note, warning
from damperfit.store import file_set, settle
from damperfit.tables.columns import (
    PAPER_QUANTITIES,
    TABLES,
    adjusters_in,
    column_kinds,
    quantities_in,
    read_setting,
    setting_cells,
    table_schema,
)
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    from damperfit.simulation import Response
    from damperfit.units.shown_units import ShownUnits

    Rows = tuple[dict[str, Any], ...]


RECORD = b"damperfit_record"  # in the footer of a fleet's part
PART_FOLDERS = ("serial-*", "serial=*")  # the latter of earlier versions
_OWN = ("version", "schema_version", "test", "configuration")  # of a table, not of run.json
_BROKEN = (OSError, ValueError, TypeError, KeyError, csv.Error, pa.ArrowException)
_SIGNALS = [name for name in column_kinds("responses") if name not in {"setting", "log"}]


class LogSignals(NamedTuple):
    """Measured and simulated signals of one log, its steady whole cycles, positive in rebound.

    The shape is (n,), in s, m, m/s and N; of the pressures (3, n), Pa absolute.
    """

    setting: Setting
    log: str
    time: FloatArray
    displacement: FloatArray
    velocity: FloatArray
    force_measured: FloatArray
    force: FloatArray
    pressures: FloatArray


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
    arrays = [_floats(signal) for signal in (*signals, *response.pressures)]
    return pa.Table.from_arrays(arrays, schema=table_schema("time_series", {}))


def write_responses(
    path: Path, logs: Iterable[LogSignals], facts: Mapping[str, Any] | None = None, **of: Any
) -> None:
    """Write measured and simulated signals, one row group per log.

    The logs are taken one by one, so that memory need not grow with their number; the rest is as
    of `lay_out`.
    """
    schema = table_schema("responses", facts or {}, **of)
    # A dictionary of numbers that never repeat costs twice the time and a sixth more space; to pack
    # them takes three tenths of the time, for a sixth less. Row groups are found by setting and
    # log, never by the range of their signals.
    repeating = ["setting", "log"]
    how: Any = {"write_page_checksum": True, "use_dictionary": repeating}
    how["compression"] = {n: "SNAPPY" if n in repeating else "NONE" for n in schema.names}
    how["write_statistics"] = schema.names[: schema.get_field_index("time_s")]
    with pq.ParquetWriter(path, schema, **how) as writer:
        for log in logs:
            table = _signals_table(schema, log)
            writer.write_table(table, row_group_size=max(table.num_rows, 1))
    pa.default_memory_pool().release_unused()


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


def sha256_of_table(table: pa.Table) -> str:
    """Return the SHA-256 of the Parquet file that `write_table` makes of a table."""
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, write_page_checksum=True)
    return sha256(sink.getvalue()).hexdigest()


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
    """Return the value with every number that JSON does not know as None, problems as sentences."""
    if type(value) in _PLAIN:  # with numbers, lists and dictionaries of them nearly all there is
        return value
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): json_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(item) for item in value]
    if isinstance(value, Problem):
        return value.sentence()
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


# A results folder, a table of parameters or a part of a fleet read back, for `results.Run`.
#
# Whatever is whole is returned; what is missing or damaged becomes a remark. What a file should
# hold run.json says: a column that its version did not write is not missing, and its cells
# are None. A part of a fleet is a table of parameters with what is compared of run.json in its
# metadata.


# One file


def read_facts(path: Path) -> dict[str, Any]:
    """Return what a Parquet table says about the run that wrote it; empty where it says nothing."""
    with suppress(OSError, ValueError, pa.ArrowException):
        return facts_of(pq.read_schema(regular(path)))
    return {}


def facts_of(schema: pa.Schema) -> dict[str, Any]:
    """Return what the schema of a table says about the run that made it."""
    with suppress(ValueError, RecursionError):
        facts = json.loads((schema.metadata or {}).get(b"damperfit", b"{}"))
        return facts if isinstance(facts, dict) else {}
    return {}


def _cells(path: Path) -> tuple[list[str], list[dict[str, Any]]]:
    """Return the names of a table's columns and its rows as they stand in the file."""
    if path.suffix.lower() == ".parquet":
        with pq.ParquetFile(regular(path), page_checksum_verification=True) as file:
            table = file.read()
        return table.column_names, table.to_pylist()
    lines = StringIO(read_text(path), newline="")
    reader = csv.DictReader((line for line in lines if not line.startswith("#")), strict=True)
    rows: list[dict[str, Any]] = list(reader)
    return list(reader.fieldnames or ()), rows


def typed_rows(
    table: str, rows: Iterable[Mapping[str, Any]], of: Sequence[Quantity], names: Sequence[str] = ()
) -> Rows:
    """Return the rows that say their setting, by column; None where a cell or a column is missing.

    They come from a file with columns of these names, or from a fit. A KeyError, TypeError or
    ValueError: a column of settings is missing, or a cell is not of its kind.
    """

    def cell(value: Any, kind: type) -> Any:
        is_empty = value is None or (value == "" and kind is not str)
        return None if is_empty else finite(kind(value))

    adjusters, kinds = adjusters_in(names, of), column_kinds(table, of)
    del kinds["setting"]
    return tuple(
        {"setting": setting} | {name: cell(row.get(name), kind) for name, kind in kinds.items()}
        for row in rows
        if (setting := read_setting(row, adjusters)) is not None
    )


def _reason(error: BaseException) -> str:
    text = str(getattr(error, "strerror", None) or error)
    return text.splitlines()[0] if text else type(error).__name__


# A results folder


def has_table(folder: Path, record: Mapping[str, Any], table: str) -> bool:
    """Whether the run wrote a table that not every run writes."""
    files = record.get("files")
    is_listed = isinstance(files, dict) and f"{table}.parquet" in files
    return is_listed or any((folder / f"{table}{end}").is_file() for end in (".parquet", ".csv"))


def read_record(path: Path, problems: list[Problem]) -> dict[str, Any]:
    """Return run.json; empty, with a problem, where it cannot be read."""
    why = "is not a JSON object"
    try:
        document = json.loads(read_text(path))
        if isinstance(document, dict):
            return document
    except FileNotFoundError:
        why = "is missing"
    except (OSError, ValueError, RecursionError) as error:
        why = f"cannot be read ({_reason(error)})"
    text = "run.json {why}: rig, inputs and warnings are not known"
    problems.append(warning("no-record", text, why=why))
    return {}


def check_files(
    folder: Path, record: dict[str, Any], problems: list[Problem], parts: Sequence[str]
) -> None:
    """Add the files that are not those the run wrote."""
    files = record.get("files")
    for name, expected in files.items() if isinstance(files, dict) else ():
        path = folder / str(name)
        is_asked = path.stem in parts and path.suffix == ".parquet" and path.parent == folder
        if is_asked and path.is_file() and sha256_of(path) != expected:
            text = "{file} is not the file that the run wrote (see run.json)"
            problems.append(warning("other-file", text, file=name))


def read_rows(
    folder: Path,
    table: str,
    problems: list[Problem],
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
    record: Mapping[str, Any] | None = None,
) -> Rows:
    """Return the rows of a table, from Parquet, else from CSV; a lost column is reported."""
    schema = (record or {}).get("schema")
    columns = schema.get(table) if isinstance(schema, dict) else None
    listed = [c for c in columns if isinstance(c, dict)] if isinstance(columns, list) else []
    written = [str(column["name"]) for column in listed if "name" in column]
    for suffix in (".parquet", ".csv"):
        path = folder / (table + suffix)
        try:
            names, cells = _cells(path)
            if "setting" not in names:
                raise KeyError("setting")  # noqa: TRY301 - as of a damaged file
            rows = typed_rows(table, cells, quantities, names)
        except FileNotFoundError:
            problems.append(_lost(path, "is missing"))
        except KeyError as error:
            problems.append(_lost(path, f"has no column {error.args[0]}"))
        except _BROKEN as error:
            problems.append(_lost(path, f"cannot be read: {_reason(error)}"))
        else:
            if rows and (lost := [name for name in written if name not in names]):
                problems.append(_lost(path, f"has no column {listed_names(lost)}"))
            return rows
    return ()


def _lost(path: Path, why: str) -> Problem:
    return warning("lost-data", "{file} {why}", file=path.name, why=why)


def read_signals(
    folder: Path, problems: list[Problem], quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> Iterator[LogSignals]:
    """Yield the signals of each log; a damaged row group costs that log alone."""
    path = folder / "responses.parquet"
    try:
        with pq.ParquetFile(regular(path), page_checksum_verification=True) as file:
            columns = file.schema_arrow.names
            wanted = ("setting", "log", *_SIGNALS)
            if missing := [name for name in wanted if name not in columns]:
                problems.append(_lost(path, f"has no column {', '.join(missing)}: no loops"))
                return
            adjusters = adjusters_in(columns, quantities)
            for group in range(file.num_row_groups):
                try:
                    table = file.read_row_group(group, columns=[*wanted, *adjusters])
                except _BROKEN as error:
                    text = "{file}: log {number} is damaged: {why}"
                    about = {"file": path.name, "number": group + 1, "why": _reason(error)}
                    problems.append(warning("damaged-log", text, **about))
                    continue
                yield from _each_log(table, adjusters)
    except FileNotFoundError:
        problems.append(_lost(path, "is missing: no loops"))
    except _BROKEN as error:
        problems.append(_lost(path, f"cannot be read: {_reason(error)}"))


def _each_log(table: pa.Table, adjusters: Sequence[str]) -> Iterator[LogSignals]:
    """Yield the logs of a row group: one as we write it, several where another program did."""
    keys = table.select(["setting", "log", *adjusters]).to_pylist()
    edges = [k for k in range(1, len(keys)) if keys[k] != keys[k - 1]]
    signals = [np.asarray(table.column(name).to_numpy(), dtype=np.float64) for name in _SIGNALS]
    for first, stop in pairwise([0, *edges, len(keys)] if keys else []):
        time, x, v, measured, force, *pressures = (signal[first:stop] for signal in signals)
        setting = read_setting(keys[first], adjusters) or Setting.of(0)
        log, stacked = str(keys[first]["log"]), np.stack(pressures)
        yield LogSignals(setting, log, time, x, v, measured, force, stacked)


# A table of parameters, of a run or of somebody's own


def table_quantities(path: Path, record: Mapping[str, Any] | None = None) -> tuple[Quantity, ...]:
    """Return what a table of parameters is of: as it says itself, else run.json, else the paper's.

    ``record`` is run.json of a results folder; where it is lost the columns say what there is.
    """
    facts = read_facts(path)
    if "quantities" in facts:
        return quantities_in(facts)
    columns: list[str] = []
    for table in dict.fromkeys((path, path.with_suffix(".csv"))):
        with suppress(*_BROKEN):
            columns = columns or _cells(table)[0]
    beside = read_record(path.parent / "run.json", []) if record is None else record
    return quantities_in(beside, columns)


def read_table(
    path: Path, *, is_whole: bool = True
) -> tuple[dict[str, Any], tuple[Quantity, ...], Rows, str]:
    """Return what a table of parameters and run.json beside it say, and where the damper stands.

    It was written by `write_table`, or is any table with the columns ``setting`` and those of the
    quantities in SI; ``is_whole``: of each quantity that has no default.
    """
    settle(path.parent)
    quantities = table_quantities(path)
    needed = [q.name for q in quantities if q.default is None] if is_whole else []
    try:
        names, cells = _cells(path)
        for name in ("setting", *needed):
            if name not in names:
                raise ConfigurationError(
                    f"not a parameters table: it has no column '{name}'",
                    subject=path,
                    code="not-a-table",
                )
        rows = typed_rows("parameters", cells, quantities, names)
    except OSError as error:
        raise ConfigurationError(why_unread(error), subject=path, code="unreadable") from error
    except (ValueError, TypeError, csv.Error, pa.ArrowException) as error:
        raise ConfigurationError(
            f"not a parameters table: {error}", subject=path, code="not-a-table"
        ) from error
    facts, beside = read_facts(path), read_record(path.parent / "run.json", [])
    is_declared = isinstance(facts.get("configuration"), dict)
    source = path if is_declared or not beside else path.parent / "run.json"
    own = {key: facts[key] for key in _OWN if key in facts}
    return beside | own, quantities, rows, str(source)


def read_known_numbers(path: Path) -> dict[Setting, dict[str, float]]:
    """Read the quantities of its own model in a parameters table, by setting and name.

    Empty cells are left out, and so are settings without a number; errors as of `read_table`.
    """
    _, quantities, rows, _ = read_table(path, is_whole=False)
    names = [q.name for q in quantities]
    by_setting = {row["setting"]: {n: row[n] for n in names if row[n] is not None} for row in rows}
    return {setting: numbers for setting, numbers in by_setting.items() if numbers}


# A part of a fleet

_DATE = re.compile(r"\d{4}-\d\d-\d\d.*")  # dates that sort


def _parts_of(folder: Path) -> list[Path]:
    is_ours = folder.name.startswith(("serial-", "serial="))
    return sorted(folder.glob("part-*.parquet")) if is_ours else []


def serial_in(folder: Path) -> str:
    """Return the serial number that a folder of parts is called by, as it is spelled there."""
    return folder.name.removeprefix("serial-").removeprefix("serial=")


def packed(record: Mapping[str, Any]) -> str:
    """Return a record as text for the footer of a part."""
    return b64encode(compress(json.dumps(record, sort_keys=True).encode(), 9)).decode()


def unpacked(text: bytes) -> dict[str, Any]:
    """Return the record that a footer holds."""
    try:
        record = json.loads(decompress(b64decode(text))) if text else {}
    except zlib_error as error:
        raise ValueError(str(error)) from error
    return record if isinstance(record, dict) else {}


def is_part(path: Path) -> bool:
    """Whether a path is a part, or the folder of a serial number that holds parts."""
    if path.is_dir():
        return bool(_parts_of(path))
    return path.name.startswith("part-") and path.suffix == ".parquet" and path.is_file()


def part_in(path: Path, problems: list[Problem]) -> Path:
    """Return the part that a path names, itself or as the folder of its serial number.

    Of several tests it is the last, with a note; they are refused where it is not known which.
    """
    if not path.is_dir():
        return path
    parts = tests_in(path)
    *earlier, last = sorted(parts)
    names = [f"{parts[date].name} ({date.partition(',')[0]})" for date in (*earlier, last)]
    if earlier and not all(map(_DATE.fullmatch, parts)):
        text = f"several tests of one damper; name one of {', '.join(names)}"
        raise ConfigurationError(text, subject=path, code="several-tests")
    if earlier:
        text = "of {n} tests the last is taken, of {date}; before it: {names}"
        about = {"n": len(parts), "date": last, "names": listed_names(names[:-1])}
        problems.append(note("several-tests", text, **about))
    return parts[last]


def tests_in(folder: Path) -> dict[str, Path]:
    """Return the parts in the folder of a serial number, by the dates of their tests."""
    parts: dict[str, Path] = {}
    for part in _parts_of(folder):
        dates: list[str] = []
        with suppress(*_BROKEN):
            dates = pq.ParquetFile(part).read(columns=["date"])["date"].drop_null().to_pylist()
        date = max(dates, default="no date")
        parts[f"{date}, {part.name}" if date in parts else date] = part
    return parts


def part_table(path: Path) -> tuple[pa.Table, dict[str, Any]]:
    """Return the rows of a part, and what it keeps of run.json; a damaged one is refused."""
    try:
        file = pq.ParquetFile(regular(path), page_checksum_verification=True)
        return file.read(), unpacked((file.metadata.metadata or {}).get(RECORD, b""))
    except (OSError, pa.ArrowInvalid, ValueError) as error:
        raise ConfigurationError(
            f"damaged ({error}); remove it, and the next damperfit fleet makes it again",
            subject=path,
            code="damaged",
        ) from error


def read_part(
    path: Path, problems: list[Problem]
) -> tuple[dict[str, Any], tuple[Quantity, ...], Rows]:
    """Return what a part keeps of run.json, its quantities, and its rows of parameters."""
    table, record = part_table(path := part_in(path, problems))
    table = table.select([name for name in table.column_names if name != "serial"])
    if not record:
        raise ConfigurationError(
            "does not say which damper and motion it is of: from an earlier version, of "
            "several dampers, or without a fit; remove it, and the next damperfit fleet makes it "
            "again",
            subject=path,
            code="no-damper",
        )
    quantities = quantities_in(record)
    adjusters = adjusters_in(table.column_names, quantities)
    # A setting is text here: what it was in the run, the record says.
    cells = (entry["setting"] for entry in record.get("uncertainty") or () if "setting" in entry)
    cell_of = {str(cell): cell for cell in cells}
    rows = [row for row in table.to_pylist() if not row["error_kind"]]
    for row in rows:
        row["setting"] = (
            Setting(tuple((name, parse_place(row[name])) for name in adjusters))
            if len(adjusters) > 1
            else Setting.of(cell_of.get(row["setting"], row["setting"]))
        )
    return record, quantities, tuple(rows)


def _serial_folder(place: Path) -> Path | None:
    """Of a part, or of a folder of parts; None of other results."""
    return None if not is_part(place) else place if place.is_dir() else place.parent


def written_of(place: Path, name: str) -> Path:
    """Return where what is made of results goes: of a fleet's part beside all parts."""
    serial = _serial_folder(place)
    # Readers of a folder of Parquet leave out what begins with an underscore.
    return place if serial is None else serial.parent / f"_{name}" / serial.name


def title_of(place: Path) -> str:
    """Return whose results these are, for a heading."""
    serial = _serial_folder(place)
    if serial is None:
        return place.resolve().name or str(place)
    return unquote(serial_in(serial), errors="replace")


# Folders of results: what an earlier run left there and a new one must not keep, or not lose.
#
# Page and figures are drawn after the run, on request; beside new tables the old ones would show
# other numbers. Only files with the names that damperfit gives them go.

_BESIDE = "folders_of_this_run"  # in run.json, where one command wrote results of several dampers
_DRAWN = re.compile(
    r"(mse|fan|absolute_velocity|peak_force|named_speeds|(parameter|profile)_\w+"
    r"|setting_[\w.+-]+_(force_velocity|force_displacement|force_time|residual|pressures|peaks|valves))"
    r"\.(png|svg|pdf)"
)
_WRITTEN = re.compile(rf"({'|'.join(TABLES)})\.(csv|parquet)|run\.json|report\.(md|html)")


def holds_fits(folder: Path) -> bool:
    """Whether a folder holds the results of a run that fitted something."""
    try:
        rows = [line for line in read_text(folder / "parameters.csv").splitlines() if line.strip()]
    except (OSError, ValueError):
        return False
    return (folder / "run.json").is_file() and len(rows) > 1


def spare_others(folder: Path) -> None:
    """Refuse a folder in which results would replace what somebody else has put there."""
    if (folder / "run.json").exists() or not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        if _WRITTEN.fullmatch(path.name):
            text = (
                "is there already, without a run.json of damperfit; nothing "
                "was written. Move it away, or give another {out}"
            )
            raise ConfigurationError(text, code="not-ours", subject=path, out=Option("out"))


def forget_others(folder: Path, written: Sequence[str]) -> None:
    """Remove what an earlier command left in a results folder: it holds one run only.

    ``written`` are the folders inside that this command writes; "" for itself. A folder inside goes
    only where its run.json says that it was written as one of several dampers; what somebody put
    there by another command stays.
    """
    if "" not in written:
        _forget_run(folder)
    with suppress(OSError):
        for inside in sorted(folder.iterdir()):
            siblings = (
                read_record(inside / "run.json", []).get(_BESIDE) if inside.is_dir() else None
            )
            is_listed = isinstance(siblings, list) and inside.name in siblings
            if is_listed and inside.name not in written and not inside.is_symlink():
                _forget_run(inside)
                with suppress(OSError):  # what else it holds stays
                    inside.rmdir()


def _forget_run(folder: Path) -> None:
    if (folder / "run.json").is_file():
        with file_set(folder) as files:
            for path in folder.iterdir():
                if _WRITTEN.fullmatch(path.name) and path.is_file():
                    files.without(path.name)
        forget_figures(folder)


def forget_figures(folder: Path) -> None:
    """Remove the figures that damperfit drew into the results folder, and their folder if empty."""
    figures = folder / "figures"
    with suppress(OSError):  # what cannot be removed is no reason to lose the run
        if figures.is_symlink() or not figures.is_dir():
            return
        for path in figures.iterdir():
            if _DRAWN.fullmatch(path.name):
                path.unlink()
        figures.rmdir()
