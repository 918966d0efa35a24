"""MATLAB files by SciPy in a child that lasts: what the own reader is measured against."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.readers.child_process import ChildAnswer
from damperfit.readers.foreign import refusing_damage
from damperfit.readers.grouping import (
    Group,
    GroupChannel,
    group_tables,
    groups_answer,
    read_groups_in_child,
)

if TYPE_CHECKING:
    from damperfit.readers.files import Source
    from damperfit.readers.options import ReadOptions
    from damperfit.readers.table import Table

EXTRA, READS = "none", "MATLAB"
IS_MEMORY_SAFE = False  # a segmentation fault on one damaged byte


def use(formats: Any) -> None:
    """Put SciPy in the place of the own reader."""
    formats.FORMATS = tuple(
        replace(known, read=read_matlab) if known.name == "MATLAB" else known
        for known in formats.FORMATS
    )


def read_matlab(source: Source, options: ReadOptions) -> tuple[Table, ...]:
    """Return the table of a MATLAB file, as read by SciPy."""
    groups = read_groups_in_child(__name__, "scipy", source, options)
    return group_tables(groups, options, name=source.name)


def answer(data: bytes, limit: int) -> ChildAnswer:
    """Return the vectors of a MATLAB file; runs in a process of its own."""
    from scipy.io import loadmat, whosmat

    with refusing_damage(READS):
        shapes = {name: shape for name, shape, _ in whosmat(io.BytesIO(data))}
        names = [name for name, shape in shapes.items() if len(shape) == 2 and max(shape) > 1]
        assert sum(8 * np.prod(shapes[name]) for name in names) <= limit
        held = loadmat(io.BytesIO(data), variable_names=names)
    arrays = {n: held[n].astype(float) for n in names if held[n].dtype.kind in "fiu"}
    return groups_answer(
        [
            Group(
                "",
                tuple(
                    GroupChannel(name, None, values.size, partial(np.ravel, values))
                    for name, values in arrays.items()
                ),
            )
        ]
    )
