"""The last word on what a fit says of its parameters, once errors and profiles are known."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.identification.fit_setting import NOT_FIT_TO_SHARE, NOT_FOUND, is_loose
from damperfit.identification.inactive_parts import is_nothing
from damperfit.identification.outcome import Outcome, Status
from damperfit.statistics import NORMAL_95

if TYPE_CHECKING:
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Campaign, Fit
    from damperfit.uncertainty.assessment import Assessment
    from damperfit.uncertainty.intervals import Uncertainty

__all__ = ["reconsider"]

_FOUND = frozenset({Status.FITTED, Status.SHARED})


def reconsider(campaign: Campaign, assessment: Assessment) -> Campaign:
    """Return the campaign with the status that the errors and profiles of its parameters allow.

    The fit itself judges by rough errors of noise. A profile that sets no limit has the last word,
    and so have the printed intervals, which hold the misfit, and of a value that all settings share
    the printed error of noise. What ran to where its part does nothing, as a friction below the
    noise, is no bound that a fit strains against: the logs do not tell it from none.
    """
    known = {one.setting: one for one in assessment.uncertainties}
    fits = []
    for fit in campaign.fits:
        flat = {
            name
            for name, profile in assessment.telling(fit.setting).items()
            if profile.is_flat and fit.status[name] in _FOUND
        }
        flat |= {
            name
            for name in campaign.sharing.found
            if fit.status[name] == Status.SHARED and _is_unfit(fit, name, known.get(fit.setting))
        }
        flat |= _anywhere(fit, assessment)
        lost = flat.intersection(campaign.sharing.found)
        lost |= {
            name for name in campaign.sharing.found if fit.status[name] == Status.NOT_IDENTIFIABLE
        }
        flat |= _carried(fit, lost, known.get(fit.setting))
        at_bound = {name for name, status in fit.status.items() if status == Status.AT_BOUND}
        none = {name for name in at_bound if is_nothing(fit.parameters, name)}
        own = none | {name for name in flat if fit.status[name] == Status.FITTED}
        is_strained = fit.outcome is Outcome.AT_BOUND and not none >= at_bound
        outcome = fit.outcome
        if own and outcome in {Outcome.CONVERGED, Outcome.AT_BOUND} and not is_strained:
            outcome = Outcome.NOT_IDENTIFIABLE
        status = {**fit.status, **dict.fromkeys(flat | none, Status.NOT_IDENTIFIABLE)}
        fits.append(replace(fit, status=status, outcome=outcome))
    return replace(campaign, fits=tuple(fits))


def _is_unfit(fit: Fit, name: str, known: Uncertainty | None) -> bool:
    """Whether a shared value is less than three errors away from nothing, or from any other."""
    if known is None or name not in known.names:
        return False
    quantity, value = fit.parameters.quantity(name), getattr(fit.parameters, name)
    return is_loose(quantity, value, _error(quantity, known), NOT_FIT_TO_SHARE)


def _anywhere(fit: Fit, assessment: Assessment) -> set[str]:
    """What was found with an interval as wide as of what no log tells; a profile decides itself."""
    profiles = assessment.telling(fit.setting)
    found = set()
    for name, status in fit.status.items():
        if name in profiles:
            continue
        low, high = assessment.limits(fit.setting, name)
        quantity = fit.parameters.quantity(name)
        if status in _FOUND and low and high and quantity.is_logarithmic:
            error = math.log(high / low) / (2.0 * NORMAL_95)
            if is_loose(quantity, 1.0, error, NOT_FOUND):
                found.add(name)
    return found


def _error(quantity: Quantity, known: Uncertainty) -> float:
    """Its printed error of noise, of its logarithm or in its size."""
    place = known.names.index(quantity.name)
    error = math.sqrt(abs(float(known.covariance[place, place])))
    return error if quantity.is_logarithmic else error / quantity.size


def _carried(fit: Fit, lost: set[str], known: Uncertainty | None) -> set[str]:
    """What a setting finds only beside a shared slope of either sign that the logs do not tell."""
    is_told = all(fit.parameters.quantity(name).is_logarithmic for name in lost)
    if known is None or is_told:
        return set()
    return {
        name
        for name in known.names
        if fit.status[name] == Status.FITTED
        and is_loose(
            one := fit.parameters.quantity(name),
            getattr(fit.parameters, name),
            _error(one, known),
            NOT_FOUND,
        )
    }
