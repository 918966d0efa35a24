r"""Least squares: the one loop of all fits and the linear algebra of its steps.

Nothing here knows of dampers. A model gives residuals r with their Jacobian J by the variables u
as a system; a step p minimises ``|r + J p|^2 + lambda |D p|^2`` for lengths D of the
variables, by orthogonal factors of J: J^T J would halve the digits. `DenseSystem` is one block of
residuals, `BorderedSystem` many blocks (settings) with variables of their own and some in common::

    J = | J_1          T_1 |      u_i of a block are eliminated by a QR factorisation of its own
        |     J_2      T_2 |      rows; what is left of all blocks is a least-squares problem in the
        |          ... ... |      shared variables alone.

The trust region is MINPACK's, scaled by the lengths of the Jacobian's columns (J. J. More, "The
Levenberg-Marquardt algorithm: implementation and theory", 1978). Bounds have one rule: a step is
cut off at them, and a variable at its bound is held as long as the cost falls only beyond it. Run
over the nonlinear regression problems of NIST by ``python -m tests.certificate``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np

from damperfit.compiled_core import compiled_core
from damperfit.errors import SimulationError
from damperfit.statistics import largest_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import TypeAlias

    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]
    LinearSystem: TypeAlias = "DenseSystem | BorderedSystem"
    _Model = Callable[[FloatArray], tuple[FloatArray, FloatArray, "Extra"]]

__all__ = [
    "NO_LENGTH",
    "BorderedSystem",
    "DenseSystem",
    "Minimum",
    "Step",
    "Stopping",
    "Transformation",
    "inverse_information",
    "iterate",
    "minimise",
    "reduced",
]

Extra = TypeVar("Extra")

# A column shorter than this has a variance beyond the largest number: as good as zeros.
NO_LENGTH = 1e-130
# Singular value of columns of length 1 below which a bordered system takes the shortest step.
_NOT_SEEN = 1e-10


class Step(NamedTuple):
    """A damped step p."""

    change: FloatArray  # p, (k,)
    length: float  # |D p|
    effect: float  # |J p|^2; without damping the fall of |r|^2 that is promised
    shrinkage: float  # -d ln |D p| / d lambda


class DenseSystem:
    """One block of residuals.

    Parameters
    ----------
    residuals : numpy.ndarray
        Shape (n,).
    jacobian : numpy.ndarray
        Shape (n, k).
    held : numpy.ndarray, optional
        Shape (k,), of bool: variables that are left where they are.
    """

    def __init__(
        self,
        residuals: FloatArray,
        jacobian: FloatArray,
        held: NDArray[np.bool_] | None = None,
    ) -> None:
        self._moving = np.ones(jacobian.shape[1], dtype=bool) if held is None else ~held
        self.cost = float(residuals @ residuals)
        triangle = reduced(residuals, jacobian)
        self._rows, self._right = triangle[:, :-1], triangle[:, -1]
        self.lengths = _lengths(self._rows)
        self.gradient = self._rows.T @ self._right

    @property
    def triangle(self) -> FloatArray:
        """R of the Jacobian, shape (k, k), of fewer rows where n is less: R^T R = J^T J."""
        return self._rows[: self._rows.shape[1]]

    def scaled(self, scale: FloatArray) -> _DenseSteps:
        """Return the solver for D; one singular value decomposition serves every lambda."""
        return _DenseSteps(self._rows, self._right, scale, self._moving)

    def without(self, held: NDArray[np.bool_]) -> DenseSystem:
        """Return the system in which some variables do nothing."""
        return DenseSystem(self._right, np.where(held, 0.0, self._rows), held)

    def effect(self, change: FloatArray) -> float:
        """Return |J p|^2."""
        moved = self._rows @ change
        return float(moved @ moved)


class _DenseSteps:
    def __init__(
        self,
        rows: FloatArray,
        right: FloatArray,
        scale: FloatArray,
        seen: NDArray[np.bool_],
    ) -> None:
        columns = rows / scale
        left, self._values, directions = np.linalg.svd(columns[:, seen], full_matrices=False)
        self._directions = np.zeros((len(self._values), len(scale)))
        self._directions[:, seen] = directions
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

    def scaled(self, scale: FloatArray) -> _BorderedSteps:
        """Return the solver for D."""
        return _BorderedSteps(self._triangles, scale, self._n_own)

    def without(self, held: NDArray[np.bool_]) -> BorderedSystem:
        """Return the system in which some variables do nothing."""
        rest = self._triangles.copy()
        rest[:, :, :-1] *= ~self._by_block(held)
        return BorderedSystem(list(rest), len(held) - len(rest) * self._n_own)

    def effect(self, change: FloatArray) -> float:
        """Return |J p|^2."""
        moved = np.einsum("bij,bj->bi", self._triangles[:, :, :-1], self._by_block(change)[:, 0])
        return float(np.sum(moved**2))

    def _by_block(self, variables: NDArray[Any]) -> NDArray[Any]:
        """The variables of each block, its own and the shared ones: (blocks, 1, variables)."""
        n_blocks = len(self._triangles)
        own, shared = np.split(variables, [n_blocks * self._n_own])
        both = np.hstack([own.reshape(n_blocks, self._n_own), np.tile(shared, (n_blocks, 1))])
        return both[:, None, :]

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
    # By LAPACK columns of zeros round otherwise, and the search of laws takes other paths
    # (bench_numbers: valves 2 ends in another layout).
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


# A cosine between residuals and Jacobian that is zero to the last digits.
_RIGHT_ANGLE = 1e-12
# MINPACK's numbers: the first trust region, how near to it a step must end, within how many trials
# of lambda, the least share of the fall foreseen that takes a step, and a sum of squares so much
# higher that nothing is read off it. A point that the model cannot be evaluated at counts as that.
_FIRST_RADIUS = 100.0
_NEAR = 0.1
_MAX_TRIALS = 10
_LEAST_RATIO = 1e-4
_TOO_HIGH = 100.0
_DWARF = float(np.finfo(np.float64).tiny)
_LAST_BIT = float(np.finfo(np.float64).eps)
# How a descent ended, as `scipy.optimize.least_squares` has it.
_LIMIT, _MET_GRADIENT, _MET_COST, _MET_STEP, _MET_BOTH = 0, 1, 2, 3, 4


class Stopping(NamedTuple):
    """When a descent ends, and how far it may go at once.

    Attributes
    ----------
    cost_tolerance : float
        Relative fall of the sum of squares, found and foreseen, below which it has.
    step_tolerance : float
        Likewise for the relative size of the steps.
    max_evaluations : int
        Limit of evaluations.
    rest : float
        Relative length of the full step that may be left when the cost has ceased to fall: where
        the steps become shorter slowly, the descent goes on; infinity asks for nothing. A damper's
        descents end below 2e-9 by themselves (61 of the sample runs).
    least_gain : float
        Fall of the sum of squares that a full step must promise to be tried at all.
    least_share : float
        The same as a share of the sum of squares.
    longest_step : float
        Largest change of a variable in one step.
    near : float
        Largest change of a variable in a full step that is left to the caller to take unseen.
    """

    cost_tolerance: float = 1e-8
    step_tolerance: float = 1e-9
    max_evaluations: int = 100
    rest: float = 1e-8
    least_gain: float = 0.0
    least_share: float = 0.0
    longest_step: float = math.inf
    near: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Minimum(Generic[Extra]):
    """Where a descent ended.

    Attributes
    ----------
    variables : numpy.ndarray
        Shape (k,), u of the best point found.
    system : LinearSystem
        Residuals and Jacobian there.
    extra : object
        What the model remembered of it.
    evaluations, failed_trials : int
        Evaluations of the model, and those that it refused.
    status : int
        As `scipy.optimize.least_squares` has it: 0 is the limit of evaluations, 1 to 4 are tests
        met.
    is_held : numpy.ndarray
        Shape (k,), of bool: at a bound, beyond which alone the cost falls.
    """

    variables: FloatArray
    system: LinearSystem
    extra: Extra
    evaluations: int
    failed_trials: int
    status: int
    is_held: NDArray[np.bool_]

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return self.system.cost

    @property
    def jacobian(self) -> FloatArray:
        """R of the derivative of one block of residuals by u: R^T R = J^T J, at most (k, k)."""
        assert isinstance(self.system, DenseSystem)
        return self.system.triangle

    @property
    def gradient_cosine(self) -> float:
        """Largest cosine between residuals and a column of the Jacobian; 0 at a minimum."""
        return _cosine(self.system, self.is_held)


def iterate(
    point_at: Callable[[FloatArray], tuple[LinearSystem, Extra]],
    start: FloatArray,
    stopping: Stopping,
    bounds: tuple[FloatArray, FloatArray] | None = None,
) -> Minimum[Extra]:
    """Minimise a sum of squares in the variables u themselves; the loop behind every fit.

    Parameters
    ----------
    point_at : callable
        From u, shape (k,), to residuals with Jacobian as a `LinearSystem`, and anything to be
        remembered. It raises `SimulationError` where the model cannot be evaluated.
    start : numpy.ndarray
        Shape (k,), u.
    stopping : Stopping
        When to end.
    bounds : tuple of numpy.ndarray, optional
        Least and largest u, shape (k,) each.

    Raises
    ------
    SimulationError
        When the model cannot be evaluated at the start.
    """
    descent = _Descent(point_at, start, stopping, bounds or (-math.inf, math.inf))
    if not len(start):
        return descent.ended(_MET_GRADIENT)
    while True:
        status = descent.linearised()
        if status is None:
            status = descent.advanced()
        if status is not None:
            return descent.ended(status)


class _Descent(Generic[Extra]):
    """Where a descent is: MINPACK's lmder, with the steps of a system in place of its QR."""

    def __init__(
        self,
        point_at: Callable[[FloatArray], tuple[LinearSystem, Extra]],
        start: FloatArray,
        stopping: Stopping,
        bounds: tuple[FloatArray | float, FloatArray | float],
    ) -> None:
        self.point_at = point_at
        self.stopping = stopping
        self.low, self.high = bounds
        self.evaluations, self.failed_trials = 1, 0
        self.variables = np.minimum(np.maximum(start, self.low), self.high)
        self.system, self.extra = point_at(self.variables)
        # The least sum of squares seen, also where the fall was too small for a step.
        self.best = (self.system, self.extra, self.variables)
        self.scale = np.where(self.system.lengths > NO_LENGTH, self.system.lengths, 1.0)
        self.radius = self.damping = 0.0
        self.is_first = True
        self.is_ending = False

    def ended(self, status: int) -> Minimum[Extra]:
        system, extra, variables = self.best
        held = self.is_held(variables, system)
        return Minimum(variables, system, extra, self.evaluations, self.failed_trials, status, held)

    def is_held(self, variables: FloatArray, system: LinearSystem) -> NDArray[np.bool_]:
        """Which variables are at a bound beyond which alone the cost falls."""
        is_low = (variables <= self.low) & (system.gradient >= 0.0)
        return is_low | ((variables >= self.high) & (system.gradient <= 0.0))

    @property
    def size(self) -> float:
        """Length of u in the units of the trust region."""
        return _length(self.scale * self.variables)

    def linearised(self) -> int | None:
        """Find the steps from a new point; returns a status where it is the last."""
        stopping = self.stopping
        self.scale = np.maximum(self.scale, self.system.lengths)
        held = self.is_held(self.variables, self.system)
        self.rest = self.system.without(held) if held.any() else self.system
        if _cosine(self.system, held) <= _RIGHT_ANGLE:
            return _MET_GRADIENT
        self.steps = self.rest.scaled(self.scale)
        if self.is_first:
            self.radius = _FIRST_RADIUS * self.size or _FIRST_RADIUS
        least = max(stopping.least_gain, stopping.least_share * self.system.cost)
        if least > 0.0 or stopping.near > 0.0 or self.is_ending:
            full = self.steps.step(0.0)
            if full.effect < least or largest_of(full.change) < stopping.near:
                return _MET_COST
            if self.is_ending and full.length <= stopping.rest * self.size:
                return _MET_COST
        return None

    def advanced(self) -> int | None:
        """Try steps until one is taken; returns a status where the descent ends."""
        stopping, cost = self.stopping, self.system.cost
        while self.evaluations < stopping.max_evaluations:
            gradient = self.rest.gradient
            self.damping, step = _damped(
                self.steps, _length(gradient / self.scale), self.radius, self.damping
            )
            share = min(1.0, stopping.longest_step / max(largest_of(step.change), 1e-300))
            aim = self.variables + share * step.change
            trial = np.minimum(np.maximum(aim, self.low), self.high)
            slope, effect = step.effect + self.damping * step.length**2, share**2 * step.effect
            slope, length = share * slope, share * step.length
            if (trial != aim).any():
                change = trial - self.variables
                slope, effect = -float(gradient @ change), self.rest.effect(change)
                length = _length(self.scale * change)
            if self.is_first:
                self.radius = min(self.radius, length)
            found = self.tried(trial)
            # Where there is no model, a wall of finite height: the region shrinks by a rule.
            is_far = found is None or found[0].cost >= _TOO_HIGH * cost
            fall = -1.0 if found is None or is_far else 1.0 - found[0].cost / cost
            foreseen = (2.0 * slope - effect) / cost
            ratio = fall / foreseen if foreseen > 0.0 else 0.0
            self.adapt(ratio, 0.1 if is_far else _shrunk(fall, slope / cost), length)
            is_taken = found is not None and ratio >= _LEAST_RATIO
            if is_taken and found is not None:
                self.system, self.extra = found
                self.variables, self.is_first = trial, False
            status = self.met(fall, foreseen, ratio)
            if status == _MET_COST and stopping.rest < math.inf and is_taken:
                self.is_ending, status = True, None
            elif self.is_ending and not is_taken:
                status = _MET_COST
            if status is not None or is_taken:
                return status
        return _LIMIT

    def tried(self, variables: FloatArray) -> tuple[LinearSystem, Extra] | None:
        """Evaluate a trial; None where the model cannot be."""
        self.evaluations += 1
        try:
            system, extra = self.point_at(variables)
        except SimulationError:
            self.failed_trials += 1
            return None
        if system.cost < self.best[0].cost:
            self.best = (system, extra, variables)
        return system, extra

    def adapt(self, ratio: float, factor: float, length: float) -> None:
        """Make the trust region smaller or larger, as the trial has met what was foreseen."""
        if ratio <= 0.25:
            self.radius = factor * min(self.radius, length / 0.1)
            self.damping /= factor
        elif self.damping == 0.0 or ratio >= 0.75:
            self.radius = 2.0 * length
            self.damping *= 0.5

    def met(self, fall: float, foreseen: float, ratio: float) -> int | None:
        """Which of MINPACK's tests are met."""
        tolerance = self.stopping.cost_tolerance
        is_flat = abs(fall) <= tolerance and foreseen <= tolerance and ratio <= 2.0
        is_short = self.radius <= self.stopping.step_tolerance * self.size
        if is_flat or is_short:
            return _MET_BOTH if is_flat and is_short else _MET_COST if is_flat else _MET_STEP
        if abs(fall) <= _LAST_BIT and foreseen <= _LAST_BIT and ratio <= 2.0:
            return _MET_COST
        return _MET_STEP if self.radius <= _LAST_BIT * self.size else None


def _length(vector: FloatArray) -> float:
    """Length of a few numbers; NumPy's norm takes as long again to find out what they are."""
    return math.sqrt(float(vector @ vector))


def _shrunk(fall: float, slope: float) -> float:
    """Factor for a trust region that was too large: where a parabola has its minimum."""
    return 0.5 if fall >= 0.0 else max(0.5 * slope / (slope - 0.5 * fall), 0.1)


def _cosine(system: LinearSystem, held: NDArray[np.bool_]) -> float:
    """Largest cosine between the residuals and a column of the Jacobian that is not held."""
    lengths = np.maximum(system.lengths, 1e-300) * math.sqrt(system.cost)
    cosines = system.gradient / np.maximum(lengths, 1e-300)
    return largest_of(np.where(held, 0.0, cosines))


def _damped(
    steps: _DenseSteps | _BorderedSteps, slope: float, radius: float, damping: float
) -> tuple[float, Step]:
    """Return lambda and the step that is as long as the radius within a tenth (lmpar).

    ``slope`` is the length of the scaled gradient, D^-1 J^T r; ``damping`` the lambda before.
    """
    step = steps.step(0.0)
    excess = step.length - radius
    if excess <= _NEAR * radius:
        return 0.0, step
    low = excess / radius / step.shrinkage if steps.is_full_rank else 0.0
    high = slope / radius or _DWARF / min(radius, 0.1)
    damping = min(max(damping, low), high) or slope / step.length
    for trial in range(1, _MAX_TRIALS + 1):
        damping = damping or max(_DWARF, 1e-3 * high)
        step, before = steps.step(damping), excess
        excess = step.length - radius
        is_falling = low == 0.0 and excess <= before < 0.0
        if abs(excess) <= _NEAR * radius or is_falling or trial == _MAX_TRIALS:
            break
        if excess > 0.0:
            low = max(low, damping)
        else:
            high = min(high, damping)
        damping = max(low, damping + excess / radius / step.shrinkage)
    return damping, step


# Of a singular value of a Jacobian with columns of length 1.
_LAST_DIGIT = 1e-14


class Transformation(NamedTuple):
    """In which variables the steps are taken: u = ln y, or u = y/scale.

    With u = ln y a step is a relative change and y cannot change sign.

    Attributes
    ----------
    is_logarithmic : numpy.ndarray
        Shape (k,), of bool.
    scales : numpy.ndarray
        Shape (k,), size of each linear parameter; not used where the logarithm is.
    """

    is_logarithmic: NDArray[np.bool_]
    scales: FloatArray

    def pack(self, values: FloatArray) -> FloatArray:
        """Return u."""
        logarithms = np.log(np.where(self.is_logarithmic, values, 1.0))
        return np.where(self.is_logarithmic, logarithms, values / self.scales)

    def unpack(
        self, variables: FloatArray, bounds: tuple[FloatArray, FloatArray] | None = None
    ) -> FloatArray:
        """Return y; e^600 overflows nothing yet, and a model refuses it as a failed trial.

        A bound of y is met exactly, not as rounding leaves it.
        """
        powers = np.exp(np.minimum(np.maximum(variables, -600.0), 600.0))
        values = np.where(self.is_logarithmic, powers, variables * self.scales)
        if bounds is None:
            return values
        low, high = bounds
        values = np.where(variables <= self.pack(low), low, values)
        return np.where(variables >= self.pack(high), high, values)

    def slopes(self, values: FloatArray) -> FloatArray:
        """Return dy/du."""
        return np.where(self.is_logarithmic, values, self.scales)


def minimise(
    model: _Model[Extra],
    start: FloatArray,
    transformation: Transformation,
    stopping: Stopping = Stopping(),
    bounds: tuple[FloatArray, FloatArray] | None = None,
) -> Minimum[Extra]:
    """Minimise a sum of squares from a start.

    Parameters
    ----------
    model : callable
        From y, shape (k,), to residuals (n,), their derivative by y (n, k), and anything to be
        remembered. It raises `SimulationError` where it cannot be evaluated; numbers that are not
        finite count as that.
    start : numpy.ndarray
        Shape (k,), y.
    transformation : Transformation
        In which variables to step.
    stopping : Stopping
        When to end.
    bounds : tuple of numpy.ndarray, optional
        Least and largest y, shape (k,) each.

    Raises
    ------
    SimulationError
        When the model cannot be evaluated at the start.
    """

    def point_at(variables: FloatArray) -> tuple[LinearSystem, Extra]:
        values = transformation.unpack(variables, bounds)
        residuals, slopes, extra = model(values)
        with np.errstate(over="ignore", invalid="ignore"):
            cost = float(residuals @ residuals)
            jacobian = slopes * transformation.slopes(values)
            system = DenseSystem(residuals, jacobian)
            # A number that is none is in every sum after it.
            if not math.isfinite(cost + float(np.add.reduce(system.triangle, axis=None))):
                raise SimulationError(
                    f"no finite residuals or derivatives at {values}.", code="not-finite"
                )
        return system, extra

    low_high = bounds and (transformation.pack(bounds[0]), transformation.pack(bounds[1]))
    return iterate(point_at, transformation.pack(start), stopping, low_high)


def inverse_information(jacobian: FloatArray) -> FloatArray:
    """Return (J^T J)^-1, shape (k, k), without forming J^T J, which would halve the digits.

    Times the variance of independent residuals it is the covariance of u. Directions that the
    data do not see to the last digit get a variance that says so; a column of zeros gives
    infinity on the diagonal.

    Parameters
    ----------
    jacobian : numpy.ndarray
        Shape (n, k).
    """
    lengths = np.sqrt(np.sum(jacobian * jacobian, axis=0))
    is_seen = lengths > NO_LENGTH
    if is_seen.all():
        return _inverse_of_seen(jacobian, lengths)
    found = np.zeros((len(lengths), len(lengths)))
    found[~is_seen, ~is_seen] = math.inf
    found[np.ix_(is_seen, is_seen)] = _inverse_of_seen(jacobian[:, is_seen], lengths[is_seen])
    return found


def _inverse_of_seen(jacobian: FloatArray, lengths: FloatArray) -> FloatArray:
    """The same of columns that all have a length."""
    scaled = jacobian / lengths
    if len(scaled) > scaled.shape[1]:
        scaled = np.asarray(np.linalg.qr(scaled, mode="r"))
    _, values, directions = np.linalg.svd(scaled)
    roots = directions.T / np.maximum(values, _LAST_DIGIT) / lengths[:, None]
    return np.asarray(roots @ roots.T)
