"""Blocks of one file that are one record: write buffers, whose time runs on from each to the next.

A servo-hydraulic controller heads each buffer that it writes like a test of its own. What tells a
record from tests is the step in time from the last row of a block to the first of the next.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.recording import Recording

__all__ = ["TITLE", "join_buffers"]

TITLE = "part: "  # begins the note that says which block a part was
# Steps from block to block, in usual sample intervals; stamps are rounded to few digits.
_LEAST_STEP, _LARGEST_STEP = 0.5, 1.5
_LISTED = 3  # breaks in the record that are listed one by one


def join_buffers(blocks: Sequence[Sequence[Recording]]) -> list[Recording]:
    """Return the tests in blocks, those joined whose time runs on.

    Parameters
    ----------
    blocks : sequence of sequence of Recording
        The tests of each block, in the order of the file; nearly always one.
    """
    runs: list[list[Recording]] = []
    first_blocks: list[int] = []
    for number, block in enumerate(blocks, start=1):
        for i, part in enumerate(block):
            if i == 0 and runs and _runs_on(runs[-1][-1], part):
                runs[-1].append(part)
            else:
                runs.append([part])
                first_blocks.append(number)
    n_joined = sum(len(run) for run in runs if len(run) > 1)
    if not n_joined:
        return [run[0] for run in runs]
    said = f"{n_joined} blocks joined, as time runs on by one step from each to the next"
    if len(runs) > 1:
        said += f", into {sum(len(run) > 1 for run in runs)} of {len(runs)} tests"
    note = f"{said}{_breaks(runs, first_blocks)}"
    return [_joined(run, note) for run in runs]


def _runs_on(before: Recording, after: Recording) -> bool:
    """Say whether a part begins one step after the end of another, at the same rate."""
    if before.setting != after.setting:
        return False
    steps = [float(np.median(np.diff(one.time))) for one in (before, after) if len(one.time) > 1]
    if not steps or max(steps) > _LARGEST_STEP * min(steps):
        return False
    between = float(after.time[0] - before.time[-1])
    return all(_LEAST_STEP < between / step < _LARGEST_STEP for step in steps)


def _breaks(runs: Sequence[Sequence[Recording]], first_blocks: Sequence[int]) -> str:
    """Tell where time does not run on: what is missing there, or where it goes back to."""
    breaks = []
    for (before, after), block in zip(pairwise(runs), first_blocks[1:], strict=True):
        end, start = before[-1].time[-1], after[0].time[0]
        how = f"{start - end:.4g} s later" if start > end else f"{end - start:.4g} s earlier"
        breaks.append(f"block {block} begins at {start:.6g} s, {how} than the block before ends")
    if not breaks:
        return ""
    more = f"; and {len(breaks) - _LISTED} more" if len(breaks) > _LISTED else ""
    return f"; {'; '.join(breaks[:_LISTED])}{more}"


def _joined(run: Sequence[Recording], note: str) -> Recording:
    first = run[0]
    if len(run) == 1:
        return replace(first, notes=(*first.notes, note))
    notes = [text for part in run for text in part.notes if not text.startswith(TITLE)]
    title = [text for text in first.notes if text.startswith(TITLE)]

    def extra(name: str) -> np.ndarray | None:
        values = [getattr(part, name) for part in run]
        return None if any(one is None for one in values) else np.concatenate(values)

    return replace(
        first,
        time=np.concatenate([part.time for part in run]),
        displacement=np.concatenate([part.displacement for part in run]),
        force=np.concatenate([part.force for part in run]),
        temperature=extra("temperature"),
        velocity=extra("velocity"),
        notes=tuple(dict.fromkeys([*title, *notes, note])),
        findings=tuple(dict.fromkeys(one for part in run for one in part.findings)),
    )
