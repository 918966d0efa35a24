"""A part of a fleet read as results: parameters, and what of run.json is compared."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING
from urllib.parse import unquote

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.tables import Results, quantities_in, read_results
from damperfit.tables.columns import adjusters_in
from damperfit.tested.setting import Setting, parse_place

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path
    from typing import Any

__all__ = [
    "RECORD",
    "is_part",
    "part_in",
    "parts_of",
    "read_part",
    "record_of",
    "results_in",
    "title_of",
    "written_of",
]

RECORD = b"damperfit_record"  # of the schema's metadata


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
        raise ConfigurationError(f"{path}: several tests of one damper; name one of {names}")
    return parts[0]


def record_of(part: Path) -> dict[str, Any]:
    """Return what of run.json a part keeps; nothing where it is damaged."""
    try:
        found = json.loads((pq.read_schema(part).metadata or {}).get(RECORD, b"{}"))
    except (OSError, pa.ArrowInvalid, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


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
    path = part_in(path)
    try:
        table = pq.ParquetFile(path, page_checksum_verification=True).read()
        record = json.loads((table.schema.metadata or {}).get(RECORD, b"{}"))
    except (OSError, pa.ArrowInvalid, ValueError) as error:
        raise ConfigurationError(
            f"{path}: damaged ({error}); remove it, and the next damperfit fleet makes it again"
        ) from error
    if not record:
        raise ConfigurationError(
            f"{path}: does not say which damper and motion it is of: from an earlier version, of "
            "several dampers, or without a fit; remove it, and the next damperfit fleet makes it "
            "again"
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


def results_in(
    place: Path, *, parts: Sequence[str] = ("parameters", "mse", "responses", "valves")
) -> Results:
    """Read results, be they a folder that `identify` wrote or one damper of a fleet.

    Parameters
    ----------
    place : pathlib.Path
        Results folder, a part, or the folder of a serial number with one.
    parts : sequence of str
        Tables to read of a results folder.

    Raises
    ------
    ConfigurationError
        There is none, or it cannot be read.
    """
    return read_part(place) if is_part(place) else read_results(place, parts=parts)


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
