"""Fits over the settings of a damper: the procedures `plain`, `paper` and `joint`.

`plain` fits every setting by itself; `paper` is `as_in_the_paper`; `joint` starts from either
and fits all settings at once, with R_m3 and f_f, or what the model ties, in common.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType
from typing import cast

import numpy as np

from damperfit.damper.model import GAS_AMOUNT, STIFFNESS, Model, Quantity, Values
from damperfit.damper.network import BLOW_OFF_PARTS
from damperfit.damper.purdy.parameters import Damper, cavitation_limit
from damperfit.damper.temperature_law import BETA
from damperfit.errors import (
    ConfigurationError,
    FitCancelledError,
    LogError,
    SimulationError,
)
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.identification.fit_problem import Block, does_nothing, kept_within
from damperfit.identification.fit_setting import (
    EXCELLENT,
    NOT_FIT_TO_SHARE,
    Fit,
    FitResult,
    Search,
    describe_fit,
    fit_from,
    fit_setting,
    lacks_stiffness_alone,
    minimised,
    own_start,
    unless_failed,
    with_given,
)
from damperfit.identification.joint import (
    JointResult,
    declared_sharing,
    fit_from_one_model,
    fit_settings_jointly,
)
from damperfit.identification.logs import settled
from damperfit.identification.options import FitOptions, check_options, shared_names
from damperfit.identification.outcome import Outcome, Status, attempted
from damperfit.identification.sharing import GAS_FOLLOWER, Sharing, of_settings, unknown_at
from damperfit.problem import Failure, Option, Problem, listed_names, warning
from damperfit.recording import Trace, natural_order
from damperfit.statistics import CHI_SQUARED_95, chi_squared_quantile
from damperfit.tested.setting import Setting
from damperfit.workers import executor

# The settings of a campaign fitted side by side; one that cannot be fitted costs itself alone.


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """The fits of a damper over its settings."""

    procedure: str  # how they were made
    fits: tuple[Fit, ...]  # by rising setting
    failures: tuple[Failure, ...] = ()  # settings without a fit, and why
    warnings: tuple[Problem, ...] = ()
    is_complete: bool = True  # False: the caller asked to stop before every setting was done
    sharing: Sharing = Sharing()  # how the shared parameters were estimated
    searches: tuple[Search, ...] = ()  # what fits from many starts found, where asked for
    failure: Failure | None = None  # what damperfit got wrong in a step over all settings
    quantities: tuple[Quantity, ...] = ()  # of the model

    @property
    def gaps(self) -> tuple[tuple[int, int], ...]:
        """Runs of settings without a fit within a run of clicks: first and last of each."""
        done = [cell for fit in self.fits if isinstance(cell := Setting.of(fit.setting).cell, int)]
        pairs = list(pairwise(done))
        # Where every other click or none but 1, 5, 10 was tested, those between are no gaps.
        steps = sorted(b - a for a, b in pairs)
        if len(done) < len(self.fits) or not steps or steps[len(steps) // 2] != 1:
            return ()
        return tuple((a + 1, b - 1) for a, b in pairs if b - a > 1)


@dataclass(frozen=True, slots=True, eq=False)
class ProcedureInput:
    """Everything a procedure needs."""

    settings: Mapping[Setting, tuple[Trace, ...]]
    damper: Model
    options: FitOptions
    jobs: int
    on_fit: Callable[[Fit], None]
    cancelled: Callable[[], bool]

    @property
    def softest_first(self) -> list[Setting]:
        """Settings by rising stiffness, as far as it is declared how clicks count."""
        return sorted(self.settings, key=lambda setting: setting.softness(self.options.from_closed))

    def ordered(self, names: Iterable[str]) -> tuple[str, ...]:
        """The names in the order of the model."""
        wanted = set(names)
        return tuple(name for name in self.damper.names if name in wanted)

    def block(self, setting: Setting, free: Iterable[str]) -> Block:
        """What is fitted at a setting; of logs that repeat their mean cycles, but among kinks."""
        traces = self.settings[setting]
        return Block(
            self.damper,
            traces,
            self.ordered(free),
            self.options.solver,
            None if self.damper.kinks else settled(traces, is_thinned=False),
            self.cancelled,
            self.options.max_evaluations,
        )


def fit_every_setting(
    given: ProcedureInput,
    fit: Callable[[Setting], tuple[Fit, Search | None]],
    warnings: Iterable[Problem] = (),
    *,
    known: Mapping[Setting, Failure] = MappingProxyType({}),
) -> Campaign:
    """Run the fit at every setting, side by side; those `known` to have failed are left alone."""

    def of(setting: Setting) -> tuple[Fit, Search | None] | Failure | None:
        if setting in known:
            return known[setting]
        try:
            return attempted(setting, lambda: fit(setting))
        except FitCancelledError:
            return None

    settings, done, failures, is_complete = sorted(given.settings), [], [], True
    with executor(given.jobs) as pool:
        for result in pool.map(of, settings):
            if isinstance(result, tuple):
                given.on_fit(result[0])
                done.append(result)
            elif result is None:
                is_complete = False
            else:
                failures.append(result)
    return Campaign(
        procedure=given.options.procedure,
        fits=tuple(fit for fit, _ in done),
        failures=tuple(failures),
        warnings=tuple(warnings),
        is_complete=is_complete,
        searches=tuple(search for _, search in done if search is not None),
    )


# The paper's own procedure as stages of one fit, automated.
#
# 1. All five parameters at every setting, the lowest one first. The mean friction of the sound fits
#    is f_f.
# 2. The lowest setting whose logs show R_m3 once more with that friction: R_m3 and f_f are strongly
#    correlated within one setting, and the mean over the settings knows f_f better than any.
# 3. R_m1, R_m2 and K_e at every setting with both held.
#
# What the logs leave open is taken from the options or the model, with a warning.

# R_m3 is taken from one setting, f_f is the mean over the settings.
TAKEN, MEAN = "r_m3", "f_f"
# Frictions that chance makes so different once in a thousand campaigns.
_CHANCE = 0.001
# A first-pass friction is used when its setting's R_m3 agrees this well with the lowest setting's.
_SAME_R_M3 = 0.25


def as_in_the_paper(given: ProcedureInput) -> Campaign:
    """The paper's own procedure, sections 3 and 4 of its identification."""
    fixed = dict(given.options.fixed)
    free = given.options.free or tuple(
        quantity.name
        for quantity in given.damper.quantities
        if quantity.default is None and not quantity.is_shared and quantity.name not in fixed
    )
    for quantity in given.damper.quantities:
        if quantity.default is not None and quantity.name not in free:
            fixed.setdefault(quantity.name, quantity.default)
    stages = _Stages(given, fixed, [name for name in (TAKEN, MEAN) if name not in {*fixed, *free}])
    try:
        if stages.wanted:
            stages.run()
    except FitCancelledError:
        return Campaign("paper", (), is_complete=False)
    held = {**{k: v for k, v in fixed.items() if k not in free}, **stages.shared}

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        block, first = given.block(setting, free), stages.fits.get(setting)
        is_good = first is not None and _is_good(first)
        start = first.values if first and is_good else own_start(given, setting, block, held)
        nfev = 0 if first is None else first.evaluations
        result, search = fit_from(
            setting, block, start.replace(held), starts=given.options.starts, nfev=nfev
        )
        named = dict.fromkeys(stages.sharing.estimated, Status.SHARED) | stages.status
        return describe_fit(setting, result.with_status(named), block), search

    campaign = fit_every_setting(given, fit, stages.warnings, known=stages.broken)
    searches = (*stages.searches, *campaign.searches)
    return replace(campaign, sharing=stages.sharing, searches=searches)


class _Stages:
    """The first two stages: fits with everything free, and the shared values that they give."""

    def __init__(
        self, given: ProcedureInput, fixed: Mapping[str, float], wanted: Sequence[str]
    ) -> None:
        self.given, self.fixed, self.wanted = given, fixed, wanted
        self.names = tuple(name for name in given.damper.names if name not in fixed)
        self.fits: dict[Setting, FitResult] = {}
        self.broken: dict[Setting, Failure] = {}  # met a bug, which a second fit would only hide
        self.searches: tuple[Search, ...] = ()
        self.shared: dict[str, float] = {}  # R_m3 and f_f as far as they are wanted
        self.status: dict[str, Status] = {}  # of a shared value that the logs leave open
        self.sharing = Sharing()  # where they came from
        self.warnings: list[Problem] = []
        # What is taken for a shared parameter that no log determines; its model knows one.
        known = {name: given.options.fallback(given.damper.quantity(name)) for name in wanted}
        self.fallbacks = cast("dict[str, float]", known)

    def _warn(self, code: str, text: str, **values: Option) -> None:
        self.warnings.append(warning(code, text, **values))

    def _warn_assumed(self, text: str, name: str) -> None:
        """Say that a value is used which the logs do not determine."""
        self._warn(
            "assumed", f"{text}; give {{fix}} if yours is known.", fix=Option("fix", "VALUE", name)
        )

    def run(self) -> None:
        """Fit everything free everywhere, then find what is shared."""
        lowest = self._fit_everywhere()
        while self.fits:
            lowest = lowest if lowest in self.fits else min(self.fits)
            failure = self._share(lowest)
            if failure is None:
                return
            # A setting that met a bug is left out of all that is shared.
            self.broken[failure.setting] = failure
            del self.fits[failure.setting]
            self.searches = tuple(s for s in self.searches if s.setting != failure.setting)
        self.shared, self.sharing, self.warnings = dict(self.fallbacks), Sharing(), []
        self.status = dict.fromkeys(self.wanted, Status.FIXED)
        known = [f"{n} {v:.4g} (identification.fallback_{n})" for n, v in self.shared.items()]
        text = "with all parameters free no setting can be fitted: these are used"
        self._warn("assumed", f"{text}: {', '.join(known)}.")

    def _fit_everywhere(self) -> Setting | None:
        """Everything free at every setting; the lowest one that can be fitted so."""
        given, lowest = self.given, self.given.softest_first[0]

        def fit(setting: Setting) -> tuple[FitResult, Search | None] | Failure:
            starts = given.options.starts if setting == lowest else 1

            def begun() -> tuple[FitResult, Search | None]:
                block = given.block(setting, self.names)
                start = own_start(given, setting, block, self.fixed)
                return fit_from(setting, block, start, starts=starts)

            return attempted(setting, begun)

        settings = sorted(given.settings)
        with executor(given.jobs) as pool:
            results = list(pool.map(fit, settings))
        for setting, result in zip(settings, results, strict=True):
            if not isinstance(result, Failure):
                self.fits[setting], search = result
                self.searches += () if search is None else (search,)
            elif result.is_internal:
                self.broken[setting] = result
        return next((setting for setting in given.softest_first if setting in self.fits), None)

    def _share(self, lowest: Setting) -> Failure | None:
        """R_m3 and f_f from the fits with everything free; a failure of the setting of R_m3."""
        fits, first = self.fits, self.given.softest_first[0]
        self.warnings, self.shared, self.sharing = [], {}, Sharing(self.names)
        if TAKEN not in self.wanted:
            self._take_friction(None)
            return None
        code = "taken-from-another"
        if lowest != first:
            text = (
                f"setting {first} could not be fitted with all parameters free: R_m3 is taken from "
            )
            self._warn(code, f"{text}setting {lowest}.")
        telling = [s for s, result in fits.items() if result.is_sound and _determines_r_m3(result)]
        source = lowest if _determines_r_m3(fits[lowest]) else min(telling, default=None)
        if MEAN in self.wanted:
            self._take_friction(None if source is None else fits[source].values.r_m3)
        # A mean that does not hold there would bend R_m3, which stays beside its own friction.
        holds = source is None or not self.sharing.friction_varies
        where = lowest if source is None else source
        f_f = self.shared.get(MEAN) if holds else None
        failure = attempted(where, lambda: self._take_r_m3(where, f_f))
        if failure is None and where != lowest:
            text = f"the logs of setting {lowest} do not determine R_m3: it is taken from setting "
            self._warn(code, f"{text}{where}.")
        return failure

    def _take_friction(self, r_m3: float | None) -> None:
        """f_f as the mean over the settings whose first fit is sound."""

        def agrees(result: FitResult) -> bool:
            return r_m3 is None or abs(result.values.r_m3 / r_m3 - 1.0) < _SAME_R_M3

        def is_sound(result: FitResult) -> bool:
            return _is_good(result) and agrees(result)

        def lacks_r_m3_alone(result: FitResult) -> bool:  # where no setting determines it
            is_fitted = all(result.status[n] == Status.FITTED for n in result.errors if n != TAKEN)
            end = result.outcome
            return is_fitted and end.is_minimum and end is not Outcome.CAVITATING

        def cavitates_rightly(result: FitResult) -> bool:  # in a damper that does at every setting
            is_fitted = all(error < NOT_FIT_TO_SHARE for error in result.errors.values())
            is_excellent = result.outcome is Outcome.CAVITATING and result.mse_percent < EXCELLENT
            return is_excellent and is_fitted and r_m3 is not None and agrees(result)

        used: list[Setting] = []
        for counts in (is_sound, lacks_r_m3_alone, cavitates_rightly):
            used = used or sorted(s for s, result in self.fits.items() if counts(result))
        if not used:
            self.shared[MEAN] = self.fallbacks[MEAN]
            self._warn_assumed(
                f"no setting's logs determine the friction: {self.shared[MEAN]:g} N "
                "(identification.fallback_f_f) is used",
                MEAN,
            )
            return
        if left_out := sorted(set(self.fits) - set(used)):
            self._warn(
                "mean-of-some",
                f"friction is the mean over {len(used)} of {len(self.fits)} settings: with "
                f"all parameters free the fit is not sound at {of_settings(left_out)}.",
            )
        own = np.array([self.fits[setting].values.f_f for setting in used])
        self.shared[MEAN] = float(np.mean(own))
        self.sharing = replace(self.sharing, means={MEAN: tuple(used)})
        if len(used) > 1:
            errors = own * np.array([self.fits[setting].errors[MEAN] for setting in used])
            misses = (own - np.average(own, weights=1.0 / errors**2)) / errors
            is_certain = misses @ misses > chi_squared_quantile(len(own) - 1, 1.0 - _CHANCE)
            spread = float(own.min()), float(own.max())
            self.sharing = replace(self.sharing, spread=spread, is_spread_certain=bool(is_certain))

    def _take_r_m3(self, setting: Setting, f_f: float | None) -> None:
        """R_m3 from the logs of one setting, and how well they determine it."""
        block, first = self.given.block(setting, self.names), self.fits[setting]
        fallback, again = self.fallbacks[TAKEN], first
        # An unsound fit that determines R_m3 is left alone: other friction may upset it.
        is_safe = not _determines_r_m3(first) or (first.is_sound and len(self.fits) > 1)
        if f_f is not None and is_safe:
            again = _with_mean_friction(block, first, f_f, fallback)
        is_refined = again is not first
        value, status = again.values.r_m3, Status.SHARED
        if not _determines_r_m3(again):
            text = f"the logs of setting {setting} do not determine R_m3"
            taken = f"{fallback:.4g} (identification.fallback_r_m3)"
            value, status = fallback, Status.NOT_IDENTIFIABLE
            if not again.outcome.is_minimum:
                status = Status.FIXED
                text += f" ({again.outcome.value}): {taken} is used"
            elif _is_contradicted(block, again, fallback, f_f if is_refined else None):
                value = max(again.values.r_m3, first.values.quantity(TAKEN).plausible[0])
                text += f", but {taken} does not fit them: {value:.4g} is used, which does"
            else:
                text += f": {taken} fits them as well as any and is used"
            self._warn_assumed(text, TAKEN)
        is_from_logs = status is not Status.FIXED
        self.fits[setting] = again if is_from_logs else first
        self.shared[TAKEN], self.status = value, {TAKEN: status}
        held = (MEAN,) if is_refined and is_from_logs else ()
        source = {TAKEN: setting} if is_from_logs else {}
        self.sharing = replace(self.sharing, taken=source, held=held)


def _is_good(first: FitResult) -> bool:
    """Whether a fit ended where a fit should end."""
    return first.is_sound or lacks_stiffness_alone(first)


def _determines_r_m3(result: FitResult) -> bool:
    """Whether a fit knows R_m3 well enough for all settings to use it."""
    return result.status[TAKEN] == Status.FITTED and result.errors[TAKEN] < NOT_FIT_TO_SHARE


def _is_contradicted(block: Block, best: FitResult, r_m3: float, f_f: float | None) -> bool:
    """Whether the misfit with R_m3 held at a value is more than noise above the best."""
    free = tuple(n for n in block.free if n != TAKEN and (f_f is None or n != MEAN))
    start = best.values.replace(r_m3=r_m3)
    other = unless_failed(lambda: minimised(replace(block, free=free), start))
    if other is None:
        return True
    rise = other.mse_percent / best.mse_percent - 1.0
    return rise * best.n_independent > CHI_SQUARED_95


def _with_mean_friction(block: Block, first: FitResult, f_f: float, r_m3: float) -> FitResult:
    """The setting of R_m3 with the mean friction, which halves its error, where that is better."""
    rest = replace(block, free=tuple(name for name in block.free if name != MEAN))
    start = first.values.replace(f_f=f_f)
    if not _determines_r_m3(first):  # it starts from a value that can be seen
        limit = cavitation_limit(block.traces, cast("Damper", block.model))
        start = start.replace(r_m3=min(r_m3, limit))
    again = unless_failed(lambda: fit_setting(rest, start, nfev=first.evaluations))
    if again is None:
        return first
    is_better = again.is_sound if first.is_sound else again.outcome.is_minimum
    return again if is_better else first


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
    for trace in traces:
        if not isinstance(trace, Trace):
            raise ConfigurationError(
                f"identify: found {type(trace).__name__} among the traces; expected what "
                "damperfit.conditioning.condition(read_log(path)) returns; "
                "damperfit.identify(paths) takes paths",
                code="not-a-trace",
            )
    check_options(options, damper)
    if not traces:
        raise LogError("identify: found no log to fit; give one trace or more", code="no-log")
    watched = on_fit or (lambda _fit: None), cancelled or (lambda: False)
    settings = _by_setting(traces)
    given = ProcedureInput(settings, damper, options, max(1, jobs), *watched)
    # BLAS threads spin between the small products of a fit and take the core that the next
    # setting's thread needs.
    with one_blas_thread():
        campaign = PROCEDURES[options.procedure](given)
    ambiguous = (
        warning("starts", search.warning, f"setting {search.setting}")
        for search in campaign.searches
        if search.warning
    )
    return replace(
        campaign, warnings=(*campaign.warnings, *ambiguous), quantities=damper.quantities
    )


def _by_setting(traces: Sequence[Trace]) -> dict[Setting, tuple[Trace, ...]]:
    groups: dict[Setting, list[Trace]] = defaultdict(list)
    for trace in sorted(
        traces, key=lambda trace: (natural_order(trace.name), trace.name, trace.start_time)
    ):
        if trace.setting is None:
            raise LogError(
                "the setting is not known; write '# setting: N' into the log, "
                "name it setting_N, or give {setting}.",
                setting=Option("setting", "N"),
                subject=trace.name,
                code="no-setting",
            )
        groups[Setting.of(trace.setting)].append(trace)
    return {setting: tuple(groups[setting]) for setting in sorted(groups)}


def _plain(given: ProcedureInput) -> Campaign:
    """Fit at every setting what is free, from the closed form."""
    options, defaults = given.options, {q.name: q.default for q in given.damper.quantities}
    named, known = options.free or (), {*(options.free or ()), *options.fixed}
    # What other procedures share need not be named: each setting has its own.
    free = named + tuple(
        q.name
        for q in given.damper.quantities
        if q.default is None and q.name not in known and (q.is_shared or not named)
    )
    held = {n: value for n, value in defaults.items() if value is not None and n not in free}
    fixed = {**held, **options.fixed}
    if missing := [name for name in defaults if name not in {*free, *fixed}]:
        raise ConfigurationError(
            f"{{free}} leaves {listed_names(missing)} without a value; add each, or give {{fix}}",
            free=Option("free", ",".join(named)),
            fix=Option("fix", "VALUE", missing[0]),
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
    damper, fixed, start = given.damper, given.options.fixed, given.options.start
    name = "paper" if "paper" in damper.procedures else "plain"
    sharing, moving = _sharing_of(given)
    has_model = start.is_of_one_model and all(s in start.by_setting for s in given.settings)
    if sharing is not None and sharing.jointly and has_model:
        with suppress(SimulationError):
            first = damper.start(next(iter(given.settings.values())), fixed)[0]
            starts = {s: with_given(given, s, first, fixed) for s in given.settings}
            once = replace(given, options=replace(given.options, starts=1))
            return _each_beside(once, fit_from_one_model(given, sharing, starts))
    if len(given.settings) == 1:  # nothing is shared
        return PROCEDURES[name](replace(given, options=replace(given.options, procedure=name)))
    quiet = replace(given, on_fit=lambda _fit: None)
    by_paper = {TAKEN, MEAN} if name == "paper" and not (sharing and sharing.follows) else set()
    shared = {*(shared_names(given.options, damper) if sharing is None else sharing.jointly)}
    free = tuple(n for n in moving if n not in by_paper & shared)
    options = replace(given.options, free=free, starts=1, is_leaving_out=False)
    if BETA.name in free:
        options = _with_first_beta(quiet, options, PROCEDURES[name])
    before = PROCEDURES[name](replace(quiet, options=options))
    try:
        ended = attempted(None, lambda: fit_settings_jointly(given, before.fits, sharing, moving))
    except FitCancelledError:
        return Campaign("joint", (), is_complete=False)
    if isinstance(ended, Failure):
        text = f"the joint fit met an error: these are the results of procedure {name}."
        warnings = (*before.warnings, warning("joint-failed", text))
        return replace(before, procedure="joint", warnings=warnings, failure=ended)
    together, broken = ended
    failed = {failure.setting: failure for failure in before.failures} | broken
    if not before.is_complete or together is None:
        warnings = before.warnings
        if before.is_complete:
            text = (
                "the joint fit needs two settings at a sound minimum and a shared parameter: these "
                f"are the results of procedure {name}."
            )
            warnings = (*warnings, warning("not-joint", text))
        fits = tuple(fit for fit in before.fits if fit.setting not in failed)
        failures = tuple(failed[setting] for setting in sorted(failed))
        return replace(before, procedure="joint", fits=fits, failures=failures, warnings=warnings)
    campaign = _each_beside(given, together, before.fits, before.warnings, known=failed)
    sharing = campaign.sharing
    if any(damper.quantity(n).is_friction for n in shared):
        spread, is_certain = before.sharing.spread, before.sharing.is_spread_certain
        sharing = replace(sharing, spread=spread, is_spread_certain=is_certain)
    return replace(campaign, sharing=sharing)


def _each_beside(
    given: ProcedureInput,
    together: JointResult,
    before: Sequence[Fit] = (),
    warnings: Iterable[Problem] = (),
    *,
    known: Mapping[Setting, Failure] = MappingProxyType({}),
) -> Campaign:
    """What is each setting's own, fitted beside what a joint fit has found."""
    sharing, alone = together.sharing, {fit.setting: fit for fit in before}

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        shared = {n: unknown_at(n, sharing.follows, setting) for n in sharing.estimated_at(setting)}
        lost = {*shared, *([GAS_FOLLOWER] if together.at.gas else [])}
        block = given.block(setting, (name for name in sharing.free if name not in lost))
        first = alone.get(setting)
        nfev = together.evaluations + (0 if first is None else first.evaluations)
        start = together.start(setting, block, first)
        result, search = fit_from(setting, block, start, starts=given.options.starts, nfev=nfev)
        result = result.with_status({name: together.status[u] for name, u in shared.items()})
        return describe_fit(setting, result, block), search

    campaign = fit_every_setting(given, fit, (*warnings, *together.warnings), known=known)
    return replace(campaign, sharing=sharing)


def _sharing_of(given: ProcedureInput) -> tuple[Sharing | None, tuple[str, ...]]:
    """What is shared, None where the logs are to show it, and what moves."""
    options, damper = given.options, given.damper
    wanted = [
        q.name for q in damper.quantities if q.default is None and q.name not in options.fixed
    ]
    is_handed_on = options.start.is_of_one_model and not options.is_by_scope
    if is_handed_on or not (options.is_by_scope or options.follows):
        shared = given.ordered(shared_names(options, damper))
        # What is neither shared nor fixed is the settings' own: R_m3 or f_f too.
        rest = () if options.follows else (name for name in wanted if name not in shared)
        moving = given.ordered({*(options.free or rest), *shared})
        return Sharing(moving, shared, options.follows, bool(options.follows)), moving
    both = (name for name in wanted if damper.quantity(name).is_shared)
    moving = given.ordered({*(options.free or wanted), *options.follows, *both})
    adjusters = min(given.settings).adjusters
    if not options.follows and options.detects(adjusters):
        return None, moving
    return declared_sharing(damper, moving, options.follows, adjusters, options.untied), moving


PROCEDURES: dict[str, Callable[[ProcedureInput], Campaign]] = {
    "paper": as_in_the_paper,
    "joint": _joint,
    "plain": _plain,
}


# Settings whose logs are all equally warm do not determine what temperature does, and one whose
# logs are not is missed by a fit that knows nothing of it: the widest ranges are fitted first.
_ASKED = 3  # settings; their mean only has to be near
_WIDE = 3.0  # K within a setting that are of use


def _with_first_beta(
    given: ProcedureInput, options: FitOptions, fit: Callable[[ProcedureInput], Campaign]
) -> FitOptions:
    """The options of a fit of single settings that hold beta at what some of them show."""
    beta, reach = options.start.named.get(BETA.name, 0.0), {}
    for setting, traces in given.settings.items():
        known = [trace.temperature for trace in traces if trace.temperature is not None]
        reach[setting] = np.ptp(known) if known else 0.0
    telling = [s for s in sorted(reach, key=lambda s: -reach[s]) if reach[s] >= _WIDE]
    asked = {setting: given.settings[setting] for setting in sorted(telling[:_ASKED])}
    fits = fit(replace(given, settings=asked, options=options)).fits if asked else ()
    if betas := [result.parameters.beta for result in fits if result.outcome.is_minimum]:
        beta = float(np.median(betas))
    left = tuple(name for name in options.free or () if name != BETA.name)
    return replace(options, free=left, fixed={**options.fixed, BETA.name: beta})


# Parts of a law that do nothing at a setting are left out there, and the rest is fitted again. A
# law that logs have chosen is one for all settings. Where a bleed is closed or a mounting has no
# play, the number of it runs to the edge of its range; that is the smaller law, not a bound that a
# fit strains against.

# Friction at rest and the speed at which it has gone: two numbers of one part, but for a speed that
# is lower than logs show.
_AT_REST = ("breakaway", "stribeck_speed")
# Oil that does not give, and gas whose pressure does not change: what the logs do not show.
_AS_IF = {
    STIFFNESS: "the logs do not show the oil give: it is taken as rigid here",
    GAS_AMOUNT: "the logs do not show the gas pressure change with the stroke: it is taken as "
    "constant here",
}


def _without_idle_parts(fit: Fit, block: Block) -> Fit:
    lost: dict[str, None] = {}
    warnings = [*fit.warnings]
    while idle := [
        name
        for name, status in fit.status.items()
        if status is Status.AT_BOUND and does_nothing(fit.parameters, name)
    ]:
        warnings += [warning("left-out", _sentence(fit.parameters, name)) for name in idle]
        lost |= dict.fromkeys(part for name in idle for part in _part(fit, name))
        start = kept_within(fit.parameters, lost)
        rest = replace(block, free=tuple(name for name in block.free if name not in lost))
        has_edges = {name: fit.parameters.quantity(name).has_own_edges for name in lost}
        left = {n: Status.FIXED if has_edges[n] else Status.ABSENT for n in lost}
        result = minimised(rest, start, nfev=fit.evaluations).with_status(left)
        fit = describe_fit(fit.setting, result, rest)
    return replace(fit, warnings=tuple(warnings)) if lost else fit


def _part(fit: Fit, name: str) -> list[str]:
    """A quantity with those that mean nothing without it: a closed blow-off has no slope."""
    quantity, part = fit.parameters.quantity(name), [name]
    edge = quantity.edge_at(getattr(fit.parameters, name))
    if name in _AT_REST and (name != _AT_REST[1] or edge == "above"):
        part = [*_AT_REST]
    elif quantity.group == "blow_off" and quantity.area_power > 0.0 and edge == "above":
        part = part if quantity.stroke == "return" else [*map(quantity.beside, BLOW_OFF_PARTS)]
    return [other for other in part if other in fit.status]


def _sentence(values: Values, name: str) -> str:
    quantity, value = values.quantity(name), getattr(values, name)
    low, high = quantity.plausible
    what = f"{quantity.label} ({quantity.symbol})"
    if quantity.has_own_edges:
        return (
            f"{what} fits best at {value:g}, a bound of its range, where the model is a simpler "
            "one; it is held there."
        )
    if quantity.role in _AS_IF:
        return f"{what}: {_AS_IF[quantity.role]}."
    if name == _AT_REST[1] and value < high:
        return (
            f"{what}: the logs do not determine one below {1e3 * low:g} mm/s, at which it is held "
            "here."
        )
    return (
        f"{what} does nothing here: it is at a bound of its range, and the model is fitted "
        "without it."
    )
