"""A campaign assessed, and what a run reports of itself: warnings, tables, run.json.

What fails at one setting or log costs that one its assessment, and no other: the steps leave the
log or the setting out, and it becomes a failure.

Of many equal problems the first is shown, and how many more: hundreds of logs or settings with the
same flaw are one sentence. The facts that go into the tables depend on the good logs and the
configuration alone, so that a bad log beside them changes no byte; run.json has everything.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from damperfit import __version__
from damperfit.adjustment.clicks import Adjustment, compare_settings
from damperfit.checks import Check, Subject, missed_gates, run_checks, unchecked
from damperfit.damper.cylinder import describe_cavitation
from damperfit.damper.model import Model
from damperfit.errors import ConfigurationError, InstallationError, OutputError, failure_of, sparing
from damperfit.identification.fit_setting import describe_searches
from damperfit.identification.outcome import Status
from damperfit.identification.procedures import Campaign
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.problem import Failure, Option, Problem, counted, warning
from damperfit.recording import Trace
from damperfit.reporting.records import to_record
from damperfit.reporting.report import markdown_report
from damperfit.results import Run
from damperfit.run.logs import Ending, LogBatch
from damperfit.tables.columns import (
    PAPER_QUANTITIES,
    SCHEMA_VERSION,
    describe_tables,
    quantity_records,
)
from damperfit.tables.files import LogSignals, json_values, typed_rows
from damperfit.tables.rows import campaign_rows, profile_rows, valve_rows
from damperfit.tested.identity import Identity, common_identity
from damperfit.tested.setting import ADJUSTER, Setting
from damperfit.uncertainty.assessment import (
    METHOD,
    Assessment,
    assess,
    profile_campaign,
    reconsider,
)
from damperfit.uncertainty.covariance import Interval, Uncertainty, make_interval
from damperfit.uncertainty.grades import (
    Objection,
    Prediction,
    air_objections,
    doubted_cavitation,
    missed_predictions,
    objections,
    predict,
    prediction_warnings,
)
from damperfit.uncertainty.profiles import Bench, MisfitProfile
from damperfit.units.quantities import engineering
from damperfit.workers import executor

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.run.identify import Clock

_Result = TypeVar("_Result")

# Judging

# What checks of another layout take of a valve's numbers: up to 5 % were seen beside the areas.
_RETURNS = 1.06
# MSE over that of the choice beyond which another fit was delivered; below a thousandth of the
# force, rms, the difference is invisible.
_DELIVERED, _OF_NO_USE = 1.5, 1e-4


class Judgement(NamedTuple):
    """What was found of the fits: errors and verdicts, across settings, checks, predictions."""

    assessment: Assessment = Assessment()
    adjustment: Adjustment = Adjustment()
    checks: tuple[Check, ...] = ()
    predictions: tuple[Prediction, ...] = ()


class FailureLog:
    """What damperfit itself got wrong so far with the logs of a run, from any thread."""

    def __init__(self, batch: LogBatch) -> None:
        self._batch = batch
        self._failures: list[Failure] = []

    @property
    def failures(self) -> tuple[Failure, ...]:
        """By setting, those of the whole run last."""
        key = lambda f: (f.setting is None, f.setting or 0, f.message)  # noqa: E731
        return tuple(sorted(self._failures, key=key))

    def add(self, failure: Failure, setting: Setting | None = None) -> None:
        """Take what a step over all settings, or one of them, has met, and went on."""
        self._failures.append(replace(failure, setting=setting))

    def at(self, task: str) -> Callable[[Trace | Setting, Exception], None]:
        """Return what takes a log or a setting and the error that a task, as "judging", has met."""

        def take(whose: Trace | Setting, error: Exception) -> None:
            if not isinstance(whose, Trace):
                self.add(failure_of(error, f"{task} setting {whose}"), whose)
                return
            name, failure = whose.name, failure_of(error, f"{task} {whose.name}")
            self.add(replace(failure, log=name, path=self._batch.path_of(name)), whose.setting)

        return take

    def spared(self, task: str, step: Callable[[], _Result], instead: _Result) -> _Result:
        """Return what a step finds, or what the run goes on with where the step has an error.

        What is wrong with the command as a whole is raised, and no failure of a log.
        """
        try:
            return step()
        except (ConfigurationError, InstallationError, OutputError):
            raise
        except Exception as error:  # noqa: BLE001 - what the run has done so far is written
            self.add(failure_of(error, task))
            return instead


def judge(  # noqa: PLR0913 - what a judgement takes
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    failure_log: FailureLog,
    *,
    clock: Clock,
    cancelled: Callable[[], bool],
    jobs: int,
) -> tuple[Campaign, Judgement]:
    """Return the campaign with the statuses that its errors allow, and what was found of it."""
    damper, solver = configuration.damper, configuration.identification.solver
    spared, take = failure_log.spared, failure_log.at("judging")
    with clock.lap("judge"):
        assessment = spared(
            "judging the fits",
            lambda: assess(
                campaign, damper, solver=solver, jobs=jobs, cancelled=cancelled, on_error=take
            ),
            Assessment(),
        )
    # Before the statuses: a profile that is flat has the last word on its parameter.
    if (names := configuration.profile) and campaign.fits and not cancelled():
        bench = Bench(damper, solver, cancelled, jobs)
        with clock.lap("profile"):
            assessment = spared(
                "following profiles",
                lambda: profile_campaign(campaign, assessment, bench, names=names, on_error=take),
                assessment,
            )
    with clock.lap("judge"):
        assessed = reconsider(campaign, assessment)
        speeds = configuration.output.speeds
        adjustment = spared(
            "comparing the settings",
            lambda: compare_settings(assessed, assessment, damper, speeds=speeds, on_error=take),
            Adjustment(),
        )

        def predicted(trace: Trace) -> tuple[Prediction, ...]:
            try:
                return predict(assessed, assessment, (trace,), damper=damper, solver=solver)
            except Exception as error:  # noqa: BLE001 - the other logs are predicted
                failure_log.at("predicting")(trace, error)
                return ()

        with executor(jobs) as pool:
            made = chain.from_iterable(pool.map(predicted, batch.held_out))
            predictions = tuple(sorted(made, key=lambda prediction: prediction.setting))
        against = _objections(configuration, assessed, assessment, failure_log, jobs=jobs)
        for setting, objection in missed_predictions(predictions).items():
            against[setting] = (*against.get(setting, ()), objection)
        assessment = replace(assessment, objections=against)
        lost = failures_of(configuration, batch, assessed)
        missing = [
            f"{failure.place} {'left out' if failure.is_left_out else 'failed'}"
            if failure.place
            else failure.message
            for failure in lost[:MANY]
        ]
        missing += [f"and {len(lost) - MANY} more"] * (len(lost) > MANY)
        subject = Subject(
            *(assessed, assessment, adjustment),
            missing=tuple(missing),
            temperature=configuration.rig.temperature,
            temperature_tolerance=configuration.rig.temperature_tolerance,
            undeclared=configuration.not_measured,
            whose=configuration.whose if configuration.is_assumed else "",
        )
        checks = spared("checking the run", lambda: run_checks(subject), unchecked())
        assessment = with_choice(assessment, damper, configuration.chosen_law)
    return assessed, Judgement(assessment, adjustment, checks, predictions)


def _objections(
    configuration: Configuration,
    campaign: Campaign,
    assessment: Assessment,
    failure_log: FailureLog,
    *,
    jobs: int,
) -> dict[Setting, tuple[Objection, ...]]:
    """Return what a grade must not hide, but for predictions: of fits, of delivery, of air."""
    gas, assumed = configuration.conditioning.gas, configuration.assumed_dimensions
    against: dict[Setting, tuple[Objection, ...]] = failure_log.spared(
        "looking for objections to the grades",
        lambda: objections(campaign, assessment, gas, assumed=assumed),
        {},
    )
    advice = "fit each setting by itself{plain}"
    values = {"plain": Option("procedure", "plain", is_aside=True)}
    if campaign.procedure == "plain":
        advice = "name the model{model}, and give its values as a start{start}"
        values = {name: Option(name, is_aside=True) for name in ("model", "start")}
    more = []
    for fit in campaign.fits:  # a law that the logs chose must be fitted as it was chosen
        chosen = configuration.chosen_mse.get(fit.setting, math.inf)
        if fit.mse_percent > _DELIVERED * max(chosen, _OF_NO_USE):
            text = (
                f"the law was chosen at an MSE of {chosen:.2g} % and is fitted at "
                f"{fit.mse_percent:.2g} %, by procedure {campaign.procedure}; these are not the "
                f"parameters of the choice: {advice}"
            )
            problem = Problem(
                "not-delivered", text, "error", f"setting {fit.setting}", values=values
            )
            failure_log.add(Failure(problem, "DeliveryError"), fit.setting)
            more.append((fit.setting, Objection("delivery", "", problem.message())))
    if "damper.ambient_pressure" not in configuration.declared and not configuration.is_assumed:
        damper, options = configuration.damper, configuration.identification
        air: dict[Setting, Objection] = failure_log.spared(
            "checking the pressure of the air on the rod",
            lambda: air_objections(campaign, assessment, damper, options, jobs=jobs),
            {},
        )
        more += air.items()
    for setting, objection in more:
        against[setting] = (*against.get(setting, ()), objection)
    return against


def with_choice(assessment: Assessment, damper: Model, law: Mapping[str, Any]) -> Assessment:
    """Return the assessment with intervals as wide as the choice of the law leaves them.

    They hold what structures about as likely as the chosen one differ by (the most of the others at
    a setting that was not compared), what valves are in layouts that the logs do not distinguish
    from the damper's, and the values of structures in exchange: what such a one lacks is where it
    does nothing.
    """
    if not law:
        return assessment
    from damperfit.damper.valve_dampers import ValveDamper
    from damperfit.laws.structures import times_in

    spread, layouts = law.get("spread", {}), law.get("layouts_alike", ())
    most: dict[str, float] = {}
    for own_spread in spread.values():
        most |= {name: max(value, most.get(name, 0.0)) for name, value in own_spread.items()}

    def wider(widened: Uncertainty, name: str, own: Interval) -> Interval:
        cell, stroke = str(widened.setting.cell), name.partition("_")[0]
        beside = spread.get(cell, most).get(name, 0.0)
        if beside and math.isfinite(own.high):  # else it says "anything" already
            value = math.sqrt(own.low * own.high)
            misfit = math.hypot(own.misfit / value, beside)
            own = make_interval(value, own.error / value, misfit=misfit)
        is_valve = stroke in {"rebound", "compression"}
        if layouts and is_valve and isinstance(damper, ValveDamper):
            raised = widened.intervals.get(f"{stroke}_power")
            power = 1.0 if raised is None else math.sqrt(raised.low * raised.high)
            times = [times_in(layout, damper, name, power) for layout in layouts]
            low, high = min(times) / _RETURNS, max(times) * _RETURNS
            own = replace(own, low=min(1.0, low) * own.low, high=max(1.0, high) * own.high)
        for exchange in law.get("exchanges", ()):
            there, quantity = exchange["values"].get(cell), damper.quantity(name)
            if there and not quantity.is_offset:
                away = there.get(name, quantity.vanishes_at)
                own = replace(own, low=min(own.low, away), high=max(own.high, away))
        return own

    widened = (
        replace(each, intervals={k: wider(each, k, own) for k, own in each.intervals.items()})
        for each in assessment.uncertainties
    )
    return replace(assessment, uncertainties=tuple(widened))


# Warnings, gates and failures

MANY = 20  # sentences of one kind that are shown one by one; a damper has some twenty settings
# Frictions of two settings that differ by so many errors and this factor are not one damper's.
_ERRORS_APART = 3.0
_TIMES_APART = 2.0
# What another law may mend; an offset it cannot.
_OF_LAWS = frozenset({"bound", "beyond", "cavitation", "friction", "misfit", "prediction"})


def warnings_of(
    configuration: Configuration, batch: LogBatch, campaign: Campaign, judgement: Judgement
) -> Iterator[Problem]:
    """Yield what the reader should know before believing the numbers."""
    assessment, sharing = judgement.assessment, campaign.sharing
    yield from (*batch.skipped_files, *batch.remarks)
    yield from log_warnings(_fitted_traces(campaign))
    yield from campaign.warnings
    if sharing.friction_varies and sharing.spread is not None:
        low, high = sharing.spread
        yield warning(
            "friction-varies",
            f"friction goes from {low:.3g} to {high:.3g} N over the settings: one value for all "
            "does not hold; free it{free}",
            free=_freeing_friction(campaign),
        )
    yield from _at_settings([(fit.setting, text) for fit in campaign.fits for text in fit.warnings])
    yield from unconfirmed_tares(campaign, assessment)
    yield from unlike_frictions(campaign, assessment)
    yield from assessment.warnings
    withheld = [
        setting
        for setting, why in assessment.objections.items()
        if _OF_LAWS & (kinds := {objection.kind for objection in why}) and "log" not in kinds
    ]
    if withheld and not configuration.chosen_law:
        yield warning(
            "other-model",
            f"model {configuration.damper.name} does not describe {of_settings(withheld)}: let "
            "the logs choose a model: identify the logs with {model}",
            model=Option("model", "auto"),
        )
    yield from prediction_warnings(judgement.predictions)


def _freeing_friction(campaign: Campaign) -> Option:
    """Return the option that gives each setting its own friction, all else as it was."""
    fit, sharing = campaign.fits[0], campaign.sharing
    frictions = [quantity.name for quantity in fit.parameters.quantities if quantity.is_friction]
    if sharing.jointly:
        shared = (n for n in sharing.jointly if n not in frictions)
        return Option("share", ",".join(shared), is_aside=True)
    held, idle = {*frictions, *sharing.estimated}, {Status.FIXED, Status.SHARED}
    own = [name for name, how in fit.status.items() if name not in held and how not in idle]
    return Option("free", ",".join((*own, *frictions)), is_aside=True)


def _at_settings(problems: Sequence[tuple[Setting, Problem]]) -> Iterator[Problem]:
    """Yield what is so at each setting; of many, the first, and which others have one."""
    is_long = len(problems) > MANY
    more = ""
    if is_long:
        others = listed_settings({other for other, _ in problems[1:]})
        more = f" (with other numbers at {others})"
    for setting, problem in problems[:1] if is_long else problems:
        yield replace(problem, subject=f"setting {setting}", text=f"{problem.text}{more}")


def log_warnings(traces: Iterable[Trace], *, is_put_right: bool = False) -> Iterator[Problem]:
    """Yield one problem for each kind of warning, or correction, with the numbers of its first."""
    logs: dict[str, list[tuple[str, Problem]]] = {}
    for trace in traces:
        for finding in trace.findings:
            is_note = finding.severity == "note" and finding.values.get("is_correction")
            if is_note if is_put_right else finding.severity == "warning":
                logs.setdefault(finding.code, []).append((trace.name, finding))
    for (name, problem), *others in logs.values():
        also = f" and {counted(len(others), 'other log')}" if others else ""
        yield replace(problem, subject=f"{name}{also}")


def corrections(campaign: Campaign) -> Iterator[Problem]:
    """Yield what was put right in the logs that were fitted, one problem for each kind."""
    return log_warnings(_fitted_traces(campaign), is_put_right=True)


def _fitted_traces(campaign: Campaign) -> Iterator[Trace]:
    return (log.trace for fit in campaign.fits for log in fit.logs)


def unconfirmed_tares(campaign: Campaign, assessment: Assessment) -> Iterator[Problem]:
    """Say where a fit has no room for the tare that a log was warned of, as when it cavitates."""
    doubted = []
    for diagnosis in assessment.diagnoses:
        fit = next((fit for fit in campaign.fits if fit.setting == diagnosis.setting), None)
        if fit is None or diagnosis.is_structured or math.isnan(diagnosis.noise_percent):
            continue
        findings = [(f.code, f.severity) for log in fit.logs for f in log.trace.findings]
        offsets = (quantity.name for quantity in fit.parameters.quantities if quantity.is_offset)
        if ("tare", "warning") in findings and all(fit.status[k] == Status.FIXED for k in offsets):
            doubted.append(fit.setting)
    if doubted:
        yield warning(
            "tare-not-confirmed",
            "the warning tare is not confirmed: the fit matches the force to within its "
            "noise without an offset",
            of_settings(doubted),
        )


def unlike_frictions(campaign: Campaign, assessment: Assessment) -> Iterator[Problem]:
    """Say where settings that were fitted separately have frictions that one damper cannot have.

    With the bleed closed, a preload and a friction give nearly the same force at one speed.
    """
    intervals = {each.setting: each.intervals for each in assessment.uncertainties}
    quantities = campaign.fits[0].parameters.quantities if campaign.fits else ()
    for quantity in (q for q in quantities if q.is_friction):
        name = quantity.name
        frictions = sorted(
            (getattr(fit.parameters, name), math.hypot(own.error, own.misfit), fit.setting)
            for fit in campaign.fits
            if fit.status[name] == Status.FITTED
            and (own := intervals.get(fit.setting, {}).get(name)) is not None
        )
        if not frictions:
            continue
        (low, low_error, where_low), (high, high_error, where_high) = frictions[0], frictions[-1]
        is_separate = high - low > _ERRORS_APART * math.hypot(low_error, high_error)
        if is_separate and high > _TIMES_APART * low:
            yield warning(
                "unlike-frictions",
                f"{quantity.symbol} is {low:.3g} N at setting {where_low} and {high:.3g} N at "
                f"setting {where_high}, but friction belongs to the damper and not to its clicks: "
                "a preloaded valve may be taken for friction; fit the settings together: {joint}",
                joint=Option("procedure", "joint"),
            )


def gates_not_met(
    configuration: Configuration, batch: LogBatch, campaign: Campaign
) -> Iterator[Problem]:
    """Yield the gates on logs, MSE and convergence that were not met."""
    refused = [failure.log for failure in batch.failures if failure.is_left_out]
    if refused:
        n = len(refused) - 1
        others = f" and {counted(n, 'other log')}" if n else ""
        yield warning("strict", f"strict quality: {refused[0]}{others} left out for warnings")
    limit = configuration.output.max_mse_percent
    above, unsound = [], []
    for fit in campaign.fits:
        if limit > 0.0 and not fit.mse_percent <= limit:  # "not <=" catches NaN too
            text = f"MSE {fit.mse_percent:.3g} % is above {limit:g} %"
            above.append((fit.setting, warning("mse-gate", text)))
        if not fit.outcome.is_minimum:
            text = f"the fit did not converge ({fit.outcome.value})"
            unsound.append((fit.setting, warning("not-converged", text)))
    if len(above) + len(unsound) > MANY:  # one sentence on many settings is about one gate
        yield from _at_settings(above)
        yield from _at_settings(unsound)
    else:
        yield from _at_settings(sorted([*above, *unsound], key=lambda pair: pair[0]))


def failures_of(
    configuration: Configuration, batch: LogBatch, campaign: Campaign
) -> tuple[Failure, ...]:
    """Return the logs and settings without a result; also those that no log claims to be."""
    present = {log.facts.get("setting") for log in batch.logs}
    missing = sorted(set(configuration.rig.settings) - present)
    why = "no log, but the configuration expects one in rig.settings"
    places: list[Any] = [(f"setting {setting}", why, setting) for setting in missing]
    if len(missing) > MANY:
        places = [(f"settings {listed_settings(missing)}", f"{why} for each", None)]
    without = (
        Failure(Problem("missing-log", text, subject=place), "MissingLogError", setting=setting)
        for place, text, setting in places
    )
    return (*batch.failures, *campaign.failures, *without)


# Tables and run.json


def run_of(  # noqa: PLR0913 - all that a run is made of
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    judgement: Judgement,
    failure_log: FailureLog,
    *,
    characteristics: Sequence[dict[str, Any]],
    signals: Callable[[], Iterable[LogSignals]] | None = None,
    is_interrupted: bool,
) -> tuple[Run, tuple[Failure, ...]]:
    """Return the run that was fitted and assessed, and what has failed.

    ``characteristics`` are the rows of that table; ``signals`` makes those of each log.
    """
    damper, fits = configuration.damper, campaign.fits
    assessment, adjustment = judgement.assessment, judgement.adjustment
    settings, quantities = [fit.setting for fit in fits], campaign.quantities or PAPER_QUANTITIES
    fitted = {log.trace.name for fit in fits for log in fit.logs}
    used = {*fitted, *(prediction.trace.name for prediction in judgement.predictions)}
    tested = _identity_of(batch, used).describe()
    # What the tables were made from; nothing in it depends on place, time or failures.
    facts = {
        "version": __version__,
        "procedure": campaign.procedure,
        **({"test": tested} if tested else {}),
        "configuration": {k: v for k, v in configuration.document.items() if k != "output"},
        "inputs": {log.log: log.sha256 for log in batch.logs if log.log in used},
    }
    rows = campaign_rows(
        campaign,
        assessment=assessment,
        predictions=judgement.predictions,
        adjustment=adjustment,
        expected=configuration.rig.settings,
    )
    rows["characteristics"] = list(characteristics)
    for fit in fits:
        with sparing(fit.setting, failure_log.at("reading the valves of")):
            valves = damper.valve_characteristics(fit.parameters, [log.trace for log in fit.logs])
            if read := list(valve_rows(fit.setting, valves)):
                rows.setdefault("valves", []).extend(read)
    if configuration.profile:
        rows["profiles"] = profile_rows(
            profile for profile in assessment.profiles if profile.name in configuration.profile
        )
    failures = (*failures_of(configuration, batch, campaign), *failure_log.failures)
    gates = (
        *gates_not_met(configuration, batch, campaign),
        *missed_gates(judgement.checks, configuration.output.checks),
    )
    ending = ending_of(len(settings), failures, gates, is_interrupted=is_interrupted)
    warned: list[Problem] = list(warnings_of(configuration, batch, campaign, judgement))
    law = configuration.chosen_law
    if law:
        from damperfit.laws.description import described_again

        law = described_again(law, campaign, configuration.damper)
    method = (METHOD,) if campaign.fits else ()
    gas = () if assessment.gas is None else (assessment.gas.sentence,)
    cavitation = describe_cavitation(
        {fit.setting: fit.cavitation for fit in campaign.fits},
        doubted=doubted_cavitation(assessment.objections),
    )
    by_setting = {fit.setting: fit for fit in fits}
    undetermined = assessment.undetermined(campaign)
    verdicts = assessment.verdicts(campaign)
    units = {quantity.name: quantity.unit for quantity in campaign.quantities}
    adjusters = Setting.of(campaign.fits[0].setting).adjusters if campaign.fits else (ADJUSTER,)
    document = {
        "version": __version__,
        "schema_version": SCHEMA_VERSION,
        "ending": ending.name.lower(),
        "exit_code": ending.value,
        "test": _identity_of(batch, fitted).describe(),
        "configuration": configuration.document,
        "inputs": [log.describe() for log in batch.logs],
        "skipped": list(batch.skipped),
        "failures": [failure.describe() for failure in failures],
        "warnings": list(map(str, warned)),
        "problems": [problem.record() for problem in warned],
        "gaps": [{"first": first, "last": last} for first, last in campaign.gaps],
        "sentences": {
            "tables_of_tests": list(batch.notes),
            "corrections": list(map(str, corrections(campaign))),
            "noise_and_lack_of_fit": list(assessment.sentences),
            "identifiability": list(map(str, assessment.doubts(campaign))),
            "undetermined": list(map(str, undetermined)),
            "many_starts": list(describe_searches(campaign.searches)),
            "cavitation": list(cavitation),
            "force_offset": list(adjustment.of_offset),
        },
        **({"law_choice": dict(law)} if law else {}),
        "procedure": [
            *batch.notes,
            *procedure_sentences(configuration, campaign),
            *gas,
            *method,
        ],
        "gates_missed": list(map(str, gates)),
        "gates": [problem.record() for problem in gates],
        "undetermined": [problem.record() for problem in undetermined],
        "checks": to_record(judgement.checks),
        "uncertainty": [
            {
                "setting": u.setting,
                "verdicts": verdicts[u.setting],
                "parameters": list(u.names),
                "shared": list(u.shared),
                "correlation": u.correlation.tolist(),
                "errors": np.sqrt(np.diag(u.covariance)).tolist(),
                "residuals": to_record(diagnosis),
                "cavitation": to_record(by_setting[u.setting].cavitation),
            }
            for u, diagnosis in zip(assessment.uncertainties, assessment.diagnoses, strict=True)
        ],
        "profiles": [profile_record(profile, assessment) for profile in assessment.profiles],
        "gas_content": to_record(assessment.gas),
        "speed_forces": to_record(assessment.forces),
        "searches": to_record(campaign.searches),
        "stretches": [
            {
                "setting": fit.setting,
                "log": log.trace.name,
                "mse_percent": mse,
                **segment.describe(log.trace),
            }
            for fit in campaign.fits
            for log in fit.logs
            for segment, mse in zip(log.trace.segments, log.segment_mse_percent, strict=False)
        ],
        "grades_withheld": [
            {"setting": setting, "reasons": to_record(why)}
            for setting, why in assessment.objections.items()
        ],
        "held_out": [prediction.describe() for prediction in judgement.predictions],
        "trends": [
            {**to_record(trend), "unit": units[trend.parameter]} for trend in adjustment.trends
        ],
        "clicks": to_record(adjustment.clicks),
        "adjusters": list(adjusters),
        "schema": describe_tables(settings, campaign.quantities),
        "quantities": quantity_records(campaign.quantities),
    }
    # Key by key: memory never holds two forms of all of it.
    record = {key: json_values(document.pop(key)) for key in list(document)}
    typed = {name: typed_rows(name, of, quantities) for name, of in rows.items()}
    with suppress(ConfigurationError):  # a model without orifices and openings
        parts = Run(record, typed, quantities=quantities).valves().rows
        typed["valve_parts"] = typed_rows("valve_parts", parts, quantities)
    run = Run(record, typed, quantities=quantities, signals=signals, facts=facts)
    run.report_text = markdown_report(run)
    return run, failures


def ending_of(
    n_fits: int, failures: Sequence[Failure], gates: Sequence[Problem], *, is_interrupted: bool
) -> Ending:
    """Return how a run ended; a failure counts before a gate, an interruption before both.

    A log that only strict quality refused has missed a gate, also when no other log is left.
    """
    if is_interrupted:
        return Ending.INTERRUPTED
    has_failed = any(not failure.is_left_out for failure in failures)
    if not n_fits and (has_failed or not gates):
        return Ending.ALL_FAILED
    if has_failed:
        return Ending.SOME_FAILED
    return Ending.GATE_MISSED if gates else Ending.COMPLETE


def _identity_of(batch: LogBatch, names: set[str]) -> Identity:
    """Return whose test some logs of a run are; no name: all. What differs is listed."""
    return common_identity(log.identity for log in batch.logs if log.log in names or not names)


def procedure_sentences(configuration: Configuration, campaign: Campaign) -> Iterator[str]:
    """Yield how the parameters were found, one sentence each."""
    yield configuration.damper_sentence()
    yield from (f"Note: {note}." for note in configuration.notes)
    if not campaign.fits:
        return
    fit, sharing, options = campaign.fits[0], campaign.sharing, configuration.identification
    yield f"Filter: {fit.logs[0].trace.model_filter.description}"
    yield f"Procedure: {campaign.procedure}."
    yield from (f"Corrected: {line}." for line in corrections(campaign))
    if sharing.sentence:
        yield f"{sharing.sentence}."
    for quantity in fit.parameters.quantities:
        name = quantity.name
        value, status = fit.parameters[name], fit.status[name]
        scale, unit = quantity.shown
        words = f"{quantity.symbol} = {engineering(scale * value, digits=5)}{unit}"
        if sharing.follows.get(name):
            continue
        is_own = quantity.default is None and not quantity.is_shared
        is_asked = name in {*(options.free or ()), *options.fixed}
        if status == Status.SHARED:
            spread = ""
            if quantity.is_friction and sharing.spread is not None:
                low, high = sharing.spread
                spread = (
                    f"; it {'varies' if sharing.friction_varies else 'hardly varies'}: fitted "
                    f"individually, the settings have {low:.3g} to {high:.3g} N"
                )
            yield f"{words} is shared by all settings, found from the logs{spread}."
        elif is_own and options.free and not is_asked:
            yield (
                f"{quantity.symbol} of each setting is held at what a first fit of its logs "
                "gave, as it was not freed; its error is not in those of the others."
            )
        elif status == Status.FIXED and value != quantity.default:
            yield f"{words} is fixed."


def profile_record(profile: MisfitProfile, assessment: Assessment) -> dict[str, Any]:
    """The limits of a profile beside those of the sandwich covariance; the points have a table."""
    intervals = {u.setting: u.intervals.get(profile.name) for u in assessment.uncertainties}
    sandwich = None if profile.is_partial else intervals.get(profile.setting)
    return {
        "setting": profile.setting,
        "parameter": profile.name,
        "shape": profile.shape,
        "ci_low": profile.low,
        "ci_high": profile.high,
        "sandwich_ci_low": None if sandwich is None else sandwich.low,
        "sandwich_ci_high": None if sandwich is None else sandwich.high,
        "is_shared": profile.is_shared,
        "points": len(profile.points),
        "evaluations": profile.evaluations,
    }
