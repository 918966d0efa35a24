"""Parts on the disk: one Parquet file a damper, in folders by serial number that any tool can read.

    OUT/serial-D003/part-KEY.parquet      rows of one damper; the serial number is a column of text
    OUT/_fleet/fleet.parquet              one table of all, which readers of OUT as a data set skip

A part is written as a whole or not at all; its name follows from the key alone. Its bytes depend on
the logs, the configuration and the version, never on the clock or the worker. Other facts stand in
the footer, outside of the schema, which would repeat them; what of run.json is compared is packed.
"""

import hashlib
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError
from damperfit.recording import natural_order
from damperfit.store import file_set, settle
from damperfit.tables.files import PART_FOLDERS, RECORD, packed, part_table, serial_in

SERIAL = "serial"
SYMBOL = b"symbol"  # in the metadata of a quantity's column
COLLECTED = "fleet"  # name of the one table
SUMMARY = "_fleet"  # the folder of what is of the whole fleet
_NAMELESS = "__unknown__"
_LONGEST = 180  # bytes of a folder's name
_FACTS = b"damperfit"
_KEPT = {b"unit", SYMBOL}  # of a column; what it means stands in the manual


def part_path(folder: Path, owner: str, key: str) -> Path:
    """Return where the part of a damper stands.

    Examples
    --------
    >>> from pathlib import Path
    >>> part_path(Path("out"), "SN 12/34", "ab").as_posix()
    'out/serial-SN%2012%2F34/part-ab.parquet'
    """
    letters = (c if c.isalnum() else quote(c, safe="", errors="surrogateescape") for c in owner)
    name = "".join(letters) or _NAMELESS
    if len(name.encode()) > _LONGEST:  # of what a disk takes as a name
        digest = hashlib.sha256(owner.encode("utf-8", "surrogateescape")).hexdigest()
        start = name.encode()[: _LONGEST - 20].decode(errors="ignore")
        name = f"{start.rpartition('%')[0] or start}-{digest[:16]}"
    return folder / f"{SERIAL}-{name}" / f"part-{key}.parquet"


def _owner_in(path: Path) -> str:
    owner = unquote(serial_in(path.parent), errors="replace")
    return "" if owner == _NAMELESS else owner


def parts_in(folder: Path) -> list[Path]:
    """Return the parts of a fleet's folder, by serial number."""
    paths = [path for name in PART_FOLDERS for path in folder.glob(f"{name}/part-*.parquet")]
    return sorted(paths, key=lambda path: (natural_order(_owner_in(path)), path.name))


def _with_serial(table: pa.Table, path: Path) -> pa.Table:
    """Return a table with the column of serial numbers, which those of earlier versions lack."""
    if SERIAL in table.column_names:
        return table
    return table.add_column(0, SERIAL, pa.array([_owner_in(path)] * table.num_rows, pa.string()))


def write_part(
    path: Path, table: pa.Table, facts: dict[str, Any], record: dict[str, Any] | None = None
) -> None:
    """Write a part with its rows, facts, and the compared keys of run.json.

    Of the facts "logs" are the hashes of its logs, "places" their paths or addresses, and "seen" by
    place the fields of `damperfit.fleets.sources.KnownObject`.
    """
    table = _with_serial(table, path)
    fields = [
        field.with_metadata({k: text for k, text in (field.metadata or {}).items() if k in _KEPT})
        for field in table.schema
    ]
    table = table.cast(pa.schema(fields))
    footer = {_FACTS.decode(): json.dumps(facts, sort_keys=True)}
    if record:
        footer[RECORD.decode()] = packed(record)
    with (
        file_set(path.parent) as files,
        pq.ParquetWriter(
            *(files.path(path.name), table.schema),
            write_page_checksum=True,
            write_statistics=False,
        ) as writer,
    ):
        writer.write_table(table)
        writer.add_key_value_metadata(footer)


def read_facts_of(path: Path) -> dict[str, Any]:
    """Return the facts in the footer of a part; none where it is damaged."""
    try:
        facts = json.loads((pq.read_metadata(path).metadata or {}).get(_FACTS, b"{}"))
    except (OSError, pa.ArrowInvalid, ValueError):
        return {}
    return facts if isinstance(facts, dict) else {}


def renew_facts(path: Path, **changed: Any) -> None:
    """Write a part again with other facts and the same rows."""
    with suppress(ConfigurationError):  # `collect` refuses a damaged one
        table, record = part_table(path)
        write_part(path, table, read_facts_of(path) | changed, record)


def touch(path: Path) -> None:
    """Make a part the latest of its logs."""
    with suppress(OSError):
        os.utime(path)


def forget_earlier(folder: Path) -> None:
    """Remove parts whose logs have a later part, also one of another damper.

    Two logs are the same with the same path, or with the same bytes and damper. Other tests of a
    damper stay. The latest part of a log is never removed, also not by another run at once.
    """

    def latest_first(path: Path) -> tuple[int, str]:
        with suppress(OSError):
            return -path.stat().st_mtime_ns, str(path)
        return 0, str(path)

    later: set[tuple[str, str]] = set()
    for path in sorted(parts_in(folder), key=latest_first):
        facts = read_facts_of(path)
        logs = {("", place) for place in facts.get("places", ())}
        logs |= {(serial_in(path.parent), digest) for digest in facts.get("logs", ())}
        if logs & later:
            with suppress(OSError):
                path.unlink()
                path.parent.rmdir()  # but for other tests of the damper
        else:
            later |= logs


def tidy(folder: Path) -> None:
    """Finish or remove what killed workers left; files of workers that may be alive stay."""
    for name in PART_FOLDERS:
        for damper in folder.glob(name):
            settle(damper)


def collect(folder: Path) -> pa.Table:
    """Make one table of all parts, ``fleet.parquet`` and ``fleet.csv`` in the folder ``_fleet``.

    Rows stand by serial number, then as in the part; equal parts give equal bytes.
    """
    from damperfit.tables.files import write_table

    tidy(folder)
    forget_earlier(folder)
    tables = []
    for path in parts_in(folder):
        if path.exists():  # else another run has just replaced it
            table, _ = part_table(path)
            tables.append(_with_serial(table.replace_schema_metadata(None), path))
    if not tables:
        raise ConfigurationError(
            "no parts of a fleet there; run damperfit fleet LOGS first",
            subject=folder,
            code="no-results",
        )
    table = pa.concat_tables(tables, promote_options="default").combine_chunks()
    with file_set(folder / SUMMARY) as files:
        for suffix in (".parquet", ".csv"):
            write_table(files.path(COLLECTED + suffix), table, suffix=suffix)
    return table
