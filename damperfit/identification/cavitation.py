r"""How far a setting is from cavitation: lowest pressure, margin of R_m3, safe gas pressure.

Chamber 2 is filled in rebound through valve 3, so that with little oil stored in compression::

    P_2 = P_3 - rho_0 R_m3 a_p2 v,     P_3 in proportion to P_0

Its lowest value falls in a straight line with R_m3 and rises in one with P_0: a response that does
not cavitate tells where both lines meet zero, and two or three short simulations find the root.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.closed_forms import gas_pressure
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.identification.model_versus_log import motion_of
from damperfit.simulation import Motion, SolverOptions, simulate

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.parameters import Damper, Parameters
    from damperfit.recording import Trace
    from damperfit.simulation import Response

__all__ = ["Cavitation", "describe_cavitation", "examine_cavitation"]

_WIDEST_FACTOR = 1e3
# The paper's own statement is "about 15 %": a tenth of a per cent is plenty.
_TOLERANCE = 1e-3
# The straight line is this good at the sample runs; a wider bracket follows where it is not.
_FIRST_STEP = 0.01


@dataclass(frozen=True, slots=True)
class Cavitation:
    """How far one setting's logs are from cavitation, with the fitted parameters.

    Attributes
    ----------
    fraction : float
        Share of the compared time with a chamber at zero pressure.
    lowest_pressure : float
        Lowest absolute pressure of any chamber in the compared time, Pa.
    chamber : int
        Where: chamber 1, 2 or 3.
    displacement, velocity : float
        When: x and v at that moment, m and m/s. Of a chamber at zero: when it gets there.
    r_m3_margin : float
        Fraction by which R_m3 may rise before a chamber cavitates on this motion; negative when
        it must fall, NaN where no factor from 1/1000 to 1000 is at the edge.
    safe_gas_pressure : float
        Gas pressure P_0 at which a chamber just reaches zero on this motion, all else as it is,
        absolute, Pa; NaN likewise. A lower one cavitates.
    """

    fraction: float = math.nan
    lowest_pressure: float = math.nan
    chamber: int = 0
    displacement: float = math.nan
    velocity: float = math.nan
    r_m3_margin: float = math.nan
    safe_gas_pressure: float = math.nan


def examine_cavitation(
    parameters: Parameters,
    seen: Sequence[tuple[Trace, Response]],
    damper: Damper,
    *,
    solver: SolverOptions = SolverOptions(),
) -> Cavitation:
    """Return how far the logs of a setting are from cavitation.

    Parameters
    ----------
    parameters : Parameters
        The fitted ones.
    seen : sequence of (Trace, Response)
        The setting's logs and what was simulated for each; the one with the lowest pressure is
        looked at closely.
    damper : Damper
        Geometry, oil and gas.
    solver : SolverOptions
        How exactly to integrate.
    """
    emptiest = min(seen, key=lambda pair: float(pair[1].pressures[:, pair[0].compared].min()))
    trace, response = emptiest
    pressures = response.pressures[:, trace.compared]
    chamber, sample = _emptiest(pressures)
    moment = int(np.arange(len(trace.force))[trace.compared][sample])
    empty = [(r.pressures[:, t.compared] <= 0.0).any(axis=0) for t, r in seen]
    line = _nearness(parameters, trace, response, damper)
    motion, n = _shortest(trace, moment)

    def lowest(trial: Parameters, gas: float) -> float:
        at = replace(damper, gas_pressure=gas)
        filled = simulate(trial, at, motion, options=solver).pressures[:2, -n:]
        # The pressure is clamped at zero; the share of time spent there gives the root a slope.
        share = float(np.mean((filled <= 0.0).any(axis=0)))
        return -gas * share if share else float(np.min(filled))

    margin = _root(
        lambda factor: lowest(
            replace(parameters, r_m3=factor * parameters.r_m3), damper.gas_pressure
        ),
        1.0 / line,
    )
    safe = _root(lambda factor: lowest(parameters, factor * damper.gas_pressure), line)
    return Cavitation(
        fraction=float(np.mean(np.concatenate(empty))),
        lowest_pressure=float(pressures.min()),
        chamber=chamber + 1,
        displacement=float(trace.displacement[moment]),
        velocity=float(trace.velocity[moment]),
        r_m3_margin=margin - 1.0,
        safe_gas_pressure=safe * damper.gas_pressure,
    )


def describe_cavitation(settings: Mapping[int, Cavitation]) -> tuple[str, ...]:
    """Return what there is to say of cavitation, a sentence each: those that do, then the rest."""
    empty = {setting: one for setting, one in settings.items() if one.fraction > 0.0}
    full = {setting: one for setting, one in settings.items() if one.fraction == 0.0}
    said = [
        f"setting {setting}: {_share(one.fraction)} of the cycle with chamber {one.chamber} at "
        f"zero pressure, {_moment(one, 'from')}{_needed(one)}"
        for setting, one in sorted(empty.items())
    ]
    if full:
        said.append(_nearest(full, "no chamber cavitates" if not empty else "elsewhere none does"))
    return tuple(said)


def _nearest(full: Mapping[int, Cavitation], opening: str) -> str:
    """The settings that do not cavitate, by the one that is nearest to it."""
    setting = min(full, key=lambda setting: full[setting].lowest_pressure)
    one = full[setting]
    words = (
        f"{opening}; lowest pressure {one.lowest_pressure / 1e5:.2f} bar absolute, in chamber "
        f"{one.chamber} of setting {setting}, {_moment(one, 'at')}"
    )
    if math.isnan(one.r_m3_margin) or math.isnan(one.safe_gas_pressure):
        return words
    return (
        f"{words}; there R_m3 may rise by {_share(one.r_m3_margin)}, or the gas pressure fall to "
        f"{one.safe_gas_pressure / 1e5:.2f} bar absolute, until a chamber cavitates on this motion"
    )


def _moment(one: Cavitation, word: str) -> str:
    stroke = "rebound" if one.velocity > 0.0 else "bump"
    return (
        f"{word} x = {1e3 * one.displacement:+.0f} mm, v = {one.velocity:+.2f} m/s of the {stroke}"
    )


def _needed(one: Cavitation) -> str:
    if math.isnan(one.safe_gas_pressure):
        return ""
    return (
        f"; it takes a gas pressure of {one.safe_gas_pressure / 1e5:.2f} bar absolute, or R_m3 "
        f"lower by {_share(-one.r_m3_margin)}, to keep it full"
    )


def _share(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %"


def _emptiest(pressures: NDArray[np.float64]) -> tuple[int, int]:
    """Chamber (from 0) and sample of the lowest pressure, or of the longest time at zero."""
    is_empty = pressures <= 0.0
    if not is_empty.any():
        chamber, sample = np.unravel_index(int(np.argmin(pressures)), pressures.shape)
        return int(chamber), int(sample)
    chamber = np.argmax(np.count_nonzero(is_empty, axis=1))
    begins = np.flatnonzero(np.diff(is_empty[chamber].astype(np.int8)) > 0)
    return int(chamber), int(begins[0]) + 1 if len(begins) else 0


def _nearness(parameters: Parameters, trace: Trace, response: Response, damper: Damper) -> float:
    """Largest (P_3 - P_2)/P_3 of the cycle: 1 at the onset of cavitation, small far from it."""
    p_2, p_3 = response.pressures[1:, trace.compared]
    if float(p_2.min()) > 0.0:
        return max(float(np.max(1.0 - p_2 / p_3)), 1e-300)
    # While the clamp holds, the drop over valve 3 is not seen: take that of incompressible oil.
    x, v = trace.displacement[trace.compared], trace.velocity[trace.compared]
    drop = damper.oil_density * parameters.r_m3 * damper.piston_area * v
    return max(float(np.max(drop / gas_pressure(damper, x))), 1e-300)


def _root(lowest: Callable[[float], float], guess: float) -> float:
    """Return the factor at which the lowest pressure is zero, near a guess; NaN when out of range.

    The bracket opens from the guess until the sign changes; then Brent's method.
    """
    from scipy.optimize import brentq

    if not 1.0 / _WIDEST_FACTOR <= guess <= _WIDEST_FACTOR:
        return math.nan
    known: dict[float, float] = {}

    def at(factor: float) -> float:
        if factor not in known:
            known[factor] = lowest(factor)
        return known[factor]

    try:
        for step in (_FIRST_STEP, 0.05, 0.3, 1.0, 3.0, 7.0):
            low, high = guess / (1.0 + step), guess * (1.0 + step)
            if at(low) * at(high) <= 0.0:
                return float(brentq(at, low, high, xtol=_TOLERANCE * guess))
    except (SimulationError, ConfigurationError):  # no such motion, or no such damper
        pass
    return math.nan


def _shortest(trace: Trace, moment: int) -> tuple[Motion, int]:
    """The motion that leads to a moment of a trace, and how many of its last samples count.

    Of steady cycles the last two: the first of them forgets the start.
    """
    stretch = next(one for one in trace.stretches if one.first <= moment < one.stop)
    first, n = 0, stretch.n_samples
    if stretch.n_cycles:
        n = round(n / stretch.n_cycles)
        first = max(0, stretch.stop - 2 * n)
    part = slice(first, stretch.stop)
    whole = motion_of(trace)
    return Motion(whole.interval, whole.displacement[part], whole.velocity[part]), n
