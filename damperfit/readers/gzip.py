"""Logs packed by gzip: unpacked in memory, up to a limit.

The format: RFC 1952. A file is one member or several behind each other, each with a checksum.

Traps. 1.7 MB may hold 1.2 GB, and the length that a member states is its length modulo 2^32: so it
is counted while it is unpacked. Members may be packed again. Tapes and disks fill up the end with
zeros.
"""

from __future__ import annotations

import gzip
import io
import zlib
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import LogError

if TYPE_CHECKING:
    from damperfit.readers.files import Source

__all__ = ["unpack"]

_MAGIC = b"\x1f\x8b"
_CHUNK = 1 << 20  # bytes unpacked at a time


def unpack(source: Source, *, max_bytes: int) -> tuple[Source, tuple[str, ...]]:
    """Return the source as it is, or what gzip packed, and a note.

    Raises
    ------
    LogError
        The archive is damaged or cut, holds more than the limit, or holds another archive.
    """
    if not source.data.startswith(_MAGIC):
        return source, ()
    name = source.name
    try:
        data = _unpacked(source.data, name, max_bytes)
    except EOFError as error:
        raise LogError(f"{name}: truncated gzip; the end of the file is missing") from error
    except (gzip.BadGzipFile, zlib.error) as error:
        # The file begins as gzip does: only what stands behind a member can be no gzip.
        is_behind = str(error).startswith("Not a gzipped file")
        reason = "odd bytes at its end" if is_behind else str(error)
        raise LogError(f"{name}: damaged gzip: {reason}; copy the log again") from error
    if not data:
        raise LogError(f"{name}: empty file inside the gzip")
    if data.startswith(_MAGIC):
        raise LogError(f"{name}: a gzip inside a gzip; unpack it once")
    return replace(source, data=data), ("gzip: unpacked",)


def _unpacked(packed: bytes, name: str, max_bytes: int) -> bytes:
    """Return all members of a gzip file, checked by their checksums."""
    parts: list[bytes] = []
    n_bytes = 0
    with gzip.GzipFile(fileobj=io.BytesIO(packed)) as file:
        while part := file.read(_CHUNK):
            n_bytes += len(part)
            if n_bytes > max_bytes:
                raise LogError(
                    f"{name}: more than the limit of {max_bytes} bytes when unpacked "
                    "(rig.max_log_bytes)"
                )
            parts.append(part)
    return b"".join(parts)
