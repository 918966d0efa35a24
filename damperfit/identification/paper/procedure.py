"""The paper's own procedure, automated.

All five parameters at the lowest setting give R_m3; the mean of the friction over a first pass of
all settings gives f_f; then R_m1, R_m2 and K_e at every setting.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import FitCancelledError
from damperfit.identification.every_setting import Campaign, fit_every_setting, with_status
from damperfit.identification.last_step import beside_earlier
from damperfit.identification.multistart import Search, fit_from
from damperfit.identification.outcome import Status
from damperfit.identification.paper.first_pass import first_pass
from damperfit.identification.procedure_input import ProcedureInput
from damperfit.identification.setting import Fit, describe_fit
from damperfit.identification.solution import Earlier

if TYPE_CHECKING:
    from damperfit.identification.paper.first_pass import FirstPass
    from damperfit.tested.setting import Setting

__all__ = ["as_in_the_paper"]


def as_in_the_paper(given: ProcedureInput) -> Campaign:
    """The paper's own procedure, sections 3 and 4 of its identification."""
    quantities = given.damper.quantities
    fixed = dict(given.options.fixed)
    own = (one.name for one in quantities if one.default is None and not one.is_shared)
    free = given.options.free or tuple(name for name in own if name not in fixed)
    for one in quantities:
        if one.default is not None and one.name not in free:
            fixed.setdefault(one.name, one.default)
    shared_free = tuple(one.name for one in quantities if one.name not in fixed)
    try:
        first, warnings = first_pass(given, given.ordered(shared_free), fixed, set(free))
    except FitCancelledError:
        return Campaign("paper", (), is_complete=False)
    held = {**{k: v for k, v in fixed.items() if k not in free}, **first.shared}

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        misfit = given.misfit(setting, given.ordered(free))
        misfit = replace(misfit, earlier=_earlier(first, setting))
        start = (first.start(setting) or given.start(setting, misfit, held)).replace(held)
        start = beside_earlier(misfit, start)
        judged, found = fit_from(given, setting, misfit, start, spent=first.evaluations(setting))
        named = dict.fromkeys(first.sharing.found, Status.SHARED) | dict(first.status)
        return describe_fit(setting, with_status(judged, named), misfit), found

    collected = fit_every_setting(given, fit, warnings, known=first.broken)
    return replace(
        collected, sharing=first.sharing, searches=(*first.searches, *collected.searches)
    )


def _earlier(first: FirstPass, setting: Setting) -> Earlier | None:
    """Where the first pass has ended at a setting, if the second starts there."""
    if first.start(setting) is None:
        return None
    judged = first.judged[setting]
    return Earlier(tuple(judged.errors), judged.solution)
