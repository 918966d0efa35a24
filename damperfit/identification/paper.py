"""The paper's own procedure, automated.

All five parameters at the lowest setting give R_m3; the mean of the friction over a first pass of
all settings gives f_f; then R_m1, R_m2 and K_e at every setting.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from damperfit.damper.purdy.starting import REBOUND, cavitation_limit, starting_values
from damperfit.errors import DamperfitError, FitCancelledError, SimulationError
from damperfit.identification.campaign import (
    Campaign,
    ProcedureInput,
    SettingError,
    SettingFailure,
    attempted,
    fit_every_setting,
)
from damperfit.identification.fit_problem import FitProblem
from damperfit.identification.fit_setting import (
    EXCELLENT,
    NOT_FIT_TO_SHARE,
    Fit,
    FitResult,
    describe_fit,
    fit_guided,
    fit_setting,
    lacks_stiffness_alone,
    minimised,
)
from damperfit.identification.outcome import Outcome, Status
from damperfit.identification.sharing import Sharing, of_settings
from damperfit.identification.starts import Search, fit_from
from damperfit.statistics import CHI_SQUARED_95, chi_squared_quantile
from damperfit.workers import apart

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from damperfit.damper.model import Values
    from damperfit.damper.purdy.parameters import Damper
    from damperfit.identification.campaign import ProcedureInput
    from damperfit.tested.setting import Setting

__all__ = [
    "MEAN",
    "TAKEN",
    "FirstPass",
    "as_in_the_paper",
    "fallback",
    "first_pass",
    "free_everywhere",
]

# Of so many settings one is fitted first.
_STRIDE = 4


def free_everywhere(
    given: ProcedureInput,
    names: tuple[str, ...],
    fixed: Mapping[str, float],
    anchor: Values,
    settings: Sequence[Setting],
) -> dict[Setting, FitResult | SettingFailure]:
    """Return the fits of settings with everything free; whatever the number of workers, the same.

    Parameters
    ----------
    given : ProcedureInput
        Logs, model and options.
    names : tuple of str
        What is free.
    fixed : mapping of str to float
        What is not.
    anchor : Values
        The lowest setting's, for what a closed form does not tell.
    settings : sequence of Setting
        By rising setting.
    """
    damper = cast("Damper", given.damper)

    def one(setting: Setting, between: Values | None = None) -> FitResult:
        problem = given.problem(setting, names)
        if between is not None and given.with_given_start(setting, between, fixed) == between:
            with suppress(SimulationError):
                found = fit_setting(problem, between)
                if found.is_sound:
                    return found
        known = {**fixed, "r_m3": anchor.r_m3, "f_f": anchor.f_f}
        start = starting_values(problem.traces, damper, known, anchor.k_e)
        return fit_guided(problem, given.with_given_start(setting, start, fixed), REBOUND)

    starts: dict[Setting, Values] = {}

    def tried(setting: Setting) -> FitResult | SettingFailure:
        return attempted(setting, lambda: one(setting, starts.get(setting)))

    def side_by_side(few: Sequence[Setting]) -> dict[Setting, FitResult | SettingFailure]:
        fits = apart(tried, few, jobs=given.jobs, known=given.known, cancelled=given.cancelled)
        return dict(zip(few, fits, strict=True))

    found = side_by_side(settings[::_STRIDE])
    starts.update(_between(settings, found))
    found |= side_by_side([setting for setting in settings if setting not in found])
    return {setting: found[setting] for setting in settings}


def _between(
    settings: Sequence[Setting], found: Mapping[Setting, FitResult | SettingFailure]
) -> dict[Setting, Values]:
    """Where the settings between two sound fits should end."""
    starts = {}
    for first in range(0, len(settings) - _STRIDE, _STRIDE):
        low, high = (_sound(found[settings[at]]) for at in (first, first + _STRIDE))
        if low is None or high is None:
            continue
        for k in range(1, _STRIDE):
            starts[settings[first + k]] = _mean(low, high, k / _STRIDE)
    return starts


def _sound(fit: FitResult | SettingFailure) -> Values | None:
    return fit.values if isinstance(fit, FitResult) and fit.is_sound else None


def _mean(low: Values, high: Values, share: float) -> Values:
    """Values on the way from one to another, along their logarithms where they have some."""
    found = {}
    for one in low.quantities:
        a, b = getattr(low, one.name), getattr(high, one.name)
        if a == b:
            continue
        found[one.name] = a * (b / a) ** share if one.is_logarithmic else a + share * (b - a)
    return low.replace(found)


# What procedure `paper` finds once for all settings, and what it takes where no log tells it.

# R_m3 is taken from one setting, f_f is the mean over the settings.
TAKEN, MEAN = "r_m3", "f_f"


def fallback(given: ProcedureInput, name: str) -> float:
    """Return what is taken for a shared parameter that no log tells; its model knows one."""
    known = given.options.fallback(given.damper.quantity(name))
    assert known is not None
    return known


# The first pass of the paper's procedure: everything free, and what it says of R_m3 and f_f.

# Frictions that chance makes so different once in a thousand campaigns.
_CHANCE = 0.001
# A first-pass friction is used when its setting's R_m3 agrees this well with the lowest setting's.
_SAME_R_M3 = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class FirstPass:
    """Fits with everything free, by setting, and the shared values they give.

    Attributes
    ----------
    judged : mapping of Setting to FitResult
        Settings that could be fitted.
    shared : mapping of str to float
        R_m3 and f_f, SI, as far as they are wanted; from the logs or the fallback.
    sharing : Sharing
        Where they came from.
    status : mapping of str to str
        Of a shared value that the logs do not tell: not_identifiable, or fixed at the fallback.
    searches : tuple of Search
        What many starts found at the lowest setting, where they were asked for.
    broken : mapping of Setting to SettingFailure
        Settings that met a bug: a second pass would only hide it.
    """

    judged: Mapping[Setting, FitResult]
    shared: Mapping[str, float]
    sharing: Sharing = Sharing()
    status: Mapping[str, Status] = field(default_factory=dict)
    searches: tuple[Search, ...] = ()
    broken: Mapping[Setting, SettingFailure] = field(default_factory=dict)

    def start(self, setting: Setting) -> Values | None:
        """Where the second pass starts, if the first ended where a fit should end."""
        judged = self.judged.get(setting)
        is_good = judged is not None and (judged.is_sound or lacks_stiffness_alone(judged))
        return judged.values if judged is not None and is_good else None

    def evaluations(self, setting: Setting) -> int:
        """Return the simulations spent on a setting."""
        return self.judged[setting].evaluations if setting in self.judged else 0


def first_pass(
    given: ProcedureInput, names: tuple[str, ...], fixed: Mapping[str, float], free: set[str]
) -> tuple[FirstPass, tuple[str, ...]]:
    """All parameters free at every setting; returns R_m3 and f_f as the paper takes them."""
    wanted = [name for name in (TAKEN, MEAN) if name not in fixed and name not in free]
    if not wanted:
        return FirstPass({}, {}), ()
    begun = _begin(given, names, fixed, wanted)
    while begun.judged:
        try:
            return _concluded(given, begun, names, wanted)
        except SettingError as error:
            begun = begun.without(error.failure)
    shared = {name: fallback(given, name) for name in wanted}
    used = ", ".join(f"{n} {v:.4g} (identification.fallback_{n})" for n, v in shared.items())
    return FirstPass({}, shared, status=dict.fromkeys(wanted, Status.FIXED), broken=begun.broken), (
        f"with all parameters free no setting can be fitted: these are used: {used}.",
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Begun:
    """The fits with everything free, before anything is shared; `lowest` is where they began."""

    lowest: Setting
    judged: Mapping[Setting, FitResult]
    broken: Mapping[Setting, SettingFailure]
    searches: tuple[Search, ...] = ()

    def without(self, failure: SettingFailure) -> _Begun:
        """Leave out a setting that met a bug."""
        setting = failure.setting
        judged = {s: one for s, one in self.judged.items() if s != setting}
        lowest = min(judged, default=setting) if setting == self.lowest else self.lowest
        searches = tuple(one for one in self.searches if one.setting != setting)
        return _Begun(lowest, judged, {**self.broken, setting: failure}, searches)


def _begin(
    given: ProcedureInput, names: tuple[str, ...], fixed: Mapping[str, float], wanted: Sequence[str]
) -> _Begun:
    """Everything free at the lowest setting that can be fitted so, and from there at the others."""
    broken: dict[Setting, SettingFailure] = {}
    for lowest in given.softest_first:
        problem = given.problem(lowest, names)

        def fit(
            lowest: Setting = lowest, problem: FitProblem = problem
        ) -> tuple[FitResult, Search | None]:
            start = given.start(lowest, problem, fixed)
            return fit_from(lowest, problem, start, starts=given.options.starts)

        found = attempted(lowest, fit)
        if not isinstance(found, SettingFailure):
            break
        if found.is_internal:
            broken[lowest] = found
    else:
        return _Begun(lowest, {}, broken)
    one, looked = found
    anchor = one.values
    if "r_m3" in wanted and not _tells_r_m3(one):
        anchor = anchor.replace(r_m3=fallback(given, TAKEN))
    others = set(given.settings) - {lowest, *broken}
    judged = {lowest: one}
    for setting, other in free_everywhere(given, names, fixed, anchor, sorted(others)).items():
        if not isinstance(other, SettingFailure):
            judged[setting] = other
        elif other.is_internal:
            broken[setting] = other
    return _Begun(lowest, judged, broken, () if looked is None else (looked,))


def _concluded(
    given: ProcedureInput, begun: _Begun, names: tuple[str, ...], wanted: Sequence[str]
) -> tuple[FirstPass, tuple[str, ...]]:
    """R_m3 and f_f from the fits with everything free."""
    lowest, judged = begun.lowest, dict(begun.judged)
    warnings: list[str] = []
    if "r_m3" in wanted:
        warnings.extend(_other_lowest(given.softest_first[0], lowest))
    shared: dict[str, float] = {}
    source = _source(judged, lowest) if "r_m3" in wanted else None
    f_f_from: tuple[Setting, ...] = ()
    f_f_range, is_certain = None, True
    if "f_f" in wanted:
        known = None if source is None else judged[source].values.r_m3
        shared["f_f"], f_f_from, said = _shared_friction(judged, known, fallback(given, MEAN))
        warnings.extend(said)
        f_f_range, is_certain = _friction_range([judged[setting] for setting in f_f_from])
    means = {MEAN: f_f_from} if f_f_from else {}
    sharing = Sharing(names, means=means, spread=f_f_range, is_spread_certain=is_certain)
    first = FirstPass(judged, shared, sharing, {}, begun.searches, begun.broken)
    if "r_m3" not in wanted:
        return first, tuple(warnings)
    # A mean that does not hold there would bend R_m3: it stays as found beside its own friction.
    holds = source is None or not sharing.friction_varies
    f_f = shared.get("f_f") if holds else None
    where = lowest if source is None else source
    found = attempted(where, lambda: _shared_r_m3(given, judged, names, where, f_f))
    if isinstance(found, SettingFailure):
        raise SettingError(found)
    if where != lowest:
        warnings.append(
            f"the logs of setting {lowest} do not determine R_m3: it is taken from setting {where}."
        )
    if found.said:
        warnings.append(found.said)
    return (
        replace(
            first,
            judged={**judged, where: found.judged},
            shared={**shared, "r_m3": found.value},
            sharing=replace(
                sharing,
                taken={} if found.setting is None else {TAKEN: found.setting},
                held=(MEAN,) if found.is_refined else (),
            ),
            status={"r_m3": found.status},
        ),
        tuple(warnings),
    )


def _other_lowest(lowest: Setting, used: Setting) -> Iterator[str]:
    """Say so where R_m3 does not come from the lowest setting that was tested."""
    if used != lowest:
        yield (
            f"setting {lowest} could not be fitted with all parameters free: R_m3 is taken from "
            f"setting {used}."
        )


def _tells_r_m3(judged: FitResult) -> bool:
    """Whether a fit knows R_m3 well enough for all settings to use it."""
    return judged.status["r_m3"] == Status.FITTED and judged.errors["r_m3"] < NOT_FIT_TO_SHARE


def _friction_range(judged: Sequence[FitResult]) -> tuple[tuple[float, float] | None, bool]:
    """Smallest and largest friction, and whether they differ by more than their errors."""
    if len(judged) < 2:
        return None, True
    own = np.array([one.values.f_f for one in judged])
    errors = own * np.array([one.errors["f_f"] for one in judged])
    weights = 1.0 / errors**2
    misses = (own - np.sum(weights * own) / np.sum(weights)) / errors
    is_certain = float(misses @ misses) > chi_squared_quantile(len(own) - 1, 1.0 - _CHANCE)
    return (float(own.min()), float(own.max())), bool(is_certain)


def _lacks_r_m3_alone(judged: FitResult) -> bool:
    return all(judged.status[name] == Status.FITTED for name in judged.errors if name != "r_m3")


def _source(judged: Mapping[Setting, FitResult], lowest: Setting) -> Setting | None:
    """The setting that gives R_m3: the lowest, or where its logs do not tell it the next one."""
    if _tells_r_m3(judged[lowest]):
        return lowest
    return min((s for s, one in judged.items() if one.is_sound and _tells_r_m3(one)), default=None)


def _is_right_all_the_same(judged: FitResult, r_m3: float | None) -> bool:
    """Whether a cavitating fit lies in no wrong valley: excellent, and with the R_m3 of others."""
    is_determined = all(error < NOT_FIT_TO_SHARE for error in judged.errors.values())
    is_same = r_m3 is not None and abs(judged.values.r_m3 / r_m3 - 1.0) < _SAME_R_M3
    return is_determined and is_same and judged.mse_percent < EXCELLENT


@dataclass(frozen=True, slots=True, eq=False)
class _SharedR_m3:  # noqa: N801 - the paper's symbol
    value: float
    status: Status
    judged: FitResult
    setting: Setting | None
    is_refined: bool
    said: str = ""


def _shared_r_m3(
    given: ProcedureInput,
    judged: Mapping[Setting, FitResult],
    names: tuple[str, ...],
    setting: Setting,
    f_f: float | None,
) -> _SharedR_m3:
    """R_m3 from the logs of one setting, and how far they tell it."""
    problem = given.problem(setting, names)
    first = judged[setting]
    again = first
    # An unsound fit that tells R_m3 all the same is left alone: other friction may upset it.
    if f_f is not None and (not _tells_r_m3(first) or (first.is_sound and len(judged) > 1)):
        again = _with_mean_friction(problem, first, f_f, fallback(given, TAKEN))
    is_refined = again is not first
    value = again.values.r_m3
    if _tells_r_m3(again):
        return _SharedR_m3(value, Status.SHARED, again, setting, is_refined)
    known = fallback(given, TAKEN)
    if not again.outcome.is_minimum:
        said = (
            f"the logs of setting {setting} do not determine R_m3 ({again.outcome.value}): "
            f"{known:.4g} (identification.fallback_r_m3) is used; give --fix r_m3=VALUE if "
            "yours is known."
        )
        return _SharedR_m3(known, Status.FIXED, first, None, is_refined=False, said=said)
    held = f_f if is_refined else None
    if _is_contradicted(problem, again, known, held):
        value = max(value, first.values.quantity("r_m3").plausible[0])
        said = (
            f"the logs of setting {setting} do not determine R_m3, but {known:.4g} "
            f"(identification.fallback_r_m3) does not fit them: {value:.4g} is used, which does; "
            "give --fix r_m3=VALUE if yours is known."
        )
    else:
        value = known
        said = (
            f"the logs of setting {setting} do not determine R_m3: {known:.4g} "
            "(identification.fallback_r_m3) fits them as well as any and is used; give "
            "--fix r_m3=VALUE if yours is known."
        )
    return _SharedR_m3(value, Status.NOT_IDENTIFIABLE, again, setting, is_refined, said)


def _is_contradicted(problem: FitProblem, best: FitResult, r_m3: float, f_f: float | None) -> bool:
    """Whether the misfit with R_m3 held at a value is more than noise above the best."""
    start = best.values.replace(r_m3=r_m3)
    free = tuple(n for n in problem.free if n != "r_m3" and (f_f is None or n != "f_f"))
    try:
        other = minimised(replace(problem, free=free), start)
    except FitCancelledError:
        raise
    except DamperfitError:
        return True
    rise = other.mse_percent / best.mse_percent - 1.0
    return rise * best.n_independent > CHI_SQUARED_95


def _with_mean_friction(
    problem: FitProblem, judged: FitResult, f_f: float, r_m3: float
) -> FitResult:
    """The setting of R_m3 once more with the mean friction, which halves the error of its R_m3.

    R_m3 and f_f are strongly correlated within one setting; the mean over the settings knows f_f
    better than any one of them. An R_m3 that the setting did not tell starts from a value that
    can be seen. An unsound result of a sound setting changes nothing.
    """
    free = tuple(name for name in problem.free if name != "f_f")
    start = judged.values.replace(f_f=f_f)
    if not _tells_r_m3(judged):
        limit = cavitation_limit(problem.traces, cast("Damper", problem.model))
        start = start.replace(r_m3=min(r_m3, limit))
    try:
        again = fit_setting(replace(problem, free=free), start, spent=judged.evaluations)
    except FitCancelledError:
        raise
    except DamperfitError:
        return judged
    if judged.is_sound:
        return again if again.is_sound else judged
    return again if again.outcome.is_minimum else judged


def _shared_friction(
    judged: Mapping[Setting, FitResult], r_m3: float | None, known: float
) -> tuple[float, tuple[Setting, ...], list[str]]:
    """The mean friction over the settings whose first pass is sound, and these settings.

    Where no setting tells R_m3, those count whose fit is a minimum that tells all the others; in
    a damper that cavitates at every setting, the excellent fits that agree on R_m3.
    """
    sound = {
        setting: one.values
        for setting, one in judged.items()
        if (one.is_sound or lacks_stiffness_alone(one))
        and (r_m3 is None or abs(one.values.r_m3 / r_m3 - 1.0) < _SAME_R_M3)
    } or {
        setting: one.values
        for setting, one in judged.items()
        if one.outcome.is_minimum
        and one.outcome is not Outcome.CAVITATING
        and _lacks_r_m3_alone(one)
    }
    sound = sound or {
        setting: one.values
        for setting, one in judged.items()
        if one.outcome is Outcome.CAVITATING and _is_right_all_the_same(one, r_m3)
    }
    if not sound:
        said = (
            f"no setting's logs determine the friction: {known:g} N "
            "(identification.fallback_f_f) is used; give --fix f_f=VALUE if yours is known."
        )
        return known, (), [said]
    left_out = sorted(set(judged) - set(sound))
    warnings = []
    if left_out:
        warnings.append(
            f"friction is the mean over {len(sound)} of {len(judged)} settings: with all "
            f"parameters free the fit is not sound at {of_settings(left_out)}."
        )
    used = tuple(sorted(sound))
    return float(np.mean([sound[setting].f_f for setting in used])), used, warnings


# The paper's own procedure, automated.
#
# All five parameters at the lowest setting give R_m3; the mean of the friction over a first pass
# of all settings gives f_f; then R_m1, R_m2 and K_e at every setting.


def as_in_the_paper(given: ProcedureInput) -> Campaign:
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
        problem = given.problem(setting, given.ordered(free))
        start = (first.start(setting) or given.start(setting, problem, held)).replace(held)
        result, search = fit_from(
            setting, problem, start, starts=given.options.starts, spent=first.evaluations(setting)
        )
        named = dict.fromkeys(first.sharing.found, Status.SHARED) | dict(first.status)
        return describe_fit(setting, result.with_status(named), problem), search

    collected = fit_every_setting(given, fit, warnings, known=first.broken)
    return replace(
        collected, sharing=first.sharing, searches=(*first.searches, *collected.searches)
    )
