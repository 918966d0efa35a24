"""A copy is told by its noise: tests of an adjuster that does nothing are tests of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.conditioning.duplicates import copies_in
from tests.conditioning.logs import sine_log


def noisy(seed: int, newtons: float = 0.3):
    log = sine_log(rate=500.0)
    random = np.random.default_rng(seed)
    force = log.force + newtons * random.standard_normal(len(log.force))
    displacement = log.displacement + 2e-6 * random.standard_normal(len(log.force))
    return replace(log, name=f"log_{seed}.csv", displacement=displacement, force=force)


@pytest.mark.parametrize("newtons", [0.2, 1.0, 4.0])
def test_the_same_motion_recorded_twice_is_no_copy(newtons):
    traces = [condition(noisy(seed, newtons)) for seed in (1, 2, 3)]
    assert not copies_in(traces, {trace.name: trace.name for trace in traces})


@pytest.mark.parametrize("digits", [1, 2, 6])
def test_a_copy_of_fewer_digits_is_found(digits):
    log = noisy(1)
    copy = replace(log, name="copy.csv", force=np.round(log.force, digits))
    traces = [condition(log), condition(copy)]
    assert list(copies_in(traces, {trace.name: trace.name for trace in traces})) == ["log_1.csv"]
