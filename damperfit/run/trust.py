"""What a run tells of how far its numbers may be trusted, beside the tables."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.identification import Status
from damperfit.identification.sharing import of_settings
from damperfit.problem import Option, Problem, warning
from damperfit.report.records import to_record

if TYPE_CHECKING:
    from collections.abc import Iterator

    from damperfit.damper.model import Model
    from damperfit.identification import Campaign, Fit
    from damperfit.uncertainty import Assessment, MisfitProfile

__all__ = ["other_model_advice", "uncertainty_record", "unconfirmed_tares", "unlike_frictions"]

# Frictions of one damper at two settings: so many errors and times apart they are not one.
_ERRORS_APART = 3.0
_TIMES_APART = 2.0
# What another law may mend; an offset it cannot.
_OF_LAWS = frozenset({"bound", "beyond", "cavitation", "friction", "misfit", "prediction"})


def other_model_advice(
    assessment: Assessment, damper: Model, *, is_chosen_by_logs: bool = False
) -> Iterator[Problem]:
    """Say where a grade is withheld that the logs should choose the model.

    Parameters
    ----------
    assessment : Assessment
        With what speaks against the grades.
    damper : Model
        The model that was fitted.
    is_chosen_by_logs : bool
        The logs have chosen it: there is nothing to advise.
    """
    withheld = [
        setting
        for setting, why in assessment.objections.items()
        if any(one.kind in _OF_LAWS for one in why)
    ]
    if withheld and not is_chosen_by_logs:
        yield warning(
            "other-model",
            f"model {damper.name} does not describe {of_settings(withheld)}: let the logs choose "
            "a model: identify the logs with {model}",
            model=Option("model", "auto"),
        )


def uncertainty_record(campaign: Campaign, assessment: Assessment) -> dict[str, Any]:
    """Return verdicts, correlations, profiles, gas content and searches, by their keys.

    Parameters
    ----------
    campaign : Campaign
        The fits.
    assessment : Assessment
        How far they may be trusted.
    """
    return {
        "uncertainty": list(_trust(campaign, assessment)),
        "profiles": [_profile(one, assessment) for one in assessment.profiles],
        "gas_content": None if assessment.gas is None else to_record(assessment.gas),
        "speed_forces": [to_record(one) for one in assessment.forces],
        "searches": [to_record(one) for one in campaign.searches],
    }


def _trust(campaign: Campaign, assessment: Assessment) -> Iterator[dict[str, Any]]:
    """Yield, by setting, what stands behind the intervals, and what the residuals say."""
    fits = {fit.setting: fit for fit in campaign.fits}
    said = assessment.verdicts(campaign)
    for known, seen in zip(assessment.uncertainties, assessment.diagnoses, strict=True):
        yield {
            "setting": known.setting,
            "verdicts": said[known.setting],
            "parameters": list(known.names),
            "shared": list(known.shared),
            "correlation": known.correlation.tolist(),
            "errors": np.sqrt(np.diag(known.covariance)).tolist(),
            "jackknife_over_sandwich": {
                name: interval.cycle_ratio for name, interval in known.intervals.items()
            },
            "residuals": to_record(seen),
            "cavitation": to_record(fits[known.setting].cavitation),
        }


def _profile(profile: MisfitProfile, assessment: Assessment) -> dict[str, Any]:
    """The limits of a profile beside those of the sandwich covariance; the points have a table."""
    intervals = {one.setting: one.intervals.get(profile.name) for one in assessment.uncertainties}
    sandwich = None if profile.is_partial else intervals.get(profile.setting)
    return {
        "setting": profile.setting,
        "parameter": profile.name,
        "shape": profile.shape,
        "ci_low": profile.low,
        "ci_high": profile.high,
        "sandwich_ci_low": None if sandwich is None else sandwich.low,
        "sandwich_ci_high": None if sandwich is None else sandwich.high,
        "is_shared": profile.is_shared,
        "points": len(profile.points),
        "evaluations": profile.evaluations,
    }


def unconfirmed_tares(campaign: Campaign, assessment: Assessment) -> Iterator[str]:
    """Say where a fit has no room for the tare that a log was warned of, as when it cavitates."""
    sound = {
        one.setting
        for one in assessment.diagnoses
        if not one.is_structured and not math.isnan(one.noise_percent)
    }
    doubted = [
        fit.setting
        for fit in campaign.fits
        if fit.setting in sound and _has_fixed_offset(fit) and _is_warned_of_tare(fit)
    ]
    if doubted:
        where = of_settings(doubted)
        yield (
            f"{where}: the warning tare is not confirmed: the fit matches the force to within its "
            "noise without an offset"
        )


def _has_fixed_offset(fit: Fit) -> bool:
    offsets = (one.name for one in fit.parameters.quantities if one.is_offset)
    return all(fit.status[name] == Status.FIXED for name in offsets)


def _is_warned_of_tare(fit: Fit) -> bool:
    findings = (finding for log in fit.logs for finding in log.trace.findings)
    return any(one.name == "tare" and one.severity == "warning" for one in findings)


def unlike_frictions(campaign: Campaign, assessment: Assessment) -> Iterator[Problem]:
    """Say where settings that were fitted apart have frictions that cannot be those of one damper.

    With the bleed closed, a preload and a friction give nearly the same force at one speed.

    Parameters
    ----------
    campaign : Campaign
        The fits.
    assessment : Assessment
        With the errors of noise and misfit.
    """
    known = {one.setting: one.intervals for one in assessment.uncertainties}
    for quantity in campaign.fits[0].parameters.quantities if campaign.fits else ():
        name = quantity.name
        if not quantity.is_friction:
            continue
        found = sorted(
            (getattr(fit.parameters, name), math.hypot(one.error, one.misfit), fit.setting)
            for fit in campaign.fits
            if fit.status[name] == Status.FITTED
            and (one := known.get(fit.setting, {}).get(name)) is not None
        )
        if not found:
            continue
        (low, low_error, where_low), (high, high_error, where_high) = found[0], found[-1]
        apart = high - low > _ERRORS_APART * math.hypot(low_error, high_error)
        if apart and high > _TIMES_APART * low:
            yield warning(
                "unlike-frictions",
                f"{quantity.symbol} is {low:.3g} N at setting {where_low} and {high:.3g} N at "
                f"setting {where_high}, but friction belongs to the damper and not to its clicks: "
                "a preloaded valve may be taken for friction; fit the settings together: {joint}",
                joint=Option("procedure", "joint"),
            )
