"""Least squares without negative values and roots, beside SciPy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq, nnls

from damperfit.damper.purdy.roots import nonnegative_least_squares, root_between


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("k", [1, 3, 6])
def test_least_squares_are_scipys(seed: int, k: int) -> None:
    random = np.random.default_rng([seed, k])
    columns = random.standard_normal((50, k))
    values = columns @ random.standard_normal(k) + 0.3 * random.standard_normal(50)
    expected = nnls(columns, values)[0]
    assert np.allclose(nonnegative_least_squares(columns, values), expected, atol=1e-10)


def test_columns_that_are_one_another_are_shared_out() -> None:
    column = np.linspace(1.0, 2.0, 9)
    found = nonnegative_least_squares(np.column_stack([column, column, 0.0 * column]), 3.0 * column)
    assert found[0] + found[1] == pytest.approx(3.0)
    assert found.min() >= 0.0


def test_what_only_negative_values_explain_is_left() -> None:
    columns = np.eye(3)
    assert nonnegative_least_squares(columns, -np.ones(3)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("function", "low", "high"),
    [
        (lambda x: x * x - 2.0, 0.0, 2.0),
        (lambda x: math.exp(x) - 5.0, 10.0, -10.0),
        (lambda x: x**3 - 1e-3, -1.0, 1.5),
        (lambda x: math.atan(x - 0.3), -50.0, 20.0),
        (lambda x: 1.0 if x > 0.7 else -1.0, 0.0, 1.0),
        (lambda x: x, 0.0, 1.0),
    ],
)
def test_a_root_is_scipys(function, low: float, high: float) -> None:
    asked: list[float] = []

    def counted(x: float) -> float:
        asked.append(x)
        return function(x)

    found = root_between(counted, low, high, tolerance=1e-9)
    spent, root = len(asked), brentq(function, low, high, xtol=1e-12)
    assert found == pytest.approx(root, abs=2e-9)
    _, theirs = brentq(function, low, high, xtol=1e-9, full_output=True)
    assert spent <= theirs.function_calls + 3
