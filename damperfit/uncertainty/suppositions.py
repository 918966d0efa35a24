"""What a fit supposes and nobody has measured, as the force that it would be off by.

Defaults of the model, each by one standard error; the form in which friction turns; and what the
pressure on the seal adds to it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.pressing import with_pressed_seal
from damperfit.damper.turning import other_turns
from damperfit.identification.model_versus_log import compare
from damperfit.identification.outcome import Status
from damperfit.simulation import simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification import Fit, LogFit
    from damperfit.simulation import SolverOptions

    FloatArray = NDArray[np.float64]

__all__ = ["ignorance", "other_frictions"]


def ignorance(fit: Fit) -> FloatArray:
    """Return one standard error of what stands at a default that nobody has measured, (k,)."""
    values = fit.parameters
    found = np.zeros(len(values.names))
    for place, one in enumerate(values.quantities):
        value = getattr(values, one.name)
        if fit.status[one.name] is Status.FIXED and value == one.default:
            found[place] = one.ignorance * (1.0 if one.may_vanish else value)
    return found


def other_frictions(
    log: LogFit,
    fit: Fit,
    damper: Model,
    *,
    solver: SolverOptions,
    places: Sequence[NDArray[np.int64]],
    slopes: FloatArray,
) -> FloatArray | None:
    """Return what the force would be more with a friction of another form, one form a row.

    One that turns otherwise; one that the pressure on the seal adds to. Friction is then what it is
    at the pressure of the gas at rest.

    Parameters
    ----------
    log : LogFit
        The log.
    fit : Fit
        Its fit.
    damper : Model
        The damper.
    solver : SolverOptions
        How exactly to integrate.
    places : sequence of numpy.ndarray
        Which samples of each stretch, counted from its first.
    slopes : numpy.ndarray
        Shape (k, m): of the force at those samples one after another, by each of the k quantities.

    Returns
    -------
    numpy.ndarray or None
        Shape (2, m), N: the same rows at every setting of a damper, zeros where a form is none of
        its own. None for a damper of which no other form is doubted.

    Raises
    ------
    SimulationError
        When the model cannot be integrated.
    """
    values = fit.parameters
    turns, pressed = other_turns(damper, values), with_pressed_seal(damper, values)
    if not turns and pressed is None:
        return None
    here = _force(log, (damper, values), fit, solver, places)
    found = np.zeros((2, len(here)))
    if turns:
        there = (w * _force(log, (one, at), fit, solver, places) for w, one, at in turns)
        found[0] = sum(there) - here
    if pressed is not None:
        own = next(place for place, one in enumerate(values.quantities) if one.is_friction)
        at_rest = pressed[1].seal_area * values.gas_pressure
        found[1] = _force(log, pressed, fit, solver, places) - here - at_rest * slopes[own]
    return found


def _force(
    log: LogFit,
    law: tuple[Model, Values],
    fit: Fit,
    solver: SolverOptions,
    places: Sequence[NDArray[np.int64]],
) -> FloatArray:
    """The force of a law, on mean cycles where the fit has them: noise of the motion is no form."""
    trace, kept = log.trace, log.seen
    damper, values = law
    if kept is None or not kept.cycles or kept.parameters != fit.parameters:
        force = compare(values, trace, damper, solver=solver).force
        stretches = zip(trace.stretches, places, strict=True)
        return np.concatenate([force[one.first + taken] for one, taken in stretches])
    found = []
    for cycle, stretch, taken in zip(kept.cycles, trace.stretches, places, strict=True):
        response = simulate(values, damper, cycle.motion, options=cycle.solver(solver))
        as_slope = replace(response, sensitivities={"force": response.force})
        found.append(cycle.slopes_over(stretch, as_slope, taken)[0])
    return np.concatenate(found)
