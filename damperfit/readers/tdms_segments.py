"""The skeleton of a TDMS file: whether its segments are whole and do not contradict themselves.

Each segment starts with 28 bytes: "TDSm", contents, version, bytes to the next segment, bytes to
its values. Then it says what its channels are, then come their values.

Traps. A damaged length moves the values by some bytes, and npTDMS reads on: so what a segment says
of its channels is walked here, and must end where the values begin, but for zeros that fill up a
disk's sector. A rig that stops while writing leaves a segment whose length is 2^64 - 1. A file cut
between two segments is whole and cannot be told from one.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from damperfit.errors import LogError

__all__ = ["Extent", "find_extent"]

_LEAD_IN = 28
# Bits of the contents.
_HAS_METADATA, _HAS_VALUES, _IS_BIG_ENDIAN, _IS_DAQMX = 1 << 1, 1 << 3, 1 << 6, 1 << 7
_OPEN = 0xFFFF_FFFF_FFFF_FFFF  # length of a segment that was never closed
_NO_VALUES, _AS_BEFORE = 0xFFFF_FFFF, 0  # length of what is said of a channel's values
_TEXT = 0x20
# Kind of a property -> bytes: integers, floats (with a unit), bool, time stamp, complex.
_SIZES = {
    0: 0, 1: 1, 2: 2, 3: 4, 4: 8, 5: 1, 6: 2, 7: 4, 8: 8, 9: 4, 10: 8, 11: 16, 0x19: 4, 0x1A: 8,
    0x1B: 16, 0x21: 1, 0x44: 16, 0x08000C: 8, 0x10000D: 16,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Extent:
    """How much of a file is there.

    Attributes
    ----------
    n_stored : int
        Bytes of values in the file.
    cut_at : int
        Byte where the segment starts that is not whole; -1: all are.
    n_missing : int
        Bytes that are missing of it; -1: nothing tells how many.
    """

    n_stored: int
    cut_at: int = -1
    n_missing: int = 0


def find_extent(data: bytes, *, name: str) -> Extent:
    """Return how many bytes of values the segments hold, and whether the last one is whole.

    Raises
    ------
    LogError
        There is no segment where one should be, or one is inconsistent.
    """
    at = total = 0
    while at < len(data):
        if at and at + _LEAD_IN > len(data) and b"TDSm".startswith(data[at : at + 4]):
            return Extent(total, at, -1)
        if at + _LEAD_IN > len(data) or data[at : at + 4] != b"TDSm":
            raise LogError(f"{name}: truncated or damaged TDMS file: no segment at byte {at}")
        (contents,) = struct.unpack_from("<I", data, at + 4)
        order = ">" if contents & _IS_BIG_ENDIAN else "<"
        _, n_bytes, n_before_values = struct.unpack_from(f"{order}IQQ", data, at + 8)
        if contents & _IS_DAQMX:
            raise LogError(f"{name}: raw DAQmx values in TDMS are not supported; export as CSV")
        values_at, end = at + _LEAD_IN + n_before_values, at + _LEAD_IN + n_bytes
        is_sound = values_at <= end if contents & _HAS_VALUES else values_at == end
        if is_sound and values_at <= len(data):
            said_to = _end_of_metadata(data[:values_at], at + _LEAD_IN, order, contents)
            is_sound = 0 <= said_to <= values_at and not any(data[said_to:values_at])
        if n_bytes != _OPEN and not is_sound:
            raise LogError(f"{name}: damaged TDMS file: the segment at byte {at} is inconsistent")
        if n_bytes == _OPEN or end > len(data):
            has_values = contents & _HAS_VALUES and values_at <= len(data)
            held = len(data) - values_at if has_values else 0
            is_known = n_bytes != _OPEN and values_at <= len(data)
            return Extent(total + held, at, end - len(data) if is_known else -1)
        total += end - values_at
        at = end
    return Extent(total)


def _end_of_metadata(data: bytes, at: int, order: str, contents: int) -> int:
    """Return the byte after what a segment says of its channels; -1: the data end before."""
    if not contents & _HAS_METADATA:
        return at if at == len(data) else -1
    try:
        at, n_objects = _number(data, at, order)
        for _ in range(n_objects):
            at = _after_text(data, at, order)
            at, n_index = _number(data, at, order)
            # The length counts itself.
            at += n_index - 4 if n_index not in {_NO_VALUES, _AS_BEFORE} else 0
            at, n_properties = _number(data, at, order)
            for _ in range(n_properties):
                at = _after_text(data, at, order)
                at, kind = _number(data, at, order)
                at = _after_text(data, at, order) if kind == _TEXT else at + _SIZES[kind]
    except (struct.error, KeyError):
        return -1
    return at


def _number(data: bytes, at: int, order: str) -> tuple[int, int]:
    return at + 4, struct.unpack_from(f"{order}I", data, at)[0]


def _after_text(data: bytes, at: int, order: str) -> int:
    at, n_bytes = _number(data, at, order)
    return at + n_bytes
