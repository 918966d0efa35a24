"""What a run keeps of a log, counted in bytes of arrays."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, identify
from damperfit.identification.descent import Misfit, descend
from damperfit.identification.evaluation import evaluate, transformation, values_of
from damperfit.identification.setting import relative_errors
from damperfit.uncertainty import assess
from tests.identification.rig import trace
from tests.identification.test_mean_cycle import misfit, on_cycles

N_ROWS = 10_000  # 10 s at 1 kHz
BAR = 0.5e6  # bytes a log of so many rows


def array_bytes(*kept: Any) -> int:
    """Bytes of all arrays that can be reached from objects, each block of memory once."""
    todo, known, blocks = list(kept), set(), {}
    while todo:
        one = todo.pop()
        if id(one) in known or isinstance(one, type) or callable(one):
            continue
        known.add(id(one))
        if isinstance(one, np.ndarray):
            while isinstance(one.base, np.ndarray):
                one = one.base
            blocks[id(one)] = one.nbytes
        else:
            todo += gc.get_referents(one)
    return sum(blocks.values())


def test_arrays_are_counted_whole_and_once() -> None:
    block = np.zeros(1000)
    assert array_bytes({"a": (block[:2], [block[5:], block])}, block) == block.nbytes


def test_a_log_that_is_judged_keeps_half_a_megabyte() -> None:
    logs = [trace(setting, noise=4.0) for setting in (3, 12)]
    assert all(len(log.force) > 0.85 * N_ROWS for log in logs)  # what is run up is cut
    campaign = identify(logs, PURDY_DAMPER)
    assessment = assess(campaign, PURDY_DAMPER, solver=FitOptions().solver)
    kept = array_bytes(logs, campaign, assessment)
    assert kept / len(logs) < BAR
    assert kept > sum(log.force.nbytes + log.displacement.nbytes for log in logs)


@pytest.mark.parametrize("way", [on_cycles, lambda whole: whole], ids=["cycles", "logs"])
def test_a_descent_keeps_a_triangle_that_gives_the_errors_of_the_whole(
    way: Callable[[Misfit], Misfit],
) -> None:
    """A Jacobian as long as the log would stay through the first pass of all settings."""
    whole = misfit([trace(10, noise=4.0)])
    found = descend(way(whole), reference_parameters(10))
    assert found.jacobian.shape == (len(whole.free), len(whole.free))
    _, slopes, _ = evaluate(whole, found.parameters, whole.scale)
    values = values_of(whole.free, found.parameters)
    long = slopes * transformation(whole, whole.free).slopes(values)
    variance = found.mse_percent / 100.0 / found.n_independent
    errors = np.sqrt(np.diag(np.linalg.inv(long.T @ long)) * variance)
    assert relative_errors(found) == pytest.approx(errors, rel=1e-3)
