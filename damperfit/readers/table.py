"""What every format comes to before channels are found: named columns with their raw values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = ["Column", "Table"]


@dataclass(frozen=True, slots=True)
class Column:
    """Name and unit of a column, as the log has them.

    Attributes
    ----------
    name : str
        Name as written, without blanks around it; may be empty.
    unit : str or None
        From a units row or a field's metadata; None when there is neither. A unit inside the
        name is not taken out here.
    """

    name: str
    unit: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """One test of a log, not yet understood.

    Attributes
    ----------
    columns : tuple of Column
        In the order of the log.
    load : callable
        {channel: index of column} -> {channel: float array of shape (n,)}; raises LogError for
        text in a number column. Blank fields are NaN.
    place : callable
        Index of sample -> where it stands, as in "line 17".
    metadata : mapping of str to str
        Keys in lower case.
    notes : tuple of str
        What the format's reader assumed.
    part : str
        Says which test of the file this is; empty when there is only one.
    """

    columns: tuple[Column, ...]
    load: Callable[[Mapping[str, int]], dict[str, FloatArray]]
    place: Callable[[int], str]
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    part: str = ""
