"""A refused log is told in the singular or the plural."""

from __future__ import annotations

from dataclasses import replace

import pytest

from damperfit.conditioning.refusals import refuse_dead
from damperfit.errors import ConditioningError
from tests.identification.rig import recording


@pytest.mark.parametrize(("n", "said"), [(1, "1 sample;"), (2, "2 samples;")])
def test_one_sample_is_no_samples(n: int, said: str) -> None:
    log = recording(1, duration=6.0)
    short = replace(log, time=log.time[:n], displacement=log.displacement[:n], force=log.force[:n])
    with pytest.raises(ConditioningError, match=f": {said} expected at least"):
        refuse_dead(short)
