"""Limits from which on a log is refused: a case just inside and one just outside."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning.refusals import refuse_dead
from damperfit.conditioning.timebase import _refuse_gap
from damperfit.errors import ConditioningError


def log(n: int = 40, largest: float = 900.0):
    wave = np.sin(np.linspace(0.0, 6.0 * np.pi, n))
    force = largest * wave / np.abs(wave).max()
    return SimpleNamespace(
        name="a.csv", time=np.arange(float(n)), displacement=0.03 * wave, force=force
    )


def is_refused(call, *arguments) -> bool:
    try:
        call(*arguments)
    except ConditioningError:
        return True
    return False


@pytest.mark.parametrize(("n", "refused"), [(19, True), (20, False)])
def test_twenty_samples_are_a_log(n, refused) -> None:
    assert is_refused(refuse_dead, log(n)) is refused


@pytest.mark.parametrize(("largest", "refused"), [(0.95e9, False), (1.05e9, True)])
def test_a_thousand_million_newtons_are_no_force(largest, refused) -> None:
    assert is_refused(refuse_dead, log(largest=largest)) is refused


@pytest.mark.parametrize(("missing", "refused"), [(4, False), (5, True)])
def test_four_samples_on_end_may_be_missing(missing, refused) -> None:
    counts = np.array([1.0, missing + 1.0, 1.0])
    assert is_refused(_refuse_gap, log(), 0.01 * counts, counts, 0.01) is refused
