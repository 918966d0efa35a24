r"""Where and when a chamber of a damper is empty, or how far it is from that.

Of the paper's damper: lowest pressure, margin of R_m3, safe gas pressure. Chamber 2 is filled in
rebound through valve 3, so that with little oil stored in compression::

    P_2 = P_3 - rho_0 R_m3 a_p2 v,     P_3 in proportion to P_0

Its lowest value falls in a straight line with R_m3 and rises in one with P_0: a response that does
not cavitate shows where both lines meet zero, and two or three short simulations find the root.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.purdy.parameters import gas_pressure
from damperfit.errors import ConfigurationError, SimulationError
from damperfit.simulation import Response, SolverOptions, motion_of, simulate

if TYPE_CHECKING:
    from damperfit.damper.model import Values
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.recording import Trace
    from damperfit.tested.setting import Setting

# By how much the factors may be looked for, and how exactly. The paper's own statement is "about
# 15 %": a tenth of a per cent is plenty.
_WIDEST_FACTOR, _TOLERANCE = 1e3, 1e-3
# s; the slowest of the pressures, at 80 1/s, has settled by then to 1e-8.
_SETTLING = 0.25
# The straight line is this good at the sample runs; a wider bracket follows where it is not.
_FIRST_STEP = 0.01


@dataclass(frozen=True, slots=True)
class Cavitation:
    """How far one setting's logs are from cavitation, with the fitted parameters."""

    fraction: float = math.nan  # share of the compared time with a chamber at zero pressure
    lowest_pressure: float = math.nan  # of any chamber in the compared time, absolute, Pa,
    chamber: int = 0  # where: chamber 1, 2 or 3,
    displacement: float = math.nan  # and when: x, m, and
    velocity: float = math.nan  # v, m/s; of a chamber at zero when it gets there
    # Fraction by which R_m3 may rise before a chamber cavitates on this motion; negative when it
    # must fall, NaN where no factor from 1/1000 to 1000 is at the edge.
    r_m3_margin: float = math.nan
    # Gas pressure P_0 at which a chamber just reaches zero on this motion, all else as it is,
    # absolute, Pa; NaN likewise. A lower one cavitates.
    safe_gas_pressure: float = math.nan

    @property
    def moment(self) -> str:
        """When the pressure is lowest, in words."""
        x, v = f"x = {1e3 * self.displacement:+.0f} mm", f"v = {self.velocity:+.2f} m/s"
        return f"{x}, {v} in {'rebound' if self.velocity > 0.0 else 'compression'}"


def describe_cavitation(
    settings: Mapping[Setting, Cavitation], *, doubted: Collection[Setting] = ()
) -> tuple[str, ...]:
    """Return what there is to say of cavitation, a sentence each: those that do, then the rest.

    Of what the fitted model shows; in settings that are doubted it does not match the logs, where
    its empty chamber is no evidence, and nothing is advised against it.
    """
    sentences = []
    for setting, state in sorted(settings.items()):
        if not state.fraction > 0.0:
            continue
        text = f"setting {setting}: {_share(state.fraction)} of the cycle with chamber "
        text += f"{state.chamber} at zero pressure, from {state.moment}"
        if setting in doubted:
            text += "; the model does not match these logs, so the damper itself may be full"
        elif not math.isnan(state.safe_gas_pressure):
            text += f"; it takes a gas pressure of {state.safe_gas_pressure / 1e5:.2f} bar absolute"
            if not math.isnan(state.r_m3_margin):
                text += f", or R_m3 lower by {_share(-state.r_m3_margin)},"
            text += " to keep it full"
        sentences.append(text)
    full = {setting: state for setting, state in settings.items() if state.fraction == 0.0}
    if full:  # by the one that is nearest to it
        setting, state = min(full.items(), key=lambda item: item[1].lowest_pressure)
        text = (
            f"{'elsewhere none does' if sentences else 'no chamber cavitates'}; lowest pressure "
            f"{state.lowest_pressure / 1e5:.2f} bar absolute, in chamber {state.chamber} of "
            f"setting {setting}, at {state.moment}"
        )
        if not math.isnan(state.r_m3_margin + state.safe_gas_pressure):
            text += (
                f"; there R_m3 may rise by {_share(state.r_m3_margin)}, or the gas pressure "
                f"fall to {state.safe_gas_pressure / 1e5:.2f} bar absolute, until a chamber "
                "cavitates on this motion"
            )
        sentences.append(text)
    return tuple(sentences)


def _share(fraction: float) -> str:
    return f"{100.0 * fraction:.2g} %"


def cavitation_in(
    seen: Sequence[tuple[Trace, Response]],
) -> tuple[Cavitation, Trace, Response, int]:
    """Return what the pressures of a setting's logs show, the log of the lowest, and its sample."""
    trace, response = min(seen, key=lambda log: float(log[1].pressures[:, log[0].compared].min()))
    part = trace.compared
    pressures = response.pressures[:, part]
    row, at = np.unravel_index(int(np.argmin(pressures)), pressures.shape)
    lowest, fraction = float(pressures[row, at]), 0.0
    if lowest <= 0.0:
        empty = [(r.pressures[:, t.compared] <= 0.0).any(axis=0) for t, r in seen]
        fraction = float(np.mean(np.concatenate(empty)))
        # The chamber that is longest at zero, and when it gets there.
        row = np.argmax(np.count_nonzero(pressures <= 0.0, axis=1))
        begins = np.flatnonzero(np.diff((pressures[row] <= 0.0).astype(np.int8)) > 0)
        at = begins[0] + 1 if len(begins) else np.intp(0)
    moment = int(part.start + at if isinstance(part, slice) else part[at])
    x, v = float(trace.displacement[moment]), float(trace.velocity[moment])
    return Cavitation(fraction, lowest, int(row) + 1, x, v), trace, response, moment


def examine_cavitation(
    parameters: Values,
    seen: Sequence[tuple[Trace, Response]],
    damper: Damper,
    *,
    solver: SolverOptions = SolverOptions(),
) -> Cavitation:
    """Return how far the logs of a setting are from cavitation, by what was simulated for each.

    The one with the lowest pressure is looked at closely.
    """
    shown, trace, response, moment = cavitation_in(seen)
    # Largest (P_3 - P_2)/P_3 of the cycle: 1 at the onset of cavitation, small far from it.
    p_2, p_3 = response.pressures[1:, trace.compared]
    if float(p_2.min()) > 0.0:
        nearness = 1.0 - p_2 / p_3
    else:
        # While the clamp holds, the drop over valve 3 is not seen: that of incompressible oil.
        x, v = trace.displacement[trace.compared], trace.velocity[trace.compared]
        drop = damper.oil_density * parameters.r_m3 * damper.piston_area * v
        nearness = drop / gas_pressure(damper, x)
    line = max(float(np.max(nearness)), 1e-300)
    # The motion that leads there: of steady cycles the last, and as much before as it takes to
    # forget the start.
    segment = next(segment for segment in trace.segments if segment.first <= moment < segment.stop)
    first, n = 0, segment.n_samples
    if segment.n_cycles:
        n = round(n / segment.n_cycles)
        first = max(0, segment.stop - n - min(n, math.ceil(_SETTLING / trace.interval)))
    motion = motion_of(trace).until(first, segment.stop)

    def lowest(r_m3: float, gas: float) -> float:
        trial = parameters.replace(r_m3=r_m3 * parameters.r_m3)
        at = damper if gas == 1.0 else replace(damper, gas_pressure=gas * damper.gas_pressure)
        filled = simulate(trial, at, motion, options=solver).pressures[:2, -n:]
        # The pressure is clamped at zero; the share of time spent there gives the root a slope.
        least, empty = float(filled.min()), (filled <= 0.0).any(axis=0)
        return least if least > 0.0 else -at.gas_pressure * float(np.mean(empty))

    known = float(response.pressures[:2, trace.compared].min())
    margin = _root(lambda factor: lowest(factor, 1.0), 1.0 / line, known)
    safe = _root(lambda factor: lowest(1.0, factor), line, known)
    return replace(shown, r_m3_margin=margin - 1.0, safe_gas_pressure=safe * damper.gas_pressure)


def _root(lowest: Callable[[float], float], guess: float, known: float = math.nan) -> float:
    """Return the factor at which the lowest pressure is zero, near a guess; NaN when out of range.

    Where one simulation just before the guess shows that the line from factor 1, where the pressure
    is known, goes on to within a step of it, the line is followed. Else the bracket opens from the
    guess until the sign changes; then the false position (Illinois).
    """
    if not 1.0 / _WIDEST_FACTOR <= guess <= _WIDEST_FACTOR:
        return math.nan
    at = cache(lowest)
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
                return _root_between(at, low, high, _TOLERANCE * guess)
    except (SimulationError, ConfigurationError):  # no such motion, or no such damper
        pass
    return math.nan


def _root_between(
    function: Callable[[float], float], low: float, high: float, tolerance: float
) -> float:
    """Return where a function changes its sign, by chords whose idle end counts half."""
    at_low, at_high = function(low), function(high)
    end, moved = math.nan, 0
    while at_low != at_high:
        last, end = end, (low * at_high - high * at_low) / (at_high - at_low)
        if abs(end - last) <= 0.1 * tolerance:
            break
        at_end = function(end)
        if at_end * at_high > 0.0:
            high, at_high = end, at_end
            at_low, moved = (0.5 * at_low if moved > 0 else at_low), 1
        else:
            low, at_low = end, at_end
            at_high, moved = (0.5 * at_high if moved < 0 else at_high), -1
    return end
