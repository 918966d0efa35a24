"""A part of a fleet read as results: parameters, and what of run.json is compared."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.setting import Setting, parse_place
from damperfit.tables import Results, quantities_in
from damperfit.tables.columns import adjusters_in

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

__all__ = ["RECORD", "is_part", "parts_of", "read_part"]

RECORD = b"damperfit_record"  # of the schema's metadata


def parts_of(folder: Path) -> list[Path]:
    """Return the parts in the folder of one serial number."""
    return sorted(folder.glob("part-*.parquet")) if folder.name.startswith("serial=") else []


def is_part(path: Path) -> bool:
    """Whether a path is a part, or the folder of a serial number that holds parts."""
    if path.is_dir():
        return bool(parts_of(path))
    return path.name.startswith("part-") and path.suffix == ".parquet" and path.is_file()


def read_part(path: Path) -> Results:
    """Return what a part holds; mean cycles and responses are not in it.

    Parameters
    ----------
    path : pathlib.Path
        A part, or the folder of a serial number with one.

    Raises
    ------
    ConfigurationError
        There are several, it is damaged, or it does not tell its damper.
    """
    if path.is_dir():
        parts = parts_of(path)
        if len(parts) > 1:
            names = ", ".join(one.name for one in parts)
            raise ConfigurationError(f"{path}: several tests of one damper; name one of {names}")
        path = parts[0]
    try:
        table = pq.ParquetFile(path, page_checksum_verification=True).read()
        record = json.loads((table.schema.metadata or {}).get(RECORD, b"{}"))
    except (OSError, pa.ArrowInvalid, ValueError) as error:
        raise ConfigurationError(
            f"{path}: damaged ({error}); remove it, and the next damperfit fleet makes it again"
        ) from error
    if not record:
        raise ConfigurationError(
            f"{path}: does not tell its damper and motion: of an earlier version, of several "
            "dampers, or without a fit; remove it, and the next damperfit fleet makes it again"
        )
    rows = [row for row in table.to_pylist() if not row["error_kind"]]
    quantities = quantities_in(record, table.column_names)
    adjusters = adjusters_in(table.column_names, quantities)
    known = {str(cell): cell for cell in _cells(record)}
    return Results(
        tuple({**row, "setting": _setting(row, adjusters, known)} for row in rows),
        (),
        (),
        record,
        (),
        quantities,
    )


def _cells(record: dict[str, Any]) -> list[int | str]:
    return [one["setting"] for one in record.get("uncertainty") or () if "setting" in one]


def _setting(row: dict[str, Any], names: Any, known: dict[str, int | str]) -> Setting:
    text = row["setting"]
    if len(names) > 1:
        return Setting(tuple((name, parse_place(row[name])) for name in names))
    return Setting.of(known.get(text, text))
