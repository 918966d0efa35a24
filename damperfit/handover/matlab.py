"""MATLAB, Octave and Scilab: a script (.m) and the same variables as a file (.mat, version 5).

Breakpoints and table of a two-dimensional lookup: vectors ``velocity`` and ``setting``, matrix
``force`` with velocities down and settings across. The bytes of the .mat depend on the damper
alone; the usual header with the date does not stand in it.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import numpy as np

from damperfit.handover.combitable import setting_numbers
from damperfit.handover.force_table import force_tables
from damperfit.handover.provenance import commented, gas_line, provenance_lines

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.handover.force_table import ForceTable
    from damperfit.handover.handed_over import HandedOver
    from damperfit.handover.targets import ExportOptions

    FloatArray = NDArray[np.float64]

__all__ = ["write_matlab"]

_SIGN = "velocity in m/s and force in N are positive in rebound; displacement in m likewise"
_MATRIX, _INT32, _UINT32, _DOUBLE, _INT8, _UINT16 = 14, 5, 6, 9, 1, 4
_CLASS_DOUBLE, _CLASS_CHAR = 6, 4


def write_matlab(handed: HandedOver, options: ExportOptions) -> Mapping[str, bytes]:
    """Return script and data file, all settings in both."""
    tables = force_tables(handed, extend=options.extend)
    place = "gas_force at gas_displacement; add it to the table's force"
    lines = provenance_lines(handed, tables, sign=_SIGN, gas=gas_line(tables[0], place=place))
    lines += ("set the table's extrapolation: linear or error, never the last value",)
    known = _variables(tables)
    labels = tuple(str(table.setting) for table in tables)
    return {
        f"{options.stem}.m": _script(known, labels, lines).encode("utf-8", "replace"),
        f"{options.stem}.mat": _file(known, "\n".join((*lines, *_columns_in_words(labels)))),
    }


def _variables(tables: Sequence[ForceTable]) -> dict[str, FloatArray]:
    first = tables[0]
    return {
        "setting": setting_numbers(tables)[None, :],
        "velocity": first.speeds[:, None],
        "force": np.column_stack([table.forces for table in tables]),
        "tested_speed": np.array([[first.tested_speed]]),
        "gas_displacement": first.gas_displacements[:, None],
        "gas_force": first.gas_forces[:, None],
    }


def _columns_in_words(labels: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"column {k} of force: setting {label}" for k, label in enumerate(labels, 1))


def _script(known: Mapping[str, FloatArray], labels: Sequence[str], lines: Sequence[str]) -> str:
    text = commented((*lines, *map(_one_line, _columns_in_words(labels))), "%")
    for name, values in known.items():
        rows = [" ".join(f"{cell:.9g}" for cell in row) for row in values]
        between = ";\n  " if len(rows) > 1 else ""
        text += f"{name} = [{between.join(rows)}];\n"
    return text


def _one_line(text: str) -> str:
    return "".join(letter if letter.isprintable() else " " for letter in text)


def _file(known: Mapping[str, FloatArray], about: str) -> bytes:
    header = b"MATLAB 5.0 MAT-file, damperfit".ljust(116, b" ") + bytes(8)
    parts = [header + struct.pack("<H2s", 0x0100, b"IM")]
    for name, values in known.items():
        data = np.asfortranarray(values, dtype="<f8").tobytes(order="F")
        parts.append(_array(name, values.shape, _CLASS_DOUBLE, _DOUBLE, data))
    text = about.encode("utf-16-le", "replace")
    parts.append(_array("about", (1, len(text) // 2), _CLASS_CHAR, _UINT16, text))
    return b"".join(parts)


def _array(name: str, shape: tuple[int, ...], kind: int, stored: int, data: bytes) -> bytes:
    body = b"".join(
        (
            _element(_UINT32, struct.pack("<II", kind, 0)),
            _element(_INT32, struct.pack("<ii", *shape)),
            _element(_INT8, name.encode("ascii")),
            _element(stored, data),
        )
    )
    return struct.pack("<II", _MATRIX, len(body)) + body


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)
