"""What yields before it slides, held against the valves that were found.

A magneto-rheological fluid or dry friction holds its force down to no speed, and so do preloaded
valves. Where logs do, the models that yield are fitted as the valves were, and told where they fit
and predict better. Valves are told only where they are clearly the better ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.damper.rivals import Biviscous, BoucWen, Kwok, Rival
from damperfit.laws.choosing import are_alike, times_worse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.laws.choosing import Tried
    from damperfit.laws.judged_laws import LawSearch
    from damperfit.laws.law_fit import LawFit

__all__ = ["YIELDING", "held_against", "is_open_to", "unbelievable", "yielding_seen"]

YIELDING: tuple[type[Rival], ...] = (BoucWen, Biviscous, Kwok)
# Valves that fit and predict so many times better are told and nothing else is. Of synthetic
# dampers of the same kinds as measured ones the true valves are far better than that.
_CLEARLY = 4.0


def held_against(law: Tried, other: Tried, share: float) -> tuple[bool, str]:
    """Return whether what yields is taken instead of a law of valves, and why.

    Parameters
    ----------
    law, other : Tried
        Of valves, and of what yields.
    share : float
        Of their force that the logs hold down to a tenth of the speed.
    """
    holds = f"the logs hold {100.0 * share:.0f} % of their force down to a tenth of the speed"
    if times_worse(other, law) > 1.0 and not are_alike(other, law):
        return True, f"{holds}; it {_better(other, law)} than the law of valves"
    beyond = unbelievable(law)
    if is_open_to(law, other) and beyond:
        return True, f"{holds}; it fits them about as well as a law of valves whose {beyond}"
    if is_open_to(law, other):
        return False, f"{holds}; it fits them about as well as the law of valves"
    return False, f"{holds}; the law of valves {_better(law, other)}"


def _better(best: Tried, other: Tried) -> str:
    times = times_worse(best, other)
    known = f"{float(f'{times:.2g}'):.0f} times" if 2.0 <= times < 1000.0 else "far"
    return f"fits and predicts {'' if times < 2.0 else known + ' '}better"


def is_open_to(law: Tried, other: Tried) -> bool:
    """Return whether the logs leave it open which of both it is."""
    return times_worse(law, other) < _CLEARLY


def unbelievable(law: Tried) -> str:
    """Return what the logs tell of a law that no damper or rig has; empty for nothing.

    A law of valves that is bent to what yields has oil as soft as air at one setting, and as stiff
    as steel at another.

    Parameters
    ----------
    law : Tried
        Of valves.
    """
    for fit in law.fits:
        for one in fit.model.quantities:
            is_told = one.name in fit.free and one.name not in (*fit.undetermined, *fit.at_bound)
            low, high = one.believable
            if is_told and not low <= (value := getattr(fit.values, one.name)) <= high:
                shown = f"{10.0**-one.power * value:.3g} {one.shown_unit or one.unit}"
                return f"{one.symbol}, {shown} at setting {fit.setting}, no damper has"
    return ""


def yielding_seen(search: LawSearch, fits: Sequence[LawFit]) -> tuple[str, ...]:
    """Return what is told of a damper that yields; nothing of one whose valves are told.

    Parameters
    ----------
    search : LawSearch
        The laws that were tried.
    fits : sequence of LawFit
        The law that was taken, at every setting.
    """
    model = fits[0].model
    up_to = "up to " if search.is_held_by_some else ""
    share = f"{up_to}{100.0 * search.held_share:.0f} %"
    holds = f"It holds {share} of its force down to a tenth of its speed"
    if search.doubt:
        what = (
            "something that yields before it slides, as a magneto-rheological fluid or dry friction"
        )
        return (f"{holds}, and {search.doubt}: what acts may be {what}, and no valve is named.",)
    if not isinstance(model, YIELDING):
        return ()
    return (
        (
            f"{holds}: it yields before it slides, as a magneto-rheological fluid or dry friction "
            "does."
        ),
        f"{_numbers(fits)}.",
        (
            f"{model.title} fits that better than any valves that a damper may have, so no valve, "
            "mounting or delay is named."
        ),
    )


def _numbers(fits: Sequence[LawFit]) -> str:
    model = fits[0].model
    first = ["f_r", "f_b"] if isinstance(model, Biviscous) else ["alpha"]
    names = (*first, *(name for name in model.names if name in {"c", "c_r", "c_b"}))
    said = []
    for name in names:
        values = [float(getattr(one.values, name)) for one in fits]
        one = model.quantity(name)
        low, high = f"{min(values):.3g}", f"{max(values):.3g}"
        said.append(f"{one.label} {low if low == high else f'{low} to {high}'} {one.unit}")
    text = ", ".join(said)
    return text[0].upper() + text[1:]
