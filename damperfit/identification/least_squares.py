r"""Least squares: the one loop of all fits and the linear algebra of its steps.

Nothing here knows of dampers. A model gives residuals r with their Jacobian J by the variables u
as a `LinearSystem`; a step p minimises ``|r + J p|^2 + lambda |D p|^2`` for lengths D of the
variables, by orthogonal factors of J: J^T J would halve the digits. Of many settings each is
`reduced` to a triangle of as many rows as it has variables before all are one system: eliminating
each setting's own variables first saves no time up to 100 settings.

The trust region is MINPACK's, scaled by the lengths of the Jacobian's columns (J. J. More, "The
Levenberg-Marquardt algorithm: implementation and theory", 1978). Bounds have one rule: a step is
cut off at them, and a variable at its bound is held as long as the cost falls only beyond it. Run
over the nonlinear regression problems of NIST by ``python -m tests.certificate``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from damperfit.arrays import FloatArray
from damperfit.compiled_core import compiled_core
from damperfit.errors import SimulationError
from damperfit.statistics import largest_of

Extra = TypeVar("Extra")

# A column shorter than this has a variance beyond the largest number: as good as zeros.
NO_LENGTH = 1e-130


class Step(NamedTuple):
    """A damped step p."""

    change: FloatArray  # p, (k,)
    length: float  # |D p|
    effect: float  # |J p|^2; without damping the fall of |r|^2 that is promised
    shrinkage: float  # -d ln |D p| / d lambda


class LinearSystem:
    """One block of residuals (n,), their Jacobian (n, k); `held` variables stay where they are."""

    def __init__(
        self, residuals: FloatArray, jacobian: FloatArray, held: NDArray[np.bool_] | None = None
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

    def scaled(self, scale: FloatArray) -> _Steps:
        """The solver for D; one singular value decomposition serves every lambda."""
        return _Steps(self._rows, self._right, scale, self._moving)

    def without(self, held: NDArray[np.bool_]) -> LinearSystem:
        """The system in which some variables do nothing."""
        return LinearSystem(self._right, np.where(held, 0.0, self._rows), held)

    def moved(self, change: FloatArray) -> LinearSystem:
        """Return the system after a step, as far as it is linear."""
        return LinearSystem(self._right + self._rows @ change, self._rows)

    def effect(self, change: FloatArray) -> float:
        """Return |J p|^2."""
        moved = self._rows @ change
        return float(moved @ moved)


class _Steps:
    def __init__(
        self, rows: FloatArray, right: FloatArray, scale: FloatArray, seen: NDArray[np.bool_]
    ) -> None:
        columns = rows / scale
        left, self._values, directions = np.linalg.svd(columns[:, seen], full_matrices=False)
        self._directions = np.zeros((len(self._values), len(scale)))
        self._directions[:, seen] = directions
        self._pull, self._scale = left.T @ right, scale
        is_whole = len(self._values) == len(scale)
        self.is_full_rank = bool(is_whole and np.all(self._values[-1:] > NO_LENGTH))

    def step(self, damping: float) -> Step:
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


def reduced(residuals: FloatArray, jacobian: FloatArray) -> FloatArray:
    """(J, r) as a triangle (k + 1, k + 1), of fewer rows where n is less: the same products."""
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
    """R of a QR factorisation."""
    return np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)


def _lengths(rows: FloatArray) -> FloatArray:
    """Lengths of columns of few rows, also where their squares overflow."""
    return np.array([math.hypot(*column) for column in rows.T.tolist()])


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
# How a minimisation ended, as `scipy.optimize.least_squares` has it.
_LIMIT, _MET_GRADIENT, _MET_COST, _MET_STEP, _MET_BOTH = 0, 1, 2, 3, 4


class Stopping(NamedTuple):
    """When a minimisation ends, and how far it may go at once."""

    cost_tolerance: float = 1e-8  # relative fall of the cost, met and foreseen, at which it ends
    step_tolerance: float = 1e-9  # likewise for the relative size of the steps
    max_evaluations: int = 100
    # Relative length of the full step that may be left when the cost has ceased to fall: where the
    # steps become shorter slowly, the iteration goes on. Those of the sample runs end below 2e-9.
    rest: float = 1e-8
    least_gain: float = 0.0  # fall of the cost that a full step must promise to be tried at all
    least_share: float = 0.0  # the same as a share of the cost
    longest_step: float = math.inf  # largest change of a variable in one step
    near: float = 0.0  # largest change in a full step that the caller takes unseen


@dataclass(frozen=True, slots=True, eq=False)
class Minimum(Generic[Extra]):
    """The end of a fit; `status` is as `scipy.optimize.least_squares` has it, 0 is a limit."""

    variables: FloatArray  # u of the best point found, (k,)
    system: LinearSystem  # residuals and Jacobian there
    extra: Extra  # what the model remembered of it
    evaluations: int
    failed_trials: int
    status: int
    is_held: NDArray[np.bool_]  # at a bound, beyond which alone the cost falls

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return self.system.cost

    def promised(self, least: float | None = None) -> float:
        """Fall of the cost that the full step promises; directions below a share are left out."""
        lengths = np.maximum(self.system.lengths, 1e-300)
        columns, pull = (self.system.triangle / lengths).T, self.system.gradient / lengths
        along = np.linalg.lstsq(columns, pull, rcond=least)[0]
        return float(along @ along)

    @property
    def gradient_cosine(self) -> float:
        """Largest cosine between residuals and a column of the Jacobian; 0 at a minimum."""
        return _cosine(self.system, self.is_held)


def iterate(  # noqa: C901, PLR0912, PLR0915 - MINPACK's lmder, which reads best whole
    point_at: Callable[[FloatArray], tuple[LinearSystem, Extra]],
    start: FloatArray,
    stopping: Stopping,
    bounds: tuple[FloatArray, FloatArray] | None = None,
) -> Minimum[Extra]:
    """Minimise a sum of squares in the variables u, (k,); the loop behind every fit.

    `point_at` gives a `LinearSystem` and anything to be remembered, or raises `SimulationError`,
    which is passed on at the start.
    """
    low, high = bounds or (-math.inf, math.inf)
    variables = np.minimum(np.maximum(start, low), high)
    system, extra = point_at(variables)
    best = system, extra, variables  # the least sum seen, also where the fall was no step's worth
    scale = np.where(system.lengths > NO_LENGTH, system.lengths, 1.0)
    evaluations, failed_trials = 1, 0
    radius = damping = 0.0
    is_first, is_ending = True, False
    status = None if len(start) else _MET_GRADIENT
    while status is None:
        scale = np.maximum(scale, system.lengths)
        held = _held(variables, system, low, high)
        rest = system.without(held) if held.any() else system
        if _cosine(system, held) <= _RIGHT_ANGLE:
            status = _MET_GRADIENT
            break
        steps, size = rest.scaled(scale), _length(scale * variables)
        if is_first:
            radius = _FIRST_RADIUS * size or _FIRST_RADIUS
        least = max(stopping.least_gain, stopping.least_share * system.cost)
        if least > 0.0 or stopping.near > 0.0 or is_ending:
            full = steps.step(0.0)
            is_near = full.effect < least or largest_of(full.change) < stopping.near
            if is_near or (is_ending and full.length <= stopping.rest * size):
                status = _MET_COST
                break
        is_taken, gradient, cost = False, rest.gradient, system.cost
        while status is None and not is_taken:
            if evaluations >= stopping.max_evaluations:
                status = _LIMIT
                break
            damping, step = _damped(steps, _length(gradient / scale), radius, damping)
            share = min(1.0, stopping.longest_step / max(largest_of(step.change), 1e-300))
            aim = variables + share * step.change
            trial = np.minimum(np.maximum(aim, low), high)
            slope, effect = step.effect + damping * step.length**2, share**2 * step.effect
            slope, length = share * slope, share * step.length
            if (trial != aim).any():
                change = trial - variables
                slope, effect = -float(gradient @ change), rest.effect(change)
                length = _length(scale * change)
            if is_first:
                radius = min(radius, length)
            evaluations += 1
            tried = None
            try:
                tried = point_at(trial)
            except SimulationError:
                failed_trials += 1
            if tried is not None and tried[0].cost < best[0].cost:
                best = (*tried, trial)
            # Where there is no model, a wall of finite height: the region shrinks by a rule.
            is_far = tried is None or tried[0].cost >= _TOO_HIGH * cost
            fall = -1.0 if tried is None or is_far else 1.0 - tried[0].cost / cost
            foreseen = (2.0 * slope - effect) / cost
            ratio = fall / foreseen if foreseen > 0.0 else 0.0
            if ratio <= 0.25:
                shrunk = 0.1 if is_far else _shrunk(fall, slope / cost)
                radius, damping = shrunk * min(radius, length / 0.1), damping / shrunk
            elif damping == 0.0 or ratio >= 0.75:
                radius, damping = 2.0 * length, 0.5 * damping
            if tried is not None and ratio >= _LEAST_RATIO:
                is_taken, is_first = True, False
                (system, extra), variables = tried, trial
            size, tolerance = _length(scale * variables), stopping.cost_tolerance
            is_flat = abs(fall) <= tolerance and foreseen <= tolerance and ratio <= 2.0
            is_short = radius <= stopping.step_tolerance * size
            if is_flat or is_short:
                status = _MET_BOTH if is_flat and is_short else _MET_COST if is_flat else _MET_STEP
            elif abs(fall) <= _LAST_BIT and foreseen <= _LAST_BIT and ratio <= 2.0:
                status = _MET_COST
            elif radius <= _LAST_BIT * size:
                status = _MET_STEP
            if status == _MET_COST and stopping.rest < math.inf and is_taken:
                is_ending, status = True, None
            elif is_ending and not is_taken:
                status = _MET_COST
    system, extra, variables = best
    held = _held(variables, system, low, high)
    return Minimum(variables, system, extra, evaluations, failed_trials, status, held)


def _held(
    variables: FloatArray, system: LinearSystem, low: FloatArray | float, high: FloatArray | float
) -> NDArray[np.bool_]:
    """Which variables are at a bound beyond which alone the cost falls."""
    is_low = (variables <= low) & (system.gradient >= 0.0)
    return np.asarray(is_low | ((variables >= high) & (system.gradient <= 0.0)))


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


def _damped(steps: _Steps, slope: float, radius: float, damping: float) -> tuple[float, Step]:
    """Return lambda and the step that is as long as the radius within a tenth (lmpar)."""
    # The slope is the length of the scaled gradient, D^-1 J^T r; the damping the lambda before.
    step = steps.step(0.0)
    excess = step.length - radius
    if excess <= _NEAR * radius:
        return 0.0, step
    low = excess / radius / step.shrinkage if steps.is_full_rank else 0.0
    high = slope / radius
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
    """In which variables the steps are taken: u = ln y, a relative change, or u = y/scale."""

    is_logarithmic: NDArray[np.bool_]  # (k,)
    scales: FloatArray  # (k,), size of each linear parameter

    def pack(self, values: FloatArray) -> FloatArray:
        """The variables of y."""
        logarithms = np.log(np.where(self.is_logarithmic, values, 1.0))
        return np.where(self.is_logarithmic, logarithms, values / self.scales)

    def unpack(
        self, variables: FloatArray, bounds: tuple[FloatArray, FloatArray] | None = None
    ) -> FloatArray:
        """Return y; e^600 overflows nothing yet. A bound is met exactly, whatever rounding."""
        powers = np.exp(np.minimum(np.maximum(variables, -600.0), 600.0))
        values = np.where(self.is_logarithmic, powers, variables * self.scales)
        if bounds is None:
            return values
        low, high = bounds
        values = np.where(variables <= self.pack(low), low, values)
        return np.where(variables >= self.pack(high), high, values)

    def slopes(self, values: FloatArray) -> FloatArray:
        """dy/du."""
        return np.where(self.is_logarithmic, values, self.scales)


def finite_system(residuals: FloatArray, jacobian: FloatArray) -> LinearSystem:
    """One block of residuals, all numbers of which are finite; else a failed simulation."""
    with np.errstate(over="ignore", invalid="ignore"):
        system = LinearSystem(residuals, jacobian)
        # A number that is none is in every sum after it.
        is_finite = math.isfinite(system.cost + float(np.add.reduce(system.triangle, axis=None)))
    if not is_finite:
        raise SimulationError("no finite residuals or derivatives.", code="not-finite")
    return system


def inverse_information(jacobian: FloatArray) -> FloatArray:
    """(J^T J)^-1, (k, k), without forming J^T J; of a column of zeros infinity on the diagonal."""
    lengths = np.sqrt(np.sum(jacobian * jacobian, axis=0))
    is_seen = lengths > NO_LENGTH
    scaled = jacobian[:, is_seen] / lengths[is_seen]
    if len(scaled) > scaled.shape[1]:
        scaled = _triangle(scaled)
    _, values, directions = np.linalg.svd(scaled)
    roots = directions.T / np.maximum(values, _LAST_DIGIT) / lengths[is_seen, None]
    inverse = np.diag(np.where(is_seen, 0.0, math.inf))
    inverse[np.ix_(is_seen, is_seen)] = roots @ roots.T
    return inverse


class Quadratic(NamedTuple):
    """A sum of squares near a point, as its Jacobian has it: where variables are tied."""

    cost: float  # at the point
    at: FloatArray  # its variables, (n,)
    slope: FloatArray  # J^T r, (n,)
    curvature: FloatArray  # J^T J, (n, n)

    def tied(self, unknowns: Sequence[Any]) -> tuple[float, FloatArray]:
        """Return the least sum where variables that are one unknown are equal, and all of them."""
        numbers = {unknown: k for k, unknown in enumerate(dict.fromkeys(unknowns))}
        places, n = np.array([numbers[u] for u in unknowns], dtype=np.intp), len(numbers)
        pairs = (n * places[:, None] + places).ravel()
        whole = np.bincount(pairs, self.curvature.ravel(), n * n).reshape(n, n)
        right = np.bincount(places, self.curvature @ self.at - self.slope, n)
        variables = np.linalg.solve(whole, right)[places]
        away = variables - self.at
        return self.cost + float(away @ (2.0 * self.slope + self.curvature @ away)), variables
