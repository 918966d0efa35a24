"""The loop of every fit: steps, endings and bounds, on small problems with known answers."""

import numpy as np
import pytest

from damperfit.errors import SimulationError
from damperfit.identification.least_squares import (
    LinearSystem,
    Stopping,
    Transformation,
    inverse_information,
    iterate,
    reduced,
)
from tests.certificate.fits import minimise

RANDOM = np.random.default_rng(4)
X = np.linspace(0.0, 1.0, 20)
TIGHT = Stopping(1e-15, 1e-12, 200)
LINEAR = Transformation(np.array([False, False]), np.array([1.0, 10.0]))
POSITIVE = Transformation(np.array([True, True]), np.ones(2))


def line(y):
    slopes = np.stack([np.ones_like(X), X], axis=1)
    return slopes @ y - (3.0 - 2.0 * X), slopes, f"{y[0]:.3f}"


def decay(y):
    curve = y[0] * np.exp(-y[1] * X)
    return curve - 2.0 * np.exp(-3.0 * X), np.stack([curve / y[0], -X * curve], axis=1), None


def test_a_line_is_found_at_once_and_what_was_seen_is_kept() -> None:
    found = minimise(line, np.array([0.0, 0.0]), LINEAR)
    assert LINEAR.unpack(found.variables) == pytest.approx([3.0, -2.0], abs=1e-12)
    assert found.extra == "3.000"
    assert found.evaluations <= 3
    assert found.status > 0


def test_points_without_a_model_are_a_wall_also_far_from_the_minimum() -> None:
    seen = []

    def walled(y):
        seen.append(y)
        if y[1] < 2.9:
            raise SimulationError("no")
        residuals, slopes, _ = decay(y)
        return 1e4 * residuals, 1e4 * slopes, None  # a start far above the wall's own height

    steps = Transformation(np.array([False, False]), np.array([1.0, 1.0]))
    found = minimise(walled, np.array([9.0, 8.0]), steps, TIGHT)
    assert found.variables == pytest.approx([2.0, 3.0], rel=1e-6)
    assert found.failed_trials > 0
    assert found.evaluations == len(seen)
    with pytest.raises(SimulationError):
        minimise(walled, np.array([9.0, 1.0]), steps)


def test_a_descent_among_failures_shrinks_until_its_steps_are_short() -> None:
    start = np.array([1.0, 1.0])

    def lonely(u):
        if u.tolist() != start.tolist():
            raise SimulationError("nothing but the start")
        return LinearSystem(*decay(u)[:2]), u

    stopping = Stopping(step_tolerance=1e-4)
    ended = iterate(lonely, start, stopping)
    assert ended.status == 3
    assert ended.failed_trials == ended.evaluations - 1
    longer = iterate(lonely, start, stopping._replace(step_tolerance=1e-8))
    assert longer.failed_trials == ended.failed_trials + 4  # a tenth at each failure


@pytest.mark.parametrize("limit", [1, 2, 5])
def test_the_limit_of_evaluations_holds_and_is_told(limit: int) -> None:
    found = minimise(decay, np.array([0.01, 90.0]), POSITIVE, Stopping(1e-15, 1e-15, limit))
    # MINPACK looks at its limit only after a trial.
    assert found.evaluations <= limit + 1
    assert found.status == 0


def test_the_inverse_keeps_the_digits_that_normal_equations_lose() -> None:
    eps = 1e-7
    jacobian = np.array([[1.0, 1.0], [eps, 0.0], [0.0, eps]])
    determinant = 2 * eps**2 + eps**4  # by hand
    expected = np.array([[1 + eps**2, -1.0], [-1.0, 1 + eps**2]]) / determinant
    assert inverse_information(jacobian) == pytest.approx(expected, rel=1e-8)
    with np.errstate(over="raise", invalid="raise"):
        for unseen in ([[2.0, 0.0], [0.0, 0.0]], [[2.0, 1e-150], [0.0, 1e-150]]):
            inverse = inverse_information(np.array(unseen))
            assert inverse[0, 0] == pytest.approx(0.25)
            assert np.isinf(inverse[1, 1])


@pytest.mark.parametrize("bound", [2.5, 2.9, 3.5])
def test_a_bound_holds_a_variable_while_the_others_go_on(bound: float) -> None:
    """The rate of the decay is 3: at a bound below it the amplitude is what fits best there."""
    bounds = np.array([0.1, 0.5]), np.array([9.0, bound])
    found = minimise(decay, np.array([0.7, 1.0]), POSITIVE, TIGHT, bounds)
    y = POSITIVE.unpack(found.variables, bounds)
    shape = np.exp(-min(bound, 3.0) * X)
    assert y[1] == pytest.approx(min(bound, 3.0), rel=1e-9)
    assert y[0] == pytest.approx(shape @ (2.0 * np.exp(-3.0 * X)) / (shape @ shape), rel=1e-6)
    assert found.is_held.tolist() == [False, bound < 3.0]
    assert bool(y[1] == bound) is (bound < 3.0)
    assert bound > 3.0 or found.gradient_cosine < 1e-6


def test_a_variable_that_starts_at_a_bound_leaves_it() -> None:
    bounds = np.array([2.5, 0.5]), np.array([9.0, 9.0])
    away = minimise(decay, np.array([2.5, 9.0]), POSITIVE, TIGHT, bounds)
    assert POSITIVE.unpack(away.variables, bounds)[0] == 2.5
    corner = np.array([9.0, 9.0])
    free = minimise(decay, corner, POSITIVE, TIGHT)
    inner = minimise(decay, corner, POSITIVE, TIGHT, (np.full(2, 0.1), corner))
    assert inner.variables == pytest.approx(free.variables, abs=1e-9)


@pytest.mark.parametrize("damping", [0.0, 1e-3, 5.0])
def test_a_damped_step_is_that_of_the_normal_equations(damping: float) -> None:
    residuals, jacobian = RANDOM.normal(size=120), RANDOM.normal(size=(120, 14))
    system = LinearSystem(residuals, jacobian)
    scale = RANDOM.uniform(0.1, 9.0, jacobian.shape[1])
    found = system.scaled(scale).step(damping)
    matrix = jacobian.T @ jacobian + damping * np.diag(scale**2)
    change = -np.linalg.solve(matrix, jacobian.T @ residuals)
    assert found.change == pytest.approx(change, rel=1e-10, abs=1e-12)
    assert found.length == pytest.approx(np.linalg.norm(scale * change))
    assert found.effect == pytest.approx(np.sum((jacobian @ change) ** 2))
    assert system.cost == pytest.approx(residuals @ residuals)
    assert system.gradient == pytest.approx(jacobian.T @ residuals)
    assert system.lengths == pytest.approx(np.linalg.norm(jacobian, axis=0))
    more = 1e-5 * (1.0 + damping)
    longer, shorter = (system.scaled(scale).step(damping + d).length for d in (0.0, more))
    slope = -np.log(shorter / longer) / more
    assert found.shrinkage == pytest.approx(slope, rel=1e-3)


@pytest.mark.parametrize("shape", [(2, 1), (9, 1), (8, 3), (721, 3), (400, 12)])
def test_the_triangle_of_the_core_is_that_of_lapack(shape: tuple[int, int]) -> None:
    residuals, jacobian = RANDOM.normal(size=shape[0]), RANDOM.normal(size=shape)
    twin = np.linalg.qr(np.column_stack([jacobian, residuals]), mode="r")
    assert reduced(residuals, jacobian) == pytest.approx(twin, rel=1e-12, abs=1e-13)
