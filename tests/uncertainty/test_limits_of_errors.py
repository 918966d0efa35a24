"""Limits of intervals, profiles and forces: a case just inside and one just outside."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from damperfit.recording import Finding
from damperfit.uncertainty import (
    Assessment,
)
from damperfit.uncertainty import (
    grades as withheld,
)
from damperfit.uncertainty.covariance import _sums_of_others
from damperfit.uncertainty.grades import _jumps
from damperfit.uncertainty.prediction import _enough, _is_same_motion, _tested
from damperfit.uncertainty.profiles import interpolated_limit
from damperfit.uncertainty.speed_forces import _misfit
from tests.uncertainty.test_words import diagnosis, known


@pytest.mark.parametrize(("ratio", "is_blind"), [(0.38, True), (0.42, False)])
def test_a_jackknife_is_blind_below_two_fifths(ratio, is_blind) -> None:
    one = known()
    intervals = {name: replace(i, cycle_ratio=ratio) for name, i in one.intervals.items()}
    told = Assessment(uncertainties=(replace(one, intervals=intervals),)).cycle_check
    assert ("cannot see a misfit that repeats" in told) is is_blind


def steady(amplitude=0.03, speed=0.3):
    return SimpleNamespace(amplitude=amplitude, peak_speed=speed, n_cycles=5, window=slice(0, 2))


@pytest.mark.parametrize("name", ["amplitude", "speed"])
@pytest.mark.parametrize(("factor", "is_same"), [(1.049, True), (1.051, False)])
def test_a_motion_within_five_per_cent_of_a_fitted_one_is_the_same(name, factor, is_same) -> None:
    fit = SimpleNamespace(logs=[SimpleNamespace(trace=SimpleNamespace(stretches=[steady()]))])
    one = {"amplitude": 0.03, "speed": 0.3}
    other = steady(**one | {name: factor * one[name]})
    assert _is_same_motion(fit, SimpleNamespace(stretches=[other])) is is_same


@pytest.mark.parametrize(
    ("low", "high", "is_near"),
    [
        (1.6, 2.38, True),  # 0.78 apart
        (1.5, 2.32, False),
        (1.0, 2.20, True),  # the farther one 0.24 beyond 1.96
        (1.0, 2.22, False),
        (1.84, 2.9, True),  # the nearer one 0.12 below
        (1.83, 2.9, False),
    ],
)
def test_a_limit_is_told_between_points_that_are_near(low, high, is_near) -> None:
    assert interpolated_limit([(0.0, 0.0), (0.2, low), (0.3, high)], 1.0)[1] is is_near


@pytest.mark.parametrize(("factor", "is_alike"), [(1.95, True), (2.05, False)])
def test_the_misfit_at_a_speed_is_that_within_a_factor_of_two(factor, is_alike):
    for speed in (0.1 * factor, 0.1 / factor):
        part = SimpleNamespace(noise=0.0, velocity=np.array([speed]), residuals=np.array([7.0]))
        assert _misfit([part], 0.1, 1.0) == (7.0 if is_alike else 0.0)


@pytest.mark.parametrize(("share", "has_yielded"), [(0.39, False), (0.41, True)])
def test_a_damper_has_yielded_from_two_fifths_of_its_range(share, has_yielded) -> None:
    assert replace(diagnosis(1), held_share=share).has_yielded is has_yielded


def test_the_jump_at_a_reversal_is_read_over_twenty_milliseconds(monkeypatch) -> None:
    monkeypatch.setattr(withheld, "apply_filter", lambda _, signal: signal)
    force = np.zeros(400)
    force[199 - 20], force[200 + 20] = 50.0, -50.0  # nothing before and behind
    trace = SimpleNamespace(
        drive=SimpleNamespace(velocity=np.repeat([1.0, -1.0], 200)),
        interval=1e-3,
        compared=slice(0, 400),
        force=force,
        model_filter=None,
    )
    assert _jumps(trace, 10.0, 0.0) == pytest.approx(0.2)


@pytest.mark.parametrize("n", [0, 1, 2, 5])
def test_the_sum_of_the_others_is_that_of_all_but_one(n: int) -> None:
    parts = [np.diag([2.0**k, -(3.0**k)]) for k in range(n)]
    found = _sums_of_others(parts, np.zeros((2, 2)))
    assert len(found) == n
    for k, one in enumerate(found):
        assert np.array_equal(
            one, sum((p for j, p in enumerate(parts) if j != k), np.zeros((2, 2)))
        )


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


@pytest.mark.parametrize(("own", "per_cent"), [(100.0, 0.01), (50.0, 0.04), (10.0, 1.0)])
def test_what_moves_beside_cycles_is_met_to_a_hundredth_of_the_fitted_forces(own, per_cent) -> None:
    trace = SimpleNamespace(force=np.array([own, -own]), compared=slice(None))
    assert _enough(trace, 100.0) == pytest.approx(per_cent, rel=1e-9)
