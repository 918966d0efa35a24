"""How a text log is written, looked for once for each kind of file.

A rig writes all of its logs alike: the second needs no more than a look that it is of the same
kind. It is where the names, the rows between them and the data, and all else above the data are the
same to the byte, but for entries behind a '#' that hold no separator; and where as many rows as
would have been looked at are numbers throughout, with this separator and decimal mark. Whatever
differs is looked at anew.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from threading import Lock
from typing import TYPE_CHECKING

from damperfit.readers.dialect import Dialect, find_dialect

if TYPE_CHECKING:
    from damperfit.readers.options import Declarations

__all__ = ["dialect_of", "forget_dialects"]

_LOOKED_AT = 40  # lines, as where nothing is known
_HEAD_BYTES = 32_768
_KINDS = 8


@dataclass(frozen=True, slots=True)
class _Kind:
    """A dialect, the lines above its data, and what a row looks like."""

    key: tuple[str, str, int]
    dialect: Dialect
    above: tuple[bytes, ...]
    row: re.Pattern[bytes]

    def of(self, lines: list[bytes]) -> Dialect | None:
        """Return the dialect of a log that begins with these lines; None where it is another."""
        n_above = len(self.above)
        rows = lines[n_above:]
        if len(rows) < 2 or not all(map(self.row.fullmatch, rows)):
            return None
        # Whole numbers alone do not tell the mark.
        if self.dialect.decimal == "," and not any(b"," in row for row in rows):
            return None
        separator = self.dialect.separator.encode()
        for here, known in zip(lines, self.above, strict=False):
            is_entry = here.startswith(b"#") and known.startswith(b"#") and separator not in here
            if here != known and not (is_entry and separator not in known):
                return None
        texts = [line.rstrip(b"\r\n").decode("utf-8", "replace") for line in lines[:n_above]]
        n_preamble = self.dialect.names_line - self.key[2]
        return replace(
            self.dialect,
            data_offset=sum(map(len, lines[:n_above])),
            preamble=tuple(text for text in texts[:n_preamble] if text.strip()),
        )


_known: list[_Kind] = []
_lock = Lock()


def forget_dialects() -> None:
    """Forget the kinds of files that were seen."""
    with _lock:
        _known.clear()


def dialect_of(data: bytes, declared: Declarations, *, name: str, first_line: int = 1) -> Dialect:
    """Return how a log in UTF-8 is written, as `find_dialect` does.

    Raises
    ------
    LogError
        There are no rows of numbers.
    """
    key = (declared.separator, declared.decimal, first_line)
    if declared.thousands:
        return find_dialect(data, declared, name=name, first_line=first_line)
    head = data[:_HEAD_BYTES].splitlines(keepends=True)[:-1]
    for kind in tuple(_known):
        if kind.key == key and (found := kind.of(_looked_at(head, len(kind.above)))) is not None:
            return found
    dialect = find_dialect(data, declared, name=name, first_line=first_line)
    if (new := _kind(key, dialect, head)) is not None:
        with _lock:
            _known[:] = [new, *_known[: _KINDS - 1]]
    return dialect


def _looked_at(head: list[bytes], n_above: int) -> list[bytes]:
    """Return the lines that are looked at; all of them, where blank ones stand above."""
    return head[: max(_LOOKED_AT, n_above + 4)]


def _kind(key: tuple[str, str, int], dialect: Dialect, head: list[bytes]) -> _Kind | None:
    """Return what the next log of the kind is known by; None where nothing simple tells it."""
    n_above = dialect.data_line - key[2]
    is_simple = dialect.separator != " " and not dialect.is_short
    # Without names their line is 0.
    if not is_simple or dialect.names_line < key[2] or dialect.hint or n_above > _LOOKED_AT // 2:
        return None
    mark = re.escape(dialect.decimal.encode())
    number = rb"[ ]*[+-]?(?:\d+%b?\d*|%b\d+)(?:[eE][+-]?\d+)?[ ]*" % (mark, mark)
    others = re.escape(dialect.separator.encode()) + number
    row = re.compile(rb"%b(?:%b){%d}\r?\n" % (number, others, len(dialect.names) - 1))
    kind = _Kind(key, dialect, tuple(head[:n_above]), row)
    # It must know itself again.
    return kind if kind.of(_looked_at(head, n_above)) == dialect else None
