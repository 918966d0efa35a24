"""MATLAB files of version 7.3, which are HDF5, through h5py.

The format: 512 bytes of MATLAB's header, then HDF5 (https://support.hdfgroup.org/documentation/). A
variable is a data set with the attribute MATLAB_class; MATLAB's columns are HDF5's rows.

Traps. Text is an array of 16-bit numbers, told from numbers by that attribute alone. Cells,
structures and function handles are references; a link may lead into another file, and so may the
values of a data set. A data set may claim terabytes of which nothing is stored. On damaged bytes
the library takes all memory there is: it runs in a process of its own. Only data sets of real
numbers at the top are looked at; no references are followed and no objects made.
"""

from __future__ import annotations

import importlib
import io
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.readers.channels import visible
from damperfit.readers.child_process import ChildAnswer
from damperfit.readers.foreign import check_size, refusing_damage
from damperfit.readers.grouping import (
    Group,
    GroupChannel,
    group_tables,
    groups_answer,
    read_groups_in_child,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

    FloatArray = NDArray[np.float64]

__all__ = ["EXTRA", "IS_MEMORY_SAFE", "READS", "answer", "read_hdf5"]

EXTRA, READS = "mat73", "MATLAB 7.3"
IS_MEMORY_SAFE = False

_MAX_ITEMS = 10_000
_MAX_COLUMNS = 64
_NO_NUMBERS = (b"char", b"logical", b"cell", b"struct", b"function_handle")


def read_hdf5(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of the vectors at the top of the file, of their commonest length.

    Raises
    ------
    LogError
        The file is damaged, claims more than the limit, or h5py is not installed.
    """
    groups = read_groups_in_child(__name__, "h5py", source, options)
    channels = [channel for group in groups for channel in group.channels]
    lengths = [channel.length for channel in channels]
    usual = max(set(lengths), key=lambda n: (lengths.count(n), n), default=0)
    used = tuple(channel for channel in channels if channel.length == usual)
    n_others = len(channels) - len(used)
    notes = (f"{n_others} vectors left out; they are not {usual} long",) if n_others else ()
    return group_tables([Group("", used)], options, name=source.name, notes=notes)


def answer(data: bytes, limit: int) -> ChildAnswer:
    """Return the vectors at the top of a file; runs in a process of its own.

    Raises
    ------
    LogError
        The file is damaged or claims more than the limit.
    """
    h5py = importlib.import_module("h5py")
    channels: list[GroupChannel] = []
    with refusing_damage(READS), h5py.File(io.BytesIO(data), "r") as file:
        for key in islice(file, _MAX_ITEMS):
            # A link into another file would read what nobody gave; it must not even be followed.
            is_own = isinstance(file.get(key, getlink=True), h5py.HardLink)
            if is_own and file.get(key, getclass=True) is h5py.Dataset:
                n_before = 8 * sum(channel.length for channel in channels)
                channels += list(_channels(file[key], str(key), n_before, limit))
    return groups_answer([Group("", tuple(channels))])


def _channels(data: Any, key: str, n_before: int, limit: int) -> Iterator[GroupChannel]:
    """Yield the columns of a data set; MATLAB's columns are rows in HDF5."""
    kind = data.attrs.get("MATLAB_class", b"")
    is_number = data.dtype.kind in "fiu" and kind not in _NO_NUMBERS
    if not is_number or data.ndim != 2 or min(data.shape) < 1 or max(data.shape) < 2:
        return
    # So may values that stand in another file, or are put together from several.
    if data.id.get_create_plist().get_external_count() or data.is_virtual:
        return
    n_columns, n_rows = data.shape
    if n_rows == 1:
        n_columns, n_rows = 1, n_columns
    if n_columns > 1 and (n_columns >= n_rows or n_columns > _MAX_COLUMNS):
        return
    n_bytes = n_before + 8 * n_columns * n_rows
    check_size(n_bytes, limit=limit, what=f"the file up to {visible(key)}")
    values = np.asarray(data[()], dtype=np.float64).reshape(n_columns, n_rows)
    for i, column in enumerate(values):
        label = key if n_columns == 1 else f"{key}:{i + 1}"
        yield GroupChannel(label, None, n_rows, partial(np.asarray, column))
