"""What run.json tells of how far the numbers may be trusted."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

    from damperfit.identification import Campaign
    from damperfit.uncertainty import Assessment, MisfitProfile

__all__ = ["confidence_record"]


def confidence_record(campaign: Campaign, assessment: Assessment) -> dict[str, Any]:
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
        "gas_content": None if assessment.gas is None else asdict(assessment.gas),
        "searches": [asdict(one) for one in campaign.searches],
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
            "jackknife_over_sandwich": {
                name: interval.cycle_ratio for name, interval in known.intervals.items()
            },
            "residuals": asdict(seen),
            "cavitation": asdict(fits[known.setting].cavitation),
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
