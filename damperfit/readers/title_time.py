"""Blocks of one file whose titles alone tell time: a record without a column for it.

A controller stamps each buffer that it writes. Where whole buffers follow each other at a steady
rate they are one record, and its sample rate is their rows by the time between their titles. One
title says neither whether it stands for the first row or the last, nor how long the block took.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import LogError
from damperfit.readers.channels import has_channel
from damperfit.readers.table import Samples, Table
from damperfit.statistics import median

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.readers.options import ReadOptions

__all__ = ["with_time_of_titles"]

_TIME = re.compile(
    r"\b(?:Time|Zeit):\s*(\d+(?:[.,]\d+)?)\s*(?:s|sec|seconds?|Sek)\b", re.IGNORECASE
)
_FEWEST = 3  # blocks: one step between two of them could be anything
_STEADY = 0.01  # of a step


def with_time_of_titles(tables: Sequence[Table], options: ReadOptions) -> tuple[Table, ...]:
    """Return blocks without a column for time as one table, where their titles tell its rate.

    Parameters
    ----------
    tables : sequence of Table
        The blocks of a file in their order; as they are where they have a column for time, or a
        rate is declared.
    options : ReadOptions
        What is declared.
    """
    stamps = [_TIME.search(table.part) for table in tables]
    has_time = any(has_channel("time", table.columns, options) for table in tables)
    if has_time or options.sample_rate > 0.0 or not all(stamps):
        return tuple(tables)
    times = np.array([float(found[1].replace(",", ".")) for found in stamps if found])
    rate = _rate(tables, times)
    if rate is None:
        hint = (
            "only the titles of its blocks give a time, and no steady rate; if the rate is known: "
            "--rig sample_rate=HZ"
        )
        return tuple(replace(table, hint=table.hint or hint) for table in tables)
    n = len(tables)
    note = f"{n} blocks joined; time: {rate:g} Hz, by the times in their titles"
    return (_joined(tables, rate, note),)


def _rate(tables: Sequence[Table], times: np.ndarray) -> float | None:
    """Return the sample rate, Hz; None where the blocks are not known to be one record."""
    first = tables[0]
    is_alike = all(
        (table.columns, table.metadata) == (first.columns, first.metadata) for table in tables
    )
    if len(tables) < _FEWEST or not is_alike:
        return None
    try:
        rows = [len(table.load({"any": 0}).channels["any"]) for table in tables]
    except LogError:  # said with the place when the channels are read
        return None
    # The last buffer may not be full: its step is as long as itself, or as the one before.
    steps = np.diff(times if rows[-1] == rows[0] else times[:-1])
    if len(set(rows[:-1])) > 1 or rows[-1] > rows[0] or not len(steps):
        return None
    usual = median(steps)
    if not usual > 0.0 or np.abs(steps / usual - 1.0).max() > _STEADY:
        return None
    return rows[0] * len(steps) / float(steps.sum())


def _joined(tables: Sequence[Table], rate: float, note: str) -> Table:
    def load(wanted: Mapping[str, int]) -> Samples:
        parts = [table.load(wanted) for table in tables]
        lengths = [len(next(iter(part.channels.values()))) for part in parts]
        ends = np.cumsum(lengths)

        def place(index: int) -> str:
            block = min(int(np.searchsorted(ends, index, side="right")), len(parts) - 1)
            return parts[block].place(index - int(ends[block]) + lengths[block])

        return Samples(
            {name: np.concatenate([part.channels[name] for part in parts]) for name in wanted},
            place,
            tuple(dict.fromkeys(text for part in parts for text in part.notes)),
            tuple(dict.fromkeys(one for part in parts for one in part.findings)),
        )

    first = tables[0]
    return replace(
        first,
        load=load,
        metadata={**first.metadata, "sample rate": repr(rate)},
        notes=(*first.notes, note),
        findings=tuple(dict.fromkeys(one for table in tables for one in table.findings)),
        may_run_on=False,
    )
