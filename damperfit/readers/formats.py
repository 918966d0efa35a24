"""The formats that can be read, and how a file is known to be one: by content, then by suffix."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import PurePath
from typing import TYPE_CHECKING

from damperfit.errors import LogError
from damperfit.readers.delimited import read_delimited
from damperfit.readers.encoding import is_binary
from damperfit.readers.json_log import is_json, read_json

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

__all__ = ["FORMATS", "LOG_SUFFIXES", "Format", "find_format"]


@dataclass(frozen=True, slots=True)
class Format:
    """One format.

    Attributes
    ----------
    name : str
        For people.
    magic : tuple of bytes
        What its files start with; empty when nothing tells.
    suffixes : tuple of str
        In lower case, with the point.
    read : callable
        (source, options) -> tables, one for each test.
    """

    name: str
    magic: tuple[bytes, ...]
    suffixes: tuple[str, ...]
    read: Callable[[Source, ReadOptions], tuple[Table, ...]]


def _late(module: str, name: str) -> Callable[[Source, ReadOptions], tuple[Table, ...]]:
    """Return a reader that is loaded when a log is of its format."""

    def read(source: Source, options: ReadOptions) -> tuple[Table, ...]:
        reader = getattr(import_module(f"damperfit.readers.{module}"), name)
        tables: tuple[Table, ...] = reader(source, options)
        return tables

    return read


FORMATS = (
    Format("Parquet", (b"PAR1",), (".parquet", ".pq"), _late("parquet", "read_parquet")),
    Format("MATLAB", (b"MATLAB 5.0 MAT-file",), (".mat",), _late("matlab", "read_matlab")),
    Format(
        "MATLAB 7.3",
        (b"MATLAB 7.3 MAT-file", b"\x89HDF"),
        (".mat", ".h5"),
        _late("hdf5", "read_hdf5"),
    ),
    Format("TDMS", (b"TDSm",), (".tdms",), _late("tdms", "read_tdms")),
    Format("MDF", (b"MDF     ", b"UnFinMF "), (".mf4", ".mdf"), _late("mdf", "read_mdf")),
    Format(
        "Excel",
        (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"),
        (".xlsx", ".xls"),
        _late("excel", "read_excel"),
    ),
    Format("JSON", (), (".json", ".jsonl", ".ndjson"), read_json),
    Format("delimited text", (), (".csv", ".txt", ".tsv", ".dat", ".asc", ".log"), read_delimited),
)
_JSON, _TEXT = FORMATS[-2:]  # any suffix may stand for text

# What a file in a folder is called that is taken for a log.
_PLAIN = tuple(suffix for known in FORMATS for suffix in known.suffixes)
LOG_SUFFIXES = (*_PLAIN, *(f"{suffix}.gz" for suffix in _PLAIN))

# What is known by its first bytes and not read, and why.
_PICKLE = "this is a Python pickle, which could run code; write CSV or Parquet"
_ARCHIVE = "this is an archive; unpack it and give the logs in it"
_REFUSED = (
    (b"\x93NUMPY", "this is a NumPy array without names or units; write CSV or Parquet"),
    *((b"\x80" + bytes([protocol]), _PICKLE) for protocol in (2, 3, 4, 5)),
    *((magic, _ARCHIVE) for magic in (b"7z\xbc\xaf\x27\x1c", b"Rar!\x1a\x07")),
    *((magic, _ARCHIVE) for magic in (b"BZh", b"\xfd7zXZ\0", b"\x28\xb5\x2f\xfd")),
    (b"%PDF", "this is a PDF; export the log as delimited text"),
    (b"SQLite format 3\0", "this is a database; export the log as delimited text"),
)
_TAR = 257  # where a tar archive says "ustar"


def find_format(source: Source) -> Format:
    """Return the format of a file: what its first bytes say, else what its suffix says.

    Raises
    ------
    LogError
        It is of a kind that is not read, or does not begin as its suffix says.
    """
    for known in FORMATS:
        if known.magic and source.data.startswith(known.magic):
            return known
    for magic, reason in _REFUSED:
        if source.data.startswith(magic):
            raise LogError(f"{source.name}: {reason}")
    if source.data.startswith(b"ustar", _TAR):
        raise LogError(f"{source.name}: {_ARCHIVE}")
    if is_json(source.data):
        return _JSON
    suffix = PurePath(source.name).suffix.lower()
    named = next((known for known in FORMATS if suffix in known.suffixes), _TEXT)
    if named is not _TEXT and is_binary(source.data):
        raise LogError(
            f"{source.name}: is named like {named.name} and does not begin like it; it is damaged "
            "or of a version that is not read"
        )
    return _TEXT
