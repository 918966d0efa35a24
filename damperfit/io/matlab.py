"""MATLAB files: vectors of numbers beside what scripts left over.

Up to version 7 (https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf) SciPy reads them,
version 7.3, which is HDF5, h5py: both in a child, for one damaged byte ends SciPy's reader by a
segmentation fault, and makes HDF5 take all memory there is. Sizes are checked before values are
read: 0.4 MB may unpack to 400 MB, and a data set may claim terabytes of which nothing is stored.
Only arrays of real numbers at the top are looked at, no cells, structures or objects; a link, and
the values of a data set, may lead into another file, and neither is followed.
"""

from __future__ import annotations

import importlib
import io
import math
import struct
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from damperfit.errors import LogError
from damperfit.io.channels import visible
from damperfit.io.child_process import ChildAnswer, ChildReader, check_size, refusing_damage
from damperfit.io.files import Source
from damperfit.io.formats import Table
from damperfit.io.groups import (
    Group,
    GroupChannel,
    answer_of_groups,
    group_tables,
    groups_of_child,
)
from damperfit.io.options import ReadOptions

__all__ = ["read_matlab"]

_MAT = ChildReader("MATLAB", "", "scipy", f"{__name__}:matlab_vectors")
_MAT73 = ChildReader("MATLAB 7.3", "mat73", "h5py", f"{__name__}:hdf5_vectors")
_MAX_ITEMS = 10_000
_MAX_COLUMNS = 64  # of a matrix that is read as channels side by side
_NUMBERS = {"single", "double"} | {f"{sign}int{n}" for sign in ("", "u") for n in (8, 16, 32, 64)}
_NO_NUMBERS = (b"char", b"logical", b"cell", b"struct", b"function_handle")


def read_matlab(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a MATLAB file: its vectors of the commonest length.

    A matrix ``x_F`` of three columns gives the columns ``x_F:1``, ``x_F:2`` and ``x_F:3``.

    Raises
    ------
    LogError
        The file is cut or damaged, claims more than the limit, or holds no vectors of numbers; or
        h5py, which version 7.3 needs, is not installed.
    """
    name = source.name
    is_old = source.data.startswith(b"MATLAB 5.0")
    if is_old and not _is_whole(source.data):  # SciPy reads what is left without a word
        raise LogError("truncated MATLAB file; the end is missing, or it is damaged", subject=name)
    (group,) = groups_of_child(_MAT if is_old else _MAT73, source, options)
    others = group.metadata  # name -> what it is instead
    lengths = [channel.length for channel in group.channels]
    usual = max(set(lengths), key=lambda n: (lengths.count(n), n), default=0)
    if is_old and not lengths:
        held = ", ".join(f"{visible(key)} ({kind})" for key, kind in [*others.items()][:10])
        struct_name = next((visible(key) for key, kind in others.items() if kind == "struct"), "")
        advice = f"; save its fields as variables: save(file, '-struct', {struct_name})"
        raise LogError(
            f"no vectors of numbers; the file holds {held or 'nothing'}"
            f"{advice if struct_name else ''}",
            subject=name,
        )
    used = tuple(channel for channel in group.channels if channel.length == usual)
    variables = {channel.name.partition(":")[0] for channel in group.channels}
    variables -= {channel.name.partition(":")[0] for channel in used}
    n_others = len(others) + len(variables)
    note = f"{n_others} variables left out; they are not vectors of {usual} numbers"
    tables = group_tables([Group("", used)], options, name=name)
    notes = (note,) * (n_others > 0)
    return tuple(replace(table, notes=(*notes, *table.notes)) for table in tables)


def _is_whole(data: bytes) -> bool:
    """Whether a file up to version 7 ends where its last variable does."""
    order, at = "<" if data[126:128] == b"IM" else ">", 128
    while at + 8 <= len(data):
        kind, n_bytes = struct.unpack_from(f"{order}II", data, at)
        at += 4 + 4 if kind >> 16 else 8 + n_bytes
    return at == len(data)


def matlab_vectors(data: bytes, limit: int) -> ChildAnswer:
    """Return the vectors of a MATLAB file up to version 7, and what else it holds; in a child.

    Raises
    ------
    LogError
        The file is cut or damaged, or claims more than the limit.
    """
    scipy_io: Any = importlib.import_module("scipy.io")
    channels: list[GroupChannel] = []
    others: dict[str, str] = {}
    with refusing_damage("MATLAB file"), catch_warnings():
        simplefilter("error")  # a variable that is there twice
        kinds = {name: (shape, kind) for name, shape, kind in scipy_io.whosmat(io.BytesIO(data))}
        wanted = [
            name
            for name, (shape, kind) in kinds.items()
            if kind in _NUMBERS and _columns_of(shape[::-1])
        ]
        n_values = sum(math.prod(kinds[name][0]) for name in wanted)
        check_size(8 * n_values, limit=limit, what="the file")
        held = scipy_io.loadmat(io.BytesIO(data), variable_names=wanted) if wanted else {}
        for name, (_, kind) in kinds.items():
            if name in wanted and held[name].dtype.kind in "fiu":
                channels += _vectors(name, held[name].T)
            elif name in wanted:
                others[name] = "complex numbers"
            else:
                others[name] = "numbers" if kind in _NUMBERS else kind
    return answer_of_groups([Group("", tuple(channels), others)])


def hdf5_vectors(data: bytes, limit: int) -> ChildAnswer:
    """Return the vectors at the top of a MATLAB file of version 7.3; in a child.

    Raises
    ------
    LogError
        The file is damaged or claims more than the limit.
    """
    h5py = importlib.import_module("h5py")
    channels: list[GroupChannel] = []
    with refusing_damage(_MAT73.reads), h5py.File(io.BytesIO(data), "r") as file:
        for key in islice(file, _MAX_ITEMS):
            # A link into another file would read what nobody gave; it must not even be followed.
            is_own = isinstance(file.get(key, getlink=True), h5py.HardLink)
            is_data = is_own and file.get(key, getclass=True) is h5py.Dataset
            if is_data and _holds_numbers(file[key]):
                n_values = sum(channel.length for channel in channels) + file[key].size
                check_size(8 * n_values, limit=limit, what=f"the file up to {visible(str(key))}")
                channels += _vectors(str(key), file[key][()])
        return answer_of_groups([Group("", tuple(channels))])


def _holds_numbers(data: Any) -> bool:
    """Whether a data set holds vectors, and holds them itself."""
    kind = data.attrs.get("MATLAB_class", b"")  # text is an array of 16-bit numbers otherwise
    is_number = data.dtype.kind in "fiu" and kind not in _NO_NUMBERS
    if not is_number or data.ndim != 2 or not _columns_of(data.shape):
        return False
    return not (data.id.get_create_plist().get_external_count() or data.is_virtual)


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
    return [
        GroupChannel(label, None, len(column), partial(np.asarray, column))
        for label, column in zip(names, columns, strict=True)
    ]
