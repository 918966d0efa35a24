"""What a run warns of, what it put right, and what is missing; of many alike the first alone.

Hundreds of logs or settings with the same flaw are one sentence: which, and how many more.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.identification import Status
from damperfit.identification.sharing import listed_settings, of_settings
from damperfit.problem import Failure, Option, Problem, warning
from damperfit.uncertainty import prediction_warnings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign, Fit
    from damperfit.recording import Finding, Trace
    from damperfit.run.judging import Judgement
    from damperfit.run.logs import LogBatch
    from damperfit.tested.setting import Setting
    from damperfit.uncertainty import Assessment

MANY = 20  # sentences of one kind that are shown one by one; a damper has some twenty settings
# Frictions of one damper at two settings: so many errors and times apart they are not one.
_ERRORS_APART = 3.0
_TIMES_APART = 2.0
# What another law may mend; an offset it cannot.
_OF_LAWS = frozenset({"bound", "beyond", "cavitation", "friction", "misfit", "prediction"})


def warnings_of(
    configuration: Configuration, batch: LogBatch, campaign: Campaign, judgement: Judgement
) -> Iterator[Problem]:
    """Yield what the reader should know before believing the numbers."""
    assessment = judgement.assessment
    yield from map(as_warning, (*batch.skipped_files, *batch.remarks))
    yield from log_warnings(_fitted_traces(campaign))
    yield from map(as_warning, campaign.warnings)
    if campaign.sharing.friction_varies and campaign.sharing.spread is not None:
        low, high = campaign.sharing.spread
        yield warning(
            "friction-varies",
            f"friction goes from {low:.3g} to {high:.3g} N over the settings: one value for all "
            "does not hold; free it{free}",
            free=_freeing_friction(campaign),
        )
    yield from _at_settings([(fit.setting, said) for fit in campaign.fits for said in fit.warnings])
    yield from unconfirmed_tares(campaign, assessment)
    yield from unlike_frictions(campaign, assessment)
    yield from map(as_warning, assessment.warnings)
    withheld = [
        setting
        for setting, why in assessment.objections.items()
        if any(one.kind in _OF_LAWS for one in why)
    ]
    if withheld and not configuration.chosen_law:
        yield warning(
            "other-model",
            f"model {configuration.damper.name} does not describe {of_settings(withheld)}: let "
            "the logs choose a model: identify the logs with {model}",
            model=Option("model", "auto"),
        )
    yield from map(as_warning, prediction_warnings(judgement.predictions))


def as_warning(said: Problem | str) -> Problem:
    """Return a warning as a problem, where it is a sentence alone."""
    return said if isinstance(said, Problem) else warning("said", said)


def _freeing_friction(campaign: Campaign) -> Option:
    """Return the option that gives each setting its own friction, all else as it was."""
    fit = campaign.fits[0]
    frictions = [one.name for one in fit.parameters.quantities if one.is_friction]
    if campaign.sharing.jointly:
        shared = (n for n in campaign.sharing.jointly if n not in frictions)
        return Option("share", ",".join(shared), is_aside=True)
    held = {*frictions, *campaign.sharing.found}
    idle = {Status.FIXED, Status.SHARED}
    own = [name for name, how in fit.status.items() if name not in held and how not in idle]
    return Option("free", ",".join((*own, *frictions)), is_aside=True)


def _at_settings(said: Sequence[tuple[Setting, Problem | str]]) -> Iterator[Problem]:
    """Yield what is so at each setting; of many, the first, and which others have one."""
    for setting, sentence in said[:1] if len(said) > MANY else said:
        problem = replace(as_warning(sentence), subject=f"setting {setting}")
        if len(said) > MANY:
            others = listed_settings({other for other, _ in said[1:]})
            problem = replace(problem, text=f"{problem.text} (with other numbers at {others})")
        yield problem


def log_warnings(traces: Iterable[Trace]) -> Iterator[Problem]:
    """Yield one problem for each kind of warning, with the numbers of its first log."""
    yield from _by_kind(traces, lambda finding: finding.severity == "warning")


def corrections(campaign: Campaign) -> Iterator[Problem]:
    """Yield what was put right in the logs that were fitted, one problem for each kind."""
    yield from _by_kind(_fitted_traces(campaign), lambda finding: finding.is_correction)


def _fitted_traces(campaign: Campaign) -> Iterator[Trace]:
    return (log.trace for fit in campaign.fits for log in fit.logs)


def _by_kind(traces: Iterable[Trace], is_meant: Callable[[Finding], bool]) -> Iterator[Problem]:
    logs: dict[str, list[tuple[str, Problem]]] = {}
    for trace in traces:
        for one in filter(is_meant, trace.findings):
            logs.setdefault(one.name, []).append((trace.name, one.problem))
    for (name, problem), *others in logs.values():
        also = f" and {len(others)} other log{'s' if len(others) > 1 else ''}" if others else ""
        yield replace(problem, subject=f"{name}{also}")


def unconfirmed_tares(campaign: Campaign, assessment: Assessment) -> Iterator[Problem]:
    """Say where a fit has no room for the tare that a log was warned of, as when it cavitates."""
    sound = {
        one.setting
        for one in assessment.diagnoses
        if not one.is_structured and not math.isnan(one.noise_percent)
    }
    doubted = [
        fit.setting
        for fit in campaign.fits
        if fit.setting in sound and _holds_offset(fit) and _is_warned_of_tare(fit)
    ]
    if doubted:
        yield warning(
            "tare-not-confirmed",
            "the warning tare is not confirmed: the fit matches the force to within its "
            "noise without an offset",
            of_settings(doubted),
        )


def _holds_offset(fit: Fit) -> bool:
    offsets = (one.name for one in fit.parameters.quantities if one.is_offset)
    return all(fit.status[name] == Status.FIXED for name in offsets)


def _is_warned_of_tare(fit: Fit) -> bool:
    findings = (finding for log in fit.logs for finding in log.trace.findings)
    return any(one.name == "tare" and one.severity == "warning" for one in findings)


def unlike_frictions(campaign: Campaign, assessment: Assessment) -> Iterator[Problem]:
    """Say where settings that were fitted apart have frictions that cannot be those of one damper.

    With the bleed closed, a preload and a friction give nearly the same force at one speed.

    Parameters
    ----------
    campaign : Campaign
        The fits.
    assessment : Assessment
        With the errors of noise and misfit.
    """
    known = {one.setting: one.intervals for one in assessment.uncertainties}
    for quantity in campaign.fits[0].parameters.quantities if campaign.fits else ():
        name = quantity.name
        if not quantity.is_friction:
            continue
        found = sorted(
            (getattr(fit.parameters, name), math.hypot(one.error, one.misfit), fit.setting)
            for fit in campaign.fits
            if fit.status[name] == Status.FITTED
            and (one := known.get(fit.setting, {}).get(name)) is not None
        )
        if not found:
            continue
        (low, low_error, where_low), (high, high_error, where_high) = found[0], found[-1]
        apart = high - low > _ERRORS_APART * math.hypot(low_error, high_error)
        if apart and high > _TIMES_APART * low:
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
        others = f" and {n} other log{'s' * (n > 1)}" if n else ""
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
    if len(above) + len(unsound) > MANY:  # one sentence on many settings tells of one gate
        yield from _at_settings(above)
        yield from _at_settings(unsound)
    else:
        yield from _at_settings(sorted([*above, *unsound], key=lambda one: one[0]))


def failures_of(
    configuration: Configuration, batch: LogBatch, campaign: Campaign
) -> tuple[Failure, ...]:
    """Return the logs and settings without a result."""
    return (*batch.failures, *campaign.failures, *missing_logs(configuration, batch))


def missing_logs(configuration: Configuration, batch: LogBatch) -> Iterator[Failure]:
    """Yield the settings that the configuration expects and no log claims to be; many as one."""
    present = {log.facts.get("setting") for log in batch.logs}
    missing = sorted(set(configuration.rig.settings) - present)
    why = "no log, but the configuration expects one in rig.settings"
    if len(missing) > MANY:
        place = f"settings {listed_settings(missing)}"
        yield Failure(Problem("missing-log", f"{why} for each", subject=place), "MissingLogError")
        return
    for setting in missing:
        problem = Problem("missing-log", why, subject=f"setting {setting}")
        yield Failure(problem, "MissingLogError", setting=setting)
