"""A fit that is much worse than its neighbour's starts again from where that one ended.

So does one that ran to the edge of a range: a minimum within that fits as well is preferred.

Clicks change a damper little: where setting 4 is met to 0.05 % and setting 5 to 2 %, the fit of 5
has more likely ended in a wrong valley than met another damper. What stands in the first results
alone decides, so that the order in which settings are done does not matter.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.errors import FitCancelledError, SimulationError
from damperfit.identification.outcome import Outcome
from damperfit.identification.restarts import LEAST, WELL_ABOVE
from damperfit.identification.setting import attempt, describe_fit, is_sound
from damperfit.statistics import CHI_SQUARED_95
from damperfit.tested.setting import nearest_setting
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.identification.descent import Misfit
    from damperfit.identification.every_setting import Campaign
    from damperfit.identification.setting import Fit
    from damperfit.tested.setting import Setting

__all__ = ["beside_neighbours"]

# Two clicks of one damper are met alike; the MSE of a soft and a stiff one may differ by half.
MUCH_WORSE = 2.0


def beside_neighbours(
    campaign: Campaign, misfit_of: Callable[[Setting], Misfit], *, jobs: int
) -> Campaign:
    """Return the fits, those that are much worse than their neighbour's started again from there.

    Parameters
    ----------
    campaign : Campaign
        Fits of settings by themselves.
    misfit_of : callable
        What is fitted at a setting.
    jobs : int
        Threads; the result does not depend on them.
    """
    sound = {fit.setting: fit for fit in campaign.fits if fit.outcome is Outcome.CONVERGED}

    def again(fit: Fit) -> Fit:
        others = {setting: one for setting, one in sound.items() if _is_in_doubt(fit, one)}
        near = nearest_setting(fit.setting, others)
        if near is None:
            return fit
        try:
            return _from(others[near], fit, misfit_of(fit.setting))
        except (SimulationError, FitCancelledError):
            return fit

    if not campaign.is_complete:
        return campaign
    with executor(jobs) as pool:
        return replace(campaign, fits=tuple(pool.map(again, campaign.fits)))


def _is_in_doubt(fit: Fit, neighbour: Fit) -> bool:
    """Whether a fit is so much worse than another that noise is no reason, or ran to an edge."""
    if _ran_to_an_edge(fit):
        return True
    floor = max(LEAST, WELL_ABOVE * fit.noise_floor_percent)  # NaN: the first
    return fit.mse_percent > max(floor, MUCH_WORSE * neighbour.mse_percent)


def _from(neighbour: Fit, fit: Fit, misfit: Misfit) -> Fit:
    """The better of a fit and of one from its neighbour's values, with its own offset."""
    own = {
        one.name: getattr(fit.parameters, one.name)
        for one in fit.parameters.quantities
        if one.name not in misfit.free or one.is_offset
    }
    judged = attempt(misfit, neighbour.parameters.replace(own), fit.evaluations)
    solution = judged.solution
    gain = fit.mse_percent / max(solution.mse_percent, 1e-300) - 1.0
    if _is_level(gain * solution.n_independent) and is_sound(judged) and _ran_to_an_edge(fit):
        said = (
            "the first fit ran to the edge of a range: from the values of setting "
            f"{neighbour.setting} it found a minimum within them that fits as well, which is used."
        )
        return describe_fit(fit.setting, replace(judged, said=(said,)), misfit)
    if gain * solution.n_independent <= CHI_SQUARED_95:
        return replace(fit, evaluations=solution.evaluations)
    said = (
        f"the first fit ended in a local minimum (MSE {fit.mse_percent:.2g} %): from the values of "
        f"setting {neighbour.setting} it found a better one ({solution.mse_percent:.2g} %), which "
        "is used."
    )
    return describe_fit(fit.setting, replace(judged, said=(said,)), misfit)


def _ran_to_an_edge(fit: Fit) -> bool:
    return fit.outcome is Outcome.AT_BOUND


def _is_level(gain: float) -> bool:
    """Whether noise alone makes two misfits differ by so much, in units of chi squared."""
    return abs(gain) <= CHI_SQUARED_95
