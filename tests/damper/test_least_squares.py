"""Least squares without negative values, beside SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from damperfit.damper.purdy.starting import nonnegative_least_squares


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
