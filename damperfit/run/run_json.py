"""The account a run gives of itself: how it ended, what failed, what to beware of, from what.

`provenance` goes into the tables and depends on the good logs and the configuration alone, so
that a bad log beside them changes no byte. `record` is run.json and tells everything.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from damperfit import __version__
from damperfit.adjustment.clicks import Adjustment
from damperfit.checks import Check, missed_gates
from damperfit.damper.cavitation import describe_cavitation
from damperfit.errors import sparing
from damperfit.identification import Outcome, Status, describe_searches
from damperfit.problem import Failure, Problem
from damperfit.report.markdown import markdown_report
from damperfit.report.records import to_record
from damperfit.results import Run
from damperfit.run.logs import Ending
from damperfit.run.remarks import as_warning, corrections, gates_not_met, missing_logs, run_warnings
from damperfit.run.trust import (
    other_model_advice,
    uncertainty_record,
    unconfirmed_tares,
    unlike_frictions,
)
from damperfit.tables.columns import (
    PAPER_QUANTITIES,
    SCHEMA_VERSION,
    describe_tables,
    quantity_records,
)
from damperfit.tables.documents import json_values
from damperfit.tables.files import lay_out
from damperfit.tables.rows import make_tables, profile_rows, valve_rows
from damperfit.tested.identity import common_identity
from damperfit.tested.setting import ADJUSTER, Setting
from damperfit.uncertainty import METHOD, Assessment, prediction_warnings
from damperfit.uncertainty.withheld import doubted_cavitation
from damperfit.units.quantities import engineering

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.damper.quantity import Quantity
    from damperfit.identification import Campaign, Fit, FitOptions
    from damperfit.run.logs import LogBatch
    from damperfit.run.mishaps import Mishaps
    from damperfit.tested.identity import Identity
    from damperfit.uncertainty import Prediction

__all__ = [
    "Judgement",
    "ReportFacts",
    "ending_of",
    "failures_of",
    "identity_of",
    "provenance",
    "record",
    "report_facts",
    "run_of",
]


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
    failures : tuple of Failure
        Settings and logs that could not be judged.
    """

    assessment: Assessment = Assessment()
    adjustment: Adjustment = Adjustment()
    checks: tuple[Check, ...] = ()
    predictions: tuple[Prediction, ...] = ()
    failures: tuple[Failure, ...] = ()


@dataclass(frozen=True, slots=True)
class ReportFacts:
    """What run.json tells besides the tables, by its keys there, before it is JSON."""

    version: str
    procedure: tuple[str, ...] = ()
    tested: str = ""
    failures: tuple[Failure, ...] = ()
    warnings: tuple[Problem, ...] = ()
    gaps: tuple[tuple[int, int], ...] = ()
    gates: tuple[Problem, ...] = ()
    advice: tuple[tuple[str, str], ...] = ()
    trust: tuple[str, ...] = ()
    held_out: tuple[Prediction, ...] = ()
    identifiability: tuple[str, ...] = ()
    undetermined: tuple[str, ...] = ()
    taken: tuple[str, ...] = ()
    searches: tuple[str, ...] = ()
    cavitation: tuple[str, ...] = ()
    across: tuple[str, ...] = ()
    checks: tuple[Check, ...] = ()
    withheld: tuple[str, ...] = ()
    stretches: tuple[Mapping[str, Any], ...] = ()
    law_choice: Mapping[str, Any] = field(default_factory=dict)
    is_interrupted: bool = False


def run_of(  # noqa: PLR0913 - all that a run is made of
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    judgement: Judgement,
    mishaps: Mishaps,
    *,
    characteristics: Sequence[dict[str, Any]],
    is_interrupted: bool,
) -> tuple[Run, ReportFacts]:
    """Return the run that was fitted and judged, without its signals, and what its report tells.

    Parameters
    ----------
    characteristics : sequence of dict
        Rows of that table.
    is_interrupted : bool
        Whether the user has stopped it.
    """
    damper, settings = configuration.damper, [fit.setting for fit in campaign.fits]
    quantities = campaign.quantities or PAPER_QUANTITIES
    origin = provenance(configuration, batch, campaign, judgement.predictions)
    rows: dict[str, list[dict[str, Any]]] = {"characteristics": list(characteristics)}
    for fit in campaign.fits:
        with sparing(fit.setting, mishaps.at_setting("reading the valves of")):
            found = damper.valve_characteristics(fit.parameters, [one.trace for one in fit.logs])
            rows.setdefault("valves", []).extend(valve_rows(fit.setting, found))
    if configuration.profile:
        wanted = (p for p in judgement.assessment.profiles if p.name in configuration.profile)
        rows["profiles"] = profile_rows(wanted)
    tables = make_tables(
        campaign,
        assessment=judgement.assessment,
        predictions=judgement.predictions,
        adjustment=judgement.adjustment,
        expected=configuration.rig.settings,
        facts=origin,
    ) | {
        name: lay_out(name, of, facts=origin, settings=settings, quantities=quantities)
        for name, of in rows.items()
        if of or name != "valves"
    }
    judgement = replace(judgement, failures=mishaps.failures)
    facts = report_facts(configuration, batch, campaign, judgement, is_interrupted=is_interrupted)
    ending = ending_of(campaign, facts)
    run = Run(
        record(configuration, batch, facts, campaign, judgement, ending=ending),
        quantities=quantities,
        tables=tables,
    )
    run.report_text = markdown_report(run)
    return run, facts


def failures_of(
    configuration: Configuration, batch: LogBatch, campaign: Campaign
) -> tuple[Failure, ...]:
    """Return the logs and settings without a result."""
    return (*batch.failures, *campaign.failures, *missing_logs(configuration, batch))


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
        tested=identity_of(batch, _used(campaign)).sentence,
        procedure=(
            *batch.notes,
            *_procedure(configuration, campaign),
            *((assessment.gas.sentence,) if assessment.gas is not None else ()),
            *_method(campaign, assessment),
        ),
        failures=(*failures_of(configuration, batch, campaign), *judgement.failures),
        warnings=_problems(
            *run_warnings(batch, campaign),
            *unconfirmed_tares(campaign, assessment),
            *unlike_frictions(campaign, assessment),
            *assessment.warnings,
            *other_model_advice(
                assessment, configuration.damper, is_chosen_by_logs=bool(configuration.chosen_law)
            ),
            *prediction_warnings(judgement.predictions),
        ),
        trust=assessment.sentences,
        identifiability=assessment.doubts(campaign),
        undetermined=assessment.undetermined(campaign),
        taken=batch.notes,
        searches=describe_searches(campaign.searches),
        cavitation=describe_cavitation(
            {fit.setting: fit.cavitation for fit in campaign.fits},
            doubted=doubted_cavitation(assessment.objections),
        ),
        across=judgement.adjustment.sentences,
        checks=judgement.checks,
        gaps=campaign.gaps,
        gates=_problems(
            *gates_not_met(configuration, batch, campaign),
            *missed_gates(judgement.checks, configuration.output.checks),
        ),
        advice=tuple(sorted((outcome.value, outcome.advice) for outcome in outcomes)),
        held_out=judgement.predictions,
        withheld=tuple(
            f"setting {setting}: {'; '.join(one.sentence for one in why)}"
            for setting, why in assessment.objections.items()
        ),
        stretches=tuple(entry for fit in campaign.fits for entry in _stretches(fit)),
        law_choice=_chosen_law(configuration, campaign),
        is_interrupted=is_interrupted,
    )


def _problems(*said: Problem | str) -> tuple[Problem, ...]:
    return tuple(map(as_warning, said))


def _chosen_law(configuration: Configuration, campaign: Campaign) -> Mapping[str, Any]:
    """Which law the logs have chosen, in the numbers that all settings were fitted with."""
    if not configuration.chosen_law:
        return {}
    from damperfit.laws import seen_again

    return seen_again(configuration.chosen_law, campaign, configuration.damper)


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
    tested = identity_of(batch, used).describe()
    return {
        "version": __version__,
        "procedure": campaign.procedure,
        **({"test": tested} if tested else {}),
        "configuration": document,
        "inputs": {log.log: log.sha256 for log in batch.logs if log.log in used},
    }


def identity_of(batch: LogBatch, names: Collection[str]) -> Identity:
    """Return whose test the logs of a run are; what differs between them is listed.

    Parameters
    ----------
    batch : LogBatch
        What was read.
    names : collection of str
        The logs that count; none: all.
    """
    known = batch.identities
    return common_identity(one for name, one in known.items() if name in names or not names)


def _used(campaign: Campaign) -> set[str]:
    return {log.trace.name for fit in campaign.fits for log in fit.logs}


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
    document: dict[str, Any] = {
        "version": __version__,
        "schema_version": SCHEMA_VERSION,
        "ending": ending.name.lower(),
        "exit_code": ending.value,
        "test": identity_of(batch, _used(campaign)).describe(),
        "configuration": configuration.document,
        "inputs": [log.describe() for log in batch.logs],
        "skipped": list(batch.skipped),
        "failures": [failure.describe() for failure in facts.failures],
        "warnings": list(map(str, facts.warnings)),
        "problems": [one.record() for one in facts.warnings],
        "gaps": [{"first": first, "last": last} for first, last in facts.gaps],
        "sentences": {
            "noise_and_lack_of_fit": list(facts.trust),
            "identifiability": list(facts.identifiability),
            "many_starts": list(facts.searches),
            "cavitation": list(facts.cavitation),
            "force_offset": list(judgement.adjustment.of_offset),
        },
        **({"law_choice": dict(facts.law_choice)} if facts.law_choice else {}),
        "gates_missed": list(map(str, facts.gates)),
        "procedure": list(facts.procedure),
        "checks": [to_record(check) for check in judgement.checks],
        **uncertainty_record(campaign, judgement.assessment),
        "stretches": [entry for fit in campaign.fits for entry in _stretches(fit)],
        "grades_withheld": [
            {"setting": setting, "reasons": [to_record(one) for one in why]}
            for setting, why in judgement.assessment.objections.items()
        ],
        "held_out": [one.describe() for one in judgement.predictions],
        **_across(judgement.adjustment, campaign),
        "adjusters": list(_adjusters(campaign)),
        "schema": describe_tables([fit.setting for fit in campaign.fits], campaign.quantities),
        "quantities": quantity_records(campaign.quantities),
    }
    # Key by key, so that no two forms of all of it stand beside each other.
    return {key: json_values(document.pop(key)) for key in list(document)}


def _adjusters(campaign: Campaign) -> tuple[str, ...]:
    """Names of the adjusters that the settings tell the place of."""
    return Setting.of(campaign.fits[0].setting).adjusters if campaign.fits else (ADJUSTER,)


def _stretches(fit: Fit) -> Iterator[dict[str, Any]]:
    """Yield what was compared of each log of a setting, stretch by stretch."""
    for log in fit.logs:
        errors = log.stretch_mse_percent
        for stretch, mse in zip(log.trace.stretches, errors, strict=False):
            facts = stretch.describe(log.trace)
            yield {
                "setting": fit.setting,
                "log": log.trace.name,
                "mse_percent": mse,
                **facts,
            }


def _across(adjustment: Adjustment, campaign: Campaign) -> dict[str, Any]:
    """Return trends, and the changes of force by click."""
    units = {one.name: one.unit for one in campaign.quantities}
    return {
        "trends": [
            {**to_record(trend), "unit": units[trend.parameter]} for trend in adjustment.trends
        ],
        "clicks": [to_record(click) for click in adjustment.clicks],
    }


def _procedure(configuration: Configuration, campaign: Campaign) -> Iterator[str]:
    """Yield how the parameters were found, one sentence each."""
    yield configuration.damper_sentence
    yield from (f"Note: {note}." for note in configuration.notes)
    if not campaign.fits:
        return
    fit = campaign.fits[0]
    yield f"Filter: {fit.logs[0].trace.model_filter.description}"
    yield f"Procedure: {campaign.procedure}."
    yield from (f"Corrected: {line}." for line in corrections(campaign))
    if campaign.sharing.sentence:
        yield f"{campaign.sharing.sentence}."
    for one in fit.parameters.quantities:
        name, unit, value = one.name, one.unit, getattr(fit.parameters, one.name)
        said = f"{name} = {engineering(value, digits=5)} {unit}"
        if campaign.sharing.follows.get(name):
            continue
        if fit.status[name] == Status.SHARED:
            spread = _friction_spread(campaign) if one.is_friction else ""
            yield f"{said} is shared by all settings, found from the logs{spread}."
        elif _is_of_first_fit(one, configuration.identification):
            yield (
                f"{name} of each setting is held at what a first fit of its logs gave, as --free "
                "leaves it out; its error is not in those of the others."
            )
        elif fit.status[name] == Status.FIXED and value != one.default:
            yield f"{said} is fixed."


def _is_of_first_fit(one: Quantity, options: FitOptions) -> bool:
    """Whether a setting's own quantity is neither asked for nor given."""
    is_own = one.default is None and not one.is_shared
    return is_own and bool(options.free) and one.name not in {*(options.free or ()), *options.fixed}


def _friction_spread(campaign: Campaign) -> str:
    if campaign.sharing.spread is None:
        return ""
    low, high = campaign.sharing.spread
    word = "it varies" if campaign.sharing.friction_varies else "it hardly varies"
    return f"; {word}: fitted individually, the settings have {low:.3g} to {high:.3g} N"
