"""Which files that stand in the way damperfit wrote itself, and may write anew.

A file is our own where it begins as the new one does and says "damperfit", near its beginning or
near its end (files of pictures, archives and Parquet say it there), or where it is a CSV with the
same columns, in whichever units of force, speed and length it may be written; those of signals over
time have one unit each. Tables beside a run.json are results, which only `identify`
replaces.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError
from damperfit.units.quantities import units_of

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["is_own_file", "refuse_others"]

_MARK = b"damperfit"
_HEAD, _TAIL = 16384, 65536  # bytes; the columns of a table of parameters take thousands
_NAME = re.compile(rb"\"?[A-Za-z]\w*( \[[^\]]*\])?\"?")
_ALIKE = 4  # bytes: enough to tell kinds of files from each other
_RESULTS = "run.json"
_PARQUET = b"PAR1"
_FEWEST = 3  # columns of a table
_SHOWN = {
    unit.replace("/", "_per_").encode(): dimension.encode()
    for dimension in ("force", "velocity", "length")
    for unit in units_of(dimension)
}
_IN_A_UNIT = re.compile(  # the shortest name, hence the longest unit: of m_per_s not s
    rb"(.+?)(?:_| \[)(" + b"|".join(map(re.escape, _SHOWN)) + rb")\]?"
)


def refuse_others(target: Path, draft: Path) -> None:
    """Refuse to write over a file of another origin.

    Parameters
    ----------
    target : pathlib.Path
        What would be written over; it need not be there.
    draft : pathlib.Path
        What is to be written, under its temporary name.

    Raises
    ------
    ConfigurationError
        The file that is there is not our own.
    """
    if target.is_file() and not is_own_file(target, draft):
        raise ConfigurationError(
            f"{target}: is there already, and damperfit did not write it as this kind of file; "
            "nothing was written. Give --overwrite to replace it, or another --out"
        )


def is_own_file(target: Path, draft: Path) -> bool:
    """Whether a file was written by damperfit, of the kind of another one."""
    new = _begin(draft, _HEAD)
    old = _begin(target, _HEAD)
    columns = _columns(new)
    if (columns or new.startswith(_PARQUET)) and (target.parent / _RESULTS).exists():
        return False
    if columns:
        return columns == _columns(old)
    return old[:_ALIKE] == new[:_ALIKE] and _says(target, _MARK)


def _says(path: Path, mark: bytes) -> bool:
    """Whether a file holds some bytes near its beginning or its end."""
    with path.open("rb") as file:
        if mark in file.read(_HEAD):
            return True
        size = file.seek(0, 2)
        file.seek(max(0, size - _TAIL))
        return mark in file.read()


def _begin(path: Path, n: int) -> bytes:
    with path.open("rb") as file:
        return file.read(n)


def _columns(head: bytes) -> tuple[bytes, ...]:
    """Names of a CSV's columns, a unit that may be chosen as its dimension; else nothing."""
    line = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")[0].strip()
    cells = re.split(rb"[,;]", line)
    if len(cells) < _FEWEST or not all(map(_NAME.fullmatch, cells)):
        return ()
    return tuple(cells if cells[0] == b"time_s" else map(_in_any_unit, cells))


def _in_any_unit(name: bytes) -> bytes:
    found = _IN_A_UNIT.fullmatch(name.replace(b"/", b"_per_"))
    return name if found is None else found[1] + b" " + _SHOWN[found[2]]
