"""Descents on settled cycles: for laws to be compared, and for a start near the minimum.

The misfit is that of every fit, each stretch weighed by its own noise, steps in logarithms; but
what runs into an edge of its plausible range stays there, and the whole logs are looked at only by
who wants their word.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.minimiser import Minimum, Transformation, minimise
from damperfit.identification.settled import settled
from damperfit.identification.trust_region import Stopping
from damperfit.identification.weights import weights
from damperfit.simulation.motion import motion_of

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.damper.quantity import Quantity
    from damperfit.identification.settled import SettledLogs
    from damperfit.recording import Trace
    from damperfit.simulation import SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = [
    "COMPARING",
    "LawMisfit",
    "best_fitting",
    "best_of_starts",
    "is_as_expected",
    "vanishes_below",
]

# Laws are compared by factors of their MSE: a fall of a few in ten thousand changes nothing.
COMPARING = Stopping(
    cost_tolerance=3e-4, step_tolerance=1e-4, max_evaluations=60, rest=math.inf, near=5e-3
)
# Starts that are followed for a few evaluations before the best is followed to its end: so many, or
# one beside those that are known.
_TRIED = 3
_SHORT = Stopping(cost_tolerance=1e-2, step_tolerance=1e-3, max_evaluations=8, rest=math.inf)
# Quantities that, beside friction, do nothing when they are small; stiffnesses and resistances do
# when large.
_VANISHING = (
    "play", "lag", "moving_mass", "drag", "_width", "_lift", "_port", "_leak", "free_gas",
    "presliding", "breakaway", "seal_area", "turning_speed",
)  # fmt: skip
# Of the force's deviation: starts with offsets or frictions that are so far apart are two places.
_APART = 0.1
# Times the scatter between cycles: a descent that is there needs no other start.
_AS_EXPECTED = 2.0

_OF_VALVES = ("_bleed", "_opening", "_slope")
# Shares of a bleed's pressure: through an orifice, and through a gap in layers.
_BLEED, _LEAK = "bleed", "leak"

# Of the force's deviation: what a step may err by while laws are compared on settled cycles. It
# moves no quantity by a third of its error.
_COARSE = 2e-4


@dataclass(frozen=True, slots=True, eq=False)
class LawMisfit:
    """A law, the logs of a setting, and what moves.

    Attributes
    ----------
    model : Model
        The law.
    traces : tuple of Trace
        Logs of one setting.
    free : tuple of str
        What moves.
    solver : SolverOptions
        How exactly to integrate.
    cycles : SettledLogs, optional
        What stands for the logs; None: they do themselves.
    cancelled : callable
        Asked before each evaluation.
    """

    model: Model
    traces: tuple[Trace, ...]
    free: tuple[str, ...]
    solver: SolverOptions
    cycles: SettledLogs | None = None
    cancelled: Callable[[], bool] = lambda: False

    @property
    def deviation(self) -> float:
        """Standard deviation of all measured forces that are compared, N."""
        return float(np.std(np.concatenate([t.force[t.compared] for t in self.traces])))

    @property
    def scale(self) -> float:
        """What makes the sum of squares of a useless law 1."""
        n = sum(trace.n_samples for trace in self.traces)
        return 1.0 / (self.deviation * math.sqrt(n))

    @property
    def scatter(self) -> float:
        """The sum of squares that no law takes away, as far as it is known."""
        return 0.0 if self.cycles is None else self.cycles.scatter * self.scale**2

    def on_cycles(self) -> LawMisfit:
        """Return the misfit of the settled cycles, where the logs have them."""
        tolerance = max(self.solver.tolerance, _COARSE * self.deviation)
        solver = replace(self.solver, tolerance=tolerance)
        cycles = settled(self.traces)
        return self if cycles is None else replace(self, solver=solver, cycles=cycles)

    def is_at_edge(self, values: Values, name: str) -> bool:
        """Whether a quantity has run out of its plausible range."""
        low, high = self.model.quantity(name).plausible
        return not low < getattr(values, name) < high

    def absent(self, name: str) -> float:
        """Return the value at which a part does next to nothing, of a part that may be absent."""
        one = self.model.quantity(name)
        low, high = one.plausible
        stroke, _, part = name.rpartition("_")
        is_all = part == _LEAK and f"{stroke}_{_BLEED}" not in self.model.names
        return low if vanishes_below(one) and not is_all else high

    def absent_beside(self, known: Collection[str]) -> dict[str, float]:
        """Return values of what a law has beside some quantities at which it does nothing to them.

        A bleed that has its laminar share does without an orifice where that is wide, and not where
        it is closed.

        Parameters
        ----------
        known : collection of str
            What there is without it.
        """
        found = {name: self.absent(name) for name in self.free if name not in known}
        for name in found:
            stroke, _, part = name.rpartition("_")
            if part == _BLEED and f"{stroke}_{_LEAK}" in known:
                found[name] = self.model.quantity(name).plausible[0]
        return found

    def cost(self, values: Values) -> float:
        """Return the sum of squares at a point, without derivatives.

        Raises
        ------
        SimulationError
            The law cannot be simulated there.
        """
        rest = np.hstack(self.rows(values, ()))[0] * self.scale
        return float(rest @ rest)

    def descend(self, start: Values, stopping: Stopping) -> Minimum[Values]:
        """Minimise from a start.

        Raises
        ------
        SimulationError
            The law cannot be simulated at the start.
        """
        scale, deviation = self.scale, self.deviation
        quantities = [self.model.quantity(name) for name in self.free]
        low, high = (np.array([one.plausible[k] for one in quantities]) for k in (0, 1))

        def residuals(numbers: FloatArray) -> tuple[FloatArray, FloatArray, Values]:
            within = np.minimum(np.maximum(numbers, low), high)
            values = start.replace(dict(zip(self.free, within.tolist(), strict=True)))
            whole = np.hstack(self.rows(values, self.free))
            whole *= scale
            if (within != numbers).any():  # beyond the edge nothing changes any more
                whole[1:][within != numbers] = 0.0
            return whole[0], whole[1:].T, values

        transformation = Transformation(
            np.array([one.is_logarithmic for one in quantities], dtype=bool),
            np.array([deviation if not one.is_logarithmic else 1.0 for one in quantities]),
        )
        at = np.array([getattr(start, name) for name in self.free])
        return minimise(residuals, np.clip(at, low, high), transformation, stopping)

    def glimpse(self, start: Values) -> Minimum[Values]:
        """Minimise for a few evaluations.

        Raises
        ------
        SimulationError
            The law cannot be simulated at the start.
        """
        return self.descend(start, _SHORT)

    def rows(self, values: Values, names: Sequence[str]) -> list[FloatArray]:
        """Residuals and their derivatives by some names, weighed, N: blocks of shape (1 + k, n)."""
        if self.cancelled():
            raise FitCancelledError("stopped while a fit was running.")
        found = self._whole(values, names) if self.cycles is None else self._settled(values, names)
        if not all(np.isfinite(rows).all() for rows in found):
            raise SimulationError("simulation failed: the force is not a number.")
        return found

    def _settled(self, values: Values, names: Sequence[str]) -> list[FloatArray]:
        assert self.cycles is not None
        found = [
            one.rows(
                self.model.simulate(values, one.motion, sensitivities=names, options=self.solver)
            )
            for one in self.cycles.cycles
        ]
        rest = np.zeros((1 + len(names), 1))
        rest[0] = math.sqrt(self.cycles.scatter)
        return [*found, rest]

    def _whole(self, values: Values, names: Sequence[str]) -> list[FloatArray]:
        found = []
        for trace, weight in zip(self.traces, weights(self.traces), strict=True):
            response = self.model.simulate(
                values, motion_of(trace), sensitivities=names, options=self.solver
            )
            rows = np.stack([response.force, *response.sensitivities.values()])
            rows = apply_filter(trace.model_filter, rows)[:, trace.compared]
            rows[0] -= trace.force[trace.compared]
            found.append(rows if weight is None else rows * weight)
        return found


def vanishes_below(one: Quantity) -> bool:
    """Whether a quantity does nothing when it is small; others do when they are large.

    Parameters
    ----------
    one : Quantity
        Of a damper of valves, a part that may be absent.
    """
    return one.is_friction or one.name.endswith(_VANISHING)


def is_as_expected(misfit: LawMisfit, ended: Minimum[Values]) -> bool:
    """Whether a descent has left about what differs by cycle, and needs no other start.

    Parameters
    ----------
    misfit : LawMisfit
        What is fitted.
    ended : Minimum
        Where it has ended.
    """
    return ended.point.cost <= _AS_EXPECTED * misfit.scatter


def best_of_starts(
    misfit: LawMisfit,
    starts: Sequence[Values],
    *,
    known: int = 0,
    hopeless: float = math.inf,
    is_thorough: bool = False,
) -> Minimum[Values]:
    """Return where the best of some starts leads.

    Those that fit best, with unlike offsets or frictions, are followed for a few evaluations, the
    best of them to its end; where it loses a bleed or a blow-off there, the next start is followed
    too.

    Parameters
    ----------
    misfit : LawMisfit
        What is fitted.
    starts : sequence of Values
        Where to start from.
    known : int
        So many of the first starts are followed however badly they fit.
    hopeless : float
        Where the few evaluations leave more than this, nothing is followed to its end.
    is_thorough : bool
        Whether the others are followed to their ends too, until one leaves about what differs by
        cycle: after a few evaluations a wrong valley may look better than the right one.

    Raises
    ------
    SimulationError
        The law cannot be simulated at any of them.
    """
    ranked = [*starts[:known], *_in_turn(misfit, best_fitting(misfit, starts[known:]))]
    looks: list[Minimum[Values]] = []
    many = known + 1 if known else _TRIED
    for start in ranked[:many]:
        with suppress(SimulationError):
            looks.append(misfit.descend(start, _SHORT))
            if is_as_expected(misfit, looks[-1]):
                break
    if not looks:
        raise SimulationError(f"{misfit.model.name} cannot be simulated from any of its starts.")
    spent = sum(one.evaluations for one in looks)
    best, *others = sorted(looks, key=lambda one: one.point.cost)
    if best.point.cost > hopeless:
        return replace(best, evaluations=spent)
    ended = misfit.descend(best.point.extra, COMPARING)
    spent += ended.evaluations
    for look in others if is_thorough else ():
        if is_as_expected(misfit, ended):
            break
        with suppress(SimulationError):
            other = misfit.descend(look.point.extra, COMPARING)
            spent += other.evaluations
            ended = min(ended, other, key=lambda one: one.point.cost)
    left = ranked[many:]
    if left and _lost_a_valve(misfit, ended):
        last = _descended(misfit, left[0])
        if last is not None:
            spent += last.evaluations
            ended = min(ended, last, key=lambda one: one.point.cost)
    return replace(ended, evaluations=spent)


def _in_turn(misfit: LawMisfit, ranked: list[Values]) -> list[Values]:
    """Starts in the order in which they are followed: the best, then the best that is none of it.

    An offset or a friction that hides a preload fits best at the start and leads nowhere else.
    """
    if len(ranked) < 2:
        return ranked
    of = {name: misfit.model.quantity(name) for name in misfit.free}
    forces = [name for name, one in of.items() if one.is_offset or one.is_friction]
    least = _APART * misfit.deviation

    def is_apart(one: Values, other: Values) -> bool:
        return any(abs(getattr(one, name) - getattr(other, name)) > least for name in forces)

    first: list[Values] = []
    for one in ranked:
        if all(is_apart(one, other) for other in first):
            first.append(one)
    return [*first, *(one for one in ranked if one not in first)]


def _lost_a_valve(misfit: LawMisfit, ended: Minimum[Values]) -> bool:
    """Whether a bleed or a blow-off ran out of its range, and more is left than differs by cycle.

    The starts that fit best may share what is wrong in them, an offset that hides a blow-off.
    """
    if is_as_expected(misfit, ended):
        return False
    return any(
        name.endswith(_OF_VALVES) and misfit.is_at_edge(ended.point.extra, name)
        for name in misfit.free
    )


def _descended(misfit: LawMisfit, start: Values) -> Minimum[Values] | None:
    try:
        return misfit.descend(start, COMPARING)
    except SimulationError:
        return None


def best_fitting(misfit: LawMisfit, starts: Sequence[Values]) -> list[Values]:
    """Return starts by how well they fit, the best first; what cannot be simulated is left out."""
    if len(starts) < 2:
        return list(starts)
    found = []
    for place, start in enumerate(starts):
        try:
            found.append((misfit.cost(start), place, start))
        except SimulationError:
            continue
    return [start for _, _, start in sorted(found, key=lambda one: one[:2])]
