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
from damperfit.uncertainty import Objection

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model
    from damperfit.identification import Campaign, Fit
    from damperfit.simulation import SolverOptions
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Assessment

__all__ = ["air_objections"]

# Standard errors by which the squares of the residuals must fall, cycle by cycle: Q. H. Vuong,
# Econometrica 57 (1989), of two models neither of which is a case of the other.
_CERTAIN = 4.0
# Times the noise: a model that misses by more than its noise says nothing of a few newtons.
_OF_NOISE = 2.0


def air_objections(
    configuration: Configuration,
    campaign: Campaign,
    assessment: Assessment,
    *,
    jobs: int,
) -> dict[Setting, Objection]:
    """Return why no grade stands where the logs of the paper's model show the air on the rod.

    They are fitted again with 1.013 bar of air. Nothing where somebody has declared the air or
    has declared no damper, where an offset takes its place, or where it is not needed.

    Parameters
    ----------
    configuration : Configuration
        The complete configuration.
    campaign : Campaign
        The fits without it.
    assessment : Assessment
        What of their MSE is noise.
    jobs : int
        Threads.
    """
    damper = configuration.damper
    if not _is_open(configuration, campaign):
        return {}
    inside = replace(damper.plain, ambient_pressure=AMBIENT)  # type: ignore[type-var]
    with_air: Model = inside if damper.plain is damper else replace(damper, damper=inside)  # type: ignore[type-var]
    options = configuration.identification
    start = GivenStart(
        by_setting={fit.setting: _free_of(fit) for fit in campaign.fits}, named=options.start.named
    )
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
    return {fit.setting: _objection(fit, other) for fit, other in pairs}


def _is_open(configuration: Configuration, campaign: Campaign) -> bool:
    """Whether the paper's equation was taken for another damper, with nothing for the air."""
    is_declared = "damper.ambient_pressure" in configuration.declared or configuration.is_assumed
    if configuration.damper.name != PURDY_DAMPER.name or is_declared or not campaign.fits:
        return False
    return not any(_has_offset(fit) for fit in campaign.fits)


def _has_offset(fit: Fit) -> bool:
    offsets = [one.name for one in fit.parameters.quantities if one.is_offset]
    return any(fit.status[name] != Status.FIXED for name in offsets)


def _free_of(fit: Fit) -> dict[str, float]:
    return {
        name: getattr(fit.parameters, name)
        for name, status in fit.status.items()
        if status not in {Status.FIXED, Status.ABSENT}
    }


def _gains(
    one: tuple[Fit, Model], other: tuple[Fit, Model], solver: SolverOptions
) -> Iterator[float]:
    """Yield by how much the other fit's squares are less, N^2, cycle by cycle."""
    for first, second in zip(one[0].logs, other[0].logs, strict=True):
        squares = [
            (log.trace.force - log.compared(fit.parameters, damper, solver).force) ** 2
            for log, (fit, damper) in ((first, one), (second, other))
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


def _objection(fit: Fit, other: Fit) -> Objection:
    bar = AMBIENT / 1e5
    return Objection(
        "dimensions",
        "",
        f"the logs show the air on the rod, which the paper's equation leaves out: with {bar:.4g} "
        f"bar the MSE is {other.mse_percent:.3g} % instead of {fit.mse_percent:.3g} %: set "
        'damper.ambient_pressure = "1.013bara", unless gas_pressure is declared 1 bar too high',
    )
