"""Limits of intervals, profiles and forces: a case just inside and one just outside."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.recording import Finding
from damperfit.uncertainty.prediction import _is_same_motion, _tested


def steady(amplitude=0.03, speed=0.3):
    return SimpleNamespace(amplitude=amplitude, peak_speed=speed, n_cycles=5, window=slice(0, 2))


@pytest.mark.parametrize("name", ["amplitude", "speed"])
@pytest.mark.parametrize(("factor", "is_same"), [(1.049, True), (1.051, False)])
def test_a_motion_within_five_per_cent_of_a_fitted_one_is_the_same(name, factor, is_same) -> None:
    fit = SimpleNamespace(logs=[SimpleNamespace(trace=SimpleNamespace(stretches=[steady()]))])
    one = {"amplitude": 0.03, "speed": 0.3}
    other = steady(**one | {name: factor * one[name]})
    assert _is_same_motion(fit, SimpleNamespace(stretches=[other])) is is_same


@pytest.mark.parametrize(("times", "is_tested"), [(2.99, False), (3.01, True)])
def test_friction_is_of_chance_within_three_deviations_of_the_velocity(times, is_tested) -> None:
    """Noise of 10 um at 300 Hz behind 30 Hz has 10 sqrt(0.2) 2 pi 30/sqrt(3) um/s."""
    noise = 1e-5 * math.sqrt(0.2) * 2.0 * math.pi * 30.0 / math.sqrt(3.0)
    velocity = np.array([times * noise, -1.0, 1.0, -times * noise])
    trace = SimpleNamespace(
        compared=slice(None), interval=1.0 / 300.0,
        drive=SimpleNamespace(velocity=velocity, corner=30.0),
        findings=(Finding("displacement_noise", "note", "", 10.0, "um"),),
    )  # fmt: skip
    assert _tested(trace).tolist() == [is_tested, True, True, is_tested]
    quiet = SimpleNamespace(**vars(trace) | {"findings": ()})
    assert _tested(quiet).all()
