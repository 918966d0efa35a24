"""The account a run gives of itself: its tables, and run.json with how it ended and from what.

`provenance` goes into the tables and depends on the good logs and the configuration alone, so
that a bad log beside them changes no byte. `record` is run.json and tells everything.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit import __version__
from damperfit.checks import missed_gates
from damperfit.damper.cavitation import describe_cavitation
from damperfit.errors import sparing
from damperfit.identification import Status, describe_searches
from damperfit.reporting.markdown import markdown_report
from damperfit.reporting.records import to_record
from damperfit.results import Run
from damperfit.run.logs import Ending
from damperfit.run.problems import corrections, failures_of, gates_not_met, warnings_of
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
from damperfit.uncertainty import METHOD
from damperfit.uncertainty.grades import doubted_cavitation
from damperfit.units.quantities import engineering

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign
    from damperfit.problem import Failure, Problem
    from damperfit.run.judging import Judgement, Mishaps
    from damperfit.run.logs import LogBatch
    from damperfit.tested.identity import Identity
    from damperfit.uncertainty import Assessment, MisfitProfile


def run_of(  # noqa: PLR0913 - all that a run is made of
    configuration: Configuration,
    batch: LogBatch,
    campaign: Campaign,
    judgement: Judgement,
    mishaps: Mishaps,
    *,
    characteristics: Sequence[dict[str, Any]],
    is_interrupted: bool,
) -> tuple[Run, tuple[Failure, ...]]:
    """Return the run that was fitted and judged, without its signals, and what has failed.

    Parameters
    ----------
    configuration : Configuration
        The complete configuration.
    batch : LogBatch
        What was read.
    campaign : Campaign
        The fits.
    judgement : Judgement
        What was found of them.
    mishaps : Mishaps
        Takes what goes wrong, and tells what did.
    characteristics : sequence of dict
        Rows of that table.
    is_interrupted : bool
        Whether the user has stopped it.
    """
    damper, settings = configuration.damper, [fit.setting for fit in campaign.fits]
    quantities = campaign.quantities or PAPER_QUANTITIES
    used = {log.trace.name for fit in campaign.fits for log in fit.logs}
    predicted = {one.trace.name for one in judgement.predictions}
    origin = provenance(configuration, batch, campaign.procedure, used | predicted)
    rows: dict[str, list[dict[str, Any]]] = {"characteristics": list(characteristics)}
    for fit in campaign.fits:
        with sparing(fit.setting, mishaps.at("reading the valves of")):
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
    failures = (*failures_of(configuration, batch, campaign), *mishaps.failures)
    gates = (
        *gates_not_met(configuration, batch, campaign),
        *missed_gates(judgement.checks, configuration.output.checks),
    )
    ending = ending_of(len(settings), failures, gates, is_interrupted=is_interrupted)
    document = {
        "version": __version__,
        "schema_version": SCHEMA_VERSION,
        "ending": ending.name.lower(),
        "exit_code": ending.value,
        "test": identity_of(batch, used).describe(),
        "configuration": configuration.document,
        "inputs": [log.describe() for log in batch.logs],
        "skipped": list(batch.skipped),
        "failures": [failure.describe() for failure in failures],
        **_told(configuration, batch, campaign, judgement),
        "gates_missed": list(map(str, gates)),
        **_judged(campaign, judgement),
        "schema": describe_tables(settings, campaign.quantities),
        "quantities": quantity_records(campaign.quantities),
    }
    # Key by key, so that no two forms of all of it stand beside each other.
    record = {key: json_values(document.pop(key)) for key in list(document)}
    run = Run(record, quantities=quantities, tables=tables)
    run.report_text = markdown_report(run)
    return run, failures


def ending_of(
    n_fits: int, failures: Sequence[Failure], gates: Sequence[object], *, is_interrupted: bool
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


def provenance(
    configuration: Configuration, batch: LogBatch, procedure: str, used: Collection[str]
) -> dict[str, Any]:
    """Return what the tables were made from; nothing in it depends on place, time or failures.

    Parameters
    ----------
    configuration : Configuration
        The complete configuration.
    batch : LogBatch
        What was read.
    procedure : str
        How it was fitted.
    used : collection of str
        Logs that were fitted or predicted.
    """
    document = {key: value for key, value in configuration.document.items() if key != "output"}
    tested = identity_of(batch, used).describe()
    return {
        "version": __version__,
        "procedure": procedure,
        **({"test": tested} if tested else {}),
        "configuration": document,
        "inputs": {log.log: log.sha256 for log in batch.logs if log.log in used},
    }


def identity_of(batch: LogBatch, names: Collection[str]) -> Identity:
    """Return whose test some logs of a run are; no name: all. What differs is listed."""
    known = batch.identities
    return common_identity(one for name, one in known.items() if name in names or not names)


def _told(
    configuration: Configuration, batch: LogBatch, campaign: Campaign, judgement: Judgement
) -> dict[str, Any]:
    """Return what the run tells people: warnings, sentences, procedure."""
    assessment = judgement.assessment
    warned: list[Problem] = list(warnings_of(configuration, batch, campaign, judgement))
    law = configuration.chosen_law
    if law:
        from damperfit.laws import seen_again

        law = seen_again(law, campaign, configuration.damper)
    method = (METHOD, assessment.cycle_check) if campaign.fits else ()
    gas = () if assessment.gas is None else (assessment.gas.sentence,)
    return {
        "warnings": list(map(str, warned)),
        "problems": [one.record() for one in warned],
        "gaps": [{"first": first, "last": last} for first, last in campaign.gaps],
        "sentences": {
            "tables_of_tests": list(batch.notes),
            "corrections": [str(one) for one in corrections(campaign)],
            "noise_and_lack_of_fit": list(assessment.sentences),
            "identifiability": list(assessment.doubts(campaign)),
            "undetermined": list(assessment.undetermined(campaign)),
            "many_starts": list(describe_searches(campaign.searches)),
            "cavitation": list(
                describe_cavitation(
                    {fit.setting: fit.cavitation for fit in campaign.fits},
                    doubted=doubted_cavitation(assessment.objections),
                )
            ),
            "force_offset": list(judgement.adjustment.of_offset),
        },
        **({"law_choice": dict(law)} if law else {}),
        "procedure": [
            *batch.notes,
            *procedure_sentences(configuration, campaign),
            *gas,
            *filter(None, method),
        ],
    }


def procedure_sentences(configuration: Configuration, campaign: Campaign) -> Iterator[str]:
    """Yield how the parameters were found, one sentence each."""
    yield configuration.damper_sentence
    yield from (f"Note: {note}." for note in configuration.notes)
    if not campaign.fits:
        return
    fit, sharing, options = campaign.fits[0], campaign.sharing, configuration.identification
    yield f"Filter: {fit.logs[0].trace.model_filter.description}"
    yield f"Procedure: {campaign.procedure}."
    yield from (f"Corrected: {line}." for line in corrections(campaign))
    if sharing.sentence:
        yield f"{sharing.sentence}."
    for one in fit.parameters.quantities:
        name, value, status = one.name, getattr(fit.parameters, one.name), fit.status[one.name]
        said = f"{name} = {engineering(value, digits=5)} {one.unit}"
        if sharing.follows.get(name):
            continue
        is_own = one.default is None and not one.is_shared
        is_asked = name in {*(options.free or ()), *options.fixed}
        if status == Status.SHARED:
            spread = ""
            if one.is_friction and sharing.spread is not None:
                low, high = sharing.spread
                spread = (
                    f"; it {'varies' if sharing.friction_varies else 'hardly varies'}: fitted "
                    f"individually, the settings have {low:.3g} to {high:.3g} N"
                )
            yield f"{said} is shared by all settings, found from the logs{spread}."
        elif is_own and options.free and not is_asked:
            yield (
                f"{name} of each setting is held at what a first fit of its logs gave, as --free "
                "leaves it out; its error is not in those of the others."
            )
        elif status == Status.FIXED and value != one.default:
            yield f"{said} is fixed."


def _judged(campaign: Campaign, judgement: Judgement) -> dict[str, Any]:
    """Return checks, verdicts, correlations, profiles, trends, clicks: what was found of fits."""
    assessment, adjustment = judgement.assessment, judgement.adjustment
    fits = {fit.setting: fit for fit in campaign.fits}
    verdicts = assessment.verdicts(campaign)
    units = {one.name: one.unit for one in campaign.quantities}
    adjusters = Setting.of(campaign.fits[0].setting).adjusters if campaign.fits else (ADJUSTER,)
    return {
        "checks": [to_record(check) for check in judgement.checks],
        "uncertainty": [
            {
                "setting": known.setting,
                "verdicts": verdicts[known.setting],
                "parameters": list(known.names),
                "shared": list(known.shared),
                "correlation": known.correlation.tolist(),
                "errors": np.sqrt(np.diag(known.covariance)).tolist(),
                "jackknife_over_sandwich": {
                    name: interval.cycle_ratio for name, interval in known.intervals.items()
                },
                "residuals": to_record(seen),
                "cavitation": to_record(fits[known.setting].cavitation),
            }
            for known, seen in zip(assessment.uncertainties, assessment.diagnoses, strict=True)
        ],
        "profiles": [profile_record(one, assessment) for one in assessment.profiles],
        "gas_content": None if assessment.gas is None else to_record(assessment.gas),
        "speed_forces": [to_record(one) for one in assessment.forces],
        "searches": [to_record(one) for one in campaign.searches],
        "stretches": [
            {
                "setting": fit.setting,
                "log": log.trace.name,
                "mse_percent": mse,
                **stretch.describe(log.trace),
            }
            for fit in campaign.fits
            for log in fit.logs
            for stretch, mse in zip(log.trace.stretches, log.stretch_mse_percent, strict=False)
        ],
        "grades_withheld": [
            {"setting": setting, "reasons": [to_record(one) for one in why]}
            for setting, why in assessment.objections.items()
        ],
        "held_out": [one.describe() for one in judgement.predictions],
        "trends": [
            {**to_record(trend), "unit": units[trend.parameter]} for trend in adjustment.trends
        ],
        "clicks": [to_record(click) for click in adjustment.clicks],
        "adjusters": list(adjusters),
    }


def profile_record(profile: MisfitProfile, assessment: Assessment) -> dict[str, Any]:
    """The limits of a profile beside those of the sandwich covariance; the points have a table."""
    intervals = {one.setting: one.intervals.get(profile.name) for one in assessment.uncertainties}
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
