"""Whether bleeds are orifices or narrow gaps, through which oil flows in layers.

Beside a friction that is free, a laminar valve passes for a blow-off with next to no preload, and a
laminar bleed for an orifice with a softer blow-off: under a small MSE, with a friction that is not
the damper's. So the other kind is tried wherever it costs no quantity more, and taken where it fits
better. A bleed that is both has a quantity more, and is looked for as other parts are.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.mounting import NONE
from damperfit.laws.both_ways import bled_flow
from damperfit.laws.choosing import Tried, judged, predicted_worse
from damperfit.laws.course import valve_damper
from damperfit.laws.elsewhere import freed_of
from damperfit.laws.variants import LAMINAR, STROKES, of_kind

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.laws.choosing import Verdict
    from damperfit.laws.course import Course
    from damperfit.laws.law_fit import LawFit, SettingLogs

__all__ = ["fits_better", "with_bleeds_told"]

# The MSE of one kind over that of another of as many quantities: with less they are alike.
_FITS_BETTER = 1.1
# Of half the force's range: more than seals have, which is up to 8 %, with room for soft settings.
_MOST_FRICTION = 0.2


def with_bleeds_told(course: Course, law: Tried) -> Tried:
    """Return the law with bleeds of the kind that the logs tell.

    Parameters
    ----------
    course : Course
        What has been tried so far.
    law : Tried
        A law of valves.
    """
    for change, spared, model in _other_kinds(valve_damper(law)):
        one = course.fitted(model, freed=freed_of(law), near=_in_layers(law, model))
        if one is None:
            continue
        if one.n_quantities < law.n_quantities:
            # However little is left: what a preload is taken for is off at other speeds.
            verdict = judged(one, law, course.n_eff, left_percent=math.inf)
            is_taken, reason = _is_enough(one, spared, verdict, course.evidence)
        else:
            verdict, (is_taken, reason) = None, fits_better(law, one, course.n_eff)
        course.record(one, reason, is_taken=is_taken, change=change, verdict=verdict)
        if is_taken:
            law = one
    return law


def _in_layers(law: Tried, model: ValveDamper) -> Tried:
    """The law to start another from without orifices: what a bleed passes at the opening stays.

    With the laminar share alone the bleed would be too wide, and the descent end elsewhere.
    """
    valves = {stroke: getattr(valve_damper(law), stroke) for stroke in STROKES}
    both = [
        one
        for one, valve in valves.items()
        if (valve.bleed, getattr(model, one).bleed) == ("long", "leak") and valve.blow_off != NONE
    ]

    def at(fit: LawFit) -> LawFit:
        found = {
            f"{one}_leak": getattr(fit.values, f"{one}_opening") / bled_flow(fit.values, one)
            for one in both
        }
        return dataclasses.replace(fit, values=fit.values.replace(found))

    return Tried(law.title, tuple(map(at, law.fits))) if both else law


def _is_enough(
    one: Tried, spared: str, verdict: Verdict, evidence: Sequence[SettingLogs]
) -> tuple[bool, str]:
    """Whether laminar valves do without the preload of blow-offs, or an orifice, and why."""
    if verdict.takes_larger:
        return False, f"{spared} is needed: {verdict.reason}"
    share = max(
        sum(float(getattr(fit.values, q.name)) for q in fit.model.quantities if q.is_friction)
        / (0.5 * max(float(np.ptp(log.force[log.compared])) for log in logs.fitted))
        for fit, logs in zip(one.fits, evidence, strict=True)
    )
    if share > _MOST_FRICTION:
        return False, (
            f"its friction is {100.0 * share:.0f} % of half the force's range, more than seals "
            "have: it is the preload"
        )
    return True, f"{spared} is not needed: {verdict.reason}"


def fits_better(law: Tried, one: Tried, n_eff: float) -> tuple[bool, str]:
    """Return whether another law with as many quantities is taken, and why.

    Parameters
    ----------
    law, one : Tried
        What there is, and the other.
    n_eff : float
        Effective samples of all settings compared.
    """
    gain = law.mse_percent / max(one.mse_percent, 1e-300)
    is_told = gain > _FITS_BETTER and n_eff * math.log(gain) > math.log(n_eff)
    if not is_told:
        return False, f"it fits no better, {one.mse_percent:.2g} after {law.mse_percent:.2g} %"
    if worse := predicted_worse(law, one):
        return False, worse
    return True, f"MSE {law.mse_percent:.2g} to {one.mse_percent:.2g} % with as many quantities"


def _other_kinds(damper: ValveDamper) -> Iterator[tuple[str, str, ValveDamper]]:
    """Laws of as many quantities or fewer, and what these do without."""
    gaps = of_kind(of_kind(damper, "bleed", "orifice", "leak"), "bleed", "long", "leak")
    if gaps != damper:
        yield "with laminar bleeds", "an orifice beside the gap", gaps
    valves = {"rebound": damper.rebound, "compression": damper.compression}
    closed = [stroke for stroke, valve in valves.items() if valve.bleed == "none"]
    if closed:
        where = "" if len(closed) == len(valves) else f" in {STROKES[closed[0]]}"
        own = {stroke: LAMINAR if stroke in closed else valves[stroke] for stroke in valves}
        model = dataclasses.replace(damper, rebound=own["rebound"], compression=own["compression"])
        yield f"with laminar bleeds for blow-offs{where}", "a preload", model
