"""The model beside the measurement: simulate, filter alike, subtract."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

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

__all__ = ["SETTLING", "SimulatedLog", "compare", "normalised_mse"]

# s; the slowest of a damper's pressures, at 80 1/s, has settled by then to 1e-8.
SETTLING = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedLog:
    """A response and its force as compared with the measured one.

    Attributes
    ----------
    response : Response
        As simulated, unfiltered.
    force : numpy.ndarray
        Shape (n,), the response's force behind the trace's model filter, N.
    sensitivities : numpy.ndarray
        Shape (k, n), the sensitivities asked for, in that order, behind the same filter.
    """

    response: Response
    force: FloatArray
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

    Filtering both sides alike is what keeps the parameters right: a raw model against filtered
    data costs 5 % of the friction, a causal filter on one side most of the bulk modulus.

    Raises
    ------
    SimulationError
        When the model cannot be integrated.
    """
    options = replace(solver, settling=SETTLING)
    response = simulate(
        parameters, damper, motion_of(trace), sensitivities=sensitivities, options=options
    )
    rows = np.stack([response.force, *response.sensitivities.values()])
    rows = apply_filter(trace.model_filter, rows)
    return SimulatedLog(response, rows[0], rows[1:])


def normalised_mse(measured: FloatArray, simulated: FloatArray) -> float:
    """Return the normalised mean-square error in per cent, eq. (22).

    100/(N var(f)) sum (f - f_hat)^2 with the population variance, so that predicting the mean
    gives exactly 100.

    Examples
    --------
    >>> f = np.array([1.0, 2.0, 3.0, 4.0])
    >>> normalised_mse(f, np.full(4, f.mean()))
    100.0
    """
    misfit = measured - simulated
    # In NumPy's numbers: of a force that does not vary it is infinite.
    return float(np.float64(100.0 * mean_of(misfit * misfit)) / variance_of(measured))
