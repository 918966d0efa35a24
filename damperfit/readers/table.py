"""What every format comes to before channels are found: named columns with their raw values."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from damperfit.recording import Finding

    FloatArray = NDArray[np.float64]

__all__ = ["Column", "Samples", "Table"]


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
    is_clock : bool
        The values are times of day, as in "04/29/2022 11:56:20.699 AM".
    """

    name: str
    unit: str | None = None
    is_clock: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Raw values of the channels asked for.

    Attributes
    ----------
    channels : dict of str to numpy.ndarray
        Shape (n,) each; what is blank is NaN. A clock is in seconds from its first stamp.
    place : callable
        Index of a sample -> where it stands, as in "line 17".
    notes : tuple of str
        What was left out.
    findings : tuple of Finding
        What was left out and makes the log doubtful.
    """

    channels: dict[str, FloatArray]
    place: Callable[[int], str]
    notes: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """One test of a log, not yet understood.

    Attributes
    ----------
    columns : tuple of Column
        In the order of the log.
    load : callable
        {channel: index of column} -> Samples; raises LogError for text in a number column.
    metadata : mapping of str to str
        Keys in lower case.
    notes : tuple of str
        What the format's reader assumed.
    part : str
        Title of the test in the file (block, sheet, group); may be empty.
    findings : tuple of Finding
        What was left out and makes the log doubtful.
    may_run_on : bool
        It may be the next piece of one record, where its time runs on from the table before.
    hint : str
        Why names may be missing, said where a channel is not found; may be empty.
    """

    columns: tuple[Column, ...]
    load: Callable[[Mapping[str, int]], Samples]
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    part: str = ""
    findings: tuple[Finding, ...] = ()
    may_run_on: bool = False
    hint: str = ""
