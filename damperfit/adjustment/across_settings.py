"""The settings of a campaign beside each other: trends of the parameters, forces, clicks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.adjustment.click_changes import Click, clicks
from damperfit.adjustment.force_at import (
    Force,
    credible_forces,
    force_at,
    named_speeds,
    offset_sentence,
)
from damperfit.adjustment.stage import stage_of
from damperfit.adjustment.trends import Trend, find_trends

if TYPE_CHECKING:
    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.identification import Campaign
    from damperfit.uncertainty import Assessment

__all__ = ["Adjustment", "compare_settings"]


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What shows only across settings.

    Attributes
    ----------
    trends : tuple of Trend
        One for each parameter that was fitted setting by setting.
    forces : tuple of Force
        By setting, named speed and stroke: of one origin at a speed and stroke.
    clicks : tuple of Click
        Their change between neighbouring settings.
    """

    trends: tuple[Trend, ...] = ()
    forces: tuple[Force, ...] = ()
    clicks: tuple[Click, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """What there is to say of the trends, one sentence a parameter, and of offsets."""
        trends = tuple(trend.sentence for trend in self.trends)
        return (*trends, *self.of_offset)

    @property
    def of_offset(self) -> tuple[str, ...]:
        """What became of the rigs' offsets in forces by setting; empty where there are none."""
        said = offset_sentence(
            [one.tare for one in self.forces], holds_gas=any(one.holds_gas for one in self.forces)
        )
        return (f"forces by setting: {said}",) if said else ()


def compare_settings(
    campaign: Campaign,
    assessment: Assessment,
    damper: Model,
    *,
    on_error: OnError | None = None,
) -> Adjustment:
    """Lay the settings of a campaign beside each other.

    Parameters
    ----------
    campaign : Campaign
        Result of `damperfit.identification.identify`.
    assessment : Assessment
        The same campaign judged.
    damper : Model
        The damper's model.
    on_error : callable, optional
        Told of a setting and the error that it met; without it such an error is raised.
    """
    if not campaign.fits:
        return Adjustment()
    stages = [stage_of(fit, assessment) for fit in campaign.fits]
    found = force_at(
        stages,
        damper,
        named_speeds(max(one.top_speed for one in stages)),
        measured=assessment.forces,
        on_error=on_error,
    )
    told = credible_forces(found)
    known = {one.setting: one for one in assessment.uncertainties}
    return Adjustment(trends=find_trends(campaign.fits, known), forces=told, clicks=clicks(told))
