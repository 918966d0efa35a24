"""Files of a run read back, for `damperfit.results.Run`: rows of tables, signals, run.json.

Whatever is whole is returned; what is missing, damaged or of another version becomes a remark.
Every column may be absent: then its cells are None. A part of a fleet is a table of parameters with
what is compared of run.json in its metadata.
"""

from __future__ import annotations

import csv
import hashlib
import json
from contextlib import suppress
from dataclasses import dataclass
from io import StringIO
from itertools import pairwise
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.io.files import read_text, regular
from damperfit.tables.columns import (
    PAPER_QUANTITIES,
    adjusters_in,
    column_kinds,
    is_late,
    quantities_in,
    read_setting,
)
from damperfit.tables.files import read_facts, read_parameter_rows, table_quantities
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.damper.quantity import Quantity

    FloatArray = NDArray[np.float64]

__all__ = [
    "RECORD",
    "LogSignals",
    "check_files",
    "has_table",
    "is_part",
    "part_in",
    "read_part",
    "read_quantities",
    "read_record",
    "read_rows",
    "read_signals",
    "read_table",
    "rows_of",
    "title_of",
    "written_of",
]

_OWN = ("version", "schema_version", "test", "configuration")  # of a table, not of run.json
RECORD = b"damperfit_record"  # of the schema's metadata of a fleet's part

_BROKEN = (OSError, ValueError, TypeError, KeyError, csv.Error, pa.ArrowException)
_MANY = 6  # columns that are named when they are missing
_SIGNALS = (
    "time_s",
    "displacement_m",
    "velocity_m_per_s",
    "force_measured_N",
    "force_N",
    "pressure_1_Pa",
    "pressure_2_Pa",
    "pressure_3_Pa",
)


@dataclass(frozen=True, slots=True, eq=False)
class LogSignals:
    """Measured and simulated signals of one log, its steady whole cycles.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    log : str
        Name of the log.
    time, displacement, velocity, force_measured, force : numpy.ndarray
        Shape (n,); s, m, m/s, N; positive in rebound.
    pressures : numpy.ndarray
        Shape (3, n), Pa absolute.
    """

    setting: Setting
    log: str
    time: FloatArray
    displacement: FloatArray
    velocity: FloatArray
    force_measured: FloatArray
    force: FloatArray
    pressures: FloatArray


def has_table(folder: Path, record: Mapping[str, Any], table: str) -> bool:
    """Whether the run wrote a table that not every run writes."""
    files = record.get("files")
    is_listed = isinstance(files, dict) and f"{table}.parquet" in files
    return is_listed or any((folder / f"{table}{end}").is_file() for end in (".parquet", ".csv"))


def read_quantities(folder: Path, record: Mapping[str, Any]) -> tuple[Quantity, ...]:
    """What the table of parameters is of: as it says itself, else run.json, else its columns."""
    try:
        schema = pq.read_schema(regular(folder / "parameters.parquet"))
        facts = json.loads((schema.metadata or {}).get(b"damperfit", b"{}"))
        if isinstance(facts, dict) and "quantities" in facts:
            return quantities_in(facts)
        columns = schema.names
    except (*_BROKEN, RecursionError):
        columns = []
        with suppress(OSError, UnicodeDecodeError):
            text = read_text(folder / "parameters.csv")
            columns = text.partition("\n")[0].split(",")
    return quantities_in(record, columns)


def read_record(path: Path, remarks: list[str]) -> dict[str, Any]:
    """Return run.json; empty, with a remark, where it cannot be read."""
    try:
        document = json.loads(read_text(path))
    except FileNotFoundError:
        remarks.append("run.json is missing: rig, inputs and warnings are not known")
    except (OSError, ValueError, RecursionError) as error:
        remarks.append(f"run.json cannot be read ({_reason(error)}): rig and inputs are not known")
    else:
        if isinstance(document, dict):
            return document
        remarks.append("run.json is not a JSON object: rig, inputs and warnings are not known")
    return {}


def check_files(
    folder: Path, record: dict[str, Any], remarks: list[str], parts: Sequence[str]
) -> None:
    """Remark on files that are not those the run wrote."""
    files = record.get("files")
    for name, expected in files.items() if isinstance(files, dict) else ():
        path = folder / str(name)
        if path.stem not in parts:
            continue
        if path.parent != folder or path.suffix != ".parquet" or not path.is_file():
            continue
        with path.open("rb") as file:
            if hashlib.file_digest(file, "sha256").hexdigest() != expected:
                remarks.append(f"{name} is not the file that the run wrote (see run.json)")


def read_rows(
    folder: Path, table: str, remarks: list[str], quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> tuple[dict[str, Any], ...]:
    """Return the rows of a table, from Parquet, else from CSV."""
    kinds = column_kinds(table, quantities)
    for suffix, read in ((".parquet", _parquet_rows), (".csv", _csv_rows)):
        path = folder / (table + suffix)
        try:
            rows = [_clean(row, kinds, quantities) for row in read(path)]
        except FileNotFoundError:
            remarks.append(f"{path.name} is missing")
        except _BROKEN as error:
            remarks.append(f"{path.name} cannot be read: {_reason(error)}")
        else:
            missing = [name for name in kinds if not rows or name not in rows[0]]
            missing = [name for name in missing if not is_late(name)]
            if rows and missing:
                more = f" and {len(missing) - _MANY} more" if len(missing) > _MANY else ""
                remarks.append(f"{path.name} has no column {', '.join(missing[:_MANY])}{more}")
            whole = [{name: row.get(name) for name in kinds} for row in rows]
            return tuple(row for row in whole if row["setting"] is not None)
    return ()


def rows_of(
    table: pa.Table, name: str, quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> tuple[dict[str, Any], ...]:
    """Return the rows of a table in memory, as `read_rows` reads them from a file."""
    kinds = column_kinds(name, quantities)
    rows = (_clean(row, kinds, quantities) for row in table.to_pylist())
    return tuple({name: row.get(name) for name in kinds} for row in rows)


def _clean(
    row: dict[str, Any], kinds: dict[str, type], quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> dict[str, Any]:
    cells = ((name, kind) for name, kind in kinds.items() if name in row and name != "setting")
    cells_of_row = {name: _cell(row[name], kind) for name, kind in cells}
    return cells_of_row | (
        {"setting": read_setting(row, adjusters_in(tuple(row), quantities))}
        if "setting" in row
        else {}
    )


def _cell(value: Any, kind: type) -> Any:
    if value is None or (value == "" and kind is not str):
        return None
    return kind(value)


def _parquet_rows(path: Path) -> list[dict[str, Any]]:
    with pq.ParquetFile(regular(path), page_checksum_verification=True) as file:
        rows: list[dict[str, Any]] = file.read().to_pylist()
    return rows


def _csv_rows(path: Path) -> list[dict[str, Any]]:
    return list(csv.DictReader(StringIO(read_text(path), newline=""), strict=True))


def read_signals(
    folder: Path, remarks: list[str], quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> Iterator[LogSignals]:
    """Yield the signals of each log; a damaged row group costs that log alone."""
    path = folder / "responses.parquet"
    try:
        with pq.ParquetFile(regular(path), page_checksum_verification=True) as file:
            wanted = ("setting", "log", *_SIGNALS)
            missing = [name for name in wanted if name not in file.schema_arrow.names]
            if missing:
                remarks.append(f"{path.name} has no column {', '.join(missing)}: no loops")
                return
            named = adjusters_in(file.schema_arrow.names, quantities)
            for group in range(file.num_row_groups):
                try:
                    table = file.read_row_group(group, columns=["setting", *named, *wanted[1:]])
                except _BROKEN as error:
                    remarks.append(f"{path.name}: log {group + 1} is damaged: {_reason(error)}")
                    continue
                yield from _split(table, quantities)
    except FileNotFoundError:
        remarks.append(f"{path.name} is missing: no loops")
    except _BROKEN as error:
        remarks.append(f"{path.name} cannot be read: {_reason(error)}")


def _split(
    table: pa.Table, quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> Iterator[LogSignals]:
    """Yield each log of a table whose rows stand log by log."""
    if table.num_rows == 0:
        return
    names = table.column("log").combine_chunks().dictionary_encode()
    settings = table.column("setting").to_pylist()
    named = adjusters_in(table.column_names, quantities)
    codes = names.indices.to_numpy(zero_copy_only=False)
    edges = (
        np.flatnonzero(
            (np.diff(codes) != 0)
            | np.array([a != b for a, b in pairwise(settings)], dtype=np.bool_)
        )
        + 1
    )
    signals = [np.asarray(table.column(name).to_numpy(), dtype=np.float64) for name in _SIGNALS]
    for start, stop in zip([0, *edges], [*edges, table.num_rows], strict=True):
        time, x, v, measured, force, *pressures = (signal[start:stop] for signal in signals)
        yield LogSignals(
            setting=read_setting(
                table.select(["setting", *named]).slice(start, 1).to_pylist()[0], named
            )
            or Setting.of(0),
            log=str(names.dictionary[int(codes[start])].as_py()),
            time=time,
            displacement=x,
            velocity=v,
            force_measured=measured,
            force=force,
            pressures=np.stack(pressures),
        )


def _reason(error: BaseException) -> str:
    strerror = getattr(error, "strerror", None)
    return str(strerror or error).splitlines()[0] if str(error) else type(error).__name__


def parts_of(folder: Path) -> list[Path]:
    """Return the parts in the folder of one serial number."""
    return sorted(folder.glob("part-*.parquet")) if folder.name.startswith("serial=") else []


def is_part(path: Path) -> bool:
    """Whether a path is a part, or the folder of a serial number that holds parts."""
    if path.is_dir():
        return bool(parts_of(path))
    return path.name.startswith("part-") and path.suffix == ".parquet" and path.is_file()


def part_in(path: Path) -> Path:
    """Return the part that a path names, itself or as the folder of its serial number.

    Raises
    ------
    ConfigurationError
        There are several.
    """
    if not path.is_dir():
        return path
    parts = parts_of(path)
    if len(parts) > 1:
        names = ", ".join(one.name for one in parts)
        raise ConfigurationError(f"several tests of one damper; name one of {names}", subject=path)
    return parts[0]


def read_part(
    path: Path,
) -> tuple[dict[str, Any], tuple[Quantity, ...], tuple[dict[str, Any], ...]]:
    """Return what a part keeps of run.json, its quantities, and its rows of parameters.

    Raises
    ------
    ConfigurationError
        There are several, it is damaged, or it does not tell its damper.
    """
    path = part_in(path)
    try:
        table = pq.ParquetFile(regular(path), page_checksum_verification=True).read()
        record = json.loads((table.schema.metadata or {}).get(RECORD, b"{}"))
    except (OSError, pa.ArrowInvalid, ValueError) as error:
        raise ConfigurationError(
            f"damaged ({error}); remove it, and the next damperfit fleet makes it again",
            subject=path,
        ) from error
    if not record:
        raise ConfigurationError(
            "does not say which damper and motion it is of: from an earlier version, of "
            "several dampers, or without a fit; remove it, and the next damperfit fleet makes it "
            "again",
            subject=path,
        )
    rows = [row for row in table.to_pylist() if not row["error_kind"]]
    quantities = quantities_in(record, table.column_names)
    adjusters = adjusters_in(table.column_names, quantities)
    known = {str(cell): cell for cell in _cells(record)}
    of_settings = tuple({**row, "setting": _setting(row, adjusters, known)} for row in rows)
    return record, quantities, of_settings


def read_table(
    path: Path,
) -> tuple[dict[str, Any], tuple[Quantity, ...], tuple[dict[str, Any], ...], str]:
    """Return what a table of parameters and run.json beside it tell, and where the damper stands.

    Raises
    ------
    ConfigurationError
        The file is missing, is no table, or lacks a column.
    """
    facts = read_facts(path)
    beside = read_record(path.parent / "run.json", [])
    is_told = isinstance(facts.get("configuration"), dict)
    quantities = table_quantities(path)
    rows = read_parameter_rows(path, quantities, column_kinds("parameters", quantities))
    source = path if is_told or not beside else path.parent / "run.json"
    own = {key: facts[key] for key in _OWN if key in facts}
    return beside | own, quantities, rows, str(source)


def written_of(place: Path, name: str) -> Path:
    """Return where what is made of results goes: beside a fleet's parts, which programs read whole.

    Parameters
    ----------
    place : pathlib.Path
        As `results_in` takes it.
    name : str
        What is made; a folder of the fleet.

    Examples
    --------
    >>> from pathlib import Path
    >>> written_of(Path("results"), "reports").as_posix()
    'results'
    """
    if not is_part(place):
        return place
    serial = place if place.is_dir() else place.parent
    # Readers of a folder of Parquet leave out what begins with an underscore.
    return serial.parent / f"_{name}" / serial.name


def title_of(place: Path) -> str:
    """Return whose results these are, for a heading."""
    if not is_part(place):
        return place.resolve().name or str(place)
    serial = place if place.is_dir() else place.parent
    return unquote(serial.name.removeprefix("serial="), errors="replace")


def _cells(record: dict[str, Any]) -> list[int | str]:
    return [one["setting"] for one in record.get("uncertainty") or () if "setting" in one]


def _setting(row: dict[str, Any], names: Any, known: dict[str, int | str]) -> Setting:
    text = row["setting"]
    if len(names) > 1:
        return Setting(tuple((name, parse_place(row[name])) for name in names))
    return Setting.of(known.get(text, text))
