"""Settled cycles tell what whole logs tell, and are left aside where nothing repeats."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.identification.fit_problem import Block
from damperfit.identification.mean_cycle import settled
from damperfit.identification.starts import best_of_starts
from damperfit.recording import Recording, Trace
from damperfit.simulation import Motion, SolverOptions, simulate
from damperfit.tested.setting import Setting
from tests.laws.valve_logs import VALUES, damper, moved

MODEL = damper()
TRUE = MODEL.values(VALUES)
FREE = tuple(one.name for one in MODEL.quantities if one.default is None)
MOTION = moved((0.06, 0.24))


def logged(motion: Motion, options: ConditionOptions = ConditionOptions()) -> Trace:
    noise = np.random.default_rng(5)
    force = simulate(TRUE, MODEL, motion).force
    n = len(force)
    return condition(
        Recording(
            name="log.csv",
            path="log.csv",
            sha256="",
            setting=Setting.of(3),
            time=motion.interval * np.arange(n),
            displacement=motion.displacement + noise.normal(0.0, 3e-6, n),
            force=force + noise.normal(0.0, 2.0, n),
        ),
        options,
    )


def misfit(*traces: Trace) -> Block:
    return Block(MODEL, traces, FREE, SolverOptions(), is_candidate=True)


@pytest.mark.parametrize(
    "options",
    [ConditionOptions(), ConditionOptions(filter="causal"), ConditionOptions(filter_corner=60.0)],
    ids=["zero phase", "causal", "60 Hz"],
)
def test_the_minimum_lies_where_that_of_the_whole_logs_lies(options: ConditionOptions) -> None:
    whole = misfit(logged(MOTION, options))
    cycles = whole.on_cycles()
    assert cycles.cycles is not None
    assert len(cycles.cycles.cycles) == 2
    assert cycles.cost(TRUE) == pytest.approx(whole.cost(TRUE), rel=0.3)
    rows, few = (one.rows(TRUE, FREE) for one in (whole, cycles))
    slopes = rows[1:] @ rows[1:].T
    # How far apart both minima are, by one step of Gauss and Newton, in errors of what is fitted.
    apart = np.linalg.solve(slopes, few[1:] @ few[0] - rows[1:] @ rows[0])
    variance = (rows[0] @ rows[0]) / 200.0  # independent samples, at a filter of 30 Hz more
    errors = np.sqrt(np.diag(np.linalg.inv(slopes)) * variance)
    assert np.max(np.abs(apart) / errors) < 0.75


def test_what_differs_between_cycles_counts_as_in_the_whole_log() -> None:
    found = settled([logged(MOTION)])
    assert found is not None
    # 2 N behind the filter of 30 Hz at 500 Hz, in all samples that are compared.
    n = logged(MOTION).n_samples
    assert found.scatter / n == pytest.approx(4.0 * 2 * 31.0 / 500.0, rel=0.35)


def test_a_descent_from_afar_comes_to_the_true_values() -> None:
    one = misfit(logged(MOTION)).on_cycles()
    start = TRUE.replace({"rebound_opening": 5e5, "compression_bleed": 4e4, "lag": 4e-3})
    found = best_of_starts(one, [start]).extra
    for name in ("rebound_opening", "compression_opening", "compression_bleed"):
        assert getattr(found, name) == pytest.approx(getattr(TRUE, name), rel=0.03), name
