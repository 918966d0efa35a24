"""Wall-clock stamps to seconds from the first one.

The date is only compared with the one above, so that day and month need not be told apart; each
change of date is one day.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["clock_seconds", "is_stamp"]

_DAY = 86_400.0  # s
# In the common subset of Python's and Arrow's regular expressions.
_PATTERN = (
    r"^\s*(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ]+)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[.,](?P<fraction>\d{1,9}))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|UTC|[+-]\d{2}:?\d{2})?\s*$"
)
_STAMP = re.compile(_PATTERN, re.ASCII)


def is_stamp(text: str) -> bool:
    """Say whether a field is a time of day, with or without a date.

    Examples
    --------
    >>> is_stamp("04/29/2022 11:56:20.699 AM"), is_stamp("2022-04-29"), is_stamp("1.5")
    (True, False, False)
    """
    return _STAMP.match(text) is not None


def clock_seconds(stamps: Any) -> FloatArray:
    """Return seconds from the first stamp; NaN for what is no stamp.

    Parameters
    ----------
    stamps : pyarrow.ChunkedArray or pyarrow.Array
        Text, shape (n,).
    """
    import pyarrow as pa
    from pyarrow import compute

    if isinstance(stamps, pa.ChunkedArray):
        stamps = stamps.combine_chunks()
    if not len(stamps):
        return np.zeros(0)
    parts = compute.call_function(
        "extract_regex", [stamps], compute.ExtractRegexOptions(pattern=_PATTERN)
    )

    def number(field: str) -> FloatArray:
        text = compute.call_function("struct_field", [parts], compute.StructFieldOptions([field]))
        is_blank = compute.call_function("equal", [text, pa.scalar("")])
        filled = compute.call_function("if_else", [is_blank, pa.scalar("0"), text])
        return np.asarray(filled.cast(pa.float64()).to_numpy(zero_copy_only=False))

    def text(field: str) -> Any:
        return compute.call_function("struct_field", [parts], compute.StructFieldOptions([field]))

    digits = compute.call_function("utf8_length", [text("fraction")])
    fraction = number("fraction") / 10.0 ** np.asarray(
        digits.to_numpy(zero_copy_only=False), dtype=np.float64
    )
    hour = number("hour")
    half = compute.call_function("utf8_lower", [text("half")])
    first = compute.call_function("utf8_slice_codeunits", [half], compute.SliceOptions(0, 1))
    letters = np.asarray(first.to_numpy(zero_copy_only=False), dtype=object)
    has_half = (letters == "a") | (letters == "p")
    hour = np.where(has_half, hour % 12.0 + 12.0 * (letters == "p"), hour)
    whole = hour * 3600.0 + number("minute") * 60.0 + number("second")
    days = _days(np.asarray(text("date").to_numpy(zero_copy_only=False), dtype=object), whole)
    # Whole seconds first: the difference of large numbers would cost digits of the fraction.
    return np.asarray((whole + days * _DAY - whole[0]) + (fraction - fraction[0]))


def _days(dates: NDArray[np.object_], whole: FloatArray) -> FloatArray:
    """Return days since the first stamp."""
    if len(dates) and dates[0]:
        steps = np.asarray(dates[1:] != dates[:-1], dtype=np.float64)
    else:
        steps = np.asarray(np.diff(whole) < -_DAY / 2.0, dtype=np.float64)
    return np.concatenate(([0.0], np.cumsum(steps)))
