"""MATLAB files of version 5 to 7, through SciPy: vectors of numbers beside what scripts left over.

The format: https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf. After a header of
128 bytes come elements of a type, a length and that many bytes; a compressed element is one zlib
stream. Sizes are checked before anything is loaded, as 0.4 MB may grow to 400 MB.
Only arrays of real numbers are ever loaded; no cells, structures, functions or objects.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import visible
from damperfit.readers.foreign import check_size, refusing_damage
from damperfit.readers.table import Column, Samples, Table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions

    FloatArray = NDArray[np.float64]

__all__ = ["read_matlab"]

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15  # miMATRIX, miCOMPRESSED
_CHUNK = 1 << 20
_MAX_COLUMNS = 64  # of a matrix that is read as channels side by side
_NUMBERS = frozenset(
    ("double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
)


@dataclass(frozen=True, slots=True)
class _Vector:
    """One column of the log: a variable, or one column of it."""

    variable: str
    column: int | None  # None: the variable is a vector
    length: int

    @property
    def label(self) -> str:
        return self.variable if self.column is None else f"{self.variable}:{self.column + 1}"


def read_matlab(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a MATLAB file: its vectors of the commonest length.

    A matrix ``x_F`` of three columns gives the columns ``x_F:1``, ``x_F:2`` and ``x_F:3``.

    Raises
    ------
    LogError
        The file is cut or damaged, holds more than the limit, or holds no vectors of numbers.
    """
    name = source.name
    _check_elements(source.data, name=name, limit=options.max_bytes)
    from scipy import io as scipy_io

    file: Any = io.BytesIO(source.data)  # the stubs know paths only
    with refusing_damage("MATLAB file", name=name):
        listed = scipy_io.whosmat(file, appendmat=False)
    found = [(str(variable), tuple(map(int, shape)), kind) for variable, shape, kind in listed]
    repeated = [variable for variable, n in Counter(row[0] for row in found).items() if n > 1]
    if repeated:
        raise LogError(f"{name}: variable {visible(repeated[0])} occurs twice")
    vectors = [vector for row in found for vector in _vectors(*row)]
    if not vectors:
        held = ", ".join(f"{visible(v)} ({kind})" for v, _, kind in found[:10]) or "nothing"
        raise LogError(f"{name}: no vectors of numbers; the file holds {held}")
    counts = Counter(vector.length for vector in vectors)
    length = max(counts, key=lambda n: (counts[n], n))
    used = [vector for vector in vectors if vector.length == length]
    check_size(8 * length, limit=options.max_bytes, what="a variable", name=name)
    n_others = len(found) - len({vector.variable for vector in used})
    note = f"{n_others} variables left out; they are no vectors of {length} numbers"
    return (
        Table(
            columns=tuple(Column(vector.label) for vector in used),
            load=lambda wanted: _load(source, used, wanted),
            notes=(note,) if n_others else (),
        ),
    )


def _vectors(variable: str, shape: tuple[int, ...], kind: str) -> Iterator[_Vector]:
    if kind not in _NUMBERS or len(shape) != 2 or min(shape) < 1 or max(shape) < 2:
        return
    n_rows, n_columns = shape
    if min(shape) == 1:
        yield _Vector(variable, None, max(shape))
    elif n_rows > n_columns and n_columns <= _MAX_COLUMNS:
        for column in range(n_columns):
            yield _Vector(variable, column, n_rows)


def _load(source: Source, vectors: Sequence[_Vector], wanted: Mapping[str, int]) -> Samples:
    from scipy import io as scipy_io

    name = source.name
    file: Any = io.BytesIO(source.data)
    names = sorted({vectors[index].variable for index in wanted.values()})
    with refusing_damage("MATLAB file", name=name):
        loaded = scipy_io.loadmat(file, appendmat=False, variable_names=names, squeeze_me=False)
    columns = {}
    for channel, index in wanted.items():
        vector = vectors[index]
        values = loaded.get(vector.variable)
        if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
            raise LogError(f"{name}: {channel}: variable {visible(vector.label)} is no real array")
        column = values.ravel() if vector.column is None else values[:, vector.column]
        if len(column) != vector.length:
            raise LogError(f"{name}: damaged MATLAB file: {visible(vector.label)} is cut")
        columns[channel] = np.ascontiguousarray(column, dtype=np.float64)
    return Samples(columns, lambda index: f"row {index + 1}")


def _check_elements(data: bytes, *, name: str, limit: int) -> None:
    """Walk the elements: whole, of the two kinds there are, and within the limit when unpacked."""
    order = {b"IM": "<", b"MI": ">"}.get(data[126:_HEADER])
    if order is None:
        raise LogError(f"{name}: damaged MATLAB file: no byte order in the header")
    at, total = _HEADER, 0
    while at < len(data):
        if at + 8 > len(data):
            raise LogError(f"{name}: truncated MATLAB file; the end of the file is missing")
        kind, n_bytes = struct.unpack_from(f"{order}II", data, at)
        at += 8
        if kind not in {_MATRIX, _COMPRESSED}:
            raise LogError(f"{name}: damaged MATLAB file: element of type {kind} at byte {at - 8}")
        if at + n_bytes > len(data):
            raise LogError(f"{name}: truncated MATLAB file; the end of the file is missing")
        if kind == _COMPRESSED:
            total += _unpacked_size(data[at : at + n_bytes], name=name, limit=limit - total)
        else:
            total += n_bytes
        at += n_bytes


def _unpacked_size(packed: bytes, *, name: str, limit: int) -> int:
    unpacker = zlib.decompressobj()
    total = 0
    try:
        while not unpacker.eof:
            part = unpacker.decompress(packed, _CHUNK)
            total += len(part)
            if total > limit:
                break
            packed = unpacker.unconsumed_tail
            if not packed and not part:
                raise LogError(f"{name}: truncated MATLAB file; a variable ends too early")
    except zlib.error as error:
        raise LogError(f"{name}: damaged MATLAB file: {error}; copy the log again") from error
    if total > limit:
        raise LogError(f"{name}: unpacks to more than the limit of max_bytes")
    return total
