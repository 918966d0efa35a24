"""Bytes of a file: read once, within a limit, hashed, unpacked and, of text, brought to UTF-8.

Traps. Opening a pipe waits for ever; a device never ends; a file may grow or be written over while
it is read; one that says it is empty may not be. The hash of a large file costs a good part of
parsing it. 1.7 MB of gzip may hold 1.2 GB, and the length that it states is one modulo 2^32. Any
bytes are valid Latin-1, so it is tried last, with a note. UTF-16 is known by its mark only; without
it every second byte is NUL, and so are bytes that a serial line dropped.
"""

import codecs
import errno
import gzip
import hashlib
import io
import os
import re
import stat
import zlib
from io import FileIO
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from damperfit.errors import LogError

MAX_TEXT = 100_000_000  # bytes of a file that is no log
_PIECE = 1 << 20  # bytes unpacked at a time
_GZIP = b"\x1f\x8b"
_UTF16 = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
_CONTROL = re.compile(rb"[\x01-\x08\x0e-\x1a\x1c-\x1f\x7f]")  # ESC occurs in terminals' captures
# "[Data]" begins a text of entries, and no JSON.
_BEGINS = re.compile(r'\s*(?:\{\s*(?:["}]|$)|\[\s*(?:[\[{"\d\]-]|$))')
_HEAD = 4096  # bytes looked at for signs of binary data


class Source(NamedTuple):
    """A file in memory."""

    name: str  # for messages
    path: str  # as given
    data: bytes
    sha256: str  # of the file's bytes, hexadecimal


class IrregularFileError(OSError):
    """What a path names is a pipe or a device, or more than what is to be read of it."""


def open_regular(path: str | os.PathLike[str]) -> FileIO:
    """Open a file to be read, if it is one on disk; nothing else is waited for."""
    # Without O_NONBLOCK, opening a FIFO waits for its writer for ever.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    number = os.open(path, flags)
    kind = os.fstat(number).st_mode
    if stat.S_ISREG(kind):
        return os.fdopen(number, "rb", buffering=0)
    os.close(number)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), os.fspath(path))
    text = "is not a regular file (a pipe or device)"
    raise IrregularFileError(errno.EINVAL, text, os.fspath(path))


def regular(path: Path) -> Path:
    """Return a path that a library may open; as `open_regular`."""
    open_regular(path).close()
    return path


def read_bytes(path: str | os.PathLike[str], *, max_bytes: int = MAX_TEXT) -> bytes:
    """Return the bytes, up to a limit, of a file that is no log."""
    with open_regular(path) as file:
        data = _read_up_to(file, max_bytes + 1)
    if len(data) > max_bytes:
        text = f"is larger than {max_bytes / 1e6:g} MB"
        raise IrregularFileError(errno.EFBIG, text, os.fspath(path))
    return data


def read_text(path: str | os.PathLike[str], *, max_bytes: int = MAX_TEXT) -> str:
    """Return a file's text in UTF-8; as `read_bytes`, or UnicodeDecodeError."""
    return read_bytes(path, max_bytes=max_bytes).decode("utf-8-sig")


def why_unread(error: Exception) -> str:
    """Return why a file cannot be read, for people."""
    if isinstance(error, FileNotFoundError):
        return "no such file"
    return f"cannot be read: {getattr(error, 'strerror', None) or str(error).lstrip(', ')}"


def sha256_of(path: Path) -> str:
    """Return the hash of a file, hexadecimal."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _read_up_to(file: FileIO, n_bytes: int) -> bytes:
    chunks = []
    while n_bytes > 0 and (chunk := file.read(n_bytes)):
        chunks.append(chunk)
        n_bytes -= len(chunk)
    return chunks[0] if len(chunks) == 1 else b"".join(chunks)


def read_source(path: str | os.PathLike[str], *, max_bytes: int) -> Source:
    """Return a regular file's bytes."""
    name = _one_line(os.fsencode(path).decode("utf-8", "backslashreplace"))
    code = "unreadable"
    try:
        with open_regular(path) as file:
            before = os.fstat(file.fileno())
            is_too_large = before.st_size > max_bytes
            # A file that says it is empty may not be (/proc); one byte more shows one that grows.
            data = b"" if is_too_large else _read_up_to(file, before.st_size + 1)
            after = os.fstat(file.fileno())
    except (OSError, ValueError) as error:
        text = why_unread(error)
        if isinstance(error, IrregularFileError):
            text = f"{error.strerror}; give a file on disk"
        elif isinstance(error, IsADirectoryError):
            text = "is a folder; name the logs in it"
        elif isinstance(error, FileNotFoundError) and Path(path).is_symlink():
            target = _one_line(str(Path(path).readlink()))
            text = f"a link to {target}, which is not there; link it again, or remove it"
        raise LogError(text, subject=name, code=code) from error
    is_same = (before.st_size, before.st_mtime_ns) == (after.st_size, after.st_mtime_ns)
    text = ""
    if is_too_large:
        text = f"{before.st_size} bytes, more than the limit of {max_bytes} (rig.max_log_bytes)"
        code = "too-large"
    elif len(data) != before.st_size or not is_same:
        text = "file changed during read; wait until the rig has written it"
    elif not data:
        text, code = "empty file (0 bytes)", "no-data"
    if text:
        raise LogError(text, subject=name, code=code)
    return Source(Path(name).name or name, name, data, hashlib.sha256(data).hexdigest())


def _one_line(text: str) -> str:
    """Return a path as it can stand in a message: control characters escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def unpack(source: Source, *, max_bytes: int) -> tuple[Source, tuple[str, ...]]:
    """Return the source as it is, or what gzip packed in one member or several, and a note."""
    if not source.data.startswith(_GZIP):
        return source, ()
    problem, data = "", b""
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(source.data)) as file:
            # In pieces: a read of many bytes takes the memory for all of them first.
            pieces = iter(lambda: file.read(_PIECE), b"")
            data = b"".join(islice(pieces, max_bytes // _PIECE + 1))
    except EOFError:
        problem = "truncated gzip; the end of the file is missing"
    except (gzip.BadGzipFile, zlib.error) as error:
        # The file begins as gzip does: only what stands behind a member can be no gzip.
        is_behind = str(error).startswith("Not a gzipped file")
        reason = "odd bytes at its end" if is_behind else str(error)
        problem = f"damaged gzip: {reason}; copy the log again"
    if len(data) > max_bytes:
        problem = f"more than the limit of {max_bytes} bytes when unpacked (rig.max_log_bytes)"
    elif data.startswith(_GZIP):
        problem = "a gzip inside a gzip; unpack it once"
    elif not data:
        problem = problem or "empty file inside the gzip"
    if problem:
        raise LogError(problem, code="unreadable")
    return source._replace(data=data), ("gzip: unpacked",)


def is_binary(data: bytes) -> bool:
    """Say whether the first bytes are no text, neither of one byte a letter nor UTF-16."""
    head = data[:_HEAD]
    return head[:2] not in _UTF16 and (b"\0" in head or _CONTROL.search(head) is not None)


def is_json(data: bytes) -> bool:
    """Say whether a file begins like JSON that may hold a log."""
    head = data[:64]
    if head[:2] in _UTF16:
        return _BEGINS.match(head.decode("utf-16", "ignore")) is not None
    return _BEGINS.match(head.removeprefix(codecs.BOM_UTF8).decode("latin-1")) is not None


def to_utf8(
    data: bytes, *, encoding: str = "", allows_nul: bool = False
) -> tuple[bytes, tuple[str, ...]]:
    """Return text as UTF-8 without byte order mark, and notes; allowed NULs as question marks."""
    notes: tuple[str, ...] = ()
    if name := encoding or _UTF16.get(data[:2], ""):
        notes = (f"encoding: {name}, as declared" if encoding else f"encoding: {name.upper()}",)
        try:
            data = data[0 if encoding else 2 :].decode(name).encode("utf-8")
        except UnicodeError as error:
            raise LogError(f"is not valid {name.upper()}", code="not-text") from error
    data = data.removeprefix(codecs.BOM_UTF8)
    start = data[:200].lstrip().lower()
    text = ""
    if start.startswith((b"<!doctype html", b"<html", b"<head", b"<body")):
        text = "this is HTML, a web page, not a log; download the log again"
    elif start.startswith(b"<?xml"):
        text = "this is XML; export the log as delimited text"
    elif allows_nul:
        data = data.replace(b"\0", b"?")  # no number, so its row is dropped
    elif b"\0" in data:
        raise _nul(data)
    if not text and _CONTROL.search(data, 0, _HEAD):
        text = "binary data in no known format"
    if text:
        raise LogError(text, code="unknown-format")
    if not data.isascii():
        try:
            data.decode("utf-8")
        except UnicodeDecodeError:
            data = data.decode("latin-1").encode("utf-8")
            notes = (*notes, "encoding: not UTF-8, read as Latin-1")
    return data, notes


def _nul(data: bytes) -> LogError:
    head, at = data[:64], data.find(b"\0")
    place, text = "", "looks like UTF-16 without a byte order mark; save the log as UTF-8"
    if not data.strip(b"\0"):
        text = (
            f"{len(data)} bytes, all of them NUL; the log was never written to the disk: "
            "copy it again from the rig"
        )
    elif len(head) < 8 or (any(head[1::2]) and any(head[::2])):
        n_above = data.count(b"\n", 0, at)
        place = f", line {n_above + 1}"
        text = f"NUL byte at byte offset {at}; the file is damaged"
    return LogError(text, subject=place, code="unreadable")
