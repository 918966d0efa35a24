"""Which layout of the same parts is taken, and what is said of the others."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.laws.choosing import are_alike

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.laws.choosing import Tried

__all__ = ["is_told_as_one", "layout_taken", "said_of_layout"]


def layout_taken(law: Tried, others: Sequence[Tried]) -> Tried:
    """Return which of the same parts in several layouts is taken.

    The best, unless the one that the search went on with is alike.

    Parameters
    ----------
    law : Tried
        What the search went on with.
    others : sequence of Tried
        The same parts in other layouts.
    """
    best = min((law, *others), key=lambda one: one.score)
    return law if are_alike(best, law) else best


def is_told_as_one(law: Tried, other: Tried) -> bool:
    """Return whether one model of all settings tells another layout than that of the law.

    It must be better and not alike; or leave nothing where the law leaves something, which would
    be told as a part that the damper has not.

    Parameters
    ----------
    law, other : Tried
        The same parts in two layouts.
    """
    needs_no_more = law.leaves_something and not other.leaves_something
    return other.score < law.score and (needs_no_more or not are_alike(other, law))


def said_of_layout(best: Tried, one: Tried, *, is_alone: bool, is_near: bool) -> str:
    """Return what is said of a layout beside the best.

    Parameters
    ----------
    best, one : Tried
        The same parts in two layouts, which may be one.
    is_alone : bool
        No other layout was tried.
    is_near : bool
        It does hardly worse than the best.
    """
    what = "fits" if math.isnan(best.held_out_percent) else "fits and predicts"
    if is_alone:
        return "the only layout that was tried"
    if one is best:
        return f"the layout that {what} best"
    words = best.fits[0].model.name.replace("_", " ")
    return f"{words} {what} {'hardly ' if is_near else ''}better"
