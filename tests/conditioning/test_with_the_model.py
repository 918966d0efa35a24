"""Filtering data and model alike recovers the truth: logs by Radau, fitted with the core."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, sosfilt, sosfiltfilt

from damperfit.conditioning import ConditionOptions, condition
from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.purdy.reference import reference_parameters
from damperfit.identification import FitOptions, compare, identify
from damperfit.identification.simulated_log import normalised_mse
from damperfit.synthetic.steady import steady_cycle
from tests.conditioning.logs import recording

RATE, CYCLES = 1000.0, 12
SECTIONS = butter(4, 30.0, fs=RATE, output="sos")


@cache
def channels():
    """Displacement and force of setting 10, noise-free, three times as long as a log."""
    cycle = steady_cycle(reference_parameters(10), PURDY_DAMPER, amplitude=0.032, frequency=1.5)
    phase = 1.5 * np.arange(round(3 * CYCLES / 1.5 * RATE)) / RATE + 0.17
    return cycle.displacement(phase), cycle.force(phase)


def log_behind(filtered):
    n = round(CYCLES / 1.5 * RATE)
    x, f = (filtered(channel)[n : 2 * n] for channel in channels())
    return recording(np.arange(n) / RATE, x, f)


CASES = {
    "ours, zero-phase": (lambda s: s, ConditionOptions()),
    "ours, causal": (lambda s: s, ConditionOptions(filter="causal")),
    "none": (lambda s: s, ConditionOptions(filter="none")),
    "rig, causal": (lambda s: sosfilt(SECTIONS, s), ConditionOptions(rig_filter="causal")),
    "rig, zero-phase": (
        lambda s: sosfiltfilt(SECTIONS, s, padlen=900),
        ConditionOptions(rig_filter="zero_phase"),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_five_parameters_come_back_behind_every_filter(case):
    filtered, options = CASES[case]
    trace = condition(log_behind(filtered), options)
    free = ("r_m1", "r_m2", "r_m3", "k_e", "f_f")
    fit = identify([trace], PURDY_DAMPER, FitOptions(procedure="plain", free=free)).fits[0]
    true = reference_parameters(10)
    for name, tolerance in zip(free, (1e-6, 1e-6, 2e-6, 2e-6, 2e-6), strict=True):
        assert getattr(fit.parameters, name) == pytest.approx(getattr(true, name), rel=tolerance)


def test_filtering_one_side_only_does_not():
    trace = condition(log_behind(lambda s: s))
    comparison = compare(reference_parameters(10), trace, PURDY_DAMPER)
    measured = trace.force[trace.compared]
    alike = normalised_mse(measured, comparison.force[trace.compared])
    raw = normalised_mse(measured, comparison.response.force[trace.compared])
    assert alike < 1e-7
    assert raw > 1e4 * alike
