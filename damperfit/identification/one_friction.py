"""Friction is the damper's, not its clicks': a setting that tells another takes that of the others.

With its bleed closed, a preload and a friction give nearly the same force at one speed, so that the
logs of one setting may take either for the other under the same misfit. Where most settings agree,
one that does not is fitted again with their friction, and keeps it where it fits as well.
"""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import median
from typing import TYPE_CHECKING

from damperfit.damper.quantity import DAMPER, RIG
from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.effective_samples import FEWEST_SAMPLES
from damperfit.identification.every_setting import with_status
from damperfit.identification.law_misfit import LawMisfit, best_fitting
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.plausible import kept_within
from damperfit.identification.setting import attempt, describe_fit
from damperfit.tested.setting import nearest_setting
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.damper.model import Model, Values
    from damperfit.damper.quantity import Quantity
    from damperfit.identification.descent import Misfit
    from damperfit.identification.every_setting import Campaign
    from damperfit.identification.setting import Fit, Judged

__all__ = ["with_one_friction"]

# Frictions this many times apart are not those of one damper; seals that are pressed harder in one
# setting than in another have less.
TIMES_APART = 1.5
_LEAST = 0.1  # of a preload is left where a fit starts with more friction
_FEWEST = 2  # that agree, and more than tell another; what ran to none tells nothing


def with_one_friction(
    campaign: Campaign, misfit_of: Callable[[Fit], Misfit], *, jobs: int
) -> Campaign:
    """Return the fits, those with a friction unlike that of most fitted again with theirs.

    Parameters
    ----------
    campaign : Campaign
        Fits of settings by themselves.
    misfit_of : callable
        What is fitted at the setting of a fit.
    jobs : int
        Threads; the result does not depend on them.
    """
    if not campaign.fits or not campaign.is_complete:
        return campaign
    found = campaign
    for quantity in campaign.fits[0].parameters.quantities:
        if quantity.is_friction:
            found = _with_one(found, quantity, misfit_of, jobs)
    return found


def _with_one(
    campaign: Campaign, quantity: Quantity, misfit_of: Callable[[Fit], Misfit], jobs: int
) -> Campaign:
    name = quantity.name
    told = [
        float(getattr(fit.parameters, name))
        for fit in campaign.fits
        if fit.status[name] is Status.FITTED
    ]
    if not told:
        return campaign
    usual = median(told)
    agreeing = [one for one in told if _is_like(one, usual)]
    odd = [fit for fit in campaign.fits if _is_odd(fit, name, usual)]
    if len(agreeing) < max(_FEWEST, len(told) - len(agreeing) + 1):
        return campaign
    of_all = sum(agreeing) / len(agreeing)
    like = {
        fit.setting: fit
        for fit in campaign.fits
        if fit.status[name] is Status.FITTED and _is_like(getattr(fit.parameters, name), usual)
    }

    def again(fit: Fit) -> Fit:
        if fit not in odd:
            return fit
        try:
            near = like[nearest_setting(fit.setting, like) or fit.setting]
            return _held(fit, quantity, of_all, misfit_of(fit), near)
        except (SimulationError, FitCancelledError):
            return fit

    with executor(jobs) as pool:
        return replace(campaign, fits=tuple(pool.map(again, campaign.fits)))


def _is_like(one: float, other: float) -> bool:
    return one < TIMES_APART * other and other < TIMES_APART * one


def _is_odd(fit: Fit, name: str, usual: float) -> bool:
    status = fit.status[name]
    if status in {Status.FIXED, Status.SHARED}:
        return False
    return status is Status.ABSENT or not _is_like(float(getattr(fit.parameters, name)), usual)


def _traded(values: Values, damper: Model, quantity: Quantity, value: float) -> Values:
    """Values with another friction, and preloads that are less by what it is more."""
    more = value - float(getattr(values, quantity.name))
    known: dict[str, float] = {quantity.name: value}
    areas = getattr(damper, "pressed_areas", ())
    for stroke, area in zip(("rebound", "compression"), areas, strict=False):
        name = f"{stroke}_opening"
        if name in values.names:
            opening = float(getattr(values, name))
            known[name] = max(opening - more / area, _LEAST * opening)
    return values.replace(known)


def _held(fit: Fit, quantity: Quantity, value: float, misfit: Misfit, near: Fit) -> Fit:
    """The fit with the friction of the others, where that fits as well."""
    lost = {name for name, status in fit.status.items() if status is Status.ABSENT}
    free = tuple(one for one in misfit.free if one != quantity.name and one not in lost)
    rest = replace(misfit, free=free)
    fixed = {
        one: float(getattr(fit.parameters, one)) for one in fit.parameters.names if one not in free
    } | {quantity.name: value}
    held = _traded(fit.parameters, rest.damper, quantity, value)
    read = LawMisfit(rest.damper, rest.traces, free, rest.solver)
    shared = {
        one.name: float(getattr(near.parameters, one.name))
        for one in fit.parameters.quantities
        if one.name in free and one.scope in {DAMPER, RIG}
    }
    own = rest.damper.start(rest.traces, fixed)
    read_off = best_fitting(read, [*own, *(one.replace(shared) for one in own)])
    found: list[Judged] = []
    spent = fit.evaluations
    for start in (held, *read_off[:2]):
        judged = attempt(rest, kept_within(start, free), spent)
        spent = judged.solution.evaluations
        found.append(judged)
    best = min(found, key=lambda one: one.solution.mse_percent)
    # What a law leaves over is not white: a stretch counts as a few samples.
    n = FEWEST_SAMPLES * sum(len(log.trace.stretches) for log in fit.logs)
    worse = best.solution.mse_percent / max(fit.mse_percent, 1e-300)
    is_strained = best.outcome not in {Outcome.CONVERGED, Outcome.NOT_IDENTIFIABLE}
    if is_strained or n * math.log(max(worse, 1e-300)) > math.log(n):
        return replace(fit, evaluations=spent)
    said = (
        f"{quantity.label} ({quantity.symbol}) is that of the other settings, {value:.3g} N: it "
        f"belongs to the damper, and these logs are met as well with it "
        f"({best.solution.mse_percent:.2g} % after {fit.mse_percent:.2g} % with "
        f"{float(getattr(fit.parameters, quantity.name)):.2g} N)."
    )
    status = {**dict.fromkeys(lost - {quantity.name}, Status.ABSENT), quantity.name: Status.FIXED}
    judged = with_status(best, status)
    found_fit = describe_fit(fit.setting, judged, rest)
    return replace(found_fit, warnings=(*fit.warnings, said))
