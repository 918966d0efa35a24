"""The model beside a log: simulate, filter alike, subtract; and what a fit keeps of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.simulation import Response, SolverOptions, motion_of, simulate
from damperfit.statistics import mean_of, variance_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]
    from damperfit.identification.mean_cycle import SettledCycle


class SimulatedLog(NamedTuple):
    """A response and its force as compared with the measured one."""

    response: Response  # as simulated, unfiltered
    force: FloatArray  # (n,), N, and sensitivities as asked for, (k, n), behind the model filter
    sensitivities: FloatArray


def compare(
    parameters: Values,
    trace: Trace,
    damper: Model,
    *,
    sensitivities: Sequence[str] = (),
    solver: SolverOptions = SolverOptions(),
) -> SimulatedLog:
    """Simulate the displacement of a trace and filter the force as the measured one was.

    Filtering both sides alike keeps the parameters right: a raw model against filtered data costs
    5 % of the friction, a causal filter on one side most of the bulk modulus.
    """
    response = simulate(
        parameters, damper, motion_of(trace), sensitivities=sensitivities, options=solver
    )
    rows = np.stack([response.force, *response.sensitivities.values()])
    rows = apply_filter(trace.model_filter, rows)
    return SimulatedLog(response, rows[0], rows[1:])


def normalised_mse(measured: FloatArray, simulated: FloatArray) -> float:
    """Return the normalised mean-square error in per cent, eq. (22).

    100/(N var(f)) sum (f - f_hat)^2; predicting the mean gives exactly 100.

    >>> f = np.array([1.0, 2.0, 3.0, 4.0])
    >>> normalised_mse(f, np.full(4, f.mean()))
    100.0
    """
    misfit = measured - simulated
    # In NumPy's numbers: of a force that does not vary it is infinite.
    return float(np.float64(100.0 * mean_of(misfit * misfit)) / variance_of(measured))


# One log beside the fit of its setting, and what is kept of its last simulation.
#
# Judging, the responses' file and the characteristics are all of one simulation at the values
# that a fit ended at. It is kept with the fit, and made anew where anything of it has changed.


class SeenLog(NamedTuple):
    """A log simulated with the values that a fit ended at, kept for those who come after it."""

    parameters: Values
    trace: Trace
    damper: Model
    solver: SolverOptions
    force: FloatArray  # (n,), behind the trace's model filter, N
    # (3, n), Pa; of every log of a run no more is kept than 50 bytes a sample, and 0.03 Pa are less
    # than the integrator's error. An empty chamber stays empty.
    pressures: NDArray[np.float32]
    cycles: tuple[SettledCycle, ...] = ()  # of each stretch, where the fit has gone down on them

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


class LogFit(NamedTuple):
    """How one log of a setting is met by the setting's parameters."""

    trace: Trace
    mse_percent: float  # eq. (22) over the log's steady whole cycles,
    noise_floor_percent: float  # and of the scatter between them alone; NaN for a single cycle
    stretch_mse_percent: tuple[float, ...] = ()  # of each stretch, by its own variance
    seen: SeenLog | None = None  # simulated with the fitted values, for those who judge it

    def cycles_of(
        self, parameters: Values, damper: Model, solver: SolverOptions
    ) -> tuple[SettledCycle, ...]:
        """Return the mean cycles that the fit went down on; none where it ended at other values."""
        kept = self.seen
        is_kept = kept is not None and kept.is_of(parameters, self.trace, damper, solver)
        return kept.cycles if kept is not None and is_kept else ()

    def compared(self, parameters: Values, damper: Model, solver: SolverOptions) -> SimulatedLog:
        """Return the log beside the model, as the fit has left it or simulated anew."""
        kept = self.seen
        if kept is not None and kept.is_of(parameters, self.trace, damper, solver):
            return kept.comparison
        found = compare(parameters, self.trace, damper, solver=solver)
        # As one that was kept: whoever looks at it sees the same, whether or not it was.
        single = found.response.pressures.astype(np.float32).astype(np.float64)
        return found._replace(response=replace(found.response, pressures=single))
