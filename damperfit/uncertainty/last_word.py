"""The last word on what a fit says of its parameters, once errors and profiles are known."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.identification.left_out import is_nothing
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.setting import NOT_FIT_TO_SHARE

if TYPE_CHECKING:
    from damperfit.identification import Campaign, Fit
    from damperfit.uncertainty.assessment import Assessment
    from damperfit.uncertainty.intervals import Uncertainty

__all__ = ["reconsider"]


def reconsider(campaign: Campaign, assessment: Assessment) -> Campaign:
    """Return the campaign with the status that the errors and profiles of its parameters allow.

    The fit itself judges by rough errors. A profile that sets no limit has the last word, and so
    has the printed error of a value that all settings share. What ran to where its part does
    nothing, as a friction below the noise, is no bound that a fit strains against: the logs do not
    tell it from none.
    """
    known = {one.setting: one for one in assessment.uncertainties}
    fits = []
    for fit in campaign.fits:
        flat = {
            name
            for name, profile in assessment.telling(fit.setting).items()
            if profile.is_flat and fit.status[name] in {Status.FITTED, Status.SHARED}
        }
        flat |= {
            name
            for name in campaign.sharing.found
            if fit.status[name] == Status.SHARED and _is_unfit(fit, name, known.get(fit.setting))
        }
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
    """Whether a positive value is less than three errors away from nothing."""
    is_logarithmic = fit.parameters.quantity(name).is_logarithmic
    if known is None or name not in known.names or not is_logarithmic:
        return False
    place = known.names.index(name)
    return bool(known.covariance[place, place] > NOT_FIT_TO_SHARE**2)
