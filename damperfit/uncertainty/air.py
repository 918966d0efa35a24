"""The air on the rod, which the paper's equation leaves out, where the logs show that it is there.

The air presses the rod in with a_r P_amb, 11 N on a rod of 12 mm and 39 N on one of 22 mm. A load
cell that was zeroed without the damper sees it. Where the model leaves it out, R_m3 and friction
take its place and the MSE hardly rises; but it rises in every cycle, and that can be seen.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.purdy.parameters import PURDY_DAMPER
from damperfit.damper.valve_dampers import AMBIENT
from damperfit.errors import DamperfitError
from damperfit.identification import GivenStart, Status, identify
from damperfit.uncertainty.withheld import Objection

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.damper.model import Model
    from damperfit.identification import Campaign, Fit, FitOptions
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty.assessment import Assessment

__all__ = ["air_objections"]

# Standard errors by which the squares of the residuals must fall, cycle by cycle: Q. H. Vuong,
# Econometrica 57 (1989), of two models neither of which is a case of the other.
_CERTAIN = 4.0
# Times the noise: a model that misses by more than its noise says nothing of a few newtons.
_OF_NOISE = 2.0


def air_objections(
    campaign: Campaign, assessment: Assessment, damper: Model, options: FitOptions, *, jobs: int
) -> dict[Setting, Objection]:
    """Return why no grade stands where the logs of the paper's model show the air on the rod.

    They are fitted again with 1.013 bar of air. Nothing of another model, where a free offset takes
    the air's place, or where it is not needed.

    Parameters
    ----------
    campaign : Campaign
        The fits without it.
    assessment : Assessment
        What of their MSE is noise.
    damper : Model
        Without it.
    options : FitOptions
        How the campaign was fitted.
    jobs : int
        Threads.
    """
    offsets = {one.name for one in damper.quantities if one.is_offset}
    has_offset = any(fit.status[name] != Status.FIXED for fit in campaign.fits for name in offsets)
    if damper.name != PURDY_DAMPER.name or has_offset or not campaign.fits:
        return {}
    inside = replace(damper.plain, ambient_pressure=AMBIENT)  # type: ignore[type-var]
    with_air: Model = inside if damper.plain is damper else replace(damper, damper=inside)  # type: ignore[type-var]
    idle = {Status.FIXED, Status.ABSENT}
    free = {
        fit.setting: {
            name: getattr(fit.parameters, name)
            for name, status in fit.status.items()
            if status not in idle
        }
        for fit in campaign.fits
    }
    start = GivenStart(by_setting=free, named=options.start.named)
    traces = [log.trace for fit in campaign.fits for log in fit.logs]
    try:
        again = identify(traces, with_air, replace(options, start=start, starts=1), jobs=jobs)
    except DamperfitError:  # what it would have shown is not known
        return {}
    others = {fit.setting: fit for fit in again.fits}
    pairs = [(fit, others[fit.setting]) for fit in campaign.fits if fit.setting in others]
    noise = {one.setting: one.noise_percent for one in assessment.diagnoses}
    gains = [
        gain
        for fit, other in pairs
        if other.mse_percent <= _OF_NOISE * noise.get(fit.setting, math.nan)
        for gain in _gains((fit, damper), (other, with_air), options.solver)
    ]
    if not _is_certain(gains):
        return {}
    return {
        fit.setting: Objection(
            "dimensions",
            "",
            "the logs show the air on the rod, which the paper's equation leaves out: with "
            f"{AMBIENT / 1e5:.4g} bar the MSE is {other.mse_percent:.3g} % instead of "
            f'{fit.mse_percent:.3g} %: set damper.ambient_pressure = "1.013bara", unless '
            "gas_pressure is declared 1 bar too high",
        )
        for fit, other in pairs
    }


def _gains(
    without: tuple[Fit, Model], with_air: tuple[Fit, Model], solver: SolverOptions
) -> Iterator[float]:
    """Yield by how much the squares are less with the air, N^2, cycle by cycle."""
    for first, second in zip(without[0].logs, with_air[0].logs, strict=True):
        squares = [
            (log.trace.force - log.compared(fit.parameters, damper, solver).force) ** 2
            for log, (fit, damper) in ((first, without), (second, with_air))
        ]
        for stretch in first.trace.stretches:
            fall = (squares[0] - squares[1])[stretch.window]
            for cycle in np.array_split(fall, max(stretch.n_cycles, 1)):
                yield float(np.sum(cycle))


def _is_certain(gains: Sequence[float]) -> bool:
    """Whether the mean of what is gained is above nothing by far more than chance."""
    if len(gains) < 2:
        return False
    error = float(np.std(gains, ddof=1)) / math.sqrt(len(gains))
    return float(np.mean(gains)) > _CERTAIN * error
