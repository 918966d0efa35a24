"""One log beside the fit of its setting, and what is kept of its last simulation.

Judging, the responses' file and the characteristics are all of one simulation at the values that a
fit ended at. It is kept with the fit, and made anew where anything of it has changed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.identification.model_versus_log import SimulatedLog, compare
from damperfit.simulation import Response, motion_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification.settled import SettledCycle
    from damperfit.recording import Trace
    from damperfit.simulation import SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = ["LogFit", "SeenLog"]


@dataclass(frozen=True, slots=True, eq=False)
class SeenLog:
    """A log simulated with the values that a fit ended at, kept for those who come after it.

    Attributes
    ----------
    parameters, trace, damper, solver
        What was simulated.
    force : numpy.ndarray
        Shape (n,), behind the trace's model filter, N.
    pressures : numpy.ndarray
        Shape (3, n), Pa, in single precision: of every log of a run no more is kept than 50 bytes a
        sample, and 0.03 Pa are less than the integrator's error. An empty chamber stays empty.
    cycles : tuple of SettledCycle
        Of each stretch, where the fit has gone down on them.
    """

    parameters: Values
    trace: Trace
    damper: Model
    solver: SolverOptions
    force: FloatArray
    pressures: NDArray[np.float32]
    cycles: tuple[SettledCycle, ...] = ()

    def is_of(self, parameters: Values, trace: Trace, damper: Model, solver: SolverOptions) -> bool:
        """Whether a simulation of this would be that one again."""
        same_log = self.trace is trace
        same_model = self.damper is damper or self.damper == damper
        return same_log and same_model and self.solver == solver and self.parameters == parameters

    @property
    def comparison(self) -> SimulatedLog:
        """The comparison again; without masses, sensitivities and what is before the filter."""
        motion = motion_of(self.trace)
        n = len(self.force)
        response = Response(
            time=motion.start_time + motion.interval * np.arange(n, dtype=np.float64),
            displacement=motion.displacement,
            velocity=motion.velocity,
            force=np.empty(0),
            pressures=self.pressures.astype(np.float64),
            masses=np.empty((2, 0)),
        )
        return SimulatedLog(response, self.force, np.empty((0, n)))


@dataclass(frozen=True, slots=True, eq=False)
class LogFit:
    """How one log of a setting is met by the setting's parameters.

    Attributes
    ----------
    trace : Trace
        The log as compared.
    mse_percent : float
        Eq. (22) over the log's steady whole cycles.
    noise_floor_percent : float
        What scatter between the cycles alone costs in the same measure; NaN for a single cycle.
    stretch_mse_percent : tuple of float
        Eq. (22) over each stretch of the log alone, by the stretch's own variance.
    seen : SeenLog or None
        The log simulated with the fitted values, for those who judge and write it.
    """

    trace: Trace
    mse_percent: float
    noise_floor_percent: float
    stretch_mse_percent: tuple[float, ...] = ()
    seen: SeenLog | None = None

    def cycles_of(
        self, parameters: Values, damper: Model, solver: SolverOptions
    ) -> tuple[SettledCycle, ...]:
        """Return the mean cycles that the fit went down on; none where it ended at other values."""
        kept = self.seen
        is_kept = kept is not None and kept.is_of(parameters, self.trace, damper, solver)
        return kept.cycles if kept is not None and is_kept else ()

    def compared(self, parameters: Values, damper: Model, solver: SolverOptions) -> SimulatedLog:
        """Return the log beside the model, as the fit has left it or simulated anew.

        Raises
        ------
        SimulationError
            When the model cannot be integrated.
        """
        kept = self.seen
        if kept is not None and kept.is_of(parameters, self.trace, damper, solver):
            return kept.comparison
        found = compare(parameters, self.trace, damper, solver=solver)
        # As one that was kept: whoever looks at it sees the same, whether or not it was.
        single = found.response.pressures.astype(np.float32).astype(np.float64)
        return replace(found, response=replace(found.response, pressures=single))
