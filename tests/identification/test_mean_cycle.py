"""The fit over mean cycles beside its slow twin, the descent on the logs alone.

Parameters within a tenth of their errors, on standard logs, logs that the rig has filtered or that
drift, several speeds, and rates of which a cycle is a whole number of samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions
from damperfit.identification.fit_problem import Block
from damperfit.identification.fit_setting import minimised
from damperfit.identification.mean_cycle import settled
from damperfit.recording import Recording, Trace
from damperfit.simulation import Motion, simulate
from tests.identification.rig import TIGHT, recording, trace

ALL = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
THREE = ("r_m1", "r_m2", "k_e")
# Of a standard error.
NEAR = 0.1


def problem(logs: Sequence[Trace], free: tuple[str, ...] = THREE) -> Block:
    return Block(PURDY_DAMPER, tuple(logs), free, FitOptions().solver)


def on_cycles(whole: Block) -> Block:
    cycles = settled(whole.traces, is_thinned=False)
    assert cycles is not None
    return replace(whole, cycles=cycles)


def logged(x: np.ndarray, v: np.ndarray, rate: float, setting: int = 10, seed: int = 3) -> Trace:
    """A log of a motion behind a second of it that is not in the log; 4 N and 3 um of noise."""
    lead, random = round(rate), np.random.default_rng(seed)
    force = simulate(
        reference_parameters(setting), PURDY_DAMPER, Motion(1.0 / rate, x, v), options=TIGHT
    ).force[lead:]
    n = len(force)
    return condition(
        Recording(
            name="log.csv",
            path="log.csv",
            sha256="",
            setting=setting,
            time=np.arange(n) / rate,
            displacement=x[lead:] + 3e-6 * random.standard_normal(n),
            force=force + 4.0 * random.standard_normal(n),
        ),
        ConditionOptions(centre=0.0),
    )


def drifting() -> Trace:
    """A damper that loses 4 % of its force while it is tested."""
    log = recording(10, noise=4.0)
    fade = np.linspace(1.0, 0.96, len(log.force))
    return condition(replace(log, force=log.force * fade))


def filtered_in_the_rig(kind: str) -> Trace:
    from damperfit.conditioning import apply_filter, design_filter
    from damperfit.conditioning.filters import completed

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


def apart(whole: Block, setting: int = 10) -> tuple[np.ndarray, float, float]:
    """How far both ways end apart, in errors; their misfits.

    On the logs the descent begins at the setting's truth: from afar it may end elsewhere.
    """
    start = reference_parameters(10).replace(
        {name: 1.2 * getattr(reference_parameters(10), name) for name in whole.free}
    )
    known = {name: getattr(reference_parameters(setting), name) for name in whole.free}
    slow, fast = minimised(whole, start.replace(known)), minimised(on_cycles(whole), start)
    found = [
        np.log(getattr(fast.values, name) / getattr(slow.values, name)) / slow.errors[name]
        for name in whole.free
    ]
    return np.abs(found), slow.mse_percent, fast.mse_percent


@pytest.mark.parametrize("free", [THREE, ALL], ids=["three", "five"])
@pytest.mark.parametrize("name", LOGS)
def test_the_parameters_are_those_of_the_logs_themselves(name: str, free: tuple[str, ...]) -> None:
    setting = int(name.removeprefix("setting ")) if name.startswith("setting") else 10
    distance, slow, fast = apart(problem(LOGS[name](), free), setting)
    assert distance.max() < NEAR, distance
    assert fast == pytest.approx(slow, rel=1e-4)


def test_a_sum_of_squares_on_the_cycles_is_that_of_the_logs() -> None:
    whole = problem([trace(10, noise=4.0)], ALL)
    far = reference_parameters(10).replace({"r_m1": 2.6e4, "f_f": 80.0})
    slow, fast = whole.rows(far, ALL), on_cycles(whole).rows(far, ALL)
    assert fast[0] @ fast[0] == pytest.approx(slow[0] @ slow[0], rel=1e-3)
    assert np.allclose(fast[1:] @ fast[1:].T, slow[1:] @ slow[1:].T, rtol=1e-2, atol=0.0)


def test_logs_that_do_not_repeat_have_no_mean_cycle() -> None:
    log = trace(10, noise=4.0)
    moving = replace(log.stretches[0], kind="moving", cycle_starts=np.empty(0))
    assert settled([replace(log, stretches=(moving,))], is_thinned=False) is None
