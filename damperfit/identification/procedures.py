"""Fits over the settings of a damper: the procedures `plain`, `paper` and `joint`.

`plain` fits every setting by itself; `paper` is `paper.as_in_the_paper`; `joint` starts from either
and fits all settings at once, with R_m3 and f_f, or what the model ties, in common.
"""

from __future__ import annotations

from collections import defaultdict
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.warmed import BETA
from damperfit.errors import ConfigurationError, FitCancelledError, LogError, SimulationError
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.identification.campaign import (
    Campaign,
    ProcedureInput,
    SettingFailure,
    attempted,
    fit_every_setting,
)
from damperfit.identification.fit_setting import Fit, describe_fit
from damperfit.identification.following import Way, declared_way
from damperfit.identification.inactive_parts import without_idle_parts
from damperfit.identification.joint import JointResult, fit_from_one_model, fit_settings_jointly
from damperfit.identification.mean_cycle import SettledLogs, settled
from damperfit.identification.options import FitOptions, check_options, shared_names
from damperfit.identification.paper import MEAN, TAKEN, as_in_the_paper
from damperfit.identification.starts import Search, fit_from
from damperfit.problem import Failure, Option, Problem, warning
from damperfit.recording import Trace, natural_order
from damperfit.tested.setting import Setting
from damperfit.workers import apart

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.identification.fit_problem import FitProblem

__all__ = ["PROCEDURES", "identify"]

_NOT_JOINT = (
    "the joint fit needs two settings at a sound minimum and a shared parameter: these are the "
    "results of procedure {}."
)
_NOT_FITTED_JOINTLY = "the joint fit met an error: these are the results of procedure {}."


def identify(
    traces: Sequence[Trace],
    damper: Model,
    options: FitOptions = FitOptions(),
    *,
    jobs: int = 1,
    on_fit: Callable[[Fit], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Campaign:
    """Fit the parameters of every setting that the traces hold.

    Traces of one setting are fitted together. The result does not depend on `jobs` or on the
    order of the traces.

    Parameters
    ----------
    traces : sequence of Trace
        Conditioned logs; each must know its setting.
    damper : Model
        The damper's model.
    options : FitOptions
        Procedure, free and fixed parameters.
    jobs : int
        Threads; the compiled core runs outside the interpreter's lock.
    on_fit : callable, optional
        Called with each finished `Fit`, from any thread.
    cancelled : callable, optional
        Asked often; when it returns True the finished settings are returned.

    Returns
    -------
    Campaign
        Fits by setting, failures and warnings.

    Raises
    ------
    ConfigurationError
        An unknown procedure or parameter, or one both free and fixed.
    LogError
        No trace, or one without a setting.
    """
    for one in traces:
        if not isinstance(one, Trace):
            raise ConfigurationError(
                f"identify: found {type(one).__name__} among the traces; expected what "
                "damperfit.conditioning.condition(read_log(path)) returns; "
                "damperfit.identify(paths) takes paths",
                code="not-a-trace",
            )
    check_options(options, damper)
    if not traces:
        raise LogError("identify: found no log to fit; give one trace or more", code="no-log")
    settings = _by_setting(traces)
    given = ProcedureInput(
        settings,
        damper,
        options,
        max(1, jobs),
        on_fit or (lambda _fit: None),
        cancelled or (lambda: False),
        _cycles(settings, damper, jobs=max(1, jobs)),
    )
    # BLAS threads spin between the small products of a fit and take the core that the next
    # setting's thread needs.
    with one_blas_thread():
        campaign = PROCEDURES[options.procedure](given)
    ambiguous = (
        warning("starts", one.warning, f"setting {one.setting}")
        for one in campaign.searches
        if one.warning
    )
    return replace(campaign, warnings=(*campaign.warnings, *ambiguous), named=damper.quantities)


def _cycles(
    settings: Mapping[Setting, tuple[Trace, ...]], damper: Model, *, jobs: int
) -> dict[Setting, SettledLogs | None]:
    """The mean cycles of each setting whose logs repeat; kinks need every sample."""
    if damper.kinks:
        return {}

    def of(setting: Setting) -> SettledLogs | None:
        found = attempted(setting, lambda: settled(settings[setting], is_thinned=False))
        return None if isinstance(found, SettingFailure) else found

    return dict(zip(settings, apart(of, settings, jobs=jobs), strict=True))


def _plain(given: ProcedureInput) -> Campaign:
    """Fit at every setting what is free, from the closed form."""
    options, defaults = given.options, {q.name: q.default for q in given.damper.quantities}
    free = options.free
    if free is None:
        free = tuple(n for n, default in defaults.items() if default is None)
        free = tuple(name for name in free if name not in options.fixed)
    held = {n: value for n, value in defaults.items() if value is not None and n not in free}
    fixed = {**held, **options.fixed}
    for name in defaults:
        if name not in free and name not in fixed:
            raise ConfigurationError(
                f"procedure plain: {name} is neither free nor fixed; "
                f"add it to {{free}} or give {{fix}}.",
                free=Option("free"),
                fix=Option("fix", "VALUE", name),
                code="neither-free-nor-fixed",
            )

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        problem = given.problem(setting, given.ordered(free))
        start = given.start(setting, problem, fixed)
        result, search = fit_from(setting, problem, start, starts=options.starts)
        return describe_fit(setting, result, problem), search

    found = fit_every_setting(given, fit)
    if not options.is_leaving_out:
        return found
    return without_idle_parts(
        found, lambda one: given.problem(one.setting, given.ordered(free)), jobs=given.jobs
    )


def _joint(given: ProcedureInput) -> Campaign:
    """One fit over the settings, from the model's own procedure; unsound ones follow it."""
    way, moving = _way_of(given)
    said = given.options.start
    is_ended = said.is_of_one_model and all(one in said.by_setting for one in given.settings)
    if way is not None and way.shared and is_ended:
        with suppress(SimulationError):
            return _from_one_model(given, way, moving)
    name = "paper" if "paper" in given.damper.procedures else "plain"
    by_paper = {TAKEN, MEAN} if name == "paper" and (way is None or not way.follows) else set()
    shared = {*shared_names(given.options, given.damper)} if way is None else {*way.shared}
    free = tuple(one for one in moving if one not in by_paper & shared)
    options = replace(given.options, free=free, starts=1, is_leaving_out=False)
    if BETA.name in free and len(given.settings) > 1:
        options = with_first_beta(given, options, PROCEDURES[name])
    before = PROCEDURES[name](replace(given, options=options, on_fit=lambda _fit: None))
    try:
        found = attempted(None, lambda: fit_settings_jointly(given, before.fits, way, moving))
    except FitCancelledError:
        return Campaign("joint", (), is_complete=False)
    if isinstance(found, Failure):
        warnings = (*before.warnings, warning("joint-failed", _NOT_FITTED_JOINTLY.format(name)))
        return replace(before, procedure="joint", warnings=warnings, mishap=found)
    together, broken = found
    failed = {one.setting: one for one in before.failures} | broken
    if not before.is_complete or together is None:
        # The logs of one setting tell beta by themselves: nothing was to be shared.
        is_alone = BETA.name in free and len(given.settings) == 1
        is_told = before.is_complete and not is_alone
        return replace(
            before,
            procedure="joint",
            fits=tuple(fit for fit in before.fits if fit.setting not in failed),
            failures=tuple(failed[setting] for setting in sorted(failed)),
            warnings=(
                *before.warnings,
                *((warning("not-joint", _NOT_JOINT.format(name)),) if is_told else ()),
            ),
        )
    fits = {fit.setting: fit for fit in before.fits}
    campaign = _each_beside(
        given,
        together,
        lambda setting, problem: together.start(fits[setting], problem),
        {setting: fit.evaluations for setting, fit in fits.items()},
        warnings=before.warnings,
        known=failed,
    )
    if not any(given.damper.quantity(one).is_friction for one in shared):
        return campaign
    spread = before.sharing.spread, before.sharing.is_spread_certain
    sharing = replace(campaign.sharing, spread=spread[0], is_spread_certain=spread[1])
    return replace(campaign, sharing=sharing)


def _from_one_model(given: ProcedureInput, way: Way, moving: tuple[str, ...]) -> Campaign:
    """All settings together from where one model of them has ended."""
    fixed = given.options.fixed
    first = given.damper.start(next(iter(given.settings.values())), fixed)[0]
    starts = {s: given.with_given_start(s, first, fixed) for s in given.settings}
    together = fit_from_one_model(given, way, moving, starts)
    one = replace(given, options=replace(given.options, starts=1))
    return _each_beside(one, together, lambda s, _: together.solution.parameters[s], {})


def _each_beside(
    given: ProcedureInput,
    together: JointResult,
    start: Callable[[Setting, FitProblem], Values],
    spent: Mapping[Setting, int],
    *,
    warnings: Iterable[Problem] = (),
    known: Mapping[Setting, Failure] = MappingProxyType({}),
) -> Campaign:
    """What is each setting's own, fitted beside what a joint fit has found."""

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        problem = given.problem(setting, given.ordered(together.own_at(setting)))
        result, search = fit_from(
            setting,
            problem,
            start(setting, problem),
            starts=given.options.starts,
            spent=spent.get(setting, 0) + together.evaluations,
        )
        result = result.with_status(together.status_at(setting))
        return describe_fit(setting, result, problem), search

    campaign = fit_every_setting(given, fit, (*warnings, *together.warnings), known=known)
    return replace(campaign, sharing=together.sharing)


def _way_of(given: ProcedureInput) -> tuple[Way | None, tuple[str, ...]]:
    """Return the way of sharing, None where the logs are to tell it, and what moves."""
    options, damper = given.options, given.damper
    wanted = [
        q.name for q in damper.quantities if q.default is None and q.name not in options.fixed
    ]
    if not options.is_detecting and not options.follows:
        shared = given.ordered(shared_names(options, damper))
        # What is neither shared nor fixed is the settings' own: R_m3 or f_f too.
        own = given.ordered(options.free or [name for name in wanted if name not in shared])
        return Way(own, shared, {}), given.ordered({*own, *shared})
    if options.start.is_of_one_model and options.share and not options.is_detecting:
        shared = given.ordered(options.share)
        own = given.ordered(options.free or ())
        way = Way(own, shared, options.follows, is_detected=bool(options.follows), is_general=True)
        return way, given.ordered({*own, *shared})
    moving = given.ordered({*(options.free or wanted), *options.follows})
    if not options.follows:
        return None, moving
    return declared_way(damper, moving, options.follows, min(given.settings).adjusters), moving


PROCEDURES: dict[str, Callable[[ProcedureInput], Campaign]] = {
    "paper": as_in_the_paper,
    "joint": _joint,
    "plain": _plain,
}


def _by_name(trace: Trace) -> tuple[object, ...]:
    return natural_order(trace.name), trace.name, trace.start_time


def _by_setting(traces: Sequence[Trace]) -> dict[Setting, tuple[Trace, ...]]:
    groups: dict[Setting, list[Trace]] = defaultdict(list)
    for trace in traces:
        if trace.setting is None:
            raise LogError(
                "the setting is not known; write '# setting: N' into the log, "
                "name it setting_N, or give {setting}.",
                setting=Option("setting", "N"),
                subject=trace.name,
                code="no-setting",
            )
        groups[Setting.of(trace.setting)].append(trace)
    return {setting: tuple(sorted(groups[setting], key=_by_name)) for setting in sorted(groups)}


# Settings whose logs are all equally warm do not determine what temperature does, and one whose
# logs are not is missed by a fit that knows nothing of it: the widest ranges are fitted first.
_ASKED = 3  # settings; their mean only has to be near
_WIDE = 3.0  # K within a setting that tell it anything


def with_first_beta(
    given: ProcedureInput, options: FitOptions, fit: Callable[[ProcedureInput], Campaign]
) -> FitOptions:
    """Return the options of a fit of single settings that hold beta at what some of them tell.

    Parameters
    ----------
    given : ProcedureInput
        All settings.
    options : FitOptions
        With beta among what is free.
    fit : callable
        The procedure that fits settings one by one.

    Raises
    ------
    FitCancelledError
        When the caller asked to stop.
    """
    beta = options.start.named.get(BETA.name, 0.0)
    reach = {}
    for setting, traces in given.settings.items():
        known = [trace.temperature for trace in traces if trace.temperature is not None]
        reach[setting] = max(known) - min(known) if known else 0.0
    telling = [one for one in sorted(reach, key=lambda s: -reach[s]) if reach[one] >= _WIDE]
    if telling:
        asked = {setting: given.settings[setting] for setting in sorted(telling[:_ASKED])}
        told = fit(replace(given, settings=asked, options=options, on_fit=lambda _: None))
        found = [one.parameters.beta for one in told.fits if one.outcome.is_minimum]
        beta = float(np.median(found)) if found else beta
    left = tuple(name for name in options.free or () if name != BETA.name)
    return replace(options, free=left, fixed={**options.fixed, BETA.name: beta})
