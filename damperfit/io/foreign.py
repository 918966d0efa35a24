"""MATLAB, ASAM MDF 4 and Excel: formats whose libraries run in a process of their own.

MATLAB up to version 7 (https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf) is read by
SciPy, version 7.3, which is HDF5, by h5py: one damaged byte ends SciPy's reader by a segmentation
fault, and makes HDF5 take all memory there is. Sizes are checked before values are read: 0.4 MB may
unpack to 400 MB, and a data set may claim terabytes of which nothing is stored. Only arrays of real
numbers at the top are looked at, no cells, structures or objects; a link, and the values of a data
set, may lead into another file, and neither is followed.

MDF (https://www.asam.net/standards/detail/mdf/), by asammdf: blocks "##XX" of a length and links to
others start at byte 64. The chains of links are walked before asammdf sees the file, as a damaged
one may lead back into itself, or end in the middle of a block.

Excel, by python-calamine: a ZIP archive of XML (ECMA-376), or before 2007 a compound file. A
kilobyte of the archive may unpack to gigabytes: what its directory says is checked first. 4 kB may
hold one long text and 50 000 cells that name it, or two cells at two ends of a sheet, between which
the library fills in billions: the memory of the process is limited by the size of the file. Nothing
is ever computed: formulas give the value they had and are counted, macros and links are not looked
at. Each sheet is written out as text and then read like any text log, so names, units rows and
wall-clock times are understood alike; a line number in a message is the row of the sheet.
"""

import datetime as dt
import importlib
import io
import math
import re
import struct
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from graphlib import CycleError, TopologicalSorter
from itertools import islice
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from damperfit.errors import LogError
from damperfit.io.child_process import ChildReader, ask_child, check_size, refusing_damage
from damperfit.io.columns import visible
from damperfit.io.files import Source
from damperfit.io.formats import Table
from damperfit.io.groups import Group, GroupChannel, group_tables
from damperfit.io.options import ReadOptions
from damperfit.io.text import read_delimited

_MAT = ChildReader("MATLAB", "", "scipy", f"{__name__}:matlab_vectors")
_MAT73 = ChildReader("MATLAB 7.3", "mat73", "h5py", f"{__name__}:hdf5_vectors")
_MDF = ChildReader("MDF", "mdf", "asammdf", f"{__name__}:mdf_groups")
_EXCEL = ChildReader(  # the library is written in Rust
    "Excel", "excel", "python_calamine", f"{__name__}:sheets_in", is_memory_safe=True
)

_MAX_ITEMS = 10_000
_MAX_COLUMNS = 64  # of a matrix that is read as channels side by side
_NUMBERS = {"single", "double"} | {f"{sign}int{n}" for sign in ("", "u") for n in (8, 16, 32, 64)}
_NO_NUMBERS = (b"char", b"logical", b"cell", b"struct", b"function_handle")

_FIRST_BLOCK = 64
_MAX_BLOCKS = 1_000_000
_UNPACKED_SIZE = 24 + 8  # of a ##DZ block: where its unpacked length stands
_CHAINED = (b"##DG", b"##CG", b"##CN", b"##DL", b"##HL", b"##FH", b"##AT", b"##EV", b"##CH")

_FORMULA = re.compile(rb"<(?:\w+:)?f[ />]")


# MATLAB.


def read_matlab(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a MATLAB file: its vectors of the commonest length.

    A matrix ``x_F`` of three columns gives the columns ``x_F:1``, ``x_F:2`` and ``x_F:3``.
    """
    data = source.data
    is_old = data.startswith(b"MATLAB 5.0")
    if is_old:  # does it end where its last variable does? SciPy reads what is left without a word
        order, at = "<" if data[126:128] == b"IM" else ">", 128
        while at + 8 <= len(data):
            kind, n_bytes = struct.unpack_from(f"{order}II", data, at)
            at += 4 + 4 if kind >> 16 else 8 + n_bytes
        if at != len(data):
            text = "truncated MATLAB file; the end is missing, or it is damaged"
            raise LogError(text, code="damaged")
    group = ask_child(_MAT if is_old else _MAT73, source, options)
    excluded = group.metadata  # name -> what it is instead
    lengths = [channel.length for channel in group.channels]
    length = max(set(lengths), key=lambda n: (lengths.count(n), n), default=0)
    if is_old and not lengths:
        listed = ", ".join(f"{visible(key)} ({kind})" for key, kind in [*excluded.items()][:10])
        struct_name = next((visible(key) for key, kind in excluded.items() if kind == "struct"), "")
        advice = f"; save its fields as variables: save(file, '-struct', {struct_name})"
        raise LogError(
            f"no vectors of numbers; the file holds {listed or 'nothing'}"
            f"{advice if struct_name else ''}",
            code="no-data",
        )
    used = tuple(channel for channel in group.channels if channel.length == length)
    variables = {channel.name.partition(":")[0] for channel in group.channels}
    variables -= {channel.name.partition(":")[0] for channel in used}
    n_others = len(excluded) + len(variables)
    note = f"{n_others} variables left out; they are not vectors of {length} numbers"
    return group_tables([Group("", used)], options, notes=(note,) * (n_others > 0))


def matlab_vectors(data: bytes, limit: int) -> Group:
    """Return the vectors of a MATLAB file up to version 7, and what else it holds; in a child."""
    scipy_io: Any = importlib.import_module("scipy.io")
    channels: list[GroupChannel] = []
    excluded: dict[str, str] = {}
    with refusing_damage("MATLAB file"), catch_warnings():
        simplefilter("error")  # a variable that is there twice
        kinds = {name: (shape, kind) for name, shape, kind in scipy_io.whosmat(io.BytesIO(data))}
        names = [
            name
            for name, (shape, kind) in kinds.items()
            if kind in _NUMBERS and _columns_of(shape[::-1])
        ]
        n_values = sum(math.prod(kinds[name][0]) for name in names)
        check_size(8 * n_values, limit=limit, subject="the file")
        arrays = scipy_io.loadmat(io.BytesIO(data), variable_names=names) if names else {}
        for name, (_, kind) in kinds.items():
            if name in names and arrays[name].dtype.kind in "fiu":
                channels += _vectors(name, arrays[name].T)
            elif name in names:
                excluded[name] = "complex numbers"
            else:
                excluded[name] = "numbers" if kind in _NUMBERS else kind
    return Group("", tuple(channels), excluded)


def hdf5_vectors(data: bytes, limit: int) -> Group:
    """Return the vectors at the top of a MATLAB file of version 7.3; in a child."""
    h5py = importlib.import_module("h5py")
    channels: list[GroupChannel] = []
    with refusing_damage(_MAT73.reads), h5py.File(io.BytesIO(data), "r") as file:
        for key in islice(file, _MAX_ITEMS):
            # A link into another file must not even be followed: the user did not give that file.
            is_own = isinstance(file.get(key, getlink=True), h5py.HardLink)
            if not is_own or file.get(key, getclass=True) is not h5py.Dataset:
                continue
            data_set = file[key]
            # Text is an array of 16-bit numbers otherwise.
            is_text = data_set.attrs.get("MATLAB_class", b"") in _NO_NUMBERS
            is_number = data_set.dtype.kind in "fiu" and not is_text
            if not is_number or not _columns_of(data_set.shape):
                continue
            if data_set.is_virtual or data_set.id.get_create_plist().get_external_count():
                continue  # the values are in another file
            n_values = sum(channel.length for channel in channels) + data_set.size
            check_size(8 * n_values, limit=limit, subject=f"the file up to {visible(str(key))}")
            channels += _vectors(str(key), data_set[()])
        return Group("", tuple(channels))


def _columns_of(shape: Sequence[int]) -> int:
    """Return the channels in an array of (columns, rows), as HDF5 has MATLAB's; 0: none."""
    if len(shape) != 2 or min(shape) < 1 or max(shape) < 2:
        return 0
    if min(shape) == 1:
        return 1
    return shape[0] if shape[0] < shape[1] and shape[0] <= _MAX_COLUMNS else 0


def _vectors(name: str, values: NDArray[Any]) -> list[GroupChannel]:
    columns = np.asarray(values, dtype=np.float64).reshape(_columns_of(values.shape), -1)
    names = [name] if len(columns) == 1 else [f"{name}:{i + 1}" for i in range(len(columns))]
    return [_channel(label, None, column) for label, column in zip(names, columns, strict=True)]


def _channel(name: str, unit: str | None, values: NDArray[Any]) -> GroupChannel:
    return GroupChannel(name, unit, len(values), partial(np.asarray, values))  # it is pickled


# MDF.


def read_mdf(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each channel group that is a test."""
    if not source.data[8:16].startswith(b"4."):
        version = source.data[8:16].decode("latin-1").strip("\0 ")
        raise LogError(
            f"MDF version {version!r}; expected 4, convert the log", code="unknown-format"
        )
    if source.data.startswith(b"UnFinMF"):
        raise LogError("truncated MDF file: the recording was not finished", code="truncated")
    _check_blocks(source.data, limit=options.max_bytes)
    return group_tables(ask_child(_MDF, source, options), options)


def mdf_groups(data: bytes, limit: int) -> list[Group]:
    """Return the channel groups of a file; runs in a process of its own."""
    asammdf: Any = importlib.import_module("asammdf")
    groups = []
    with refusing_damage(_MDF.reads):
        file = asammdf.MDF(io.BytesIO(data), remove_source_from_channel_names=True)
        for group in file.groups:
            n_bytes = int(group.channel_group.cycles_nr) * 8 * max(len(group.channels), 1)
            check_size(n_bytes, limit=limit, subject="a channel group")
        for index, group in enumerate(file.groups):
            channels: list[GroupChannel] = []
            for i, channel in enumerate(group.channels):
                if i == file.masters_db.get(index):
                    continue
                signal = file.get(group=index, index=i)
                if signal.samples.dtype.kind not in "fiu" or signal.samples.ndim != 1:
                    continue
                if not channels:
                    channels.append(_channel("time", "s", signal.timestamps))
                unit = str(signal.unit) or None
                channels.append(_channel(str(channel.name), unit, signal.samples))
            n_rows = int(group.channel_group.cycles_nr)
            declared = tuple(channel._replace(length=n_rows) for channel in channels)
            name = str(getattr(group.channel_group, "acq_name", "") or f"group {index + 1}")
            groups.append(Group(name, declared))
        return groups


def _check_blocks(data: bytes, *, limit: int) -> None:
    """Walk every block once: whole, in the file, and no chain of successors that bites its tail."""
    successors: dict[int, int] = {}
    waiting = [_FIRST_BLOCK]
    unpacked = 0
    while waiting:
        at = waiting.pop()
        if at in successors:
            continue
        if at + 24 > len(data):
            raise LogError("truncated MDF file; the end of the file is missing", code="truncated")
        kind = data[at : at + 4]
        length, n_links = struct.unpack_from("<QQ", data, at + 8)
        if not kind.startswith(b"##") or length < 24 + 8 * n_links:
            text = f"damaged MDF file: no block at byte {at}; copy the log again"
            raise LogError(text, code="damaged")
        if at + length > len(data):
            text = f"truncated MDF file; the block at byte {at} is not whole"
            raise LogError(text, code="truncated")
        links = struct.unpack_from(f"<{n_links}Q", data, at + 24)
        if kind == b"##DZ":
            unpacked += struct.unpack_from("<Q", data, at + _UNPACKED_SIZE)[0]
        successors[at] = links[0] if links and kind in _CHAINED else 0
        waiting += [link for link in links if link]
        if len(successors) > _MAX_BLOCKS:
            raise LogError(f"more than {_MAX_BLOCKS} blocks in the MDF file", code="too-large")
    check_size(unpacked, limit=limit, subject="the MDF file")
    try:
        TopologicalSorter({at: [following] for at, following in successors.items()}).prepare()
    except CycleError as error:
        text = f"damaged MDF file: the block at byte {error.args[1][0]} leads to itself"
        raise LogError(text, code="damaged") from error


# Excel.


def read_excel(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return a table for each sheet that holds rows of numbers."""
    if source.data.startswith(b"PK"):
        _check_archive(source, options)
    names, texts, n_formulas = ask_child(_EXCEL, source, options)
    note = f"{n_formulas} cells hold formulas; their last saved values are read"
    tables: list[Table] = []
    refusals: list[str] = []
    for sheet, text in zip(names, texts, strict=True):
        notes = [f"sheet: {visible(sheet)}"] * (len(texts) > 1) + [note] * (n_formulas > 0)
        try:
            blocks = read_delimited(source._replace(data=text), options)
        except LogError as error:
            place = f"sheet {visible(sheet)}{error.problem.subject.removeprefix(source.name)}"
            refusals.append(str(error.at(subject=place)))
            continue
        tables += [replace(table, notes=(*notes, *table.notes)) for table in blocks]
    if not tables:
        raise LogError(
            refusals[0] if refusals else "the workbook has no sheets", code="unknown-format"
        )
    return tuple(tables)


def _check_archive(source: Source, options: ReadOptions) -> None:
    """Refuse archives that are no workbook, or too large; no member is unpacked."""
    with (
        refusing_damage("ZIP archive"),
        zipfile.ZipFile(io.BytesIO(source.data)) as archive,
    ):
        members = archive.infolist()
    names = [member.filename for member in members]
    if not any(member.startswith("xl/workbook") for member in names):
        text = "this is a ZIP archive; unpack it and give the logs in it"
        if names and all(member.endswith(".npy") for member in names):
            text = "this is a NumPy archive without units; write CSV or Parquet"
        elif "content.xml" in names:
            text = "this is an OpenDocument file; save the sheet as .xlsx or CSV"
        raise LogError(text, code="damaged")
    if len(members) > _MAX_ITEMS:
        raise LogError(f"{len(members)} members, expected a workbook of few", code="too-large")
    claimed = sum(member.file_size for member in members)
    check_size(claimed, limit=options.max_bytes, subject="the workbook")


def sheets_in(data: bytes, limit: int) -> tuple[list[str], list[bytes], int]:
    """Return names and texts of a workbook's sheets, and the number of formulas; in a child."""
    calamine = importlib.import_module("python_calamine")
    n_formulas = 0
    with refusing_damage("Excel workbook"):
        if data.startswith(b"PK"):
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                members = map(archive.read, archive.infolist())
                sheets = (member for member in members if b"sheetData" in member)
                n_formulas = sum(len(_FORMULA.findall(sheet)) for sheet in sheets)
        book = calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
        names = [str(name) for name in book.sheet_names]
        texts: list[bytes] = []
        for name in names:
            rows = book.get_sheet_by_name(name).to_python(skip_empty_area=False)
            # Tab-separated lines; columns and rows that are empty throughout stay out.
            columns = enumerate(zip(*rows, strict=False))
            filled = [i for i, column in columns if any(map(_cell, column))]
            lines = []
            for row in rows:
                fields = [_cell(row[i]) for i in filled if i < len(row)]
                cells = [field for field in fields if field]
                is_entry = len(cells) == 2 < len(filled) and cells[0][:1].isalpha()
                lines.append(": ".join(cells) if is_entry else "\t".join(fields if cells else ()))
            texts.append("".join(f"{line}\n" for line in lines).encode("utf-8", "replace"))
            check_size(sum(map(len, texts)), limit=limit, subject="the workbook")
    return names, texts, n_formulas


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dt.timedelta):
        value = value.total_seconds()
    if isinstance(value, int | float):
        return repr(value)
    return re.sub(r"\s+", " ", str(value)).replace('"', "'").strip()
