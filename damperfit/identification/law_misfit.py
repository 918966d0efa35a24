"""A candidate structure on the logs of one setting, for comparing structures."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.fit_problem import FitProblem, values_of, with_values
from damperfit.identification.least_squares import Minimum, Stopping, minimise
from damperfit.identification.starts import (
    COMPARING,
    best_fitting,
    best_of_starts,
    is_as_expected,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Values

    FloatArray = NDArray[np.float64]

__all__ = [
    "COMPARING",
    "LawMisfit",
    "best_fitting",
    "best_of_starts",
    "is_as_expected",
]


class LawMisfit(FitProblem):
    """The problem of a structure of valves, with what its parts are where they do nothing.

    What runs beyond its range stays there for good: the search setting by setting was tuned to
    that. With the bounds of every other fit it takes other paths (bench_numbers: of other laws 2
    it loses the blow-off in compression, held out 0.14 to 0.67 %).

    A rig's cell is zeroed anew between the logs of a setting: where the offset is free, each log
    but the first has its own beside it, which is eliminated.
    """

    __slots__ = ()

    @property
    def offset(self) -> str | None:
        """The force offset that each log has for itself; None where logs have one in common."""
        if len(self.traces) < 2:
            return None
        return next((name for name in self.free if self.model.quantity(name).is_offset), None)

    def evaluate(self, values: Values, names: Sequence[str]) -> tuple[FloatArray, bool]:
        """Return rows of residuals and derivatives, and whether a chamber is empty."""
        offset = self.offset
        if offset is None:
            return super().evaluate(values, names)
        asked = names if offset in names else (*names, offset)
        rows, is_empty = super().evaluate(values, asked)
        along = rows[1 + list(asked).index(offset)].copy()
        ends = np.cumsum(self._lengths())
        for first, last in pairwise(ends.tolist()):
            part, unit = rows[:, first:last], along[first:last]
            part -= np.outer(part @ unit / max(float(unit @ unit), 1e-300), unit)
        return rows[: 1 + len(names)], is_empty

    def _lengths(self) -> list[int]:
        """How many residuals each log has."""
        if self.cycles is None:
            return [trace.n_samples for trace in self.traces]
        lengths = iter(len(one.force) for one in self.cycles.cycles)
        return [sum(next(lengths) for _ in trace.stretches) for trace in self.traces]

    def descend(self, start: Values, stopping: Stopping) -> Minimum[Values]:
        """Minimise from a start.

        Raises
        ------
        SimulationError
            The structure cannot be simulated at the start.
        """
        quantities = [self.model.quantity(name) for name in self.free]
        low, high = (np.array([one.plausible[k] for one in quantities]) for k in (0, 1))

        def residuals(numbers: FloatArray) -> tuple[FloatArray, FloatArray, Values]:
            within = np.minimum(np.maximum(numbers, low), high)
            values = with_values(start, self.free, within)
            rows = self.rows(values, self.free) * self.scale
            rows[1:][within != numbers] = 0.0  # beyond the edge nothing changes any more
            return rows[0], rows[1:].T, values

        numbers = np.clip(values_of(self.free, start), low, high)
        return minimise(residuals, numbers, self.variables(self.free), stopping)

    def absent(self, name: str) -> float:
        """Return the value at which a part does next to nothing, of a part that may be absent."""
        return self.model.quantity(name).vanishes_at

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
            one = self.model.quantity(name)
            if one.part == "bleed" and one.beside("leak") in known:
                found[name] = one.plausible[0]
        return found
