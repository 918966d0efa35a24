"""A results folder read back: tables, signals by log, run.json, and what was wrong with them.

Whatever is whole is returned; what is missing, damaged or of another version becomes a remark.
Every column may be absent: then its cells are None.
"""

from __future__ import annotations

import csv
import hashlib
import json
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.recording import natural_order
from damperfit.store import settle
from damperfit.tables.columns import (
    adjusters_in,
    column_kinds,
    is_late,
    read_setting,
    unknown_schema,
)
from damperfit.tables.quantities import PAPER_QUANTITIES, quantities_in
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from damperfit.damper.quantity import Quantity

    FloatArray = NDArray[np.float64]

__all__ = ["LogSignals", "Results", "read_results"]

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


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """What stands in a results folder.

    Attributes
    ----------
    parameters, mse : tuple of dict
        Rows of the tables, by column; None where a cell or a column is missing.
    logs : tuple of LogSignals
        Signals by setting and log.
    record : dict
        run.json, empty when there is none.
    remarks : tuple of str
        What was missing, damaged or written by another version.
    quantities : tuple of Quantity
        What the columns of ``parameters`` are of.
    valves : tuple of dict
        Rows of the table of valves; empty where the model has none.
    """

    parameters: tuple[dict[str, Any], ...]
    mse: tuple[dict[str, Any], ...]
    logs: tuple[LogSignals, ...]
    record: dict[str, Any]
    remarks: tuple[str, ...]
    quantities: tuple[Quantity, ...] = PAPER_QUANTITIES
    valves: tuple[dict[str, Any], ...] = ()


def read_results(
    folder: Path, *, parts: Sequence[str] = ("parameters", "mse", "responses", "valves")
) -> Results:
    """Read what `identify` wrote.

    Parameters
    ----------
    folder : pathlib.Path
        Results folder.
    parts : sequence of str
        Tables to read; the others are neither looked at nor remarked on. run.json always is.

    Raises
    ------
    ConfigurationError
        There is no such folder, or neither parameters nor responses can be read from it.
    OutputError
        Writing was interrupted there, and the earlier results cannot be put back.
    """
    if not folder.is_dir():
        raise ConfigurationError(
            f"{folder}: no such folder; expected the results of damperfit identify"
        )
    settle(folder)
    remarks: list[str] = []
    record = _record(folder / "run.json", remarks)
    remarks.extend(filter(None, [unknown_schema(record)]))
    _check_files(folder, record, remarks, parts)
    quantities = _quantities(folder, record)
    parameters: tuple[dict[str, Any], ...] = ()
    if "parameters" in parts:
        parameters = _rows(folder, "parameters", remarks, quantities)
    mse = _rows(folder, "mse", remarks, quantities) if "mse" in parts else ()
    valves: tuple[dict[str, Any], ...] = ()
    if "valves" in parts and _is_part(folder, record, "valves"):
        valves = _rows(folder, "valves", remarks, quantities)
    signals = _logs(folder, remarks, quantities) if "responses" in parts else ()
    logs = tuple(sorted(signals, key=lambda log: (log.setting, natural_order(log.log))))
    if not parameters and not logs:
        raise ConfigurationError(
            f"{folder}: nothing to show, {'; '.join(remarks) or 'its tables are empty'}; "
            "run damperfit identify LOGS --out FOLDER first"
        )
    parameters = _once(parameters, remarks)
    _check_settings(parameters, logs, remarks)
    said = tuple(dict.fromkeys(remarks))
    return Results(parameters, mse, logs, record, said, quantities, valves)


def _is_part(folder: Path, record: dict[str, Any], table: str) -> bool:
    """Whether the run wrote a table that not every run writes."""
    files = record.get("files")
    is_listed = isinstance(files, dict) and f"{table}.parquet" in files
    return is_listed or any((folder / f"{table}{end}").is_file() for end in (".parquet", ".csv"))


def _quantities(folder: Path, record: dict[str, Any]) -> tuple[Quantity, ...]:
    """What the table of parameters is of: as it says itself, else run.json, else its columns."""
    try:
        schema = pq.read_schema(folder / "parameters.parquet")
        facts = json.loads((schema.metadata or {}).get(b"damperfit", b"{}"))
        if isinstance(facts, dict) and "quantities" in facts:
            return quantities_in(facts)
        columns = schema.names
    except (*_BROKEN, RecursionError):
        columns = []
        with suppress(OSError, UnicodeDecodeError):
            text = (folder / "parameters.csv").read_text(encoding="utf-8-sig")
            columns = text.partition("\n")[0].split(",")
    return quantities_in(record, columns)


def _record(path: Path, remarks: list[str]) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        remarks.append("run.json is missing: rig, inputs and warnings are not known")
    except (OSError, ValueError, RecursionError) as error:
        remarks.append(f"run.json cannot be read ({_reason(error)}): rig and inputs are not known")
    else:
        if isinstance(document, dict):
            return document
        remarks.append("run.json is not a JSON object: rig, inputs and warnings are not known")
    return {}


def _check_files(
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


def _once(rows: tuple[dict[str, Any], ...], remarks: list[str]) -> tuple[dict[str, Any], ...]:
    """Return the first row of each setting."""
    first: dict[Setting, dict[str, Any]] = {}
    for row in rows:
        first.setdefault(row["setting"], row)
    if len(first) < len(rows):
        remarks.append(
            "the parameters table lists a setting more than once: its first row is shown"
        )
    return tuple(first.values())


def _check_settings(
    parameters: tuple[dict[str, Any], ...], logs: tuple[LogSignals, ...], remarks: list[str]
) -> None:
    """Remark on settings that stand in one table alone; where one is empty, that was said."""
    fitted = {row["setting"] for row in parameters if row["mse_percent"] is not None}
    drawn = {log.setting for log in logs}
    known = {row["setting"] for row in parameters}
    if fitted and drawn and fitted - drawn:
        names = ", ".join(map(str, sorted(fitted - drawn)))
        remarks.append(f"setting {names}: parameters but no signals, so no loops")
    if known and drawn - known:
        names = ", ".join(map(str, sorted(drawn - known)))
        remarks.append(f"setting {names}: signals but no parameters")


def _rows(
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
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        rows: list[dict[str, Any]] = file.read().to_pylist()
    return rows


def _csv_rows(path: Path) -> list[dict[str, Any]]:
    with path.open(encoding="utf-8-sig", newline="") as file:
        return list(csv.DictReader(file, strict=True))


def _logs(
    folder: Path, remarks: list[str], quantities: Sequence[Quantity] = PAPER_QUANTITIES
) -> Iterator[LogSignals]:
    """Yield the signals of each log; a damaged row group costs that log alone."""
    path = folder / "responses.parquet"
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
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
