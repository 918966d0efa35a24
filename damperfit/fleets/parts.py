"""Parts on the disk: one Parquet file a damper, in folders by serial number that any tool can read.

    OUT/serial=D003/part-KEY.parquet

A part is written beside its place and renamed, so that it is there whole or not at all; which part
a damper's logs give follows from the key alone. Its bytes depend on the logs, the configuration and
the version, never on the clock or the worker.
"""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote

import pyarrow as pa
import pyarrow.parquet as pq

from damperfit.errors import ConfigurationError, OutputError
from damperfit.recording import natural_order
from damperfit.store import file_set, remove_abandoned, replaced
from damperfit.tables.reading import RECORD

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

__all__ = [
    "COLLECTED",
    "SERIAL",
    "SYMBOL",
    "collect",
    "forget_earlier",
    "part_path",
    "parts_in",
    "read_facts_of",
    "renew_facts",
    "tidy",
    "touch",
    "write_part",
]

SERIAL = "serial"
SYMBOL = b"symbol"  # in the metadata of a quantity's column
COLLECTED = "fleet"  # name of the one table
_NAMELESS = "__unknown__"
_LONGEST = 180  # characters of a folder's name
_FACTS = b"damperfit"


def part_path(folder: Path, owner: str, key: str) -> Path:
    """Return where the part of a damper stands.

    Examples
    --------
    >>> from pathlib import Path
    >>> part_path(Path("out"), "SN 12/34", "ab").as_posix()
    'out/serial=SN%2012%2F34/part-ab.parquet'
    """
    name = quote(owner or _NAMELESS, safe="", errors="surrogateescape")
    if len(name) > _LONGEST:  # of what a disk takes as a name
        digest = hashlib.sha256(owner.encode("utf-8", "surrogateescape")).hexdigest()
        name = f"{name[: _LONGEST - 20].rpartition('%')[0] or name[:100]}-{digest[:16]}"
    return folder / f"{SERIAL}={name}" / f"part-{key}.parquet"


def owner_in(path: Path) -> str:
    """Return whose a part is, from its folder."""
    owner = unquote(path.parent.name.removeprefix(f"{SERIAL}="), errors="replace")
    return "" if owner == _NAMELESS else owner


def parts_in(folder: Path) -> list[Path]:
    """Return the parts of a fleet's folder, by serial number."""
    found = folder.glob(f"{SERIAL}=*/part-*.parquet")
    return sorted(found, key=lambda path: (natural_order(owner_in(path)), path.name))


def write_part(
    path: Path, table: pa.Table, facts: dict[str, Any], record: dict[str, Any] | None = None
) -> None:
    """Write a part, whole or not at all.

    Parameters
    ----------
    path : pathlib.Path
        From `part_path`.
    table : pyarrow.Table
        Its rows.
    facts : dict
        For the schema's ``damperfit`` entry; "logs" are the hashes of its logs, "places" where
        they stand, "seen" by place what `damperfit.fleets.sources.Seen` holds.
    record : dict, optional
        What of run.json is compared.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    text = json.dumps(facts, sort_keys=True).encode()
    of_run = json.dumps(record or {}, sort_keys=True).encode()
    table = table.replace_schema_metadata({_FACTS: text, RECORD: of_run})
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replaced(path) as file:
            pq.write_table(table, file, write_page_checksum=True)
    except OSError as error:
        raise OutputError(f"cannot be written: {error.strerror or error}", subject=path) from error


def forget_earlier(folder: Path) -> None:
    """Remove parts of logs that a later part is of, whoever they were said to be of.

    A log is the same where it stands at the same place, or of one damper where it has the same
    bytes. Other tests of a damper stay. The latest part of a log is never removed, also not by
    another run at once.
    """
    seen: set[tuple[str, str]] = set()
    for path in sorted(parts_in(folder), key=_latest_first):
        facts = read_facts_of(path)
        logs = {("", one) for one in facts.get("places", ())}
        logs |= {(path.parent.name, one) for one in facts.get("logs", ())}
        if logs & seen:
            with suppress(OSError):
                path.unlink()
        else:
            seen |= logs


def _latest_first(path: Path) -> tuple[int, str]:
    try:
        return -path.stat().st_mtime_ns, str(path)
    except OSError:
        return 0, str(path)


def touch(path: Path) -> None:
    """Make a part the latest of its logs: what it says holds again."""
    with suppress(OSError):
        os.utime(path)


def read_facts_of(path: Path) -> dict[str, Any]:
    """Return what a part tells besides its rows; nothing where it is damaged."""
    try:
        metadata = pq.read_schema(path).metadata or {}
        found = json.loads(metadata.get(_FACTS, b"{}"))
    except (OSError, pa.ArrowInvalid, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def renew_facts(path: Path, **changed: Any) -> None:
    """Write a part anew with other facts; its rows stay.

    Raises
    ------
    OutputError
        It cannot be written.
    """
    try:
        table = pq.ParquetFile(path, page_checksum_verification=True).read()
        record = json.loads((table.schema.metadata or {}).get(RECORD, b"{}"))
    except (OSError, pa.ArrowInvalid, ValueError):
        return  # whoever collects it says that it is damaged
    write_part(path, table, read_facts_of(path) | changed, record)


def tidy(folder: Path) -> None:
    """Remove what killed workers left; the files of those that may be at work stay."""
    for damper in folder.glob(f"{SERIAL}=*"):
        remove_abandoned(damper)


def _tables(folder: Path) -> Iterator[pa.Table]:
    for path in parts_in(folder):
        try:
            if not path.exists():  # another run has just replaced it
                continue
            table = pq.ParquetFile(path, page_checksum_verification=True).read()
        except (OSError, pa.ArrowInvalid) as error:
            raise ConfigurationError(
                f"damaged ({error}); remove it, and the next damperfit fleet makes it again",
                subject=path,
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
    from damperfit.tables.files import write_table

    forget_earlier(folder)
    tables: Sequence[pa.Table] = list(_tables(folder))
    if not tables:
        raise ConfigurationError(
            "no parts of a fleet there; run damperfit fleet LOGS first", subject=folder
        )
    table = pa.concat_tables(tables, promote_options="default").combine_chunks()
    with file_set(folder) as files:
        for suffix in (".parquet", ".csv"):
            write_table(files.path(COLLECTED + suffix), table, suffix=suffix)
    return table
