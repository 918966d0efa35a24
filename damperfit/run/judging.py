"""A campaign judged: intervals, verdicts, trends, checks, predictions; profiles where asked for.

What fails at one setting or log costs that one its judgement, and no other: the steps are told what
to do without, leave the log or the setting out, and it becomes a failure.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from damperfit.adjustment.clicks import Adjustment, compare_settings
from damperfit.checks import Check, Subject, run_checks, unchecked
from damperfit.errors import ConfigurationError, InstallationError, OutputError, mishap_of
from damperfit.problem import Failure, Option, Problem
from damperfit.recording import Trace
from damperfit.run.record import MANY, failures_of
from damperfit.uncertainty import (
    Assessment,
    Bench,
    Objection,
    Prediction,
    assess,
    missed_predictions,
    objections,
    predict,
    profile_campaign,
    reconsider,
)
from damperfit.uncertainty.grades import air_objections
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.damper.model import Model
    from damperfit.identification import Campaign
    from damperfit.run.identify import Clock
    from damperfit.run.logs import LogBatch
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Interval

_Result = TypeVar("_Result")

_TASK = "judging"
# What checks of another layout take of a valve's numbers: up to 5 % were seen beside the areas.
_RETURNS = 1.06
# MSE over that of the choice beyond which another fit was delivered; below a thousandth of the
# force, rms, nobody sees a difference.
_DELIVERED, _OF_NO_USE = 1.5, 1e-4


class Judgement(NamedTuple):
    """What was found of the fits: errors and verdicts, across settings, checks, predictions."""

    assessment: Assessment = Assessment()
    adjustment: Adjustment = Adjustment()
    checks: tuple[Check, ...] = ()
    predictions: tuple[Prediction, ...] = ()


class Mishaps:
    """What damperfit itself got wrong so far with the logs of a run, from any thread."""

    def __init__(self, batch: LogBatch) -> None:
        self._batch = batch
        self._found: list[Failure] = []

    @property
    def failures(self) -> tuple[Failure, ...]:
        """By setting, those of the whole run last."""
        key = lambda one: (one.setting is None, one.setting or 0, one.message)  # noqa: E731
        return tuple(sorted(self._found, key=key))

    def at(self, task: str) -> Callable[[Trace | Setting, Exception], None]:
        """Return what takes a log or a setting and the error that a task, as "judging", has met."""

        def take(whose: Trace | Setting, error: Exception) -> None:
            if isinstance(whose, Trace):
                mishap = mishap_of(error, f"{task} {whose.name}")
                path = self._batch.path_of(whose.name)
                self.add(replace(mishap, log=whose.name, path=path), whose.setting)
            else:
                self.add(mishap_of(error, f"{task} setting {whose}"), whose)

        return take

    def add(self, mishap: Failure, setting: Setting | None = None) -> None:
        """Take what a step over all settings, or one of them, has met, and went on."""
        self._found.append(replace(mishap, setting=setting))

    def spared(self, task: str, step: Callable[[], _Result], instead: _Result) -> _Result:
        """Return what a step finds, or what the run goes on with where the step has an error.

        What is wrong with the command as a whole is raised, and no mishap.
        """
        try:
            return step()
        except (ConfigurationError, InstallationError, OutputError):
            raise
        except Exception as error:  # noqa: BLE001 - what the run has done so far is written
            self.add(mishap_of(error, task))
            return instead


def judge(  # noqa: PLR0913 - what a judgement takes
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    mishaps: Mishaps,
    *,
    clock: Clock,
    cancelled: Callable[[], bool],
    jobs: int,
) -> tuple[Campaign, Judgement]:
    """Return the campaign with the statuses that its errors allow, and what was found of it."""
    damper, options = configuration.damper, configuration.identification
    solver, spared, take = options.solver, mishaps.spared, mishaps.at(_TASK)
    bench = Bench(damper, solver, cancelled, jobs)
    assessment = Assessment()
    with clock.lap("judge"):
        assessment = spared(
            "judging the fits",
            lambda: assess(
                campaign, damper, solver=solver, jobs=jobs, cancelled=cancelled, on_error=take
            ),
            assessment,
        )
    # Before the statuses: a profile that is flat has the last word on its parameter.
    if (names := configuration.profile) and campaign.fits and not cancelled():
        with clock.lap("profile"):
            assessment = spared(
                "following profiles",
                lambda: profile_campaign(campaign, assessment, bench, names=names, on_error=take),
                assessment,
            )
    with clock.lap("judge"):
        judged = reconsider(campaign, assessment)
        speeds = configuration.output.speeds
        adjustment = spared(
            "comparing the settings",
            lambda: compare_settings(judged, assessment, damper, speeds=speeds, on_error=take),
            Adjustment(),
        )
        predictions = _predicted(configuration, batch, judged, assessment, mishaps, jobs=jobs)
        against = _objections(configuration, judged, assessment, mishaps, jobs=jobs)
        for setting, objection in missed_predictions(predictions).items():
            against[setting] = (*against.get(setting, ()), objection)
        assessment = replace(assessment, objections=against)
        checks = spared(
            "checking the run",
            lambda: _checks(configuration, batch, judged, assessment, adjustment),
            unchecked(),
        )
        alike = configuration.chosen_law.get("layouts_alike", ())
        assessment = with_other_layouts(assessment, damper, alike)
    return judged, Judgement(assessment, adjustment, checks, predictions)


def _objections(
    configuration: Configuration,
    campaign: Campaign,
    assessment: Assessment,
    mishaps: Mishaps,
    *,
    jobs: int,
) -> dict[Setting, tuple[Objection, ...]]:
    """Return what a grade must not hide, but for predictions: of fits, of delivery, of air."""
    against: dict[Setting, tuple[Objection, ...]] = {}
    gas, assumed = configuration.conditioning.gas, configuration.assumed_dimensions
    against = mishaps.spared(
        "looking for what a grade must not hide",
        lambda: objections(campaign, assessment, gas, assumed=assumed),
        against,
    )
    advice = "fit each setting by itself{plain}"
    ways = {"plain": Option("procedure", "plain", is_aside=True)}
    if campaign.procedure == "plain":
        advice = "name the model{model}, and give its values as a start{start}"
        ways = {name: Option(name, is_aside=True) for name in ("model", "start")}
    more = []
    for fit in campaign.fits:  # a law that the logs chose must be fitted as it was chosen
        chosen = configuration.chosen_mse.get(fit.setting, math.inf)
        if fit.mse_percent > _DELIVERED * max(chosen, _OF_NO_USE):
            text = (
                f"the law was chosen at an MSE of {chosen:.2g} % and is fitted at "
                f"{fit.mse_percent:.2g} %, by procedure {campaign.procedure}; these are not the "
                f"parameters of the choice: {advice}"
            )
            problem = Problem("not-delivered", text, subject=f"setting {fit.setting}", values=ways)
            mishaps.add(Failure(problem, "DeliveryError"), fit.setting)
            more.append((fit.setting, Objection("delivery", "", problem.message())))
    air: dict[Setting, Objection] = {}
    if "damper.ambient_pressure" not in configuration.declared and not configuration.is_assumed:
        damper, options = configuration.damper, configuration.identification
        air = mishaps.spared(
            "looking for the air on the rod",
            lambda: air_objections(campaign, assessment, damper, options, jobs=jobs),
            air,
        )
    for setting, objection in (*more, *air.items()):
        against[setting] = (*against.get(setting, ()), objection)
    return against


def _predicted(
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    assessment: Assessment,
    mishaps: Mishaps,
    *,
    jobs: int,
) -> tuple[Prediction, ...]:
    """Return what was held out as the fits predict it; a log that fails costs that log."""
    damper, solver = configuration.damper, configuration.identification.solver
    take = mishaps.at("predicting")

    def predicted(trace: Trace) -> tuple[Prediction, ...]:
        try:
            return predict(campaign, assessment, (trace,), damper=damper, solver=solver)
        except Exception as error:  # noqa: BLE001 - the other logs are predicted
            take(trace, error)
            return ()

    with executor(jobs) as pool:
        predictions = [one for few in pool.map(predicted, batch.held_out) for one in few]
    return tuple(sorted(predictions, key=lambda one: one.setting))


def with_other_layouts(assessment: Assessment, damper: Model, layouts: Sequence[str]) -> Assessment:
    """Return the assessment with intervals of valves that reach to what they are in other layouts.

    The fits are in the layout of the damper; ``layouts`` are those that the logs do not tell from
    it.
    """
    if not layouts:
        return assessment
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.laws.structures import times_in

    if not isinstance(damper, ValveDamper):
        return assessment

    def reaching(name: str, own: Interval) -> Interval:
        if name.partition("_")[0] not in {"rebound", "compression"}:
            return own
        times = [times_in(layout, damper, name) for layout in layouts]
        low, high = min(times) / _RETURNS, max(times) * _RETURNS
        return replace(own, low=min(1.0, low) * own.low, high=max(1.0, high) * own.high)

    wider = (
        replace(one, intervals={k: reaching(k, own) for k, own in one.intervals.items()})
        for one in assessment.uncertainties
    )
    return replace(assessment, uncertainties=tuple(wider))


def _checks(
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    assessment: Assessment,
    adjustment: Adjustment,
) -> tuple[Check, ...]:
    lost = failures_of(configuration, batch, campaign)
    missing = [
        f"{one.place} {'left out' if one.is_left_out else 'failed'}" if one.place else one.message
        for one in lost[:MANY]
    ]
    if len(lost) > MANY:
        missing.append(f"and {len(lost) - MANY} more")
    rig = configuration.rig
    return run_checks(
        Subject(
            campaign,
            assessment,
            adjustment,
            missing=tuple(missing),
            temperature=rig.temperature,
            temperature_tolerance=rig.temperature_tolerance,
            undeclared=configuration.not_measured,
            whose=configuration.whose if configuration.is_assumed else "",
        )
    )
