"""What a run warns of, what it put right, and what is missing; of many alike the first alone.

Hundreds of logs or settings with the same flaw are one sentence: which, and how many more.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from damperfit.problem import Failure, Option, Problem, warning

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.identification import Campaign
    from damperfit.recording import Finding, Trace
    from damperfit.run.logs import LogBatch
    from damperfit.tested.setting import Setting

__all__ = [
    "MANY",
    "as_warning",
    "corrections",
    "gates_not_met",
    "log_warnings",
    "missing_logs",
    "run_warnings",
    "skipped_files",
]

MANY = 20  # sentences of one kind that are shown one by one; a damper has some twenty settings


def run_warnings(batch: LogBatch, campaign: Campaign) -> Iterator[Problem]:
    """Yield what the reader should know before believing the numbers.

    Parameters
    ----------
    batch : LogBatch
        What was read.
    campaign : Campaign
        The fits.
    """
    yield from map(as_warning, (*skipped_files(batch), *batch.remarks))
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


def as_warning(said: Problem | str) -> Problem:
    """Return a warning as a problem, where it is a sentence alone."""
    return said if isinstance(said, Problem) else warning("said", said)


def _freeing_friction(campaign: Campaign) -> Option:
    """Return the option that gives each setting its own friction, all else as it was."""
    from damperfit.identification import Status

    fit = campaign.fits[0]
    frictions = [one.name for one in fit.parameters.quantities if one.is_friction]
    if campaign.sharing.jointly:
        shared = (n for n in campaign.sharing.jointly if n not in frictions)
        return Option("share", ",".join(shared), is_aside=True)
    held = {*frictions, *campaign.sharing.found}
    idle = {Status.FIXED, Status.SHARED}
    own = [name for name, how in fit.status.items() if name not in held and how not in idle]
    return Option("free", ",".join((*own, *frictions)), is_aside=True)


def skipped_files(batch: LogBatch) -> Iterator[str]:
    """Yield which files are no logs; of many, the first and how many."""
    if len(batch.skipped) > MANY:
        n = len(batch.skipped) - 1
        yield f"{batch.skipped[0]} and {n} other files: written by damperfit, not logs; skipped"
        return
    for path in batch.skipped:
        yield f"{path}: written by damperfit, not a log; skipped"


def _at_settings(said: Sequence[tuple[Setting, Problem | str]]) -> Iterator[Problem]:
    """Yield what is so at each setting; of many, the first, and which others have one."""
    for setting, sentence in said:
        known = as_warning(sentence)
        place = f"setting {setting}"
        if len(said) <= MANY:
            yield replace(known, subject=place)
            continue
        from damperfit.identification.sharing import listed_settings

        others = listed_settings({setting for setting, _ in said[1:]})
        yield replace(known, subject=place, text=f"{known.text} (with other numbers at {others})")
        return


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
            above.append(
                (
                    fit.setting,
                    warning("mse-gate", f"MSE {fit.mse_percent:.3g} % is above {limit:g} %"),
                )
            )
        if not fit.outcome.is_minimum:
            text = f"the fit did not converge ({fit.outcome.value})"
            unsound.append((fit.setting, warning("not-converged", text)))
    if len(above) + len(unsound) > MANY:  # one sentence on many settings tells of one gate
        yield from _at_settings(above)
        yield from _at_settings(unsound)
    else:
        yield from _at_settings(sorted([*above, *unsound], key=lambda one: one[0]))


def missing_logs(configuration: Configuration, batch: LogBatch) -> Iterator[Failure]:
    """Yield the settings that the configuration expects and no log claims to be; many as one."""
    present = {log.facts.get("setting") for log in batch.logs}
    missing = sorted(set(configuration.rig.settings) - present)
    why = "no log, but the configuration expects one in rig.settings"
    if len(missing) > MANY:
        from damperfit.identification.sharing import listed_settings

        place = f"settings {listed_settings(missing)}"
        problem = Problem("missing-log", f"{why} for each", subject=place)
        yield Failure(problem, "MissingLogError")
        return
    for setting in missing:
        problem = Problem("missing-log", why, subject=f"setting {setting}")
        yield Failure(problem, "MissingLogError", setting=setting)
