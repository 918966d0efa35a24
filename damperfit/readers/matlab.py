"""MATLAB files of version 5 to 7: vectors of numbers beside what scripts left over.

The format: https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf. After a header of
128 bytes come elements of a type, a length and that many bytes; a compressed element is one zlib
stream that holds an element. A variable is an element of elements: flags, dimensions, name, real
part.

Read here and not by SciPy, whose compiled reader ends the process by a segmentation fault on one
damaged byte. Only arrays of real numbers are looked at; no cells, structures, functions or
objects. Sizes are checked before anything is kept, as 0.4 MB may unpack to 400 MB.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import visible
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
_CHUNK = 1 << 20  # bytes unpacked at a time
_PIECE = 1 << 16  # bytes handed over at a time
_MAX_COLUMNS = 64  # of a matrix that is read as channels side by side
# Array class -> what MATLAB calls it. Those from 6 to 15 are arrays of numbers.
_CLASSES = {1: "cell", 2: "struct", 3: "object", 4: "char", 5: "sparse", 16: "function"}
_NUMBERS = range(6, 16)
_COMPLEX = 0x0800  # in the flags
# Type of an element -> how NumPy calls its numbers.
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}


@dataclass(frozen=True, slots=True)
class _Variable:
    """A variable and where it stands."""

    name: str
    kind: str  # "numbers", or what it is instead
    shape: tuple[int, ...]
    start: int  # of the element in the file
    stop: int
    is_packed: bool
    real_part: int  # where it starts in the element, unpacked


@dataclass(frozen=True, slots=True)
class _Vector:
    """One column of the log: a variable, or one column of it."""

    variable: _Variable
    column: int | None  # None: the variable is a vector

    @property
    def label(self) -> str:
        name = self.variable.name
        return name if self.column is None else f"{name}:{self.column + 1}"

    @property
    def length(self) -> int:
        return max(self.variable.shape)


def read_matlab(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a MATLAB file: its vectors of the commonest length.

    A matrix ``x_F`` of three columns gives the columns ``x_F:1``, ``x_F:2`` and ``x_F:3``.

    Raises
    ------
    LogError
        The file is cut or damaged, holds more than the limit, or holds no vectors of numbers.
    """
    name = source.name
    order = {b"IM": "<", b"MI": ">"}.get(source.data[126:_HEADER])
    if order is None:
        raise LogError(f"{name}: damaged MATLAB file: no byte order in the header")
    variables = list(_variables(source, order, limit=options.max_bytes))
    repeated = [v for v, n in Counter(variable.name for variable in variables).items() if n > 1]
    if repeated:
        raise LogError(f"{name}: variable {visible(repeated[0])} occurs twice")
    vectors = [vector for variable in variables for vector in _vectors(variable)]
    if not vectors:
        held = ", ".join(f"{visible(v.name)} ({v.kind})" for v in variables[:10]) or "nothing"
        struct = next((visible(v.name) for v in variables if v.kind == "struct"), "")
        advice = f"; save its fields as variables: save(file, '-struct', {struct})"
        raise LogError(
            f"{name}: no vectors of numbers; the file holds {held}{advice if struct else ''}"
        )
    counts = Counter(vector.length for vector in vectors)
    length = max(counts, key=lambda n: (counts[n], n))
    used = [vector for vector in vectors if vector.length == length]
    n_others = len(variables) - len({vector.variable.name for vector in used})
    note = f"{n_others} variables left out; they are not vectors of {length} numbers"
    return (
        Table(
            columns=tuple(Column(vector.label) for vector in used),
            load=lambda wanted: _load(source, order, used, wanted),
            notes=(note,) if n_others else (),
        ),
    )


def _vectors(variable: _Variable) -> Iterator[_Vector]:
    shape = variable.shape
    if variable.kind != "numbers" or len(shape) != 2 or min(shape) < 1 or max(shape) < 2:
        return
    n_rows, n_columns = shape
    if min(shape) == 1:
        yield _Vector(variable, None)
    elif n_rows > n_columns and n_columns <= _MAX_COLUMNS:
        for column in range(n_columns):
            yield _Vector(variable, column)


def _load(
    source: Source, order: str, vectors: Sequence[_Vector], wanted: Mapping[str, int]
) -> Samples:
    chosen = {channel: vectors[index] for channel, index in wanted.items()}
    arrays = {
        vector.variable.name: _numbers(source, order, vector.variable)
        for vector in {vector.variable.name: vector for vector in chosen.values()}.values()
    }
    columns = {}
    for channel, vector in chosen.items():
        values = arrays[vector.variable.name]
        column = values.ravel() if vector.column is None else values[:, vector.column]
        columns[channel] = np.ascontiguousarray(column, dtype=np.float64)
    return Samples(columns, lambda index: f"row {index + 1}")


def _variables(source: Source, order: str, *, limit: int) -> Iterator[_Variable]:
    """Yield every variable; refuse elements that are not whole or unpack to more than the limit."""
    data, name = source.data, source.name
    at, n_before = _HEADER, 0
    while at < len(data):
        kind, n_bytes, start = _tag(data, order, at, name)
        stop = start + n_bytes
        if kind not in {_MATRIX, _COMPRESSED}:
            raise LogError(f"{name}: damaged MATLAB file: element of type {kind} at byte {at}")
        if kind == _COMPRESSED:
            head, n_unpacked = _unpack(
                data[start:stop], name=name, limit=limit, n_before=n_before, keep=_CHUNK
            )
            kind, n_inside, inside = _tag(head, order, 0, name, n_data=n_unpacked)
            if kind != _MATRIX or inside + n_inside != n_unpacked:
                raise LogError(f"{name}: damaged MATLAB file: no variable at byte {at}")
            n_before += n_unpacked
            yield _variable(head[inside:], order, name, (start, stop, inside))
        else:
            n_before += n_bytes
            yield _variable(data[start:stop], order, name, (start, stop, 0))
        at = stop


def _tag(
    data: bytes, order: str, at: int, name: str, *, n_data: int | None = None
) -> tuple[int, int, int]:
    """Return type, length and first byte of the element at a byte; it must end in the data."""
    if at + 8 <= len(data):
        kind, n_bytes = struct.unpack_from(f"{order}II", data, at)
        start = at + 8
        if kind >> 16:  # four bytes at most stand in the tag itself
            kind, n_bytes, start = kind & 0xFFFF, kind >> 16, at + 4
        if start + n_bytes <= (len(data) if n_data is None else n_data):
            return kind, n_bytes, start
    raise LogError(f"{name}: truncated MATLAB file; the end is missing, or it is damaged")


def _variable(head: bytes, order: str, name: str, place: tuple[int, int, int]) -> _Variable:
    """Return what the first elements of a variable say; place is start, stop, and of the inside."""
    start, stop, inside = place
    if not head:  # how an empty array is written
        return _Variable("", "empty", (), start, stop, bool(inside), 0)
    parts, at = [], 0
    for _ in range(3):
        kind, n_bytes, first = _tag(head, order, at, name)
        parts.append((kind, head[first : first + n_bytes]))
        at = _next(first, n_bytes)
    (_, flags), (dimensions_type, dimensions), (_, label) = parts
    if len(flags) != 8 or dimensions_type != 5 or len(dimensions) % 4:
        raise LogError(f"{name}: damaged MATLAB file: a variable without flags or dimensions")
    (bits,) = struct.unpack_from(f"{order}I", flags)
    shape = struct.unpack(f"{order}{len(dimensions) // 4}i", dimensions)
    kind_of = _CLASSES.get(bits & 0xFF, "unknown")
    if bits & 0xFF in _NUMBERS:
        kind_of = "complex numbers" if bits & _COMPLEX else "numbers"
    text = label.decode("latin-1")
    return _Variable(text, kind_of, shape, start, stop, bool(inside), inside + at)


def _next(first: int, n_bytes: int) -> int:
    """Return where the next element starts: at a multiple of 8 bytes."""
    return -(-(first + n_bytes) // 8) * 8


def _numbers(source: Source, order: str, variable: _Variable) -> NDArray[np.generic]:
    """Return an array of numbers, shape as in the file."""
    name = source.name
    data = source.data[variable.start : variable.stop]
    if variable.is_packed:
        # Its length was checked against the limit when the variables were listed.
        data, _ = _unpack(data, name=name, limit=1 << 62, keep=1 << 62)
    kind, n_bytes, first = _tag(data, order, variable.real_part, name)
    if kind not in _TYPES:
        raise LogError(f"{name}: damaged MATLAB file: {visible(variable.name)} holds no numbers")
    dtype = np.dtype(f"{order}{_TYPES[kind]}")
    n_values = math.prod(variable.shape)
    if n_values * dtype.itemsize != n_bytes:
        raise LogError(
            f"{name}: damaged MATLAB file: {visible(variable.name)} has {n_bytes} bytes, "
            f"expected {n_values} numbers of {dtype.itemsize}"
        )
    values = np.frombuffer(data, dtype, count=n_values, offset=first)
    return values.reshape(variable.shape, order="F")


def _unpack(
    packed: bytes, *, name: str, limit: int, keep: int, n_before: int = 0
) -> tuple[bytes, int]:
    """Return the first bytes of a zlib stream and its whole length; its checksum is verified."""
    kept, total = [], 0
    try:
        for part in _unpacked_parts(packed):
            if total < keep:
                kept.append(part[: keep - total])
            total += len(part)
            if n_before + total > limit:
                raise LogError(
                    f"{name}: more than the limit of {limit} bytes when unpacked "
                    "(rig.max_log_bytes)"
                )
    except EOFError as error:
        raise LogError(f"{name}: truncated MATLAB file; a variable ends too early") from error
    except zlib.error as error:
        raise LogError(f"{name}: damaged MATLAB file: {error}; copy the log again") from error
    return b"".join(kept), total


def _unpacked_parts(packed: bytes) -> Iterator[bytes]:
    """Yield a zlib stream in parts; handed over in pieces, as zlib copies what is left of one."""
    unpacker = zlib.decompressobj()
    at, piece = 0, b""
    while not unpacker.eof:
        if not piece:
            piece = packed[at : at + _PIECE]
            at += len(piece)
        part = unpacker.decompress(piece, _CHUNK)
        piece = unpacker.unconsumed_tail
        if not part and not piece and at == len(packed):
            raise EOFError
        yield part
