"""Arrow arrays from plain values and numpy arrays, straight from their buffers.

`pyarrow.array` would do the same but imports pandas first, which every run would wait for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["column", "float_array", "repeated"]


def float_array(values: NDArray[np.float64]) -> pa.Array:
    """Return an Arrow array of the same numbers, without a copy where that is possible."""
    data = np.ascontiguousarray(values, dtype=np.float64)
    return pa.Array.from_buffers(pa.float64(), len(data), [None, pa.py_buffer(data)])


def repeated(value: float | str, n: int) -> pa.Array:
    """Return an Arrow array of one number or text, ``n`` times."""
    if isinstance(value, int):
        return pa.Array.from_buffers(
            pa.int64(), n, [None, pa.py_buffer(np.full(n, value, dtype=np.int64))]
        )
    if isinstance(value, float):
        return float_array(np.full(n, value))
    data = _encoded(value)
    offsets = np.arange(n + 1, dtype=np.int32) * np.int32(len(data))
    return pa.Array.from_buffers(
        pa.string(), n, [None, pa.py_buffer(offsets), pa.py_buffer(data * n)]
    )


def column(values: Sequence[float | str | None], kind: pa.DataType) -> pa.Array:
    """Return an Arrow array of type ``kind`` (float64, int64 or string); None is null."""
    is_valid = np.array([value is not None for value in values], dtype=np.bool_)
    validity = None if is_valid.all() else pa.py_buffer(np.packbits(is_valid, bitorder="little"))
    if kind == pa.string():
        texts = [b"" if value is None else _encoded(str(value)) for value in values]
        offsets = np.cumsum([0, *(len(text) for text in texts)], dtype=np.int32)
        buffers = [validity, pa.py_buffer(offsets), pa.py_buffer(b"".join(texts))]
    else:
        dtype = np.int64 if kind == pa.int64() else np.float64
        data = np.array([0 if value is None else value for value in values], dtype=dtype)
        buffers = [validity, pa.py_buffer(data)]
    return pa.Array.from_buffers(kind, len(values), buffers)


def _encoded(text: str) -> bytes:
    return text.encode("utf-8", "backslashreplace")
