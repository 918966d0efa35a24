"""What one click changes: the force of a setting beside that of its neighbour.

The offset of a setting is the rig's, and no part of what a click does. Shared parameters are one
and the same error for both settings (`stage`).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.statistics import NORMAL_95
from damperfit.tested.setting import ADJUSTER, lines_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from damperfit.adjustment.force_at import Force
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["Click", "clicks"]


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
