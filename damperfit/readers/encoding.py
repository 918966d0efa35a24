"""Bytes of a text log to UTF-8, or the reason why they are no text.

Traps. Any bytes are valid Latin-1, so it is taken last, and said. UTF-16 is known by its mark only;
without it every second byte is NUL, and so are bytes that a serial line dropped. Whole files are
looked at for NUL, their beginning for other control characters; ESC occurs in terminals' captures.
"""

from __future__ import annotations

import codecs
import re

from damperfit.errors import LogError

__all__ = ["is_binary", "to_utf8"]

_UTF16 = {codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
_CONTROL = re.compile(rb"[\x01-\x08\x0e-\x1a\x1c-\x1f\x7f]")
_HEAD = 4096  # bytes looked at for signs of binary data


def is_binary(data: bytes) -> bool:
    """Say whether the first bytes are no text, neither of one byte a letter nor UTF-16."""
    head = data[:_HEAD]
    return head[:2] not in _UTF16 and (b"\0" in head or _CONTROL.search(head) is not None)


def to_utf8(
    data: bytes, *, name: str, encoding: str = "", allows_nul: bool = False
) -> tuple[bytes, tuple[str, ...]]:
    """Return text as UTF-8 without byte order mark, and notes.

    With ``allows_nul``, NUL bytes become question marks.

    Raises
    ------
    LogError
        The bytes are a web page, binary, or hold NUL.
    """
    notes: tuple[str, ...] = ()
    if encoding:
        data = _decoded(data, encoding, name)
        notes = (f"encoding: {encoding}, as declared",)
    if data.startswith(codecs.BOM_UTF8):
        data = data[len(codecs.BOM_UTF8) :]
    elif data[:2] in _UTF16:
        encoding = _UTF16[data[:2]]
        data = _decoded(data[2:], encoding, name)
        notes = (f"encoding: {encoding.upper()}",)
    _refuse_pages(data, name)
    if allows_nul:
        data = data.replace(b"\0", b"?")  # no number, so its row is dropped
    _refuse_nul(data, name)
    if _CONTROL.search(data, 0, _HEAD):
        raise LogError(f"{name}: binary data in no known format")
    if not data.isascii():
        try:
            data.decode("utf-8")
        except UnicodeDecodeError:
            data = data.decode("latin-1").encode("utf-8")
            notes = (*notes, "encoding: not UTF-8, read as Latin-1")
    return data, notes


def _decoded(data: bytes, encoding: str, name: str) -> bytes:
    try:
        return data.decode(encoding).encode("utf-8")
    except UnicodeError as error:
        raise LogError(f"{name}: is not valid {encoding.upper()}") from error


def _refuse_pages(data: bytes, name: str) -> None:
    start = data[:200].lstrip().lower()
    if start.startswith((b"<!doctype html", b"<html", b"<head", b"<body")):
        raise LogError(f"{name}: this is HTML, a web page, not a log; download the log again")
    if start.startswith(b"<?xml"):
        raise LogError(f"{name}: this is XML; export the log as delimited text")


def _refuse_nul(data: bytes, name: str) -> None:
    offset = data.find(b"\0")
    if offset < 0:
        return
    if not data.strip(b"\0"):
        raise LogError(
            f"{name}: {len(data)} bytes, all of them NUL; the log was never written to the disk: "
            "copy it again from the rig"
        )
    head = data[:64]
    if len(head) >= 8 and (not any(head[1::2]) or not any(head[::2])):
        raise LogError(
            f"{name}: looks like UTF-16 without a byte order mark; save the log as UTF-8"
        )
    line = data.count(b"\n", 0, offset) + 1
    raise LogError(f"{name}, line {line}: NUL byte at byte offset {offset}; the file is damaged")
