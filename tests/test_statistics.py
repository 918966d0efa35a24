"""Quantiles of our own, beside those of SciPy."""

import math

import numpy as np
import pytest
from scipy.special import chdtri, fdtrc, stdtrit

from damperfit.statistics import (
    chi_squared_quantile,
    fisher_chance,
    median,
    percentiles,
    student_quantile,
)

SHARES = (0.5, 0.6, 0.9, 0.95, 0.975, 0.999, 1.0 - 1e-6, 1.0 - 1e-9)
FREEDOMS = (0.5, 1.0, 1.7, 2.0, 3.0, 10.0, 33.3, 49.9, 50.1, 99.0, 101.0, 1e3, 1e4, 1e6)


@pytest.mark.parametrize("share", SHARES)
def test_quantiles_are_those_of_scipy(share):
    for freedom in FREEDOMS:
        student = pytest.approx(stdtrit(freedom, share), rel=1e-9, abs=1e-12)
        assert student_quantile(freedom, share) == student, freedom
        chi_squared = pytest.approx(chdtri(freedom, 1.0 - share), rel=1e-9)
        assert chi_squared_quantile(freedom, share) == chi_squared, freedom


@pytest.mark.parametrize("ratio", [1e-3, 0.9, 1.0, 1.2, 3.0, 20.0])
def test_chances_are_those_of_scipy(ratio):
    for below in FREEDOMS:
        for above in (0.7, 1.0, 7.0, 400.0):
            chance = pytest.approx(fdtrc(above, below, ratio), rel=1e-9, abs=1e-15)
            assert fisher_chance(above, below, ratio) == chance, (above, below)


def test_every_ratio_is_above_nothing_and_what_is_no_number_has_no_chance():
    assert fisher_chance(3.0, 4.0, 0.0) == fisher_chance(3.0, 4.0, -1.0) == 1.0
    for above, below, ratio in ((0.0, 1.0, 2.0), (1.0, 0.0, 2.0), (1.0, 1.0, math.nan)):
        assert math.isnan(fisher_chance(above, below, ratio))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 20, 21, 200, 999])
def test_medians_and_percentiles_are_those_of_numpy(n):
    values = np.random.default_rng(n).standard_normal(n)
    assert median(values) == np.median(values)
    shares = (0.0, 1.0, 5.0, 33.3, 50.0, 95.0, 99.9, 100.0)
    assert percentiles(values, *shares) == pytest.approx(np.percentile(values, shares), rel=1e-14)
