"""Cycles: crossings and extremes between samples, hysteresis, steady runs."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.conditioning import differentiate
from damperfit.conditioning.cycles import find_cycles


def found(x, steadiness=0.05):
    return find_cycles(x, differentiate(x, 1.0), steadiness=steadiness)


def test_noise_makes_no_crossings_at_rest():
    random = np.random.default_rng(3)
    x = np.concatenate(
        [np.zeros(3000), np.sin(2 * np.pi * np.arange(2000) / 200.0), np.zeros(3000)]
    )
    cycles = found(x + 0.01 * random.normal(size=len(x)))
    assert cycles.rising[0] >= 2990
    assert cycles.rising[-1] <= 5010
    assert cycles.n_found <= 10


def test_a_change_of_amplitude_ends_the_run():
    angle = 2 * np.pi * np.arange(4000) / 200.0
    x = np.where(angle < 2 * np.pi * 13, 1.0, 1.2) * np.sin(angle)
    cycles = found(x)
    assert len(cycles.rising) - 1 in {12, 13}
    assert cycles.amplitude == pytest.approx(1.0, rel=1e-3)
    assert cycles.n_found == 20


@pytest.mark.parametrize("rest", [130, 200, 300])
def test_rest_of_a_cycle_at_the_ends_is_no_cycle(rest):
    motion = np.sin(2 * np.pi * np.arange(2001) / 200.0)
    assert found(np.concatenate([np.zeros(rest), motion, np.zeros(rest)])).n_found in {9, 10}
