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

from damperfit.damper.network import BLOW_OFF_PARTS
from damperfit.damper.quantity import GAS_AMOUNT, STIFFNESS
from damperfit.damper.temperature_law import BETA
from damperfit.errors import ConfigurationError, FitCancelledError, LogError, SimulationError
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.identification.campaign import Campaign, ProcedureInput, fit_every_setting
from damperfit.identification.fit_problem import does_nothing, kept_within
from damperfit.identification.fit_setting import Fit, describe_fit, minimised
from damperfit.identification.joint import (
    JointResult,
    declared_sharing,
    fit_from_one_model,
    fit_settings_jointly,
)
from damperfit.identification.mean_cycle import SettledLogs, settled
from damperfit.identification.options import FitOptions, check_options, shared_names
from damperfit.identification.outcome import Status, attempted
from damperfit.identification.paper import MEAN, TAKEN, as_in_the_paper
from damperfit.identification.sharing import Sharing
from damperfit.identification.starts import Search, fit_from, own_start, with_given
from damperfit.problem import Failure, Option, Problem, warning
from damperfit.recording import Trace, natural_order
from damperfit.tested.setting import Setting
from damperfit.workers import apart, executor

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.identification.fit_problem import Block

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
    settings, jobs = _by_setting(traces), max(1, jobs)
    given = ProcedureInput(
        settings,
        damper,
        options,
        jobs,
        on_fit or (lambda _fit: None),
        cancelled or (lambda: False),
        {} if damper.kinks else _cycles(settings, jobs),  # kinks need every sample
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
    for logs in groups.values():
        logs.sort(key=lambda one: (natural_order(one.name), one.name, one.start_time))
    return {setting: tuple(groups[setting]) for setting in sorted(groups)}


def _cycles(
    settings: Mapping[Setting, tuple[Trace, ...]], jobs: int
) -> dict[Setting, SettledLogs | None]:
    """The mean cycles of each setting whose logs repeat."""

    def of(setting: Setting) -> SettledLogs | None:
        cycles = attempted(setting, lambda: settled(settings[setting], is_thinned=False))
        return None if isinstance(cycles, Failure) else cycles

    return dict(zip(settings, apart(of, settings, jobs=jobs), strict=True))


def _plain(given: ProcedureInput) -> Campaign:
    """Fit at every setting what is free, from the closed form."""
    options, defaults = given.options, {q.name: q.default for q in given.damper.quantities}
    free = options.free
    if free is None:
        free = tuple(n for n, x in defaults.items() if x is None and n not in options.fixed)
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
        block = given.block(setting, free)
        start = own_start(given, setting, block, fixed)
        result, search = fit_from(setting, block, start, starts=options.starts)
        return describe_fit(setting, result, block), search

    campaign = fit_every_setting(given, fit)
    if not options.is_leaving_out:
        return campaign

    def lean(fit: Fit) -> Fit:
        try:
            return _without_idle_parts(fit, given.block(fit.setting, free))
        except (SimulationError, FitCancelledError):
            return fit

    with executor(given.jobs) as pool:
        return replace(campaign, fits=tuple(pool.map(lean, campaign.fits)))


def _joint(given: ProcedureInput) -> Campaign:
    """One fit over the settings, from the model's own procedure; unsound ones follow it."""
    sharing, moving = _sharing_of(given)
    said, quiet = given.options.start, replace(given, on_fit=lambda _fit: None)
    is_ended = said.is_of_one_model and all(one in said.by_setting for one in given.settings)
    if sharing is not None and sharing.jointly and is_ended:
        with suppress(SimulationError):
            return _from_one_model(given, sharing)
    name = "paper" if "paper" in given.damper.procedures else "plain"
    by_paper = {TAKEN, MEAN} if name == "paper" and not (sharing and sharing.follows) else set()
    names = shared_names(given.options, given.damper) if sharing is None else sharing.jointly
    shared = set(names)
    free = tuple(one for one in moving if one not in by_paper & shared)
    options = replace(given.options, free=free, starts=1, is_leaving_out=False)
    if BETA.name in free and len(given.settings) > 1:
        options = _with_first_beta(quiet, options, PROCEDURES[name])
    before = PROCEDURES[name](replace(quiet, options=options))
    try:
        ended = attempted(None, lambda: fit_settings_jointly(given, before.fits, sharing, moving))
    except FitCancelledError:
        return Campaign("joint", (), is_complete=False)
    if isinstance(ended, Failure):
        warnings = (*before.warnings, warning("joint-failed", _NOT_FITTED_JOINTLY.format(name)))
        return replace(before, procedure="joint", warnings=warnings, failure=ended)
    together, broken = ended
    failed = {one.setting: one for one in before.failures} | broken
    if not before.is_complete or together is None:
        warnings = before.warnings
        # The logs of one setting tell beta by themselves: nothing was to be shared.
        if before.is_complete and not (BETA.name in free and len(given.settings) == 1):
            warnings = (*warnings, warning("not-joint", _NOT_JOINT.format(name)))
        return replace(
            before,
            procedure="joint",
            fits=tuple(fit for fit in before.fits if fit.setting not in failed),
            failures=tuple(failed[setting] for setting in sorted(failed)),
            warnings=warnings,
        )
    fits = {fit.setting: fit for fit in before.fits}
    campaign = _each_beside(
        given,
        together,
        lambda setting, block: together.start(fits[setting], block),
        {setting: fit.evaluations for setting, fit in fits.items()},
        warnings=before.warnings,
        known=failed,
    )
    if not any(given.damper.quantity(one).is_friction for one in shared):
        return campaign
    spread, is_certain = before.sharing.spread, before.sharing.is_spread_certain
    with_spread = replace(campaign.sharing, spread=spread, is_spread_certain=is_certain)
    return replace(campaign, sharing=with_spread)


def _from_one_model(given: ProcedureInput, sharing: Sharing) -> Campaign:
    """All settings together from where one model of them has ended."""
    fixed = given.options.fixed
    first = given.damper.start(next(iter(given.settings.values())), fixed)[0]
    starts = {setting: with_given(given, setting, first, fixed) for setting in given.settings}
    together = fit_from_one_model(given, sharing, starts)
    once = replace(given, options=replace(given.options, starts=1))
    return _each_beside(once, together, lambda s, _: together.solution.parameters[s], {})


def _each_beside(
    given: ProcedureInput,
    together: JointResult,
    start: Callable[[Setting, Block], Values],
    spent: Mapping[Setting, int],
    *,
    warnings: Iterable[Problem] = (),
    known: Mapping[Setting, Failure] = MappingProxyType({}),
) -> Campaign:
    """What is each setting's own, fitted beside what a joint fit has found."""

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        block = given.block(setting, together.own_at(setting))
        result, search = fit_from(
            setting,
            block,
            start(setting, block),
            starts=given.options.starts,
            spent=spent.get(setting, 0) + together.evaluations,
        )
        result = result.with_status(together.status_at(setting))
        return describe_fit(setting, result, block), search

    campaign = fit_every_setting(given, fit, (*warnings, *together.warnings), known=known)
    return replace(campaign, sharing=together.sharing)


def _sharing_of(given: ProcedureInput) -> tuple[Sharing | None, tuple[str, ...]]:
    """What is shared, None where the logs are to tell it, and what moves."""
    options, damper = given.options, given.damper
    wanted = [
        q.name for q in damper.quantities if q.default is None and q.name not in options.fixed
    ]
    is_handed_on = options.start.is_of_one_model and options.share and not options.is_detecting
    if is_handed_on or not (options.is_detecting or options.follows):
        shared = given.ordered(shared_names(options, damper))
        # What is neither shared nor fixed is the settings' own: R_m3 or f_f too.
        rest = () if options.follows else (name for name in wanted if name not in shared)
        moving = given.ordered({*(options.free or rest), *shared})
        return Sharing(moving, shared, options.follows, bool(options.follows)), moving
    moving = given.ordered({*(options.free or wanted), *options.follows})
    if not options.follows:
        return None, moving
    adjusters = min(given.settings).adjusters
    return declared_sharing(damper, moving, options.follows, adjusters, options.untied), moving


PROCEDURES: dict[str, Callable[[ProcedureInput], Campaign]] = {
    "paper": as_in_the_paper,
    "joint": _joint,
    "plain": _plain,
}


# Settings whose logs are all equally warm do not determine what temperature does, and one whose
# logs are not is missed by a fit that knows nothing of it: the widest ranges are fitted first.
_ASKED = 3  # settings; their mean only has to be near
_WIDE = 3.0  # K within a setting that tell it anything


def _with_first_beta(
    given: ProcedureInput, options: FitOptions, fit: Callable[[ProcedureInput], Campaign]
) -> FitOptions:
    """The options of a fit of single settings that hold beta at what some of them tell."""
    beta = options.start.named.get(BETA.name, 0.0)
    reach = {}
    for setting, traces in given.settings.items():
        known = [trace.temperature for trace in traces if trace.temperature is not None]
        reach[setting] = max(known) - min(known) if known else 0.0
    telling = [one for one in sorted(reach, key=lambda s: -reach[s]) if reach[one] >= _WIDE]
    if telling:
        asked = {setting: given.settings[setting] for setting in sorted(telling[:_ASKED])}
        fits = fit(replace(given, settings=asked, options=options)).fits
        betas = [one.parameters.beta for one in fits if one.outcome.is_minimum]
        beta = float(np.median(betas)) if betas else beta
    left = tuple(name for name in options.free or () if name != BETA.name)
    return replace(options, free=left, fixed={**options.fixed, BETA.name: beta})


# Parts of a law that do nothing at a setting are left out there, and the rest is fitted again. A
# law that logs have chosen is one for all settings. Where a bleed is closed or a mounting has no
# play, the number of it runs to the edge of its range; that is the smaller law, not a bound that a
# fit strains against.

# Friction at rest and the speed at which it has gone: two numbers of one part, but for a speed that
# is lower than logs tell.
_AT_REST = ("breakaway", "stribeck_speed")
# Oil that does not give, and gas whose pressure does not change: what the logs do not show.
_AS_IF = {
    STIFFNESS: "the logs do not show the oil give: it is taken as rigid here",
    GAS_AMOUNT: "the logs do not show the gas pressure change with the stroke: it is taken as "
    "constant here",
}


def _without_idle_parts(fit: Fit, block: Block) -> Fit:
    lost: dict[str, None] = {}
    said: list[Problem] = []
    first = fit.warnings
    while idle := [
        name
        for name, status in fit.status.items()
        if status is Status.AT_BOUND and does_nothing(fit.parameters, name)
    ]:
        said += [warning("left-out", _sentence(fit.parameters, name)) for name in idle]
        lost |= dict.fromkeys(one for name in idle for one in _part(fit, name))
        start = kept_within(fit.parameters, lost)
        rest = replace(block, free=tuple(one for one in block.free if one not in lost))
        has_edges = {name: fit.parameters.quantity(name).has_own_edges for name in lost}
        left = {n: Status.FIXED if has_edges[n] else Status.ABSENT for n in lost}
        result = minimised(rest, start, spent=fit.evaluations).with_status(left)
        fit = describe_fit(fit.setting, result, rest)
    return replace(fit, warnings=(*first, *said)) if said else fit


def _part(fit: Fit, name: str) -> list[str]:
    """A quantity with those that mean nothing without it: a closed blow-off has no slope."""
    one = fit.parameters.quantity(name)
    edge = one.edge_at(getattr(fit.parameters, name))
    if name in _AT_REST:
        is_speed_alone = name == _AT_REST[1] and edge != "above"
        return [name] if is_speed_alone else [two for two in _AT_REST if two in fit.status]
    is_shut = one.group == "blow_off" and one.area_power > 0.0 and edge == "above"
    if not is_shut or one.stroke == "return":
        return [name]
    return [two for two in map(one.beside, BLOW_OFF_PARTS) if two in fit.status]


def _sentence(values: Values, name: str) -> str:
    one, value = values.quantity(name), getattr(values, name)
    low, high = one.plausible
    what = f"{one.label} ({one.symbol})"
    if one.has_own_edges:
        return (
            f"{what}: {value:g}, an edge of its range at which the law is a simpler one, fits "
            "best, and is held here."
        )
    if one.role in _AS_IF:
        return f"{what}: {_AS_IF[one.role]}."
    if name == _AT_REST[1] and value < high:
        beyond = f"below {1e3 * low:g} mm/s"
    else:
        return (
            f"{what} does nothing here: it is at a bound of its range, and the law is fitted "
            "without it."
        )
    return f"{what}: the logs do not determine one {beyond}, at which it is held here."
