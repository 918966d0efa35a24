"""A bleed that is part orifice and part gap, from which a descent has lost one of both."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.damper.mounting import NONE
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.laws.variants import STROKES

if TYPE_CHECKING:
    from damperfit.damper.model import Values

__all__ = ["bled_flow", "with_both_ways"]

# Of the pressure at which the blow-off opens: what a bleed loses in one of its two ways.
_NEXT_TO_NOTHING = 0.05


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
