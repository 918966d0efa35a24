"""What a descent sees at the points that it tries: rough from afar, every sample when near.

After a long step the misfit is far above its minimum, and where the next step leads is as well told
by every fourth or second sample of the mean cycles. Sums of squares agree, for what the filter
passes is slow beside all of these; how far the minima lie apart shows in short steps alone, which
are looked at closely.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.evaluation import evaluate, transformation, with_values
from damperfit.identification.plausible import is_within, kept_within
from damperfit.statistics import largest_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from damperfit.damper.model import Values
    from damperfit.identification.descent import Misfit

    FloatArray = NDArray[np.float64]

__all__ = ["Looks", "Seen"]

# Largest change of a variable from which on a step ends far away. Gauss and Newton's next one is
# its square, so that a last step of half a per cent is not seen roughly.
_FAR = 0.1
# The integrator's tolerance there; below it samples, not errors, set the length of its steps.
_ROUGH = 30.0


@dataclass(frozen=True, slots=True)
class Seen:
    """What is remembered of a point: with the derivatives by all that is free, held or not."""

    parameters: Values
    is_cavitating: bool
    slopes: FloatArray
    is_rough: bool = False


class Looks:
    """The model of one descent, from values to residuals with their derivatives.

    Parameters
    ----------
    misfit : Misfit
        What is fitted.
    moving : tuple of str
        Values that move; what else is free stays as at the start.
    start : Values
        Within the plausible ranges.

    Attributes
    ----------
    beyond : int
        Trials out of the plausible range, which are failed ones.
    """

    def __init__(self, misfit: Misfit, moving: tuple[str, ...], start: Values) -> None:
        self.beyond = 0
        self._misfit, self._moving, self._start = misfit, moving, start
        self._places = [misfit.free.index(name) for name in moving]
        self._variables = transformation(misfit, moving)
        self._last: FloatArray | None = None
        self._is_close = misfit.cycles is None

    def __call__(self, values: FloatArray) -> tuple[FloatArray, FloatArray, Seen]:
        """Return residuals (n,), their derivatives by what moves (n, k), and what to remember.

        Raises
        ------
        SimulationError
            The point is out of the plausible range, or the model cannot be integrated there.
        FitCancelledError
            The caller asked to stop.
        """
        misfit, moving = self._misfit, self._moving
        if misfit.cancelled():
            raise FitCancelledError("stopped while a fit was running.")
        parameters = with_values(self._start, moving, values)
        if not is_within(parameters, moving):
            self.beyond += 1
            raise SimulationError("a parameter is out of its plausible range.")
        parameters = kept_within(parameters, moving)
        rougher = self._rougher(values)
        residuals, slopes, is_cavitating = evaluate(rougher or misfit, parameters, misfit.scale)
        seen = Seen(parameters, is_cavitating, slopes, rougher is not None)
        return residuals, slopes if moving == misfit.free else slopes[:, self._places], seen

    def look_closely(self) -> None:
        """Look closely from now on, however long a step is."""
        self._is_close = True

    def _rougher(self, values: FloatArray) -> Misfit | None:
        """The misfit to look at after a long step; None where each sample counts."""
        if self._is_close:
            return None
        here, last = self._variables.pack(values), self._last
        self._last = here
        if last is None or not largest_of(here - last) > _FAR:
            return None
        return self._from_afar

    @cached_property
    def _from_afar(self) -> Misfit | None:
        cycles = self._misfit.cycles and self._misfit.cycles.from_afar
        if cycles is None:
            return None
        solver = replace(self._misfit.solver, tolerance=_ROUGH * self._misfit.solver.tolerance)
        return replace(self._misfit, cycles=cycles, solver=solver)
