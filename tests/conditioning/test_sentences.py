"""Findings whose number and words nobody else looks at."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from damperfit.conditioning.corrections import _removed
from damperfit.conditioning.motion import _stretches
from tests import fakes


@pytest.mark.parametrize(("n", "begins"), [(1, "1 stretch evaluated: "), (2, "2 stretches evalu")])
def test_stretches_are_counted_in_words(n, begins) -> None:
    log = fakes.trace(1)
    found = _stretches(replace(log, stretches=log.stretches[:1] * n))
    assert found.sentence.startswith(begins)
    assert found.value == n


def test_a_tare_is_accounted_for_by_an_offset_that_is_known() -> None:
    offset = SimpleNamespace(is_known=True, name="f_0")
    said = _removed("0 N where 90 N are expected", None, SimpleNamespace(offset=offset))
    assert said == "gas force tared away: 0 N where 90 N are expected; f_0 accounts for it"
