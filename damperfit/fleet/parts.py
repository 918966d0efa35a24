"""Parts on the disk: one Parquet file a damper, in folders by serial number that any tool can read.

    OUT/serial=D003/part-KEY.parquet

A part is written beside its place and renamed, so that it is there whole or not at all; which part
a damper's logs give is told by the key alone. Its bytes depend on the logs, the configuration and
the version, never on the clock or the worker.
"""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.atomic import file_set
from damperfit.atomic.owner import new_owner, owner_of
from damperfit.errors import ConfigurationError, OutputError
from damperfit.queries.fleet_part import RECORD
from damperfit.recording import natural_order

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

__all__ = [
    "COLLECTED",
    "SERIAL",
    "collect",
    "forget_earlier",
    "part_path",
    "parts_in",
    "read_facts_of",
    "tidy",
    "write_part",
]

SERIAL = "serial"
COLLECTED = "fleet"  # name of the one table
_NAMELESS = "__unknown__"
_FACTS = b"damperfit"


def part_path(folder: Path, owner: str, key: str) -> Path:
    """Return where the part of a damper stands.

    Examples
    --------
    >>> from pathlib import Path
    >>> part_path(Path("out"), "SN 12/34", "ab").as_posix()
    'out/serial=SN%2012%2F34/part-ab.parquet'
    """
    return folder / f"{SERIAL}={quote(owner or _NAMELESS, safe='')}" / f"part-{key}.parquet"


def owner_in(path: Path) -> str:
    """Return whose a part is, from its folder."""
    owner = unquote(path.parent.name.removeprefix(f"{SERIAL}="))
    return "" if owner == _NAMELESS else owner


def parts_in(folder: Path) -> list[Path]:
    """Return the parts of a fleet's folder, by serial number."""
    found = folder.glob(f"{SERIAL}=*/part-*.parquet")
    return sorted(found, key=lambda path: (natural_order(owner_in(path)), path.name))


def write_part(
    path: Path, table: pa.Table, facts: dict[str, Any], record: dict[str, Any] | None = None
) -> None:
    """Write a part, whole or not at all; earlier parts of the same logs go once it is there.

    Parameters
    ----------
    path : pathlib.Path
        From `part_path`.
    table : pyarrow.Table
        Its rows.
    facts : dict
        For the schema's ``damperfit`` entry; "logs" are the hashes of its files, "places" where
        its logs stand.
    record : dict, optional
        What of run.json is compared.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    text = json.dumps(facts, sort_keys=True, ensure_ascii=False).encode()
    told = json.dumps(record or {}, sort_keys=True, ensure_ascii=False).encode()
    table = table.replace_schema_metadata({_FACTS: text, RECORD: told})
    beside = path.parent / f".{new_owner().text}.damperfit-new"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with beside.open("wb") as file:
            pq.write_table(table, file, write_page_checksum=True)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
        _flush_folder(path.parent)
    except OSError as error:
        with suppress(OSError):
            beside.unlink()
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
    forget_earlier(path, facts)


def forget_earlier(path: Path, facts: dict[str, Any]) -> None:
    """Remove earlier parts of a damper that are of one of the same logs; other tests of it stay.

    A log is the same where it stands at the same place, or has the same bytes.
    """
    for other in path.parent.glob("part-*.parquet"):
        if other != path and _have_common_log(facts, read_facts_of(other)):
            with suppress(OSError):
                other.unlink()


def _have_common_log(facts: dict[str, Any], others: dict[str, Any]) -> bool:
    return any(set(facts.get(key, ())) & set(others.get(key, ())) for key in ("logs", "places"))


def _flush_folder(folder: Path) -> None:
    if os.name == "posix":
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)


def read_facts_of(path: Path) -> dict[str, Any]:
    """Return what a part tells besides its rows; nothing where it is damaged."""
    try:
        metadata = pq.read_schema(path).metadata or {}
        found = json.loads(metadata.get(_FACTS, b"{}"))
    except (OSError, pa.ArrowInvalid, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def tidy(folder: Path) -> None:
    """Remove what killed workers left; the files of those that may be at work stay."""
    for path in folder.glob(f"{SERIAL}=*/.*.damperfit-new"):
        owner = owner_of(path.name)
        with suppress(OSError):
            if owner is not None and not owner.may_live(_age(path)):
                path.unlink()


def _age(path: Path) -> float:
    return time.time() - path.stat().st_mtime


def _tables(folder: Path) -> Iterator[pa.Table]:
    for path in parts_in(folder):
        try:
            table = pq.ParquetFile(path, page_checksum_verification=True).read()
        except (OSError, pa.ArrowInvalid) as error:
            raise ConfigurationError(
                f"{path}: damaged ({error}); remove it, and the next damperfit fleet makes it again"
            ) from error
        yield table.replace_schema_metadata(None).add_column(
            0, SERIAL, pa.array([owner_in(path)] * table.num_rows, pa.string())
        )


def collect(folder: Path) -> pa.Table:
    """Make one table of all parts, ``fleet.parquet`` and ``fleet.csv`` in the same folder.

    Rows stand by serial number, then as in the part; equal parts give equal bytes.

    Raises
    ------
    ConfigurationError
        There is no part, or one is damaged.
    OutputError
        The tables cannot be written.
    """
    from damperfit.tables import write_table

    tables: Sequence[pa.Table] = list(_tables(folder))
    if not tables:
        raise ConfigurationError(
            f"{folder}: no parts of a fleet there; run damperfit fleet LOGS first"
        )
    table = pa.concat_tables(tables, promote_options="default").combine_chunks()
    with file_set(folder) as files:
        for suffix in (".parquet", ".csv"):
            write_table(files.path(COLLECTED + suffix), table, suffix=suffix)
    return table
