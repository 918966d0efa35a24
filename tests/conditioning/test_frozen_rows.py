"""Rows that a logger repeats while it drops out; a rest of the rig is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import condition
from tests.conditioning.logs import recording, sine_log, static_force


def frozen(log, rows: int):
    x, force = log.displacement.copy(), log.force.copy()
    for first in range(1000, 9000, 1000):
        x[first : first + rows], force[first : first + rows] = x[first], force[first]
    return replace(log, displacement=x, force=force)


def warnings(log):
    return [found.name for found in condition(log).findings if found.severity == "warning"]


@pytest.mark.parametrize(("rows", "is_told"), [(30, True), (4, False)])
def test_frozen_rows_are_told(rows, is_told):
    assert ("frozen_rows" in warnings(frozen(sine_log(), rows))) is is_told


def test_a_rest_of_the_rig_is_not_frozen():
    time = np.arange(8000) / 1000.0
    x = 0.032 * np.sin(3.0 * np.pi * np.clip(time - 1.0, 0.0, None))
    log = recording(time, x, static_force(np.gradient(x, time)))
    assert "frozen_rows" not in warnings(log)
