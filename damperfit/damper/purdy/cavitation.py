r"""How far a setting is from cavitation: lowest pressure, margin of R_m3, safe gas pressure.

Chamber 2 is filled in rebound through valve 3, so that with little oil stored in compression::

    P_2 = P_3 - rho_0 R_m3 a_p2 v,     P_3 in proportion to P_0

Its lowest value falls in a straight line with R_m3 and rises in one with P_0: a response that does
not cavitate tells where both lines meet zero, and two or three short simulations find the root.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.cavitation import emptiest, seen_cavitation
from damperfit.damper.purdy.closed_forms import gas_pressure
from damperfit.damper.purdy.roots import root_between
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.simulation import Motion, SolverOptions, motion_of, simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.damper.cavitation import Cavitation
    from damperfit.damper.model import Values
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.recording import Trace
    from damperfit.simulation import Response

__all__ = ["examine_cavitation"]

_WIDEST_FACTOR = 1e3
# The paper's own statement is "about 15 %": a tenth of a per cent is plenty.
_TOLERANCE = 1e-3
# s; the slowest of the pressures, at 80 1/s, has settled by then to 1e-8.
_SETTLING = 0.25
# The straight line is this good at the sample runs; a wider bracket follows where it is not.
_FIRST_STEP = 0.01


def examine_cavitation(
    parameters: Values,
    seen: Sequence[tuple[Trace, Response]],
    damper: Damper,
    *,
    solver: SolverOptions = SolverOptions(),
) -> Cavitation:
    """Return how far the logs of a setting are from cavitation.

    Parameters
    ----------
    parameters : Values
        The fitted ones.
    seen : sequence of (Trace, Response)
        The setting's logs and what was simulated for each; the one with the lowest pressure is
        looked at closely.
    damper : Damper
        Geometry, oil and gas.
    solver : SolverOptions
        How exactly to integrate.
    """
    found = seen_cavitation(seen)
    trace, _, _, moment = emptiest(seen)
    response = next(one for of, one in seen if of is trace)
    line = _nearness(parameters, trace, response, damper)
    motion, n = _shortest(trace, moment)

    def lowest(trial: Values, gas: float) -> float:
        at = damper if gas == damper.gas_pressure else replace(damper, gas_pressure=gas)
        filled = simulate(trial, at, motion, options=solver).pressures[:2, -n:]
        # The pressure is clamped at zero; the share of time spent there gives the root a slope.
        least = float(filled.min())
        return least if least > 0.0 else -gas * float(np.mean((filled <= 0.0).any(axis=0)))

    known = float(response.pressures[:2, trace.compared].min())
    margin = _root(
        lambda factor: lowest(
            parameters.replace(r_m3=factor * parameters.r_m3), damper.gas_pressure
        ),
        1.0 / line,
        known,
    )
    safe = _root(lambda factor: lowest(parameters, factor * damper.gas_pressure), line, known)
    return replace(found, r_m3_margin=margin - 1.0, safe_gas_pressure=safe * damper.gas_pressure)


def _nearness(parameters: Values, trace: Trace, response: Response, damper: Damper) -> float:
    """Largest (P_3 - P_2)/P_3 of the cycle: 1 at the onset of cavitation, small far from it."""
    p_2, p_3 = response.pressures[1:, trace.compared]
    if float(p_2.min()) > 0.0:
        return max(float(np.max(1.0 - p_2 / p_3)), 1e-300)
    # While the clamp holds, the drop over valve 3 is not seen: take that of incompressible oil.
    x, v = trace.displacement[trace.compared], trace.velocity[trace.compared]
    drop = damper.oil_density * parameters.r_m3 * damper.piston_area * v
    return max(float(np.max(drop / gas_pressure(damper, x))), 1e-300)


def _root(lowest: Callable[[float], float], guess: float, known: float = math.nan) -> float:
    """Return the factor at which the lowest pressure is zero, near a guess; NaN when out of range.

    Where one simulation just before the guess shows that the line from factor 1, where the pressure
    is known, goes on to within a step of it, the line is followed. Else the bracket opens from the
    guess until the sign changes; then Brent's method.
    """
    if not 1.0 / _WIDEST_FACTOR <= guess <= _WIDEST_FACTOR:
        return math.nan
    seen: dict[float, float] = {}

    def at(factor: float) -> float:
        if factor not in seen:
            seen[factor] = lowest(factor)
        return seen[factor]

    try:
        near = guess / (1.0 + math.copysign(_FIRST_STEP, guess - 1.0))
        low, high = sorted((near, guess * guess / near))
        # A lever shorter than five steps would turn the line by more than the tolerance.
        if abs(near - 1.0) > 0.05 and 0.0 < at(near) < known:
            end = near + at(near) * (near - 1.0) / (known - at(near))
            if low <= end <= high:
                return end
        for step in (_FIRST_STEP, 0.05, 0.3, 1.0, 3.0, 7.0):
            low, high = guess / (1.0 + step), guess * (1.0 + step)
            if at(low) * at(high) <= 0.0:
                return root_between(at, low, high, tolerance=_TOLERANCE * guess)
    except (SimulationError, ConfigurationError):  # no such motion, or no such damper
        pass
    return math.nan


def _shortest(trace: Trace, moment: int) -> tuple[Motion, int]:
    """The motion that leads to a moment of a trace, and how many of its last samples count.

    Of steady cycles the last, and as much before as it takes to forget the start.
    """
    stretch = next(one for one in trace.stretches if one.first <= moment < one.stop)
    first, n = 0, stretch.n_samples
    if stretch.n_cycles:
        n = round(n / stretch.n_cycles)
        first = max(0, stretch.stop - n - min(n, math.ceil(_SETTLING / trace.interval)))
    return motion_of(trace).until(first, stretch.stop), n
