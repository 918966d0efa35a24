"""The settings of a campaign beside each other: trends of the parameters, forces, clicks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.adjustment.click_changes import Click, clicks
from damperfit.adjustment.forces import Sine, levels_coming, named_speeds, sine_of
from damperfit.adjustment.level import Level, offset_sentence
from damperfit.adjustment.measured import credible_forces
from damperfit.adjustment.stage import stage_of
from damperfit.adjustment.trends import Trend, find_trends
from damperfit.simulation import SolverOptions

if TYPE_CHECKING:
    from damperfit.damper.model import Model
    from damperfit.errors import OnError
    from damperfit.identification import Campaign
    from damperfit.uncertainty import Assessment

__all__ = ["Adjustment", "compare_settings"]


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What shows only across settings.

    Attributes
    ----------
    trends : tuple of Trend
        One for each parameter that was fitted setting by setting.
    sine : Sine or None
        Motion of the forces; None without a fit.
    levels : tuple of Level
        Force of the model by setting, named speed and stroke, the measured one beside it.
    clicks : tuple of Click
        Its change between neighbouring settings.
    """

    trends: tuple[Trend, ...] = ()
    sine: Sine | None = None
    levels: tuple[Level, ...] = ()
    clicks: tuple[Click, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """What there is to say of the trends, one sentence a parameter, and of offsets."""
        trends = tuple(trend.sentence for trend in self.trends)
        return (*trends, *self.of_offset)

    @property
    def of_offset(self) -> tuple[str, ...]:
        """What became of the rigs' offsets in forces by setting; empty where there are none."""
        said = offset_sentence(
            [level.tare for level in self.levels],
            is_whole=True,
            holds_gas=any(level.holds_gas for level in self.levels),
        )
        return (f"forces by setting: {said}",) if said else ()


def compare_settings(
    campaign: Campaign,
    assessment: Assessment,
    damper: Model,
    *,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
    jobs: int = 1,
    on_error: OnError | None = None,
) -> Adjustment:
    """Lay the settings of a campaign beside each other; two simulated cycles a setting.

    Parameters
    ----------
    campaign : Campaign
        Result of `damperfit.identification.identify`.
    assessment : Assessment
        The same campaign judged.
    damper : Model
        The damper's model.
    solver : SolverOptions
        How exactly to integrate.
    jobs : int
        Threads.
    on_error : callable, optional
        Told of a setting and the error that it met; without it such an error is raised.
    """
    if not campaign.fits:
        return Adjustment()
    known = {one.setting: one for one in assessment.uncertainties}
    sine = sine_of([log.trace for fit in campaign.fits for log in fit.logs])
    with levels_coming(
        [stage_of(fit, known.get(fit.setting)) for fit in campaign.fits],
        damper,
        sine,
        speeds=named_speeds(sine),
        solver=solver,
        jobs=jobs,
        measured=assessment.forces,
        on_error=on_error,
    ) as coming:
        trends = find_trends(campaign.fits, known)
        found = coming()
    return Adjustment(
        trends=trends,
        sine=sine,
        levels=found,
        clicks=clicks(credible_forces(found), damper),
    )
