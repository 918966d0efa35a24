"""The settings of a campaign beside each other: trends, forces, and what one click changes."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.adjustment.force_at import (
    Force,
    credible_forces,
    force_at,
    named_speeds,
    offset_sentence,
    stage_of,
)
from damperfit.adjustment.trends import Trend, find_trends
from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import ADJUSTER, lines_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.adjustment.force_at import Force
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]
    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.identification import Campaign
    from damperfit.uncertainty import Assessment

__all__ = [
    "Adjustment",
    "Click",
    "clicks",
    "compare_settings",
]


# What one click changes: the force of a setting beside that of its neighbour.
#
# The offset of a setting is the rig's, and no part of what a click does. Shared parameters are
# one and the same error for both settings (`stage`).


@dataclass(frozen=True, slots=True)
class Click:
    """Change of force from one setting to the next one that was fitted.

    Attributes
    ----------
    first, second : Setting
        The two settings; more than one click apart where settings in between have no fit.
    speed : float
        m/s, positive.
    stroke : str
        "rebound" or "bump".
    adjuster : str
        Which was turned; the others are held.
    change, low, high : float
        Force of the second less that of the first with its 95 % interval, both without their
        offset, N. Negative in bump means a harder bump.
    percent, percent_low, percent_high : float
        How much harder, in per cent of the first one's damping: of the force less the gas force
        at mid-stroke and the offset. NaN where that is nothing.
    """

    first: Setting
    second: Setting
    speed: float
    stroke: str
    change: float
    low: float
    high: float
    percent: float
    percent_low: float
    percent_high: float
    adjuster: str = ADJUSTER


def clicks(found: Sequence[Force]) -> tuple[Click, ...]:
    """Return the change of force between neighbouring settings, by speed and stroke.

    Neighbours differ in one adjuster alone; words are no neighbours.

    Parameters
    ----------
    found : sequence of Force
        As `force_at` returns them.
    """
    lines = lines_of(level.setting for level in found)
    levels_of = {
        setting: sorted(few, key=lambda one: one.speed)
        for setting, few in itertools.groupby(found, lambda one: one.setting)
    }
    pairs = [
        (first, second, line.adjuster)
        for line in lines
        for a, b in itertools.pairwise(line.settings)
        for first, second in zip(levels_of[a], levels_of[b], strict=True)
    ]
    return _clicks(pairs) if pairs else ()


def _clicks(pairs: Sequence[tuple[Force, Force, str]]) -> tuple[Click, ...]:
    """Return what is changed from the first to the second of each pair along an adjuster."""
    firsts, seconds = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    before = np.array([one.bare_force for one in firsts])
    changes = np.array([one.bare_force for one in seconds]) - before
    reaches = NORMAL_95 * _spreads(firsts, seconds, np.ones(len(pairs)))
    # What the logs leave open may be at the one end for one setting and at the other for the next.
    is_open = [max(*a.undetermined, *b.undetermined) for a, b in zip(firsts, seconds, strict=True)]
    reaches = np.maximum(reaches, is_open)
    dampings = np.array([one.damping for one in firsts])
    dampings[dampings == 0.0] = math.nan
    ratios = 1.0 + changes / dampings
    percents = 100.0 * (ratios - 1.0)
    # The first force is the denominator too: its error counts 1 + share times.
    shares = 100.0 * NORMAL_95 * _spreads(firsts, seconds, ratios) / np.abs(dampings)
    columns = (
        changes,
        changes - reaches,
        changes + reaches,
        percents,
        percents - shares,
        percents + shares,
    )
    rows = zip(pairs, *(column.tolist() for column in columns), strict=True)
    return tuple(
        Click(first.setting, second.setting, first.speed, first.stroke, a, b, c, d, e, f, adjuster)
        for (first, second, adjuster), a, b, c, d, e, f in rows
    )


def _spreads(firsts: Sequence[Force], seconds: Sequence[Force], ratios: FloatArray) -> FloatArray:
    """Return the standard errors of second - ratio first; NaN where one of both is not known."""
    n = max(len(one.carried) for one in (*firsts, *seconds))
    before, after = (_errors(few, n) for few in (firsts, seconds))
    before *= ratios[:, None]
    apart = after[:, 2:] - before[:, 2:]
    rest, misfit = (after[:, :2] ** 2 + before[:, :2] ** 2).T
    spreads = np.sqrt(rest + misfit + np.einsum("ij,ij->i", apart, apart))
    pairs = zip(firsts, seconds, strict=True)
    is_alike = [len(one.carried) == len(other.carried) for one, other in pairs]
    return np.where(is_alike, spreads, math.nan)


def _errors(levels: Sequence[Force], n: int) -> FloatArray:
    """Errors of levels one below the other: rest, misfit, and n of shared values."""
    found = np.zeros((len(levels), 2 + n))
    for row, one in zip(found, levels, strict=True):
        row[:2] = one.rest, one.misfit
        row[2 : 2 + len(one.carried)] = one.carried
    return found


# The settings of a campaign beside each other: trends of the parameters, forces, clicks.


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
