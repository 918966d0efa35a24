"""A bleed that is part orifice and part gap, from which a descent has lost one of both."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.damper.mounting import NONE
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import SimulationError
from damperfit.identification.law_misfit import COMPARING, is_as_expected
from damperfit.laws.variants import STROKES, has_kinds_of_valves

if TYPE_CHECKING:
    from damperfit.damper.model import Values
    from damperfit.identification.law_misfit import LawMisfit
    from damperfit.identification.minimiser import Minimum

__all__ = ["bled_flow", "from_both_ways", "with_both_ways"]

# Of the pressure at which the blow-off opens: what a bleed loses in one of its two ways.
_NEXT_TO_NOTHING = 0.05


def from_both_ways(
    misfit: LawMisfit, ended: Minimum[Values], spent: int, *, hopeless: float = math.inf
) -> tuple[Minimum[Values], int]:
    """Return where a law of one setting ends, from bleeds of both ways too, and evaluations.

    It starts from both where a bleed has lost one, and more is left than differs by cycle.

    Parameters
    ----------
    misfit : LawMisfit
        What was fitted.
    ended : Minimum
        Where it has ended.
    spent : int
        Evaluations that it took.
    hopeless : float
        What leaves more than this has not ended, and is left where it is.
    """
    if ended.point.cost > hopeless or is_as_expected(misfit, ended):
        return ended, spent
    model, values = misfit.model, ended.point.extra
    if not isinstance(model, ValveDamper) or not has_kinds_of_valves(model):
        return ended, spent
    both = with_both_ways(model, values)
    moved = {name for name in values.names if getattr(both, name) != getattr(values, name)}
    if not moved or not moved <= {*misfit.free}:
        return ended, spent
    try:
        other = misfit.descend(both, COMPARING)
    except SimulationError:
        return ended, spent
    return min(ended, other, key=lambda one: one.point.cost), spent + other.evaluations


def with_both_ways(damper: ValveDamper, at: Values) -> Values:
    """Return values in which part-laminar bleeds are both, where one of the two is next to nothing.

    A nearly closed bleed fits as either beside a friction, and what is nothing has no slope: no
    descent leads back. What flows where the blow-off opens stays, half the pressure being lost in
    each way.

    Parameters
    ----------
    damper : ValveDamper
        The law.
    at : Values
        Of a setting.
    """
    for stroke in STROKES:
        valve = getattr(damper, stroke)
        if valve.bleed != "long" or valve.blow_off == NONE:
            continue
        opening, leak = (float(getattr(at, f"{stroke}_{part}")) for part in ("opening", "leak"))
        flow = bled_flow(at, stroke)
        if not _NEXT_TO_NOTHING < leak * flow / opening < 1.0 - _NEXT_TO_NOTHING:
            half = 0.5 * opening
            both = {"leak": half / flow, "bleed": math.sqrt(half) / flow}
            at = at.replace({f"{stroke}_{part}": number for part, number in both.items()})
    return at


def bled_flow(at: Values, stroke: str) -> float:
    """Return what flows through a part-laminar bleed where the blow-off beside it opens, kg/s.

    Parameters
    ----------
    at : Values
        Of a setting.
    stroke : str
        "rebound" or "compression".
    """
    parts = ("leak", "bleed", "opening")
    r, s, opening = (float(getattr(at, f"{stroke}_{part}")) for part in parts)
    return 2.0 * opening / (r + math.sqrt(r * r + 4.0 * s * s * opening))
