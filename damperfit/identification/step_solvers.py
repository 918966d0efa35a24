r"""The linear algebra of a descent: the damped step of residuals r with Jacobian J at one point.

A step p minimises ``|r + J p|^2 + lambda |D p|^2`` for given lengths D of the variables. Both
solvers work on orthogonal factors of J and never form J^T J, which would halve the digits:
`DenseSystem` for one block of residuals, `BorderedSystem` for many blocks (settings) with variables
of their own and some in common::

    J = | J_1          T_1 |      u_i of a block are eliminated by a QR factorisation of its own
        |     J_2      T_2 |      rows; what is left of all blocks is a least-squares problem in the
        |          ... ... |      shared variables alone.

Twenty settings with sixty variables of their own then cost a few 6 x 6 factorisations a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from damperfit.compiled_core import compiled_core

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

__all__ = [
    "NO_LENGTH",
    "BorderedSystem",
    "DenseSystem",
    "LinearSystem",
    "Step",
    "StepSolver",
    "reduced",
]

# A column shorter than this has a variance beyond the largest number: as good as zeros.
NO_LENGTH = 1e-130
# Singular value of columns of length 1 below which a bordered system takes the shortest step.
_NOT_SEEN = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """A damped step.

    Attributes
    ----------
    change : numpy.ndarray
        Shape (k,), p.
    length : float
        |D p|.
    effect : float
        |J p|^2; without damping the fall of |r|^2 that is promised.
    shrinkage : float
        -d ln |D p| / d lambda.
    """

    change: FloatArray
    length: float
    effect: float
    shrinkage: float


class StepSolver(Protocol):
    """Gives the steps from a point for given lengths of the variables."""

    def step(self, damping: float) -> Step:
        """Return the step for a lambda; 0 is the full (Gauss-Newton) step."""

    @property
    def is_full_rank(self) -> bool:
        """Whether the full step is the only one of its kind."""


class LinearSystem(Protocol):
    """Residuals and Jacobian at one point."""

    @property
    def cost(self) -> float:
        """|r|^2."""

    @property
    def lengths(self) -> FloatArray:
        """Shape (k,), of the columns of J."""

    @property
    def gradient(self) -> FloatArray:
        """Shape (k,), J^T r."""

    def scaled(self, scale: FloatArray) -> StepSolver:
        """Return the solver for D."""


class DenseSystem:
    """One block of residuals.

    Parameters
    ----------
    residuals : numpy.ndarray
        Shape (n,).
    jacobian : numpy.ndarray
        Shape (n, k).
    """

    def __init__(self, residuals: FloatArray, jacobian: FloatArray) -> None:
        self.cost = float(residuals @ residuals)
        triangle = reduced(residuals, jacobian)
        self._rows, self._right = triangle[:, :-1], triangle[:, -1]
        self.lengths = _lengths(self._rows)
        self.gradient = self._rows.T @ self._right

    @property
    def triangle(self) -> FloatArray:
        """R of the Jacobian, shape (k, k), of fewer rows where n is less: R^T R = J^T J."""
        return self._rows[: self._rows.shape[1]]

    def scaled(self, scale: FloatArray) -> StepSolver:
        """Return the solver for D; one singular value decomposition serves every lambda."""
        return _DenseSteps(self._rows, self._right, scale)


class _DenseSteps:
    def __init__(self, rows: FloatArray, right: FloatArray, scale: FloatArray) -> None:
        left, self._values, self._directions = np.linalg.svd(rows / scale, full_matrices=False)
        self._pull = left.T @ right
        self._scale = scale
        self._full: Step | None = None
        self.is_full_rank = bool(
            len(self._values) == len(scale) and (not len(scale) or self._values[-1] > NO_LENGTH)
        )

    def step(self, damping: float) -> Step:
        if damping:
            return self._step(damping)
        if self._full is None:  # asked for before and while it is damped
            self._full = self._step(0.0)
        return self._full

    def _step(self, damping: float) -> Step:
        values, pull, directions = self._values, self._pull, self._directions
        squares = values * values + damping
        if not self.is_full_rank:  # what is not seen stays where it is
            seen = squares > NO_LENGTH**2
            values, pull, directions = values[seen], pull[seen], directions[seen]
            squares = squares[seen]
        along = -values * pull / squares
        length = math.sqrt(float(along @ along))
        shares, effects = along / max(length, 1e-300), values * along
        return Step(
            change=along @ directions / self._scale,
            length=length,
            effect=float(effects @ effects),
            shrinkage=float(shares @ (shares / squares)),
        )


class BorderedSystem:
    """Blocks of residuals with variables of their own, all of one number, and some in common.

    The variables are those of the first block, of the second and so on, then the shared ones.

    Parameters
    ----------
    blocks : sequence of numpy.ndarray
        What `reduced` makes of each block's residuals and Jacobian, the columns of its own
        variables first.
    n_shared : int
        Shared variables.
    """

    def __init__(self, blocks: Sequence[FloatArray], n_shared: int) -> None:
        width = blocks[0].shape[1] - 1
        # A block of few residuals has a triangle that is cut off: zeros make up for it.
        self._triangles = np.zeros((len(blocks), width + 1, width + 1))
        for triangle, block in zip(self._triangles, blocks, strict=True):
            triangle[: len(block)] = block
        self.cost = float(np.sum(self._triangles[:, :, -1] ** 2))
        self._n_own = width - n_shared
        columns, right = self._triangles[:, :, :-1], self._triangles[:, :, -1]
        slopes = np.einsum("bij,bi->bj", columns, right)
        own, shared = np.split(np.array([_lengths(one) for one in columns]), [self._n_own], axis=1)
        self.lengths = np.concatenate([own.ravel(), _lengths(shared)])
        own, shared = np.split(slopes, [self._n_own], axis=1)
        self.gradient = np.concatenate([own.ravel(), shared.sum(axis=0)])

    def scaled(self, scale: FloatArray) -> StepSolver:
        """Return the solver for D."""
        return _BorderedSteps(self._triangles, scale, self._n_own)

    @property
    def shared_rows(self) -> FloatArray:
        """Jacobian of the shared variables where the blocks' own follow them."""
        rest = self._triangles[:, self._n_own :, self._n_own : -1]
        return rest.reshape(-1, rest.shape[2])


class _BorderedSteps:
    def __init__(self, triangles: FloatArray, scale: FloatArray, n_own: int) -> None:
        n_blocks = len(triangles)
        own, shared = scale[: n_blocks * n_own], scale[n_blocks * n_own :]
        self._n_own, self._n_shared = n_own, len(shared)
        self._scale = scale
        by_block = np.hstack([own.reshape(n_blocks, n_own), np.tile(shared, (n_blocks, 1))])
        self._scaled = triangles.copy()
        self._scaled[:, :, :-1] /= by_block[:, None, :]
        squares = np.sum(self._scaled[:, :, :-1] ** 2, axis=1)
        self._squares = squares[:, :n_own], np.sum(squares[:, n_own:], axis=0)[None, :]
        self.is_full_rank = self._solved(0.0)[1]

    def step(self, damping: float) -> Step:
        return self._solved(damping)[0]

    def _solved(self, damping: float) -> tuple[Step, bool]:
        own, shared = self._n_own, self._n_shared
        root = np.sqrt(damping)
        lengths = [np.sqrt(squares + damping) for squares in self._squares]
        n_blocks, _, width = self._scaled.shape
        # The damping first: below longer rows a reflection would lose what short ones hold.
        dampers = np.zeros((n_blocks, own, width))
        dampers[:, np.arange(own), np.arange(own)] = root
        factors = _triangle(np.concatenate([dampers, self._scaled], axis=1))
        inverse, is_seen = _inverted(factors[:, :own, :own], lengths[0])
        coupling, right = factors[:, :own, own:-1], factors[:, :own, -1]
        rest = factors[:, own:, own:].reshape(-1, shared + 1)
        border = np.hstack([root * np.eye(shared), np.zeros((shared, 1))])
        last = np.zeros((shared + 1, shared + 1))
        found = _triangle(np.vstack([border, rest]))
        last[: len(found)] = found
        back, is_shared_seen = _inverted(last[None, :shared, :shared], lengths[1])
        common = -back[0] @ last[:shared, -1]
        mine = -np.einsum("bij,bj->bi", inverse, right + coupling @ common)
        along = np.concatenate([mine.ravel(), common])
        length = float(np.linalg.norm(along))
        # w = R^-T z/|z| of the whole triangle R, block by block.
        first = np.einsum("bji,bj->bi", inverse, mine)
        second = back[0].T @ (common - np.einsum("bij,bi->j", coupling, first))
        by_block = np.hstack([mine, np.tile(common, (n_blocks, 1))])
        effects = np.einsum("bij,bj->bi", self._scaled[:, :, :-1], by_block)
        step = Step(
            change=along / self._scale,
            length=length,
            effect=float(np.sum(effects**2)),
            shrinkage=float(np.sum(first**2) + second @ second) / max(length, 1e-300) ** 2,
        )
        return step, is_seen and is_shared_seen


def reduced(residuals: FloatArray, jacobian: FloatArray) -> FloatArray:
    """Return few rows in place of many, (J, r) in a triangle: the same J^T J, J^T r and |r|^2.

    Parameters
    ----------
    residuals, jacobian : numpy.ndarray
        Shape (n,) and (n, k).

    Returns
    -------
    numpy.ndarray
        Shape (k + 1, k + 1), of fewer rows where n is less.
    """
    n, k = jacobian.shape
    columns = np.empty((k + 1, n))
    columns[:k] = jacobian.T
    columns[k] = residuals
    if n <= k:
        return _triangle(columns.T)
    triangle = np.empty((k + 1, k + 1))
    compiled_core().triangle(columns, triangle, k + 1)
    return triangle


def _triangle(rows: FloatArray) -> FloatArray:
    """R of a QR factorisation, of each matrix of a stack."""
    return np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)


def _lengths(rows: FloatArray) -> FloatArray:
    """Lengths of columns of few rows, also where their squares overflow."""
    return np.array([math.hypot(*column) for column in rows.T.tolist()])


def _inverted(triangles: FloatArray, lengths: FloatArray) -> tuple[FloatArray, bool]:
    """Return the inverse of each matrix, without the directions that nothing is seen of.

    ``lengths`` are those of the columns before other variables were eliminated.
    """
    is_short = lengths <= NO_LENGTH
    lengths = np.maximum(lengths, NO_LENGTH)
    left, values, right = np.linalg.svd(triangles / lengths[:, None, :])
    is_seen = values > _NOT_SEEN
    weights = np.where(is_seen, 1.0 / np.maximum(values, _NOT_SEEN), 0.0)
    inverse = np.einsum("bji,bj,bkj->bik", right, weights, left) / lengths[:, :, None]
    inverse[is_short] = 0.0  # rounding in a column of zeros is not to be taken for a step
    return inverse, bool(np.all(is_seen))
