"""A setting that was not fitted, put together from settings that have its clicks.

Where a joint fit gave a quantity one value for each click of an adjuster, R12 C8 is known from R12
and C8 beside others. What settings share is one number to the last digit; fitted apart no two of
them are equal, and nothing is put together.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from damperfit.damper.model import Values

__all__ = ["unlimited_in", "values_from_others"]


def values_from_others(known: Mapping[Setting, Values], setting: Setting) -> Values | None:
    """Return the values of a setting from those of others; None where they do not tell them.

    An offset, which is each test's own, is the mean of theirs.

    Parameters
    ----------
    known : mapping of Setting to Values
        Of one model, as fitted together.
    setting : Setting
        One that is not among them.

    Examples
    --------
    >>> from damperfit.damper.model import values_type
    >>> from damperfit.damper.quantity import Quantity
    >>> from damperfit.tested.setting import Setting
    >>> s = Quantity("s", "s", "bleed", "bleed", "Pa", (1.0, 9.0))
    >>> p = Quantity("p", "p", "opening", "opening", "Pa", (1.0, 9.0))
    >>> at = lambda low, high: Setting((("low", low), ("high", high)))
    >>> known = {at(1, 1): (2.0, 5.0), at(1, 2): (2.0, 7.0), at(3, 1): (4.0, 5.0)}
    >>> values_from_others({k: values_type((s, p))(*v) for k, v in known.items()}, at(3, 2))
    Values(s=4.0, p=7.0)
    """
    settings = {Setting.of(one): at for one, at in known.items()}
    alike = {one: at for one, at in settings.items() if one.adjusters == setting.adjusters}
    if any(all(one.place(a) != place for one in alike) for a, place in setting.places):
        return None
    first = next(iter(alike.values()))
    found: dict[str, float] = {}
    for quantity in first.quantities:
        name = quantity.name
        numbers = {one: float(getattr(at, name)) for one, at in alike.items()}
        value = float(np.mean(list(numbers.values()))) if quantity.is_offset else None
        if len(set(numbers.values())) == 1:
            value = getattr(first, name)
        if value is None:
            value = _by_clicks(numbers, setting)
        if value is None:
            return None
        found[name] = value
    return first.replace(found)


def unlimited_in(
    values: Values, known: Mapping[Setting, Values], unlimited: Mapping[Setting, Collection[str]]
) -> tuple[str, ...]:
    """Return which of the values of a setting that was not fitted rest on logs that set no limit.

    A blow-off that opened in no log of its click has any p_open; another motion, or another click
    of the bleed beside it, may need the true one.

    Parameters
    ----------
    values : Values
        As `values_from_others` has put them together.
    known : mapping of Setting to Values
        Of the settings that were fitted.
    unlimited : mapping of Setting to collection of str
        Names to which the logs of a setting set no upper limit.
    """
    return tuple(
        name
        for name in values.names
        if (whose := [one for one in known if getattr(known[one], name) == getattr(values, name)])
        and all(name in unlimited.get(one, ()) for one in whose)
    )


def _by_clicks(numbers: Mapping[Setting, float], setting: Setting) -> float | None:
    """The number at a setting of what follows some of its adjusters, but not all of them.

    Where too few settings leave open which, all that is possible must agree.
    """
    adjusters = setting.adjusters
    for size in range(1, len(adjusters)):
        possible = []
        for some in combinations(adjusters, size):
            groups: dict[tuple[object, ...], set[float]] = {}
            for one, number in numbers.items():
                groups.setdefault(tuple(one.place(name) for name in some), set()).add(number)
            if all(len(group) == 1 for group in groups.values()):
                here = groups.get(tuple(setting.place(name) for name in some), set())
                possible.append(next(iter(here), None))
        if possible:
            return possible[0] if len(set(possible)) == 1 else None
    return None
