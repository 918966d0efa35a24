"""The account a run gives of itself: how it ended, what failed, what to beware of, from what.

`provenance` goes into the tables and depends on the good logs and the configuration alone, so
that a bad log beside them changes no byte. `record` is run.json and tells everything.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from damperfit import __version__
from damperfit.adjustment import Adjustment
from damperfit.checks import Check
from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.gates import missed_gates
from damperfit.identification import Outcome, Status, describe_cavitation, describe_searches
from damperfit.quantities import engineering
from damperfit.report import Failure, ReportFacts, to_record
from damperfit.run.trust import confidence_record, unconfirmed_tares
from damperfit.tables import PARAMETER_UNITS, SCHEMA_VERSION, describe_tables
from damperfit.uncertainty import METHOD, Assessment, prediction_warnings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign
    from damperfit.recording import Finding
    from damperfit.run.logs import LogBatch, LogFacts
    from damperfit.uncertainty import Prediction

__all__ = [
    "Ending",
    "Judgement",
    "corrections",
    "ending_of",
    "failures_of",
    "json_values",
    "log_documents",
    "provenance",
    "reading_ending",
    "record",
    "report_facts",
]


class Ending(Enum):
    """How a run ended; the value is the exit code of the command."""

    COMPLETE = 0
    SOME_FAILED = 1
    ALL_FAILED = 3
    GATE_MISSED = 4
    INTERRUPTED = 130


@dataclass(frozen=True, slots=True)
class Judgement:
    """What was found of the fits once they were done.

    Attributes
    ----------
    assessment : Assessment
        How far the numbers may be trusted.
    adjustment : Adjustment
        What shows across settings.
    checks : tuple of Check
        The checklist.
    predictions : tuple of Prediction
        How well what was held out is predicted.
    """

    assessment: Assessment = Assessment()
    adjustment: Adjustment = Adjustment()
    checks: tuple[Check, ...] = ()
    predictions: tuple[Prediction, ...] = ()


def failures_of(
    configuration: Configuration, batch: LogBatch, campaign: Campaign
) -> tuple[Failure, ...]:
    """Return the logs and settings without a result."""
    return (*batch.failures, *_setting_failures(campaign), *_missing(configuration, batch))


def report_facts(
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    judgement: Judgement,
    *,
    is_interrupted: bool,
) -> ReportFacts:
    """Return what a report tells besides the tables."""
    assessment = judgement.assessment
    outcomes = {fit.outcome for fit in campaign.fits if fit.outcome is not Outcome.CONVERGED}
    return ReportFacts(
        version=__version__,
        procedure=(
            *_procedure(configuration, campaign),
            *((assessment.gas.sentence,) if assessment.gas is not None else ()),
            *_method(campaign, assessment),
        ),
        failures=failures_of(configuration, batch, campaign),
        warnings=(
            *_warnings(batch, campaign),
            *unconfirmed_tares(campaign, assessment),
            *assessment.warnings,
            *prediction_warnings(judgement.predictions),
        ),
        trust=assessment.sentences,
        identifiability=assessment.doubts(campaign),
        untold=assessment.untold(campaign),
        searches=describe_searches(campaign.searches),
        cavitation=describe_cavitation({fit.setting: fit.cavitation for fit in campaign.fits}),
        across=judgement.adjustment.sentences,
        checks=judgement.checks,
        gaps=campaign.gaps,
        gates=(
            *_missed_gates(configuration, batch, campaign),
            *missed_gates(judgement.checks, configuration.output.checks),
        ),
        advice=tuple(sorted((outcome.value, outcome.advice) for outcome in outcomes)),
        held_out=judgement.predictions,
        is_interrupted=is_interrupted,
    )


def _method(campaign: Campaign, assessment: Assessment) -> tuple[str, ...]:
    """How the errors were found, and how they were checked."""
    said = (METHOD, assessment.cycle_check) if campaign.fits else ()
    return tuple(sentence for sentence in said if sentence)


def ending_of(campaign: Campaign, facts: ReportFacts) -> Ending:
    """Return how a run ended; a failure counts before a gate, an interruption before both.

    A log that only strict quality refused has missed a gate, also when no other log is left.
    """
    if facts.is_interrupted:
        return Ending.INTERRUPTED
    has_failed = any(not failure.is_left_out for failure in facts.failures)
    if not campaign.fits and (has_failed or not facts.gates):
        return Ending.ALL_FAILED
    if has_failed:
        return Ending.SOME_FAILED
    return Ending.GATE_MISSED if facts.gates else Ending.COMPLETE


def provenance(
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    predictions: Sequence[Prediction] = (),
) -> dict[str, Any]:
    """Return what the tables were made from; nothing in it depends on place, time or failures."""
    used = {log.trace.name for fit in campaign.fits for log in fit.logs}
    used |= {one.trace.name for one in predictions}
    document = {key: value for key, value in configuration.document.items() if key != "output"}
    return {
        "version": __version__,
        "procedure": campaign.procedure,
        "configuration": document,
        "inputs": {log.log: log.sha256 for log in batch.logs if log.log in used},
    }


def record(
    configuration: Configuration,
    batch: LogBatch,
    facts: ReportFacts,
    campaign: Campaign,
    judgement: Judgement,
    *,
    ending: Ending,
) -> dict[str, Any]:
    """Return what run.json tells, as JSON values."""
    document = {
        "version": __version__,
        "schema_version": SCHEMA_VERSION,
        "ending": ending.name.lower(),
        "exit_code": ending.value,
        "configuration": configuration.document,
        "inputs": [_input(log) for log in batch.logs],
        "skipped": list(batch.skipped),
        "failures": [to_record(failure) for failure in facts.failures],
        "warnings": list(facts.warnings),
        "gaps": list(facts.gaps),
        "sentences": {
            "noise_and_lack_of_fit": list(facts.trust),
            "identifiability": list(facts.identifiability),
            "many_starts": list(facts.searches),
            "cavitation": list(facts.cavitation),
        },
        "gates_missed": list(facts.gates),
        "procedure": list(facts.procedure),
        "checks": [to_record(check) for check in judgement.checks],
        **confidence_record(campaign, judgement.assessment),
        "held_out": [one.describe() for one in judgement.predictions],
        **_across(judgement.adjustment),
        "schema": describe_tables(),
    }
    cleaned: dict[str, Any] = json_values(document)
    return cleaned


def _across(adjustment: Adjustment) -> dict[str, Any]:
    """Return trends, and the changes of force by click at the sine that stands for the tests."""
    sine = adjustment.sine
    motion = {} if sine is None else {"amplitude_m": sine.amplitude, "frequency_Hz": sine.frequency}
    return {
        "trends": [
            {**to_record(trend), "unit": PARAMETER_UNITS[trend.parameter]}
            for trend in adjustment.trends
        ],
        "clicks": [to_record(click) for click in adjustment.clicks],
        "clicks_motion": motion,
    }


def log_documents(batch: LogBatch) -> dict[str, Any]:
    """Return what `inspect` tells, as JSON values."""
    document: dict[str, Any] = json_values(
        {
            "logs": [_input(log) for log in batch.logs],
            "skipped": list(batch.skipped),
            "failures": [asdict(failure) for failure in batch.failures],
        }
    )
    return document


def reading_ending(batch: LogBatch) -> Ending:
    """Return how reading alone ended."""
    if any(not failure.is_left_out for failure in batch.failures):
        return Ending.SOME_FAILED if batch.n_good else Ending.ALL_FAILED
    return Ending.GATE_MISSED if batch.failures else Ending.COMPLETE


def _input(log: LogFacts) -> dict[str, Any]:
    facts = {key: value for key, value in log.facts.items() if key != "name"}
    return {"log": log.log, "path": log.path, "sha256": log.sha256, **facts}


def json_values(value: Any) -> Any:
    """Return the value with every number that JSON does not know (NaN, infinity) as None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): json_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [json_values(item) for item in value]
    return value


def _setting_failures(campaign: Campaign) -> Iterator[Failure]:
    for one in campaign.failures:
        yield Failure("", "", one.setting, one.kind, one.message)


def _missing(configuration: Configuration, batch: LogBatch) -> Iterator[Failure]:
    """Yield the settings that the configuration expects and no log claims to be."""
    present = {log.facts.get("setting") for log in batch.logs}
    for setting in sorted(set(configuration.rig.settings) - present):
        message = f"setting {setting}: no log, but the configuration expects one in rig.settings"
        yield Failure("", "", setting, "LogError", message)


def _warnings(batch: LogBatch, campaign: Campaign) -> Iterator[str]:
    for path in batch.skipped:
        yield f"{path}: a parameter table of damperfit, not a log; skipped"
    yield from _twin_warnings(batch)
    yield from _log_warnings(campaign)
    yield from campaign.warnings
    if campaign.sharing.friction_varies and campaign.sharing.f_f_range is not None:
        low, high = campaign.sharing.f_f_range
        how = "--share r_m3" if campaign.sharing.jointly else "--free r_m1,r_m2,k_e,f_f"
        yield (
            f"friction goes from {low:.3g} to {high:.3g} N over the settings: one value for all "
            f"does not hold; free it ({how})"
        )
    for fit in campaign.fits:
        yield from (f"setting {fit.setting}: {warning}" for warning in fit.warnings)


def _twin_warnings(batch: LogBatch) -> Iterator[str]:
    """One line for each set of files with the same bytes; the tests in one file are no twins."""
    twins: dict[str, dict[str, str]] = {}
    for log in batch.logs:
        twins.setdefault(log.sha256 or log.path, {}).setdefault(log.path, log.log)
    for first, *others in (list(names.values()) for names in twins.values()):
        if len(others) == 1:
            yield f"{others[0]}: holds the same bytes as {first}; both are used"
        elif others:
            n = len(others) - 1
            yield f"{others[0]} and {n} other log{'s' * (n > 1)}: hold the same bytes as {first}"


def _log_warnings(campaign: Campaign) -> Iterator[str]:
    """One line for each kind of warning, with the numbers of its first log."""
    yield from _by_kind(campaign, lambda finding: finding.severity == "warning")


def corrections(campaign: Campaign) -> Iterator[str]:
    """Yield what was put right in the logs that were fitted, one line for each kind."""
    yield from _by_kind(campaign, lambda finding: finding.is_correction)


def _by_kind(campaign: Campaign, is_meant: Callable[[Finding], bool]) -> Iterator[str]:
    logs: dict[str, list[tuple[str, str]]] = {}
    for fit in campaign.fits:
        for log in fit.logs:
            for one in filter(is_meant, log.trace.findings):
                logs.setdefault(one.name, []).append((log.trace.name, one.sentence))
    for (name, sentence), *others in logs.values():
        also = f" and {len(others)} other log{'s' if len(others) > 1 else ''}" if others else ""
        yield f"{name}{also}: {sentence}"


def _missed_gates(
    configuration: Configuration, batch: LogBatch, campaign: Campaign
) -> Iterator[str]:
    refused = [failure.log for failure in batch.failures if failure.is_left_out]
    if refused:
        n = len(refused) - 1
        others = f" and {n} other log{'s' * (n > 1)}" if n else ""
        yield f"strict quality: {refused[0]}{others} left out for warnings"
    limit = configuration.output.max_mse_percent
    for fit in campaign.fits:
        if limit > 0.0 and not fit.mse_percent <= limit:  # "not <=" catches NaN too
            yield f"setting {fit.setting}: MSE {fit.mse_percent:.3g} % is above {limit:g} %"
        if not fit.outcome.is_minimum:
            yield f"setting {fit.setting}: the fit did not converge ({fit.outcome.value})"


def _procedure(configuration: Configuration, campaign: Campaign) -> Iterator[str]:
    """Yield how the parameters were found, one sentence each."""
    yield configuration.damper_sentence
    yield from (f"Note: {note}." for note in configuration.notes)
    if not campaign.fits:
        return
    fit = campaign.fits[0]
    yield f"Filter: {fit.logs[0].trace.model_filter.description}"
    yield f"Procedure: {campaign.procedure}."
    yield from (f"Put right: {line}." for line in corrections(campaign))
    for name in PARAMETER_NAMES:
        value = getattr(fit.parameters, name)
        unit = PARAMETER_UNITS[name]
        said = f"{name} = {engineering(value, digits=5)} {unit}"
        if fit.status[name] == Status.SHARED:
            spread = _friction_spread(campaign) if name == "f_f" else ""
            yield f"{said} is shared by all configuration, found from the logs{spread}."
        elif fit.status[name] == Status.FIXED and (name != "f_0" or value != 0.0):
            yield f"{said} is fixed."


def _friction_spread(campaign: Campaign) -> str:
    if campaign.sharing.f_f_range is None:
        return ""
    low, high = campaign.sharing.f_f_range
    word = "it varies" if campaign.sharing.friction_varies else "it hardly varies"
    return f"; {word}: fitted by themselves the settings have {low:.3g} to {high:.3g} N"
