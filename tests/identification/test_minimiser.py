"""The descent loop on small problems with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.errors import SimulationError
from damperfit.identification.minimiser import (
    Minimum,
    Transformation,
    inverse_information,
    minimise,
)
from damperfit.identification.trust_region import Stopping

LINEAR = Transformation(np.array([False, False]), np.array([1.0, 10.0]))
X = np.linspace(0.0, 1.0, 20)
TIGHT = Stopping(1e-15, 1e-12, 200)


def line(y: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    slopes = np.stack([np.ones_like(X), X], axis=1)
    return slopes @ y - (3.0 - 2.0 * X), slopes, f"{y[0]:.3f}"


def decay(y: np.ndarray) -> tuple[np.ndarray, np.ndarray, None]:
    curve = y[0] * np.exp(-y[1] * X)
    return curve - 2.0 * np.exp(-3.0 * X), np.stack([curve / y[0], -X * curve], axis=1), None


def test_a_line_is_found_at_once_and_what_was_seen_is_kept() -> None:
    found: Minimum[str] = minimise(line, np.array([0.0, 0.0]), LINEAR)
    assert found.point.values == pytest.approx([3.0, -2.0], abs=1e-12)
    assert found.point.extra == "3.000"
    assert found.evaluations <= 3
    assert found.status > 0


@pytest.mark.parametrize("kinds", [(True, True), (True, False), (False, False)])
def test_the_same_minimum_in_any_variables(kinds: tuple[bool, bool]) -> None:
    steps = Transformation(np.array(kinds), np.array([0.5, 7.0]))
    y = np.array([2.0, 3.0])
    assert steps.unpack(steps.pack(y)) == pytest.approx(y, rel=1e-14)
    found = minimise(decay, np.array([0.7, 9.0]), steps, TIGHT)
    assert found.point.values == pytest.approx(y, rel=1e-9)
    # The Jacobian is by the variables, as a difference quotient has it.
    u, h = steps.pack(found.point.values), 1e-6
    for j in range(2):
        step = h * np.eye(2)[j]
        ends = [decay(steps.unpack(u + sign * step))[0] for sign in (1, -1)]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(found.point.jacobian[:, j], abs=1e-7)


def test_points_without_a_model_are_a_wall_also_far_from_the_minimum() -> None:
    seen = []

    def walled(y: np.ndarray) -> tuple[np.ndarray, np.ndarray, None]:
        seen.append(y)
        if y[1] < 2.9:
            raise SimulationError("no")
        residuals, slopes, _ = decay(y)
        return 1e4 * residuals, 1e4 * slopes, None  # a start far above the wall's own height

    steps = Transformation(np.array([False, False]), np.array([1.0, 1.0]))
    found = minimise(walled, np.array([9.0, 8.0]), steps, TIGHT)
    assert found.point.values == pytest.approx([2.0, 3.0], rel=1e-6)
    assert found.failed_trials > 0
    assert found.evaluations == len(seen)
    with pytest.raises(SimulationError):
        minimise(walled, np.array([9.0, 1.0]), steps)


@pytest.mark.parametrize("limit", [1, 2, 5])
def test_the_limit_of_evaluations_holds_and_is_told(limit: int) -> None:
    steps = Transformation(np.array([True, True]), np.ones(2))
    found = minimise(decay, np.array([0.01, 90.0]), steps, Stopping(1e-15, 1e-15, limit))
    # MINPACK looks at its limit only after a trial.
    assert found.evaluations <= limit + 1
    assert found.status == 0


def test_nothing_free_is_one_evaluation() -> None:
    empty = Transformation(np.empty(0, dtype=bool), np.empty(0))
    found = minimise(lambda _: (np.ones(3), np.empty((3, 0)), None), np.empty(0), empty)
    assert (found.evaluations, found.status, found.gradient_cosine) == (1, 1, 0.0)


def test_a_trial_that_overflows_is_refused() -> None:
    # The first full step throws the rate to -845, and the sum of squares to infinity.
    x = np.array([1.0, 2.0, 3.0, 5.0, 7.0, 10.0])
    y = np.array([109.0, 149.0, 149.0, 191.0, 213.0, 224.0])  # BoxBOD of NIST

    def model(b: np.ndarray) -> tuple[np.ndarray, np.ndarray, None]:
        with np.errstate(over="ignore"):
            gone = np.exp(-b[1] * x)
            residuals = (b[0] * (1.0 - gone) - y) / 200.0
            slopes = np.stack([1.0 - gone, b[0] * x * gone], axis=1) / 200.0
        return residuals, slopes, None

    found = minimise(model, np.ones(2), Transformation(np.zeros(2, dtype=bool), np.ones(2)), TIGHT)
    assert found.failed_trials > 0
    assert found.point.values == pytest.approx([213.80940889, 0.54723748542], rel=1e-7)


def test_the_inverse_keeps_the_digits_that_normal_equations_lose() -> None:
    eps = 1e-7
    jacobian = np.array([[1.0, 1.0], [eps, 0.0], [0.0, eps]])
    determinant = 2 * eps**2 + eps**4  # by hand
    expected = np.array([[1 + eps**2, -1.0], [-1.0, 1 + eps**2]]) / determinant
    assert inverse_information(jacobian) == pytest.approx(expected, rel=1e-8)
    with_zero = inverse_information(np.array([[2.0, 0.0], [0.0, 0.0]]))
    assert with_zero[0, 0] == pytest.approx(0.25)
    assert np.isinf(with_zero[1, 1])
    with np.errstate(over="raise", invalid="raise"):
        nearly = inverse_information(np.array([[2.0, 1e-150], [0.0, 1e-150]]))
    assert nearly[0, 0] == pytest.approx(0.25)
    assert np.isinf(nearly[1, 1])
