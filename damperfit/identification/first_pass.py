"""The first pass of the paper's procedure: everything free, and what it says of R_m3 and f_f."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import DamperfitError
from damperfit.identification.descent import FitCancelledError, Misfit
from damperfit.identification.setting import Judged, fit_guided, fit_setting, is_sound
from damperfit.identification.sharing import Sharing
from damperfit.identification.starting import starting_values
from damperfit.identification.task import Task, closed_form_start

if TYPE_CHECKING:
    from collections.abc import Mapping

    from damperfit.damper.parameters import Parameters
    from damperfit.identification.options import FitOptions

__all__ = ["FirstPass", "first_pass"]

# A first-pass friction is used when its setting's R_m3 agrees this well with the lowest setting's.
_SAME_R_M3 = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class FirstPass:
    """Fits with everything free, by setting, and the shared values they give.

    Attributes
    ----------
    judged : mapping of int to Judged
        Settings that could be fitted.
    shared : mapping of str to float
        R_m3 and f_f, SI, as far as they are wanted; from the logs or the fallback.
    sharing : Sharing
        Where they came from.
    """

    judged: Mapping[int, Judged]
    shared: Mapping[str, float]
    sharing: Sharing = Sharing()

    def start(self, setting: int) -> Parameters | None:
        """Where the second pass starts, if the first ended where a fit should end."""
        judged = self.judged.get(setting)
        return judged.solution.parameters if judged is not None and is_sound(judged) else None

    def evaluations(self, setting: int) -> int:
        """Return the simulations spent on a setting."""
        return self.judged[setting].solution.evaluations if setting in self.judged else 0


def first_pass(
    task: Task, names: tuple[str, ...], fixed: Mapping[str, float], free: set[str]
) -> tuple[FirstPass, tuple[str, ...]]:
    """All parameters free at every setting; returns R_m3 and f_f as the paper takes them."""
    wanted = [name for name in ("r_m3", "f_f") if name not in fixed and name not in free]
    if not wanted:
        return FirstPass({}, {}), ()
    lowest = min(task.settings)
    warnings: list[str] = []
    if lowest != 1 and "r_m3" in wanted:
        warnings.append(f"there is no log of setting 1: R_m3 is taken from setting {lowest}.")
    misfit = task.misfit(lowest, names)
    judged = {lowest: fit_setting(misfit, closed_form_start(misfit, fixed))}
    shared: dict[str, float] = {}
    anchor = judged[lowest].solution.parameters
    r_m3_from, is_refined = None, False
    f_f_from: tuple[int, ...] = ()
    if "r_m3" in wanted:
        shared["r_m3"], said = _shared_r_m3(judged[lowest], lowest, task.options)
        r_m3_from = None if said else lowest
        warnings.extend(said)
    anchor = replace(anchor, **shared)
    judged.update(_free_everywhere(task, names, fixed, anchor))
    if "f_f" in wanted:
        shared["f_f"], f_f_from, said = _shared_friction(judged, shared, task.options)
        warnings.extend(said)
    if set(wanted) == {"r_m3", "f_f"} and is_sound(judged[lowest]) and len(judged) > 1:
        again = _with_mean_friction(misfit, judged[lowest], shared["f_f"])
        is_refined = again is not judged[lowest]
        judged[lowest] = again
        shared["r_m3"] = again.solution.parameters.r_m3
    sharing = Sharing(names, r_m3_from=r_m3_from, f_f_from=f_f_from, is_refined=is_refined)
    return FirstPass(judged, shared, sharing), tuple(warnings)


def _with_mean_friction(misfit: Misfit, judged: Judged, f_f: float) -> Judged:
    """The lowest setting once more with the mean friction, which halves the error of its R_m3.

    R_m3 and f_f are strongly correlated within one setting; the mean over the settings knows f_f
    better than any one of them. An unsound result changes nothing.
    """
    free = tuple(name for name in misfit.free if name != "f_f")
    start = replace(judged.solution.parameters, f_f=f_f)
    again = fit_setting(replace(misfit, free=free), start, spent=judged.solution.evaluations)
    return again if is_sound(again) else judged


def _free_everywhere(
    task: Task, names: tuple[str, ...], fixed: Mapping[str, float], anchor: Parameters
) -> dict[int, Judged]:
    """The first pass at all settings but the lowest, each from its closed form and the anchor."""

    def one(setting: int) -> Judged | None:
        misfit = task.misfit(setting, names)
        known = {**fixed, "r_m3": anchor.r_m3, "f_f": anchor.f_f}
        start = starting_values(misfit.traces, task.damper, known, anchor.k_e)
        try:
            return fit_guided(misfit, start)
        except FitCancelledError:
            raise
        except DamperfitError:
            return None

    others = sorted(task.settings)[1:]
    with ThreadPoolExecutor(task.jobs) as pool:
        found = dict(zip(others, pool.map(one, others), strict=True))
    return {setting: judged for setting, judged in found.items() if judged is not None}


def _shared_r_m3(judged: Judged, lowest: int, options: FitOptions) -> tuple[float, list[str]]:
    if is_sound(judged) or judged.status["r_m3"] == "fitted":
        return judged.solution.parameters.r_m3, []
    said = (
        f"the logs of setting {lowest} do not fix R_m3 ({judged.outcome.value}): the paper's "
        f"{options.fallback_r_m3:.4g} is used; give --fix r_m3=VALUE if yours is known."
    )
    return options.fallback_r_m3, [said]


def _shared_friction(
    judged: Mapping[int, Judged], shared: Mapping[str, float], options: FitOptions
) -> tuple[float, tuple[int, ...], list[str]]:
    """The mean friction over the settings whose first pass is sound, and these settings."""
    sound = {
        setting: one.solution.parameters
        for setting, one in judged.items()
        if is_sound(one)
        and abs(one.solution.parameters.r_m3 / shared.get("r_m3", one.solution.parameters.r_m3) - 1)
        < _SAME_R_M3
    }
    if not sound:
        said = (
            "no setting's logs fix the friction: the paper's "
            f"{options.fallback_f_f:g} N is used; give --fix f_f=VALUE if yours is known."
        )
        return options.fallback_f_f, (), [said]
    left_out = sorted(set(judged) - set(sound))
    warnings = []
    if left_out:
        listed = ", ".join(str(setting) for setting in left_out)
        warnings.append(
            f"friction is the mean over {len(sound)} of {len(judged)} settings: with all "
            f"parameters free the fit is not sound at setting {listed}."
        )
    used = tuple(sorted(sound))
    return float(np.mean([sound[setting].f_f for setting in used])), used, warnings
