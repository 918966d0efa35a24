"""The formats that can be read, and how a file is known to be one: by content, then by suffix."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING

from damperfit.errors import LogError
from damperfit.readers.delimited import read_delimited
from damperfit.readers.excel import read_excel
from damperfit.readers.hdf5 import read_hdf5
from damperfit.readers.matlab import read_matlab
from damperfit.readers.mdf import read_mdf
from damperfit.readers.parquet import read_parquet
from damperfit.readers.tdms import read_tdms

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

__all__ = ["FORMATS", "Format", "find_format"]


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


FORMATS = (
    Format("Parquet", (b"PAR1",), (".parquet", ".pq"), read_parquet),
    Format("MATLAB", (b"MATLAB 5.0 MAT-file",), (".mat",), read_matlab),
    Format("MATLAB 7.3", (b"MATLAB 7.3 MAT-file", b"\x89HDF"), (".mat",), read_hdf5),
    Format("TDMS", (b"TDSm",), (".tdms",), read_tdms),
    Format("MDF", (b"MDF     ", b"UnFinMF "), (".mf4", ".mdf"), read_mdf),
    Format("Excel", (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"), (".xlsx", ".xls"), read_excel),
    Format("delimited text", (), (".csv", ".txt", ".tsv", ".dat", ".asc", ".log"), read_delimited),
)

# Known by their first bytes, and why they are not read.
_REFUSED = (
    (b"\x93NUMPY", "this is a NumPy array without names or units; write CSV or Parquet"),
    (b"\x80\x02", "this is a Python pickle, which could run code; write CSV or Parquet"),
    (b"\x80\x03", "this is a Python pickle, which could run code; write CSV or Parquet"),
    (b"\x80\x04", "this is a Python pickle, which could run code; write CSV or Parquet"),
    (b"\x80\x05", "this is a Python pickle, which could run code; write CSV or Parquet"),
    (b"7z\xbc\xaf\x27\x1c", "this is a 7z archive; unpack it and give the logs in it"),
    (b"%PDF", "this is a PDF; export the log as delimited text"),
)


def find_format(source: Source) -> Format:
    """Return the format of a file.

    Raises
    ------
    LogError
        It is of a kind that is not read.
    """
    for known in FORMATS:
        if known.magic and source.data.startswith(known.magic):
            return known
    for magic, reason in _REFUSED:
        if source.data.startswith(magic):
            raise LogError(f"{source.name}: {reason}")
    suffix = PurePath(source.name).suffix.lower()
    for known in FORMATS:
        if suffix in known.suffixes and not known.magic:
            return known
    return FORMATS[-1]  # text can have any suffix; what is no text is refused there
