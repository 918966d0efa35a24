"""What a fit supposes and nobody has measured, as the force that it would be off by.

Defaults of the model, each by one standard error; the form in which friction turns; and what the
pressure on the seal adds to it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.pressing import with_pressed_seal
from damperfit.damper.turning import other_turns
from damperfit.identification.outcome import Status
from damperfit.identification.simulated_log import compare
from damperfit.simulation import simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification import Fit, LogFit
    from damperfit.identification.mean_cycle import SettledCycle
    from damperfit.recording import Trace
    from damperfit.simulation import SolverOptions
    from damperfit.uncertainty.rows import EverySample, Phases

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
    values: Values,
    damper: Model,
    *,
    solver: SolverOptions,
    rows: Sequence[EverySample | Phases],
    slopes: Sequence[FloatArray],
) -> list[FloatArray | None]:
    """Return what the force would be more with a friction of another form, one form a row.

    One that turns otherwise; one that the pressure on the seal adds to. Friction is then what it is
    at the pressure of the gas at rest.

    Parameters
    ----------
    log : LogFit
        The log.
    values : Values
        What its fit has found.
    damper : Model
        The damper.
    solver : SolverOptions
        How exactly to integrate.
    rows : sequence of EverySample or Phases
        Where each stretch is looked at, m rows.
    slopes : sequence of numpy.ndarray
        Shape (k, m) each: of the force there by each of the k quantities.

    Returns
    -------
    list of numpy.ndarray or None
        Shape (2, m), N, of each stretch: the same rows at every setting of a damper, zeros where a
        form is none of its own. None for a damper of which no other form is doubted.

    Raises
    ------
    SimulationError
        When the model cannot be integrated.
    """
    turns, pressed = other_turns(damper, values), with_pressed_seal(damper, values)
    if not turns and pressed is None:
        return [None] * len(rows)
    cycles = log.cycles_of(values, damper, solver)

    def force(law: Model, at: Values) -> list[FloatArray]:
        return _force(log.trace, law, at, solver, cycles, rows)

    here = force(damper, values)
    found = [np.zeros((2, len(of))) for of in here]
    for weight, one, at in turns:
        for into, there in zip(found, force(one, at), strict=True):
            into[0] += weight * there
    if turns:
        for into, now in zip(found, here, strict=True):
            into[0] -= now
    if pressed is not None:
        own = next(place for place, one in enumerate(values.quantities) if one.is_friction)
        at_rest = pressed[1].seal_area * values.gas_pressure
        for into, there, now, by in zip(found, force(*pressed), here, slopes, strict=True):
            into[1] = there - now - at_rest * by[own]
    return list(found)


def _force(
    trace: Trace,
    damper: Model,
    values: Values,
    solver: SolverOptions,
    cycles: Sequence[SettledCycle],
    rows: Sequence[EverySample | Phases],
) -> list[FloatArray]:
    """The force of a law, on mean cycles where the fit has them: noise of the motion is no form."""
    if not cycles:
        force = compare(values, trace, damper, solver=solver).force
        return [force[stretch.window] for stretch in trace.stretches]
    found = []
    for cycle, where in zip(cycles, rows, strict=True):
        response = simulate(values, damper, cycle.motion, options=cycle.solver(solver))
        found.append(where.seen(cycle, [response.force])[0])
    return found
