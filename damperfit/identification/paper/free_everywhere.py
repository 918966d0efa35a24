"""Everything free at every setting but the lowest: the first pass of the paper's procedure.

Closed forms and the lowest setting tell a start from which a fit needs two descents. Settings
beside each other are alike: where every fourth is known, those between start near their ends.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, cast

from damperfit.damper.purdy.starting import REBOUND, starting_values
from damperfit.errors import SimulationError
from damperfit.identification.failures import SettingFailure, attempted
from damperfit.identification.setting import Judged, fit_guided, fit_setting, is_sound
from damperfit.workers import apart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.model import Values
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.identification.procedure_input import ProcedureInput
    from damperfit.tested.setting import Setting

__all__ = ["free_everywhere"]

# Of so many settings one is fitted first.
_STRIDE = 4


def free_everywhere(
    given: ProcedureInput,
    names: tuple[str, ...],
    fixed: Mapping[str, float],
    anchor: Values,
    settings: Sequence[Setting],
) -> dict[Setting, Judged | SettingFailure]:
    """Return the fits of settings with everything free; whatever the number of workers, the same.

    Parameters
    ----------
    given : ProcedureInput
        Logs, model and options.
    names : tuple of str
        What is free.
    fixed : mapping of str to float
        What is not.
    anchor : Values
        The lowest setting's, for what a closed form does not tell.
    settings : sequence of Setting
        By rising setting.
    """
    damper = cast("Damper", given.damper)

    def one(setting: Setting, between: Values | None = None) -> Judged:
        misfit = given.misfit(setting, names, is_followed=True)
        if between is not None and given.with_given_start(setting, between, fixed) == between:
            with suppress(SimulationError):
                found = fit_setting(misfit, between)
                if is_sound(found):
                    return found
        known = {**fixed, "r_m3": anchor.r_m3, "f_f": anchor.f_f}
        start = starting_values(misfit.traces, damper, known, anchor.k_e)
        return fit_guided(misfit, given.with_given_start(setting, start, fixed), REBOUND)

    starts: dict[Setting, Values] = {}

    def tried(setting: Setting) -> Judged | SettingFailure:
        return attempted(setting, lambda: one(setting, starts.get(setting)))

    def side_by_side(few: Sequence[Setting]) -> dict[Setting, Judged | SettingFailure]:
        fits = apart(tried, few, jobs=given.jobs, known=given.known, cancelled=given.cancelled)
        return dict(zip(few, fits, strict=True))

    found = side_by_side(settings[::_STRIDE])
    starts.update(_between(settings, found))
    found |= side_by_side([setting for setting in settings if setting not in found])
    return {setting: found[setting] for setting in settings}


def _between(
    settings: Sequence[Setting], found: Mapping[Setting, Judged | SettingFailure]
) -> dict[Setting, Values]:
    """Where the settings between two sound fits should end."""
    starts = {}
    for first in range(0, len(settings) - _STRIDE, _STRIDE):
        low, high = (_sound(found[settings[at]]) for at in (first, first + _STRIDE))
        if low is None or high is None:
            continue
        for k in range(1, _STRIDE):
            starts[settings[first + k]] = _mean(low, high, k / _STRIDE)
    return starts


def _sound(fit: Judged | SettingFailure) -> Values | None:
    return fit.solution.parameters if isinstance(fit, Judged) and is_sound(fit) else None


def _mean(low: Values, high: Values, share: float) -> Values:
    """Values on the way from one to another, along their logarithms where they have some."""
    found = {}
    for one in low.quantities:
        a, b = getattr(low, one.name), getattr(high, one.name)
        if a == b:
            continue
        found[one.name] = a * (b / a) ** share if one.is_logarithmic else a + share * (b - a)
    return low.replace(found)
