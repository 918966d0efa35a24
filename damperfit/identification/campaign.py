"""Fits over the settings of a damper: the procedures `plain`, `paper` and `joint`.

The paper's procedure, automated: all five parameters at the lowest setting give R_m3; the mean of
the friction over a first pass of all settings gives f_f; then R_m1, R_m2 and K_e at every setting.
`joint` starts from there and fits all settings at once, with R_m3 and f_f in common.
"""

from __future__ import annotations

from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

from damperfit.errors import ConfigurationError, LogError, Mishap
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.identification.descent import FitCancelledError
from damperfit.identification.failures import SettingFailure, attempted, attempted_for_all
from damperfit.identification.first_pass import first_pass
from damperfit.identification.joint_procedure import fit_together
from damperfit.identification.multistart import Search, fit_from
from damperfit.identification.options import FitOptions, check_options, shared_names
from damperfit.identification.outcome import Status
from damperfit.identification.procedure_input import ProcedureInput, first_start
from damperfit.identification.setting import Fit, Judged, describe_fit
from damperfit.identification.sharing import MEAN, TAKEN, Sharing
from damperfit.recording import natural_order
from damperfit.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from damperfit.damper.model import Model, Quantity
    from damperfit.recording import Trace

__all__ = ["PROCEDURES", "Campaign", "identify"]

_NOT_JOINT = (
    "the joint fit needs two settings at a sound minimum and a shared parameter: these are the "
    "results of procedure {}."
)
_NOT_FITTED_JOINTLY = "the joint fit met an error: these are the results of procedure paper."


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """The fits of a damper over its settings.

    Attributes
    ----------
    procedure : str
        How they were made.
    fits : tuple of Fit
        By rising setting.
    failures : tuple of SettingFailure
        Settings without a fit and why.
    warnings : tuple of str
        One plain sentence each.
    is_complete : bool
        False when the caller asked to stop before every setting was done.
    sharing : Sharing
        How the shared parameters were estimated.
    searches : tuple of Search
        What fits from many starts found, where they were asked for.
    mishap : Mishap or None
        What damperfit got wrong in a step over all settings, done without.
    named : tuple of Quantity
        Quantities of the model, where there may be no fit to tell them.
    """

    procedure: str
    fits: tuple[Fit, ...]
    failures: tuple[SettingFailure, ...] = ()
    warnings: tuple[str, ...] = ()
    is_complete: bool = True
    sharing: Sharing = Sharing()
    searches: tuple[Search, ...] = ()
    mishap: Mishap | None = None
    named: tuple[Quantity, ...] = ()

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """What the model has; nothing where neither it nor a fit is known."""
        return self.named or (self.fits[0].parameters.quantities if self.fits else ())

    @property
    def gaps(self) -> tuple[tuple[int, int], ...]:
        """Runs of settings without a fit within a run of clicks: first and last of each.

        Where every other click or none but 1, 5, 10 was tested, those between are no gaps.
        """
        cells = [Setting.of(fit.setting).cell for fit in self.fits]
        done = [cell for cell in cells if isinstance(cell, int)]
        if len(done) < len(cells):
            return ()
        steps = sorted(later - earlier for earlier, later in pairwise(done))
        if not steps or steps[len(steps) // 2] != 1:
            return ()
        return tuple((a + 1, b - 1) for a, b in pairwise(done) if b - a > 1)


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
    check_options(options, damper)
    if not traces:
        raise LogError("identify: there is no log to fit; give one trace or more")
    given = ProcedureInput(
        _by_setting(traces),
        damper,
        options,
        max(1, jobs),
        on_fit or (lambda _fit: None),
        cancelled or (lambda: False),
    )
    # BLAS threads spin between the small products of a fit and take the core that the next
    # setting's thread needs: 200 logs on two cores took 4.9 s with them and 2.8 s without.
    with one_blas_thread():
        campaign = PROCEDURES[options.procedure](given)
    said = [f"setting {one.setting}: {one.warning}" for one in campaign.searches if one.warning]
    return replace(campaign, warnings=(*campaign.warnings, *said), named=damper.quantities)


def _plain(given: ProcedureInput) -> Campaign:
    """Fit at every setting what is free, from the closed form."""
    quantities = given.damper.quantities
    wanted = [one.name for one in quantities if one.default is None]
    free = given.options.free
    if free is None:
        free = tuple(name for name in wanted if name not in given.options.fixed)
    held = {one.name: one.default for one in quantities if one.default is not None}
    fixed = {**{k: v for k, v in held.items() if k not in free}, **given.options.fixed}
    for name in wanted:
        if name not in free and name not in fixed:
            raise ConfigurationError(
                f"procedure plain: {name} is neither free nor fixed; "
                f"add it to --free or give --fix {name}=VALUE."
            )

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        misfit = given.misfit(setting, given.ordered(free))
        judged, found = fit_from(given, setting, misfit, first_start(misfit, fixed))
        return describe_fit(setting, judged, misfit), found

    return _collect(given, fit)


def _paper(given: ProcedureInput) -> Campaign:
    """The paper's own procedure, sections 3 and 4 of its identification."""
    quantities = given.damper.quantities
    fixed = dict(given.options.fixed)
    own = (one.name for one in quantities if one.default is None and not one.is_shared)
    free = given.options.free or tuple(name for name in own if name not in fixed)
    for one in quantities:
        if one.default is not None and one.name not in free:
            fixed.setdefault(one.name, one.default)
    shared_free = tuple(one.name for one in quantities if one.name not in fixed)
    try:
        first, warnings = first_pass(given, given.ordered(shared_free), fixed, set(free))
    except FitCancelledError:
        return Campaign("paper", (), is_complete=False)
    held = {**{k: v for k, v in fixed.items() if k not in free}, **first.shared}

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        misfit = given.misfit(setting, given.ordered(free))
        start = (first.start(setting) or first_start(misfit, held)).replace(held)
        judged, found = fit_from(given, setting, misfit, start, spent=first.evaluations(setting))
        named = dict.fromkeys(first.sharing.found, Status.SHARED) | dict(first.status)
        return describe_fit(setting, _named(judged, named), misfit), found

    collected = _collect(given, fit, warnings, known=first.broken)
    return replace(
        collected, sharing=first.sharing, searches=(*first.searches, *collected.searches)
    )


def _joint(given: ProcedureInput) -> Campaign:
    """One fit over the settings, from the model's own procedure; unsound ones follow it."""
    shared = given.ordered(shared_names(given.options, given.damper))
    # What is neither shared nor fixed is the settings' own: R_m3 or f_f too.
    own = given.options.free or tuple(
        one.name
        for one in given.damper.quantities
        if one.default is None and one.name not in {*given.options.fixed, *shared}
    )
    begin = _paper if "paper" in given.damper.procedures else _plain
    varying = tuple(name for name in shared if begin is _plain or name not in {TAKEN, MEAN})
    options = replace(given.options, free=(*own, *varying), starts=1)
    before = begin(replace(given, options=options, on_fit=lambda _fit: None))
    failed = {one.setting: one for one in before.failures}
    try:
        found = attempted_for_all(
            lambda: fit_together(given, before.fits, given.ordered(own), shared)
        )
    except FitCancelledError:
        return Campaign("joint", (), is_complete=False)
    if isinstance(found, Mishap):
        warnings = (*before.warnings, _NOT_FITTED_JOINTLY)
        return replace(before, procedure="joint", warnings=warnings, mishap=found)
    together, broken = found
    failed.update(broken)
    if not before.is_complete or together is None:
        said = () if not before.is_complete else (_NOT_JOINT.format(begin.__name__.strip("_")),)
        return replace(
            before,
            procedure="joint",
            fits=tuple(fit for fit in before.fits if fit.setting not in failed),
            failures=tuple(failed[setting] for setting in sorted(failed)),
            warnings=(*before.warnings, *said),
        )
    fits = {fit.setting: fit for fit in before.fits}

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        misfit = given.misfit(setting, together.own)
        start = together.start(fits[setting], misfit)
        spent = fits[setting].evaluations + together.evaluations
        judged, found = fit_from(given, setting, misfit, start, spent=spent)
        return describe_fit(setting, _named(judged, together.status), misfit), found

    collected = _collect(given, fit, (*before.warnings, *together.warnings), known=failed)
    sharing = together.sharing
    if MEAN in shared:
        sharing = replace(
            sharing,
            f_f_range=before.sharing.f_f_range,
            is_f_f_range_certain=before.sharing.is_f_f_range_certain,
        )
    return replace(collected, sharing=sharing)


PROCEDURES: dict[str, Callable[[ProcedureInput], Campaign]] = {
    "paper": _paper,
    "joint": _joint,
    "plain": _plain,
}


def _named(judged: Judged, status: Mapping[str, Status]) -> Judged:
    """Values that were found once for all settings are not fixed but shared, or cannot be told."""
    return replace(judged, status={**judged.status, **status})


def _collect(
    given: ProcedureInput,
    fit: Callable[[Setting], tuple[Fit, Search | None]],
    warnings: Iterable[str] = (),
    *,
    known: Mapping[Setting, SettingFailure] = MappingProxyType({}),
) -> Campaign:
    """Run the fit at every setting, in threads; one setting's failure leaves the others.

    Settings that are known to have failed are not tried again.
    """
    searches: dict[Setting, Search] = {}

    def one(setting: Setting) -> Fit | SettingFailure | None:
        if setting in known:
            return known[setting]
        try:
            found = attempted(setting, lambda: fit(setting))
        except FitCancelledError:
            return None
        if isinstance(found, SettingFailure):
            return found
        result, search = found
        if search is not None:
            searches[setting] = search
        given.on_fit(result)
        return result

    settings = sorted(given.settings)
    with ThreadPoolExecutor(given.jobs) as pool:
        results = list(pool.map(one, settings))
    return Campaign(
        procedure=given.options.procedure,
        fits=tuple(result for result in results if isinstance(result, Fit)),
        searches=tuple(searches[setting] for setting in sorted(searches)),
        failures=tuple(result for result in results if isinstance(result, SettingFailure)),
        warnings=tuple(warnings),
        is_complete=all(result is not None for result in results),
    )


def _by_name(trace: Trace) -> tuple[object, ...]:
    return natural_order(trace.name), trace.name, trace.start_time


def _by_setting(traces: Sequence[Trace]) -> dict[Setting, tuple[Trace, ...]]:
    groups: dict[Setting, list[Trace]] = defaultdict(list)
    for trace in traces:
        if trace.setting is None:
            raise LogError(
                f"{trace.name}: the setting is not known; write '# setting: N' into the log, "
                "name it setting_N, or give --setting N."
            )
        groups[Setting.of(trace.setting)].append(trace)
    return {setting: tuple(sorted(groups[setting], key=_by_name)) for setting in sorted(groups)}
