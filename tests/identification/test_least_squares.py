"""The loop of every fit: steps, endings and bounds, on small problems with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.errors import SimulationError
from damperfit.identification.least_squares import (
    BorderedSystem,
    DenseSystem,
    Minimum,
    Step,
    Stopping,
    Transformation,
    inverse_information,
    iterate,
    minimise,
    reduced,
)
from tests.certificate.fits import STOPPING, correct_digits
from tests.certificate.problems import MODELS, load

# The descent loop on small problems with known answers.

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
    assert LINEAR.unpack(found.variables) == pytest.approx([3.0, -2.0], abs=1e-12)
    assert found.extra == "3.000"
    assert found.evaluations <= 3
    assert found.status > 0


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
    assert found.variables == pytest.approx([2.0, 3.0], rel=1e-6)
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


# The loop of every fit: its endings, each just inside and just outside of its limit.

X_OF_DECAY = np.linspace(0.0, 1.0, 30)
# A decay that is none: large residuals, so that the full steps become shorter slowly.
DATA = np.exp(-3.0 * X_OF_DECAY) + 0.4 * np.sin(9.0 * X_OF_DECAY)


def slow_decay(u: np.ndarray) -> tuple[DenseSystem, np.ndarray]:
    curve = u[0] * np.exp(-u[1] * X_OF_DECAY)
    system = DenseSystem(curve - DATA, np.stack([curve / u[0], -X_OF_DECAY * curve], axis=1))
    return system, u


START = np.array([1.0, 1.0])


def test_a_descent_among_failures_shrinks_until_its_steps_are_short() -> None:
    def lonely(u: np.ndarray) -> tuple[DenseSystem, np.ndarray]:
        if u.tolist() != START.tolist():
            raise SimulationError("nothing but the start")
        return slow_decay(u)

    stopping = Stopping(step_tolerance=1e-4)
    ended = iterate(lonely, START, stopping)
    assert ended.status == 3
    assert ended.failed_trials == ended.evaluations - 1
    longer = iterate(lonely, START, stopping._replace(step_tolerance=1e-8))
    assert longer.failed_trials == ended.failed_trials + 4  # a tenth at each failure


class Steps:
    """A solver of steps whose lengths are given; it keeps the damping that it was asked for."""

    is_full_rank = False

    def __init__(self, *lengths: float) -> None:
        self.lengths, self.asked = [2.0, *lengths], []

    def step(self, damping: float) -> Step:
        self.asked.append(damping)
        length = self.lengths[min(len(self.asked), len(self.lengths)) - 1]
        return Step(np.zeros(1), length, 1.0, 1.0)


@pytest.mark.parametrize("bound", [2.5, 2.9, 3.5])
def test_a_bound_holds_a_variable_while_the_others_go_on(bound: float) -> None:
    """The rate of the decay is 3: at a bound below it the amplitude is what fits best there."""
    steps = Transformation(np.array([True, True]), np.ones(2))
    bounds = np.array([0.1, 0.5]), np.array([9.0, bound])
    found = minimise(decay, np.array([0.7, 1.0]), steps, TIGHT, bounds)
    y = steps.unpack(found.variables, bounds)
    shape = np.exp(-min(bound, 3.0) * X)
    assert y[1] == pytest.approx(min(bound, 3.0), rel=1e-9)
    assert y[0] == pytest.approx(shape @ (2.0 * np.exp(-3.0 * X)) / (shape @ shape), rel=1e-6)
    assert found.is_held.tolist() == [False, bound < 3.0]
    assert bool(y[1] == bound) is (bound < 3.0)
    assert bound > 3.0 or found.gradient_cosine < 1e-6


def test_a_variable_that_starts_at_a_bound_leaves_it() -> None:
    steps = Transformation(np.array([True, True]), np.ones(2))
    bounds = np.array([2.5, 0.5]), np.array([9.0, 9.0])
    away = minimise(decay, np.array([2.5, 9.0]), steps, TIGHT, bounds)
    assert steps.unpack(away.variables, bounds)[0] == 2.5
    free = minimise(decay, np.array([9.0, 9.0]), steps, TIGHT)
    inner = minimise(decay, np.array([9.0, 9.0]), steps, TIGHT, (np.full(2, 0.1), np.full(2, 9.0)))
    assert inner.variables == pytest.approx(free.variables, abs=1e-9)


@pytest.mark.parametrize("high", [-0.2, 10.0])
def test_a_bound_in_one_block_of_many_is_that_of_one_whole_problem(high: float) -> None:
    parts = [
        (RANDOM.normal(size=30), RANDOM.normal(size=(30, OWN + SHARED))) for _ in range(BLOCKS)
    ]
    n = OWN * BLOCKS + SHARED
    whole = np.zeros((30 * BLOCKS, n))
    for k, (_, jacobian) in enumerate(parts):
        whole[30 * k : 30 * k + 30, OWN * k : OWN * k + OWN] = jacobian[:, :OWN]
        whole[30 * k : 30 * k + 30, OWN * BLOCKS :] = jacobian[:, OWN:]
    data = np.concatenate([r for r, _ in parts])
    bounds = np.full(n, -5.0), np.full(n, high)

    def one_block(u: np.ndarray) -> tuple[DenseSystem, None]:
        return DenseSystem(data + whole @ u, whole), None

    def many(u: np.ndarray) -> tuple[BorderedSystem, None]:
        moved = (data + whole @ u).reshape(BLOCKS, 30)
        blocks = [reduced(r, j) for r, (_, j) in zip(moved, parts, strict=True)]
        return BorderedSystem(blocks, SHARED), None

    start = np.full(n, -1.0)
    slow, fast = (iterate(f, start, Stopping(), bounds) for f in (one_block, many))
    assert fast.variables == pytest.approx(slow.variables, abs=1e-7)
    assert fast.is_held.tolist() == slow.is_held.tolist()
    assert slow.is_held.any() == (high < 0.0)
    assert slow.gradient_cosine < 1e-6


# Steps by orthogonal factors are those of the normal equations, in one block or in many.

RANDOM = np.random.default_rng(4)
OWN, SHARED, BLOCKS = 3, 2, 4


def bordered() -> tuple[BorderedSystem, np.ndarray, np.ndarray]:
    """Random blocks, and the same as one Jacobian."""
    parts = [
        (RANDOM.normal(size=30), RANDOM.normal(size=(30, OWN + SHARED))) for _ in range(BLOCKS)
    ]
    whole = np.zeros((30 * BLOCKS, OWN * BLOCKS + SHARED))
    for k, (_, jacobian) in enumerate(parts):
        rows = slice(30 * k, 30 * k + 30)
        whole[rows, OWN * k : OWN * k + OWN] = jacobian[:, :OWN]
        whole[rows, OWN * BLOCKS :] = jacobian[:, OWN:]
    system = BorderedSystem([reduced(*part) for part in parts], SHARED)
    return system, np.concatenate([r for r, _ in parts]), whole


@pytest.mark.parametrize("damping", [0.0, 1e-3, 5.0])
@pytest.mark.parametrize("kind", ["dense", "bordered"])
def test_a_damped_step_is_that_of_the_normal_equations(kind: str, damping: float) -> None:
    system: DenseSystem
    system, residuals, jacobian = bordered()
    if kind == "dense":
        system = DenseSystem(residuals, jacobian)
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


def test_what_the_shared_rows_leave_is_the_covariance_with_the_own_ones_free() -> None:
    system, _, jacobian = bordered()
    covariance = np.linalg.inv(jacobian.T @ jacobian)[-SHARED:, -SHARED:]
    rows = system.shared_rows
    assert np.linalg.inv(rows.T @ rows) == pytest.approx(covariance, rel=1e-10)


# Some hundred steps along a valley, which a start nearby tells as well.
LONG = {("Bennett5", 0), ("MGH09", 0), ("MGH17", 0)}


@pytest.mark.one_in(2)
@pytest.mark.parametrize(
    ("name", "k"),
    [
        pytest.param(name, k, marks=pytest.mark.slow if (name, k) in LONG else [])
        for name in MODELS
        for k in (0, 1)
    ],
)
def test_blocks_with_a_border_solve_the_problems_of_nist(name: str, k: int) -> None:
    # All parameters but the last are a block's own. From the near start each problem twice, side by
    # side; from the far one, where the way there is what is hard, once.
    problem, copies = load(name), 1 + k
    start = problem.starts[k]
    size, n = np.abs(start), len(start)
    unit = float(np.std(problem.response)) * np.sqrt(len(problem.response))

    def point_at(u: np.ndarray) -> tuple[BorderedSystem, None]:
        blocks = []
        for copy in u[:-1].reshape(copies, n - 1):
            b = np.append(copy, u[-1]) * size
            with np.errstate(all="ignore"):
                block = problem.residuals(b) / unit, problem.jacobian(b) * size / unit
                total = np.sum(block[1]) + block[0] @ block[0]
            if not np.isfinite(total):
                raise SimulationError("no number")
            blocks.append(reduced(*block))
        return BorderedSystem(blocks, 1), None

    u = start / size
    ended = iterate(point_at, np.append(np.tile(u[:-1], copies), u[-1]), STOPPING)
    for copy in ended.variables[:-1].reshape(copies, n - 1):
        found = np.append(copy, ended.variables[-1]) * size
        assert correct_digits(found, problem.certified) >= 6.0
