"""The mean cycle and the triangle of the compiled core beside slow twins."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from damperfit.compiled_core import compiled_core
from damperfit.identification.least_squares import reduced

FloatArray = NDArray[np.float64]
RANDOM = np.random.default_rng(20261126)


def between(y: FloatArray, at: float) -> float:
    """By the polynomial through the eight samples around a fractional one, by Lagrange."""
    first = int(np.clip(np.floor(at) - 3, 0, len(y) - 8))
    taps = range(first, first + 8)
    return float(
        sum(y[i] * np.prod([(at - j) / (i - j) for j in taps if j != i], dtype=float) for i in taps)
    )


@pytest.mark.parametrize("starts", [[0.0, 9.7], [1.3, 10.9, 20.0, 30.4], [-2.0, 12.0, 41.5]])
def test_the_mean_cycle_is_that_of_the_cycles(starts: list[float]) -> None:
    channels = RANDOM.normal(size=(3, 40))
    n, n_cycles = 6, len(starts) - 1
    means, beside = np.empty((3, n)), np.empty(n)
    compiled_core().fold(*channels, np.array(starts), means, beside, np.empty(n_cycles))
    places = [[a + (b - a) * k / n for k in range(n)] for a, b in pairwise(starts)]
    folded = np.array([[[between(y, at) for at in row] for row in places] for y in channels])
    assert means == pytest.approx(folded.mean(axis=1), rel=1e-11, abs=1e-11)
    squares = np.sum((folded[2] - folded[2].mean(axis=0)) ** 2, axis=0)
    assert beside == pytest.approx(squares, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("shape", [(2, 1), (9, 1), (8, 3), (721, 3), (400, 12)])
def test_the_triangle_is_that_of_lapack(shape: tuple[int, int]) -> None:
    residuals, jacobian = RANDOM.normal(size=shape[0]), RANDOM.normal(size=shape)
    twin = np.linalg.qr(np.column_stack([jacobian, residuals]), mode="r")
    assert reduced(residuals, jacobian) == pytest.approx(twin, rel=1e-12, abs=1e-13)
