"""Mean cycles tell what whole logs tell, and are left aside where nothing repeats.

The fit over mean cycles beside its slow twin, the descent on the logs alone: parameters within a
tenth of their errors, on standard logs, logs that the rig has filtered or that drift, several
speeds, and rates of which a cycle is a whole number of samples.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from damperfit.compiled_core import compiled_core
from damperfit.conditioning import ConditionOptions, apply_filter, condition, design_filter
from damperfit.conditioning.filters import completed
from damperfit.damper.purdy.parameters import PURDY_DAMPER, reference_parameters
from damperfit.identification import FitOptions
from damperfit.identification.fit_problem import Block, linearise
from damperfit.identification.fit_setting import minimised
from damperfit.identification.logs import settled
from damperfit.recording import Trace
from damperfit.simulation import Motion, SolverOptions, simulate
from tests.identification.rig import TIGHT, recorded, recording, trace
from tests.laws.valve_logs import VALUES, damper, moved

ALL = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
THREE = ("r_m1", "r_m2", "k_e")


def problem(logs: Sequence[Trace], free: tuple[str, ...] = THREE) -> Block:
    return Block(PURDY_DAMPER, tuple(logs), free, FitOptions().solver)


def on_cycles(whole: Block) -> Block:
    cycles = settled(whole.traces, is_thinned=False)
    assert cycles is not None
    return replace(whole, cycles=cycles)


def logged(x: np.ndarray, v: np.ndarray, rate: float) -> Trace:
    """A log of a motion behind a second of it that is not in the log; 4 N and 3 um of noise."""
    lead, motion = round(rate), Motion(1.0 / rate, x, v)
    force = simulate(reference_parameters(10), PURDY_DAMPER, motion, options=TIGHT).force
    log = recorded(x[lead:], force[lead:], rate, noises=(3e-6, 4.0), seed=3)
    return condition(log, ConditionOptions(centre=0.0))


def drifting() -> Trace:
    """A damper that loses 4 % of its force while it is tested."""
    log = recording(10, noise=4.0)
    return condition(replace(log, force=log.force * np.linspace(1.0, 0.96, len(log.force))))


def filtered_in_the_rig(kind: str) -> Trace:
    log = recording(10, noise=4.0)
    design = design_filter("causal", 30.0, sample_rate=1000.0)
    if kind == "zero_phase":
        design = completed(design, 30.0, 4)
    x, f = apply_filter(design, np.stack([log.displacement, log.force]))
    options = ConditionOptions(rig_filter=kind, rig_filter_corner=30.0)
    return condition(replace(log, displacement=x, force=f), options)


def two_speeds() -> Trace:
    """Eight cycles at 0.1 m/s and twelve at 0.3 m/s, one after the other."""
    omega = np.where(np.arange(24_000) < 1000 + 16_085, 0.1 / 0.032, 0.3 / 0.032)
    angle = np.cumsum(omega) / 1000.0
    return logged(0.032 * np.sin(angle), 0.032 * omega * np.cos(angle), 1000.0)


def whole_cycles() -> Trace:
    """A cycle of 400 samples, which fall on the same places in all of them."""
    angle = 2.0 * np.pi * (np.arange(6600) + 0.37) / 400.0
    return logged(0.032 * np.sin(angle), 0.032 * 3.0 * np.pi * np.cos(angle), 600.0)


LOGS: dict[str, Callable[[], Sequence[Trace]]] = {
    "setting 1": lambda: [trace(1, noise=4.0)],
    "setting 10": lambda: [trace(10, noise=4.0)],
    "setting 20": lambda: [trace(20, noise=4.0, rate=500.0, seed=3)],
    "drift": lambda: [drifting()],
    "causal": lambda: [filtered_in_the_rig("causal")],
    "zero phase": lambda: [filtered_in_the_rig("zero_phase")],
    "two speeds": lambda: [two_speeds()],
    "two logs": lambda: [trace(10, noise=4.0, amplitude=a) for a in (0.032, 0.024)],
    "whole cycles": lambda: [whole_cycles()],
}


def test_a_sum_of_squares_on_the_cycles_is_that_of_the_logs() -> None:
    whole = problem([trace(10, noise=4.0)], ALL)
    far = reference_parameters(10).replace({"r_m1": 2.6e4, "f_f": 80.0})
    slow, fast = whole.rows(far, ALL), on_cycles(whole).rows(far, ALL)
    assert fast[0] @ fast[0] == pytest.approx(slow[0] @ slow[0], rel=1e-3)
    assert np.allclose(fast[1:] @ fast[1:].T, slow[1:] @ slow[1:].T, rtol=1e-2, atol=0.0)


def test_logs_that_do_not_repeat_have_no_mean_cycle() -> None:
    log = trace(10, noise=4.0)
    moving = replace(log.segments[0], kind="moving", cycle_starts=np.empty(0))
    assert settled([replace(log, segments=(moving,))], is_thinned=False) is None


# Thinned, as structures are compared.

MODEL = damper()
TRUE = MODEL.values(VALUES)
FREE = tuple(one.name for one in MODEL.quantities if one.default is None)


def candidate(options: ConditionOptions = ConditionOptions()) -> Block:
    motion = moved((0.06, 0.24))
    force = simulate(TRUE, MODEL, motion).force
    log = recorded(
        motion.displacement, force, 1.0 / motion.interval, setting=3, noises=(3e-6, 2.0), seed=5
    )
    return Block(MODEL, (condition(log, options),), FREE, SolverOptions(), is_candidate=True)


@pytest.mark.parametrize(
    "options",
    [ConditionOptions(), ConditionOptions(filter="causal"), ConditionOptions(filter_corner=60.0)],
    ids=["zero phase", "causal", "60 Hz"],
)
def test_the_minimum_lies_where_that_of_the_whole_logs_lies(options: ConditionOptions) -> None:
    whole = candidate(options)
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
    traces = candidate().traces
    # 2 N behind the filter of 30 Hz at 500 Hz, in all samples that are compared.
    scatter = settled(traces).scatter / traces[0].n_samples
    assert scatter == pytest.approx(4.0 * 2 * 31.0 / 500.0, rel=0.35)


def between(y: np.ndarray, at: float) -> float:
    """By the polynomial through the eight samples around a fractional one, by Lagrange."""
    first = int(np.clip(np.floor(at) - 3, 0, len(y) - 8))
    taps = range(first, first + 8)
    return float(
        sum(y[i] * np.prod([(at - j) / (i - j) for j in taps if j != i], dtype=float) for i in taps)
    )


@pytest.mark.parametrize("starts", [[0.0, 9.7], [1.3, 10.9, 20.0, 30.4], [-2.0, 12.0, 41.5]])
def test_the_mean_cycle_of_the_core_is_that_of_the_cycles(starts: list[float]) -> None:
    channels, n = np.random.default_rng(20261126).normal(size=(3, 40)), 6
    means, beside = np.empty((3, n)), np.empty(n)
    compiled_core().fold(*channels, np.array(starts), means, beside, np.empty(len(starts) - 1))
    places = [[a + (b - a) * k / n for k in range(n)] for a, b in pairwise(starts)]
    folded = np.array([[[between(y, at) for at in row] for row in places] for y in channels])
    assert means == pytest.approx(folded.mean(axis=1), rel=1e-11, abs=1e-11)
    squares = np.sum((folded[2] - folded[2].mean(axis=0)) ** 2, axis=0)
    assert beside == pytest.approx(squares, rel=1e-9, abs=1e-9)


# What a run keeps of a log, counted in bytes of arrays.


@pytest.mark.parametrize("way", [on_cycles, lambda whole: whole], ids=["cycles", "logs"])
def test_a_fit_keeps_a_triangle_that_gives_the_errors_of_the_whole(way) -> None:
    """A Jacobian as long as the log would stay through the first pass of all settings."""
    whole = problem([trace(10, noise=4.0)])
    found = minimised(way(whole), reference_parameters(10))
    assert found.minimum.system.triangle.shape == (len(whole.free), len(whole.free))
    residuals, slopes = linearise(whole, found.values)
    variance = residuals @ residuals / found.n_independent
    errors = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)) * variance)
    assert list(found.errors.values()) == pytest.approx(errors, rel=1e-2)
