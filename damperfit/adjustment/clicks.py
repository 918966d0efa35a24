"""The settings of a campaign beside each other: trends, forces, and what one click changes.

The offset of a setting is the rig's, and no part of what a click does. Shared parameters are one
and the same error for both settings (`force_at`).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.adjustment.force_at import (
    Force,
    credible_forces,
    force_at,
    named_speeds,
    offset_sentence,
    stage_of,
)
from damperfit.adjustment.trends import Trend, find_trends
from damperfit.simulation import NAMED_SPEEDS
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import ADJUSTER, lines_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.identification import Campaign
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Assessment


@dataclass(frozen=True, slots=True)
class Click:
    """Change of force from one setting to the next one that was fitted, with 95 % intervals."""

    first: Setting
    second: Setting  # more than one click on where settings in between have no fit
    speed: float  # m/s, positive
    stroke: str
    change: float  # N, both without their offset; negative in bump means a harder bump
    low: float
    high: float
    # How much harder, in per cent of the first one's damping: of the force less the gas force at
    # mid-stroke and the offset. NaN where that is nothing.
    percent: float
    percent_low: float
    percent_high: float
    adjuster: str = ADJUSTER  # which was turned; the others are held


def clicks(forces: Sequence[Force]) -> tuple[Click, ...]:
    """Return the change of force between settings that differ by the next click of one adjuster."""
    by_setting = {
        setting: sorted(group, key=lambda one: one.speed)
        for setting, group in itertools.groupby(forces, lambda one: one.setting)
    }
    return tuple(
        _click(first, second, line.adjuster)
        for line in lines_of(by_setting)
        for pair in itertools.pairwise(line.settings)
        for first, second in zip(*(by_setting[setting] for setting in pair), strict=True)
    )


def _click(first: Force, second: Force, adjuster: str) -> Click:
    def spread(ratio: float) -> float:
        """Standard error of second - ratio first; NaN where one of both is not known."""
        if len(first.carried) != len(second.carried):
            return math.nan
        own = math.hypot(second.rest, second.misfit, ratio * first.rest, ratio * first.misfit)
        return math.hypot(own, *(second.carried - ratio * first.carried))

    change, damping = second.bare_force - first.bare_force, first.damping or math.nan
    reach = NORMAL_95 * spread(1.0)
    if math.isfinite(reach):
        # What the logs leave open may be at one end here and at the other there.
        reach = max(reach, *first.undetermined, *second.undetermined)
    ratio = 1.0 + change / damping
    percent = 100.0 * (ratio - 1.0)
    # The first force is the denominator too: its error counts 1 + share times.
    share = 100.0 * NORMAL_95 * spread(ratio) / abs(damping)
    of = (first.setting, second.setting, first.speed, first.stroke)
    ends = (change, change - reach, change + reach)
    return Click(*of, *ends, percent, percent - share, percent + share, adjuster)


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What shows only across settings."""

    trends: tuple[Trend, ...] = ()  # one for each parameter that was fitted setting by setting
    # By setting, named speed and stroke: of one origin at a speed and stroke.
    forces: tuple[Force, ...] = ()
    clicks: tuple[Click, ...] = ()  # change of the forces between neighbouring settings

    @property
    def sentences(self) -> tuple[str, ...]:
        """What there is to say of the trends, one sentence a parameter, and of offsets."""
        return (*(trend.sentence for trend in self.trends), *self.of_offset)

    @property
    def of_offset(self) -> tuple[str, ...]:
        """What became of the rigs' offsets in forces by setting; empty where there are none."""
        holds_gas = any(one.holds_gas for one in self.forces)
        sentence = offset_sentence([one.tare for one in self.forces], holds_gas=holds_gas)
        return (f"forces by setting: {sentence}",) if sentence else ()


def compare_settings(
    campaign: Campaign,
    assessment: Assessment,
    damper: Model,
    *,
    speeds: Sequence[float] = NAMED_SPEEDS,
    on_error: OnError | None = None,
) -> Adjustment:
    """Lay the settings of a campaign beside each other, at those speeds, m/s, that were reached."""
    if not campaign.fits:
        return Adjustment()
    stages = [stage_of(fit, assessment) for fit in campaign.fits]
    reached = named_speeds(max(one.top_speed for one in stages), speeds)
    measured = assessment.forces
    forces = credible_forces(
        force_at(stages, damper, reached, measured=measured, on_error=on_error)
    )
    known = {one.setting: one for one in assessment.uncertainties}
    return Adjustment(find_trends(campaign.fits, known), forces, clicks(forces))
