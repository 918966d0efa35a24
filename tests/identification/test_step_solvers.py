"""Steps by orthogonal factors are those of the normal equations, in one block or in many."""

from __future__ import annotations

import numpy as np
import pytest

from damperfit.errors import SimulationError
from damperfit.identification.step_solvers import BorderedSystem, DenseSystem, LinearSystem, reduced
from damperfit.identification.trust_region import iterate
from tests.certificate.fits import STOPPING, correct_digits
from tests.certificate.problems import MODELS, load

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
    system: LinearSystem
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


def test_a_variable_that_no_block_sees_stays_where_it_is() -> None:
    residuals, jacobian = RANDOM.normal(size=20), RANDOM.normal(size=(20, 3))
    jacobian[:, 1] = 0.0
    for system in (
        DenseSystem(residuals, jacobian),
        BorderedSystem([reduced(residuals, jacobian)], 1),
        BorderedSystem([reduced(residuals, jacobian[:, [0, 2, 1]])], 1),
    ):
        steps = system.scaled(np.ones(3))
        assert not steps.is_full_rank
        change = steps.step(0.0).change
        assert np.sum(np.abs(change) < 1e-12) == 1
        assert np.all(np.isfinite(change))


def test_columns_too_short_for_their_squares_make_no_noise() -> None:
    jacobian = np.array([[1.0, 0.0], [0.0, 1e-160], [1.0, 0.0]])
    with np.errstate(all="raise", under="ignore"):
        found = DenseSystem(np.array([1.0, 1.0, 1.0]), jacobian).scaled(np.ones(2)).step(0.0)
    assert found.change == pytest.approx([-1.0, 0.0])


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
