"""The noise floor: unbiased for any number of cycles, filter and phase of sampling."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from damperfit.conditioning import ConditionOptions, apply_filter, condition, noise_floor
from damperfit.conditioning.noise import with_noise
from tests import fakes
from tests.conditioning.logs import sine_log

PERIOD = 200


def cycles(n):
    """n cycles of 200 samples at 300 Hz, 1.5 Hz."""
    turns = np.arange(n * PERIOD) / PERIOD
    wave, slope = np.sin(2.0 * np.pi * turns), np.cos(2.0 * np.pi * turns)
    one = fakes.trace(1)
    starts = PERIOD * np.arange(n + 1.0)
    segment = replace(one.fastest, first=0, stop=n * PERIOD, cycle_starts=starts)
    trace = replace(
        one,
        interval=1.0 / 300.0,
        displacement=0.032 * wave,
        velocity=0.3 * slope,
        force=1000.0 * slope,
        segments=(segment,),
    )
    return with_noise(trace, np.empty(0))


def smooth_log(cycles, rate):
    """A log without friction's steps: what differs between cycles is noise alone."""
    log = sine_log(cycles=cycles, rate=rate)
    v = 0.032 * 2 * np.pi * 1.5 * np.cos(2 * np.pi * 1.5 * log.time + 1.1)
    return replace(log, force=3000.0 * v * np.abs(v) + 1500.0 * v)


CASES = list(itertools.product(("zero_phase", "none"), (5.0, 15.0), (301.0, 1000.0)))


@pytest.mark.parametrize(("kind", "cycles", "rate"), CASES)
def test_it_is_what_noise_costs_a_perfect_model(kind, cycles, rate):
    log, options = smooth_log(cycles, rate), ConditionOptions(filter=kind)
    random = np.random.default_rng(11)
    found = []
    for _ in range(60 if rate < 400.0 else 200):
        noise = random.normal(0.0, 4.0, len(log.time))
        trace = condition(replace(log, force=log.force + noise), options)
        found.append(noise_floor(trace))
    impulse = np.zeros(2001)
    impulse[1000] = 1.0
    left = np.sum(apply_filter(trace.model_filter, impulse) ** 2)
    expected = 100.0 * 4.0**2 * left / np.var(trace.force[trace.compared])
    # 60 logs: the mean is known to 1 %, 200 to 0.5 %, and less where only two cycles are left.
    assert np.mean(found) == pytest.approx(expected, rel=0.06 if trace.n_cycles < 5 else 0.02)


def test_a_single_cycle_cannot_say():
    trace = condition(smooth_log(15.0, 1000.0))
    (run,) = trace.segments
    one = replace(run, stop=round(float(run.cycle_starts[1])), cycle_starts=run.cycle_starts[:2])
    assert math.isnan(noise_floor(replace(trace, segments=(one,))))
