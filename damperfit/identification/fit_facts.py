"""What a fit asks of its logs again and again, found once."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.one_speed import holds_one_speed, n_speeds
from damperfit.identification.weights import weights
from damperfit.statistics import variance_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["FitFacts"]


class FitFacts:
    """Facts of the logs of one setting, each found where it is first asked for.

    Parameters
    ----------
    traces : tuple of Trace
        The logs.
    """

    def __init__(self, traces: tuple[Trace, ...]) -> None:
        self.traces = traces

    @cached_property
    def deviation(self) -> float:
        """Standard deviation of all measured forces that are compared, N."""
        forces = [one.force[one.compared] for one in self.traces]
        return math.sqrt(variance_of(forces[0] if len(forces) == 1 else np.concatenate(forces)))

    @cached_property
    def n_samples(self) -> int:
        """Samples compared."""
        return sum(one.n_samples for one in self.traces)

    @cached_property
    def weights(self) -> tuple[FloatArray | None, ...]:
        """What the residuals of each log are multiplied by, as `weights` has it."""
        return weights(self.traces)

    @cached_property
    def holds_one_speed(self) -> bool:
        """Whether nearly all samples are at one speed."""
        return holds_one_speed(self.traces)

    @cached_property
    def n_speeds(self) -> int | None:
        """How many speeds the stretches hold; None where one holds none."""
        return n_speeds(self.traces)
