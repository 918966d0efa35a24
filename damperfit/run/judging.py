"""A campaign judged: intervals, verdicts, trends, checks, predictions; profiles where asked for.

What fails at one setting or log costs that one its judgement, and no other.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.adjustment import Adjustment, compare_settings
from damperfit.checks import Subject, run_checks, unchecked
from damperfit.run.record import Judgement, failures_of
from damperfit.run.remarks import MANY
from damperfit.uncertainty import (
    Assessment,
    Bench,
    assess,
    predict,
    profile_campaign,
    reconsider,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from damperfit.checks import Check
    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign
    from damperfit.recording import Trace
    from damperfit.run.hold_out import Parted
    from damperfit.run.mishaps import Mishaps
    from damperfit.uncertainty import Prediction

__all__ = ["judge", "with_profiles"]

_TASK = "judging"


def judge(
    configuration: Configuration,
    parted: Parted,
    campaign: Campaign,
    mishaps: Mishaps,
    *,
    jobs: int,
    cancelled: Callable[[], bool],
) -> tuple[Campaign, Judgement]:
    """Return the campaign with the statuses that its errors allow, and what was found of it.

    Parameters
    ----------
    configuration : Configuration
        The complete configuration.
    parted : Parted
        The logs, and which of them were held out.
    campaign : Campaign
        The fits.
    mishaps : Mishaps
        Takes what goes wrong.
    jobs : int
        Threads.
    cancelled : callable
        Asked now and then.
    """
    damper, solver = configuration.damper, configuration.identification.solver
    at_setting = mishaps.at_setting(_TASK)
    assessment = mishaps.spared(
        "judging the fits",
        lambda: assess(
            campaign, damper, solver=solver, jobs=jobs, cancelled=cancelled, on_error=at_setting
        ),
        Assessment(),
    )
    judged = reconsider(campaign, assessment)
    adjustment = mishaps.spared(
        "comparing the settings",
        lambda: compare_settings(
            judged, assessment, damper, solver=solver, jobs=jobs, on_error=at_setting
        ),
        Adjustment(),
    )
    checks = mishaps.spared(
        "checking the run",
        lambda: _checks(configuration, parted, judged, assessment, adjustment),
        unchecked(),
    )
    take = mishaps.at_log("predicting")

    def predicted(trace: Trace) -> tuple[Prediction, ...]:
        try:
            return predict(judged, assessment, (trace,), damper=damper, solver=solver)
        except Exception as error:  # noqa: BLE001 - the other logs are predicted
            take(trace, error)
            return ()

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        found = [one for few in pool.map(predicted, parted.held_out) for one in few]
    predictions = tuple(sorted(found, key=lambda one: one.setting))
    return judged, Judgement(assessment, adjustment, checks, predictions)


def _checks(
    configuration: Configuration,
    parted: Parted,
    campaign: Campaign,
    assessment: Assessment,
    adjustment: Adjustment,
) -> tuple[Check, ...]:
    lost = failures_of(configuration, parted.batch, campaign)
    missing = [
        f"{one.place} {'left out' if one.is_left_out else 'failed'}" if one.place else one.message
        for one in lost[:MANY]
    ]
    if len(lost) > MANY:
        missing.append(f"and {len(lost) - MANY} more")
    subject = Subject(
        campaign,
        assessment,
        adjustment,
        missing=tuple(missing),
        temperature=configuration.rig.temperature,
        temperature_tolerance=configuration.rig.temperature_tolerance,
    )
    return run_checks(subject)


def with_profiles(
    configuration: Configuration,
    campaign: Campaign,
    judgement: Judgement,
    mishaps: Mishaps,
    *,
    jobs: int,
    cancelled: Callable[[], bool],
) -> Judgement:
    """Return the judgement with the profiles that were asked for; parameters as in `judge`."""
    bench = Bench(configuration.damper, configuration.identification.solver, cancelled, jobs)
    assessment = mishaps.spared(
        "following profiles",
        lambda: profile_campaign(
            campaign,
            judgement.assessment,
            bench,
            names=configuration.profile,
            on_error=mishaps.at_setting(_TASK),
        ),
        judgement.assessment,
    )
    return replace(judgement, assessment=assessment)
