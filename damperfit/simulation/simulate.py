"""A model of a damper asked for its response to a motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from damperfit.simulation.response import SolverOptions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.simulation.motion import Motion
    from damperfit.simulation.response import Response

__all__ = ["simulate"]


class _Simulated(Protocol):
    """What is asked of a model; the whole is `damperfit.damper.model.Model`."""

    def simulate(
        self,
        values: Any,
        motion: Motion,
        *,
        sensitivities: Sequence[str],
        options: SolverOptions,
    ) -> Response: ...


def simulate(
    values: Any,
    damper: _Simulated,
    motion: Motion,
    *,
    sensitivities: Sequence[str] = (),
    options: SolverOptions = SolverOptions(),
) -> Response:
    """Simulate a damper that is driven by a displacement.

    The start of the paper's model and of networks has one pressure in all chambers and the oil mass
    of the damper at x = 0; the steady cycle is reached within one cycle from there.

    Parameters
    ----------
    values : Values
        One number for each of the model's quantities, SI.
    damper : Model
        The damper, as far as it is declared.
    motion : Motion
        Uniform samples of displacement and velocity.
    sensitivities : sequence of str
        What to differentiate the force by: quantities and conditions of the model.
    options : SolverOptions
        Tolerance and dead band.

    Returns
    -------
    Response
        Force, pressures, masses and sensitivities at the samples.

    Raises
    ------
    SimulationError
        When a state is not finite, a chamber has no volume left, or the step limit is met.

    Examples
    --------
    >>> from damperfit.damper.purdy.parameters import PURDY_DAMPER, Parameters
    >>> from damperfit.simulation import sine_motion
    >>> y = Parameters(r_m1=1.8e4, r_m2=3.527e6, r_m3=2.597e6, k_e=3.65e8, f_f=50.0)
    >>> response = simulate(y, PURDY_DAMPER, sine_motion(0.032, 1.5, cycles=4, sample_rate=1500))
    >>> round(float(response.force[3100]))  # a tenth into the fourth cycle
    673
    """
    return damper.simulate(values, motion, sensitivities=tuple(sensitivities), options=options)
