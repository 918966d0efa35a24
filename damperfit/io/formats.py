"""The formats that can be read, and how a file is known to be one: by content, then by suffix.

Every reader makes `Table`s of a file: named columns whose values are loaded when it is known which
of them are channels (`columns`, `recordings`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import PurePath
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damperfit.errors import LogError
from damperfit.io.files import Source, is_binary, is_json
from damperfit.io.options import ReadOptions
from damperfit.problem import Problem

FloatArray = NDArray[np.float64]


class Column(NamedTuple):
    """Name and unit of a column, as the log has them."""

    name: str  # without blanks around it; may be empty
    unit: str | None = None  # of a units row or a field's metadata, not one inside the name
    is_clock: bool = False  # times of day, as in "04/29/2022 11:56:20.699 AM"


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Raw values of the channels asked for, blanks as NaN, a clock in seconds from its start.

    A channel that has a clock of its own has it in `times`, s; the others are in the rows of the
    channel "time", where there is one.
    """

    channels: Mapping[str, FloatArray]
    place: Callable[[int], str] = lambda index: f"row {index + 1}"  # of a sample
    times: Mapping[str, FloatArray] = field(default_factory=dict)
    findings: tuple[Problem, ...] = ()  # what was left out and makes the log doubtful
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """One test of a log, not yet understood."""

    columns: tuple[Column, ...]
    load: Callable[[Mapping[str, int]], Samples]  # {channel: index of column}
    metadata: Mapping[str, str] = field(default_factory=dict)  # keys in lower case
    notes: tuple[str, ...] = ()
    part: str = ""  # title of the test in the file (block, sheet, group)
    findings: tuple[Problem, ...] = ()
    may_run_on: bool = False  # it may be the next piece of one record
    hint: str = ""  # why names may be missing, said where a channel is not found


class Format(NamedTuple):
    """One format: a reader and this line are all that it takes."""

    name: str  # for people
    reader: str  # ``module:function`` in this package: (source, options) -> tables, one a test
    suffixes: tuple[str, ...]  # in lower case, with the point
    magic: tuple[bytes, ...] = ()  # what its files start with; empty where that varies
    in_child: bool = False  # read in a process of its own; other logs can be read meanwhile

    def read(self, source: Source, options: ReadOptions) -> tuple[Table, ...]:
        """Return the tables of a file."""
        module, _, function = self.reader.partition(":")
        reader = getattr(import_module(f"damperfit.io.{module}"), function)
        return tuple(reader(source, options))


_MAT73 = (b"MATLAB 7.3 MAT-file", b"\x89HDF")
_OFFICE = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
_MDF = (b"MDF     ", b"UnFinMF ")
_JSON = Format("JSON", "json_log:read_json", (".json", ".jsonl", ".ndjson"))
_TEXT = Format("text", "text:read_delimited", (".csv", ".txt", ".tsv", ".dat", ".asc", ".log"))
FORMATS = (
    Format("Parquet", "binary:read_parquet", (".parquet", ".pq"), (b"PAR1",)),
    Format("MATLAB", "foreign:read_matlab", (".mat",), (b"MATLAB 5.0 MAT-file",), in_child=True),
    Format("MATLAB 7.3", "foreign:read_matlab", (".mat", ".h5"), _MAT73, in_child=True),
    Format("TDMS", "binary:read_tdms", (".tdms",), (b"TDSm",)),
    Format("MDF", "foreign:read_mdf", (".mf4", ".mdf"), _MDF, in_child=True),
    Format("Excel", "foreign:read_excel", (".xlsx", ".xls"), _OFFICE),
    _JSON,
    Format("LabVIEW text", "text:read_lvm", (".lvm",), (b"LabVIEW Measurement",)),
    _TEXT,  # any suffix may stand for it
)

# What a file in a folder is called that is taken for a log.
_PLAIN = tuple(suffix for kind in FORMATS for suffix in kind.suffixes)
LOG_SUFFIXES = (*_PLAIN, *(f"{suffix}.gz" for suffix in _PLAIN))

# What is known by its first bytes and not read, and why.
_PICKLE = "this is a Python pickle, which could run code; write CSV or Parquet"
_ARCHIVE = "this is an archive; unpack it and give the logs in it"
_REFUSED = {
    b"\x93NUMPY": "this is a NumPy array without names or units; write CSV or Parquet",
    **{b"\x80" + bytes([protocol]): _PICKLE for protocol in (2, 3, 4, 5)},
    **dict.fromkeys((b"7z\xbc\xaf\x27\x1c", b"Rar!\x1a\x07", b"BZh"), _ARCHIVE),
    **dict.fromkeys((b"\xfd7zXZ\0", b"\x28\xb5\x2f\xfd"), _ARCHIVE),
    b"%PDF": "this is a PDF; export the log as delimited text",
    b"SQLite format 3\0": "this is a database; export the log as delimited text",
}
_TAR = 257  # where a tar archive says "ustar"


def find_format(source: Source) -> Format:
    """Return the format of a file: what its first bytes say, else what its suffix says."""
    data = source.data
    for kind in FORMATS:
        if kind.magic and data.startswith(kind.magic):
            return kind
    refused = next((reason for magic, reason in _REFUSED.items() if data.startswith(magic)), "")
    if refused or data.startswith(b"ustar", _TAR):
        raise LogError(refused or _ARCHIVE, code="unknown-format")
    if is_json(data):
        return _JSON
    suffix = PurePath(source.name).suffix.lower()
    by_suffix = next((kind for kind in FORMATS if suffix in kind.suffixes), _TEXT)
    if by_suffix is not _TEXT and is_binary(data):
        raise LogError(
            f"is named like {by_suffix.name} and does not begin like it; it is damaged "
            "or of a version that is not read",
            code="damaged",
        )
    return _TEXT
