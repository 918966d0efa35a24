"""Checks of what was found against physics and the log itself: oil, tare, friction, mounting.

They look at the same objections that withhold a grade (`damperfit.uncertainty.withheld`), so that
check and grade cannot disagree.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from damperfit.identification import Status
from damperfit.identification.sharing import of_settings
from damperfit.uncertainty.withheld import what_spreads

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Fit
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Objection

    Objections = Mapping[Setting, Sequence[Objection]]
    Verdict = tuple[bool | None, str]

__all__ = ["PHYSICAL_CHECKS"]

_FOUND = (Status.FITTED, Status.SHARED)


def _every_grade_stands(fits: Sequence[Fit], said: Objections) -> Verdict:
    if said:
        first = next(iter(said))
        return False, (
            f"grades are withheld at {of_settings(said)}; setting {first}: "
            f"{'; '.join(one.sentence for one in said[first])}"
        )
    return True, f"no objection to the grade of {of_settings([fit.setting for fit in fits])}"


def _bulk_modulus_of_oil(fits: Sequence[Fit], said: Objections) -> Verdict:
    names = _quantities(fits, lambda one: one.unit == "Pa" and math.isfinite(one.believable[1]))
    if not names:
        return None, "the oil of the model is incompressible"
    return _judged(fits, said, names, "beyond", "that of oil")


def _offset_as_in_log(fits: Sequence[Fit], said: Objections) -> Verdict:
    names = _quantities(fits, lambda one: one.is_offset)
    if not names:
        return None, "the model has no offset of the force"
    against = _against(said, names, "offset")
    if against:
        return False, _first(against)
    return True, "no offset contradicts the level of the force in the logs"


def _friction_within_jump(fits: Sequence[Fit], said: Objections) -> Verdict:
    names = _quantities(fits, lambda one: one.is_friction)
    if not names:
        return None, "the model has no friction"
    read = [fit for fit in fits if not what_spreads(fit)]
    if not read:
        return None, what_spreads(fits[0])
    return _judged(read, said, names, "friction", "within the jump of the force at the reversals")


def _series_stiffness_found(fits: Sequence[Fit], said: Objections) -> Verdict:
    names = _quantities(fits, lambda one: one.unit == "N/m")
    if not names:
        return None, "the model has no stiffness in series"
    lost = [fit for fit in fits if any(fit.status[name].has_failed for name in names)]
    if lost:
        where = of_settings(fit.setting for fit in lost)
        return False, f"{' and '.join(names)} is not determined by the logs at {where}"
    return _judged(fits, said, names, "beyond", "in the range of test rigs")


PHYSICAL_CHECKS: dict[str, Callable[[Sequence[Fit], Objections], Verdict]] = {
    "every_grade_stands": _every_grade_stands,
    "bulk_modulus_of_oil": _bulk_modulus_of_oil,
    "offset_as_in_log": _offset_as_in_log,
    "friction_within_jump": _friction_within_jump,
    "series_stiffness_found": _series_stiffness_found,
}


def _quantities(fits: Sequence[Fit], belongs: Callable[[Quantity], bool]) -> tuple[str, ...]:
    return tuple(one.name for one in fits[0].parameters.quantities if belongs(one))


def _judged(
    fits: Sequence[Fit], said: Objections, names: Sequence[str], kind: str, what: str
) -> Verdict:
    """Fail with the first objection, pass where the logs determine a value, else not looked at."""
    against = _against(said, names, kind)
    if against:
        return False, _first(against)
    determined = [fit for fit in fits if any(fit.status[name] in _FOUND for name in names)]
    if not determined:
        return None, f"no log determined {' or '.join(names)}"
    return (
        True,
        f"{' and '.join(names)} is {what} at {of_settings(fit.setting for fit in determined)}",
    )


def _against(said: Objections, names: Sequence[str], kind: str) -> dict[Setting, str]:
    return {
        setting: one.sentence
        for setting, why in said.items()
        for one in why
        if one.kind == kind and one.quantity in names
    }


def _first(against: Mapping[Setting, str]) -> str:
    """Return where there are objections, and the first of them."""
    setting = next(iter(against))
    where = "" if len(against) == 1 else f"at {of_settings(against)}: "
    return f"{where}setting {setting}: {against[setting]}"
