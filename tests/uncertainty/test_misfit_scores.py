"""What repeats in a residual: the mean of the cycles, from two cycles on."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.uncertainty.misfit_scores import _blocks
from damperfit.uncertainty.rows import BLOCKS, EverySample

PERIOD = 160


def stretch(n_cycles: int) -> SimpleNamespace:
    starts = 6.5 + PERIOD * np.arange(n_cycles + 1.0)  # between two samples
    return SimpleNamespace(n_cycles=n_cycles, cycle_starts=starts, first=7)


@pytest.mark.parametrize(("n_cycles", "kept"), [(1, 1.0), (2, 0.0), (3, 1.0 / 3.0)])
def test_what_changes_from_cycle_to_cycle_is_taken_off_from_two_cycles_on(n_cycles, kept) -> None:
    shape = np.sin(2.0 * np.pi * np.arange(PERIOD) / PERIOD)
    signs = [(-1.0) ** k for k in range(n_cycles)]
    rows = EverySample(stretch(n_cycles))
    block, repeating = _blocks(rows, np.concatenate([s * shape for s in signs])[None, :])
    assert repeating == pytest.approx(kept * np.tile(shape, n_cycles), abs=1e-12)
    assert sorted(set(block.tolist())) == list(range(BLOCKS))
