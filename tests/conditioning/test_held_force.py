"""A force that one stroke holds down to low speed is no level of the force, nor a direction."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.conditioning import condition
from damperfit.conditioning.gas_force import force_level
from damperfit.configuration.loading import load_configuration
from damperfit.uncertainty.grades import LIMITS, offset_mismatch
from tests.conditioning.test_false_alarms import RATE, logged, sine


@pytest.fixture(scope="module")
def with_gas():
    """What a run of the paper's damper conditions with."""
    return load_configuration().conditioning


def preloaded(rebound, bump, knee=2e-3):
    """Valves that open at next to no speed, and 130 N of gas; no offset of the cell."""

    def law(_, v):
        return np.where(v > 0.0, rebound, bump) * np.tanh(v / knee) + 300.0 * v - 130.4

    return law


def test_preloads_that_are_unlike_are_no_offset(with_gas) -> None:
    trace = condition(logged(sine(2.5, 0.02, 20), preloaded(900.0, 150.0)), with_gas)
    level = force_level(trace, with_gas.gas)
    seen = level.force - level.expected
    assert seen > 200.0  # where 0 is true
    fit = SimpleNamespace(parameters=SimpleNamespace(f_0=0.0), logs=[SimpleNamespace(trace=trace)])
    times, told = offset_mismatch(fit, "f_0", with_gas.gas)
    assert told == pytest.approx(seen)
    assert times < LIMITS.offset
    # An offset that no preload explains is told still.
    fit.parameters.f_0 = 1000.0
    assert offset_mismatch(fit, "f_0", with_gas.gas)[0] > LIMITS.offset


def test_a_level_is_told_where_nothing_is_held(with_gas) -> None:
    law = preloaded(60.0, 60.0)
    trace = condition(logged(sine(2.5, 0.02, 20), lambda x, v: law(x, v) + 2000.0 * v), with_gas)
    level = force_level(trace, with_gas.gas)
    assert level.held == 0.0
    assert level.force == pytest.approx(level.expected, abs=15.0)


@pytest.mark.parametrize(("rebound", "bump"), [(700.0, 100.0), (700.0, 30.0)])
def test_a_right_log_of_unlike_preloads_is_not_turned_round(rebound, bump, with_gas) -> None:
    """Their level is that of a gas force counted positive in bump, and was certain."""
    x = sine(0.5, 0.04, 8)
    trace = condition(logged(x, preloaded(rebound, bump, 1e-3), noise=(4e-6, 3.0)), with_gas)
    assert not [one.name for one in trace.findings if one.is_correction]
    level = force_level(trace, with_gas.gas)
    assert -1.7 < level.ratio < -0.5
    assert level.force > 2.0 * level.uncertainty
    assert level.force < 2.0 * level.held


SPEEDS, STROKE = (0.05, 0.13, 0.3, 0.6, 1.0), 0.04


def early(_, v):
    """Valves that open below a tenth of the highest speed, and 48 N of gas."""
    knee, slope, friction = np.where(v > 0.0, 330.0, 37.0), np.where(v > 0.0, 1100.0, 90.0), 25.0
    opened = knee * np.tanh((v / 0.06) ** 2) * np.sign(v) + slope * v
    return opened + friction * np.tanh(v / 2e-3) - 130.4


def speeds_of(frequencies, cycles=5):
    """One speed after the other."""
    rate = np.concatenate([np.full(round(cycles / f * RATE), f) for f in frequencies])
    return STROKE * np.sin(2.0 * np.pi * np.cumsum(rate) / RATE)


def test_the_slowest_of_several_speeds_tells_the_level(with_gas) -> None:
    """The fast ones of valves that open early showed another offset, and another direction."""
    x = speeds_of([speed / (2.0 * np.pi * STROKE) for speed in SPEEDS])
    trace = condition(logged(x, early), with_gas)
    assert len(trace.stretches) == len(SPEEDS)
    level = force_level(trace, with_gas.gas)
    assert level.force == pytest.approx(level.expected, abs=20.0)
    alone = (replace(trace, stretches=(one,)) for one in trace.stretches)
    levels = [force_level(one, with_gas.gas) for one in alone]
    assert level.doubt == min(one.doubt for one in levels)
    assert levels[-1].force - level.expected > 60.0
    assert not [one.name for one in trace.findings if one.name == "direction"]
