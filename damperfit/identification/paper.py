"""The paper's own procedure as stages of one fit, automated.

1. All five parameters at every setting, the lowest one first. The mean friction of the sound fits
   is f_f.
2. The lowest setting whose logs tell R_m3 once more with that friction: R_m3 and f_f are strongly
   correlated within one setting, and the mean over the settings knows f_f better than any of them.
3. R_m1, R_m2 and K_e at every setting with both held.

What the logs do not tell is taken from the options or the model, with a warning.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, cast

import numpy as np

from damperfit.damper.purdy.starting import REBOUND, cavitation_limit, starting_values
from damperfit.errors import DamperfitError, FitCancelledError
from damperfit.identification.campaign import Campaign, ProcedureInput, fit_every_setting
from damperfit.identification.fit_setting import (
    EXCELLENT,
    NOT_FIT_TO_SHARE,
    Fit,
    FitResult,
    describe_fit,
    minimised,
)
from damperfit.identification.outcome import Outcome, Status, attempted
from damperfit.identification.sharing import Sharing, of_settings
from damperfit.identification.starts import (
    Search,
    fit_from,
    fit_in_stages,
    fit_setting,
    lacks_stiffness_alone,
    own_start,
    with_given,
)
from damperfit.problem import Failure, Option, Problem, warning
from damperfit.statistics import CHI_SQUARED_95, chi_squared_quantile
from damperfit.workers import apart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.purdy.parameters import Damper
    from damperfit.identification.fit_problem import Block
    from damperfit.tested.setting import Setting

# R_m3 is taken from one setting, f_f is the mean over the settings.
TAKEN, MEAN = "r_m3", "f_f"
# Frictions that chance makes so different once in a thousand campaigns.
_CHANCE = 0.001
# A first-pass friction is used when its setting's R_m3 agrees this well with the lowest setting's.
_SAME_R_M3 = 0.25


def as_in_the_paper(given: ProcedureInput) -> Campaign:
    """The paper's own procedure, sections 3 and 4 of its identification."""
    quantities, fixed = given.damper.quantities, dict(given.options.fixed)
    free = given.options.free or tuple(
        one.name
        for one in quantities
        if one.default is None and not one.is_shared and one.name not in fixed
    )
    for one in quantities:
        if one.default is not None and one.name not in free:
            fixed.setdefault(one.name, one.default)
    names = given.ordered(one.name for one in quantities if one.name not in fixed)
    wanted = [name for name in (TAKEN, MEAN) if name not in fixed and name not in free]
    stages = _Stages(given, names, fixed, wanted)
    try:
        if wanted:
            stages.run()
    except FitCancelledError:
        return Campaign("paper", (), is_complete=False)
    held = {**{k: v for k, v in fixed.items() if k not in free}, **stages.shared}

    def fit(setting: Setting) -> tuple[Fit, Search | None]:
        block, first = given.block(setting, free), stages.judged.get(setting)
        is_good = first is not None and _is_good(first)
        start = first.values if first and is_good else own_start(given, setting, block, held)
        spent = 0 if first is None else first.evaluations
        result, search = fit_from(
            setting, block, start.replace(held), starts=given.options.starts, spent=spent
        )
        named = dict.fromkeys(stages.sharing.found, Status.SHARED) | stages.status
        return describe_fit(setting, result.with_status(named), block), search

    campaign = fit_every_setting(given, fit, stages.warnings, known=stages.broken)
    searches = (*stages.searches, *campaign.searches)
    return replace(campaign, sharing=stages.sharing, searches=searches)


class _Stages:
    """The first two stages: fits with everything free, and the shared values that they give."""

    def __init__(
        self,
        given: ProcedureInput,
        names: tuple[str, ...],
        fixed: Mapping[str, float],
        wanted: Sequence[str],
    ) -> None:
        self.given, self.names, self.fixed, self.wanted = given, names, fixed, wanted
        self.judged: dict[Setting, FitResult] = {}  # the fits
        self.broken: dict[Setting, Failure] = {}  # met a bug, which a second fit would only hide
        self.searches: tuple[Search, ...] = ()
        self.shared: dict[str, float] = {}  # R_m3 and f_f as far as they are wanted
        self.status: dict[str, Status] = {}  # of a shared value that the logs do not tell
        self.sharing = Sharing()  # where they came from
        self.warnings: list[Problem] = []
        # What is taken for a shared parameter that no log tells; its model knows one.
        known = {name: given.options.fallback(given.damper.quantity(name)) for name in wanted}
        self.fallbacks = cast("dict[str, float]", known)

    def run(self) -> None:
        """Fit everything free everywhere, then find what is shared."""
        lowest = self._fit_everywhere()
        while self.judged:
            lowest = lowest if lowest in self.judged else min(self.judged)
            failure = self._share(lowest)
            if failure is None:
                return
            # A setting that met a bug is left out of all that is shared.
            self.broken[failure.setting] = failure
            del self.judged[failure.setting]
            self.searches = tuple(s for s in self.searches if s.setting != failure.setting)
        self.shared, self.sharing = dict(self.fallbacks), Sharing()
        self.status = dict.fromkeys(self.wanted, Status.FIXED)
        known = [f"{n} {v:.4g} (identification.fallback_{n})" for n, v in self.shared.items()]
        text = "with all parameters free no setting can be fitted: these are used"
        self.warnings = [warning("assumed", f"{text}: {', '.join(known)}.")]

    def _fit_everywhere(self) -> Setting | None:
        """Everything free at the lowest setting that can be fitted so, and from there at others."""
        given = self.given

        def first(setting: Setting) -> tuple[FitResult, Search | None]:
            block = given.block(setting, self.names)
            start = own_start(given, setting, block, self.fixed)
            return fit_from(setting, block, start, starts=given.options.starts)

        for lowest in given.softest_first:
            result = attempted(lowest, partial(first, lowest))
            if not isinstance(result, Failure):
                anchored, search = result
                break
            if result.is_internal:
                self.broken[lowest] = result
        else:
            return None
        self.judged[lowest], self.searches = anchored, () if search is None else (search,)
        anchor = anchored.values
        if TAKEN in self.wanted and not _tells_r_m3(anchored):
            anchor = anchor.replace(r_m3=self.fallbacks[TAKEN])
        known = {**self.fixed, "r_m3": anchor.r_m3, "f_f": anchor.f_f}

        def other(setting: Setting) -> FitResult:
            block, damper = given.block(setting, self.names), cast("Damper", given.damper)
            first = starting_values(block.traces, damper, known, anchor.k_e)
            start = with_given(given, setting, first, self.fixed)
            return fit_in_stages(block, start, (REBOUND,), has_further_starts=True)

        others = sorted(set(given.settings) - {lowest, *self.broken})
        results = apart(
            lambda setting: attempted(setting, partial(other, setting)),
            others,
            jobs=given.jobs,
            known=given.known,
            cancelled=given.cancelled,
        )
        for setting, found in zip(others, results, strict=True):
            if not isinstance(found, Failure):
                self.judged[setting] = found
            elif found.is_internal:
                self.broken[setting] = found
        return lowest

    def _share(self, lowest: Setting) -> Failure | None:
        """R_m3 and f_f from the fits with everything free; a failure of the setting of R_m3."""
        judged, first = self.judged, self.given.softest_first[0]
        self.warnings, self.shared, self.sharing = [], {}, Sharing(self.names)
        if TAKEN not in self.wanted:
            self._take_friction(None)
            return None
        if lowest != first:
            self._warn(
                "taken-from-another",
                f"setting {first} could not be fitted with all parameters free: R_m3 is taken "
                f"from setting {lowest}.",
            )
        telling = (s for s, one in judged.items() if one.is_sound and _tells_r_m3(one))
        source = lowest if _tells_r_m3(judged[lowest]) else min(telling, default=None)
        if MEAN in self.wanted:
            self._take_friction(None if source is None else judged[source].values.r_m3)
        # A mean that does not hold there would bend R_m3: it stays as found beside its own
        # friction.
        holds = source is None or not self.sharing.friction_varies
        where = lowest if source is None else source
        f_f = self.shared.get(MEAN) if holds else None
        failure = attempted(where, lambda: self._take_r_m3(where, f_f))
        if failure is None and where != lowest:
            self._warn(
                "taken-from-another",
                f"the logs of setting {lowest} do not determine R_m3: it is taken from setting "
                f"{where}.",
            )
        return failure

    def _take_friction(self, r_m3: float | None) -> None:
        """f_f as the mean over the settings whose first fit is sound.

        Where no setting tells R_m3, those count whose fit is a minimum that tells all the others;
        in a damper that cavitates at every setting, the excellent fits that agree on R_m3.
        """

        def agrees(one: FitResult) -> bool:
            return r_m3 is None or abs(one.values.r_m3 / r_m3 - 1.0) < _SAME_R_M3

        def lacks_r_m3_alone(one: FitResult) -> bool:
            is_told = all(one.status[n] == Status.FITTED for n in one.errors if n != TAKEN)
            return is_told and one.outcome.is_minimum and one.outcome is not Outcome.CAVITATING

        def cavitates_rightly(one: FitResult) -> bool:
            is_told = all(error < NOT_FIT_TO_SHARE for error in one.errors.values())
            is_excellent = one.outcome is Outcome.CAVITATING and one.mse_percent < EXCELLENT
            return is_excellent and is_told and r_m3 is not None and agrees(one)

        rules = (lambda one: _is_good(one) and agrees(one), lacks_r_m3_alone, cavitates_rightly)
        used: list[Setting] = []
        for counts in rules:
            used = used or sorted(s for s, one in self.judged.items() if counts(one))
        if not used:
            self.shared[MEAN] = self.fallbacks[MEAN]
            self._warn_assumed(
                f"no setting's logs determine the friction: {self.shared[MEAN]:g} N "
                "(identification.fallback_f_f) is used",
                MEAN,
            )
            return
        if left_out := sorted(set(self.judged) - set(used)):
            self._warn(
                "mean-of-some",
                f"friction is the mean over {len(used)} of {len(self.judged)} settings: with "
                f"all parameters free the fit is not sound at {of_settings(left_out)}.",
            )
        own = np.array([self.judged[setting].values.f_f for setting in used])
        self.shared[MEAN] = float(np.mean(own))
        self.sharing = replace(self.sharing, means={MEAN: tuple(used)})
        if len(used) > 1:
            errors = own * np.array([self.judged[setting].errors[MEAN] for setting in used])
            weights = 1.0 / errors**2
            misses = (own - np.sum(weights * own) / np.sum(weights)) / errors
            bar = chi_squared_quantile(len(own) - 1, 1.0 - _CHANCE)
            self.sharing = replace(
                self.sharing,
                spread=(float(own.min()), float(own.max())),
                is_spread_certain=bool(float(misses @ misses) > bar),
            )

    def _take_r_m3(self, setting: Setting, f_f: float | None) -> None:
        """R_m3 from the logs of one setting, and how far they tell it."""
        block, first = self.given.block(setting, self.names), self.judged[setting]
        fallback, again = self.fallbacks[TAKEN], first
        # An unsound fit that tells R_m3 all the same is left alone: other friction may upset it.
        if f_f is not None and (
            not _tells_r_m3(first) or (first.is_sound and len(self.judged) > 1)
        ):
            again = _with_mean_friction(block, first, f_f, fallback)
        is_refined = again is not first
        value, status, text = again.values.r_m3, Status.SHARED, ""
        taken = f"{fallback:.4g} (identification.fallback_r_m3)"
        if not _tells_r_m3(again):
            text = f"the logs of setting {setting} do not determine R_m3"
            if not again.outcome.is_minimum:
                status, value = Status.FIXED, fallback
                text += f" ({again.outcome.value}): {taken} is used"
            elif _is_contradicted(block, again, fallback, f_f if is_refined else None):
                status = Status.NOT_IDENTIFIABLE
                value = max(again.values.r_m3, first.values.quantity(TAKEN).plausible[0])
                text += f", but {taken} does not fit them: {value:.4g} is used, which does"
            else:
                status, value = Status.NOT_IDENTIFIABLE, fallback
                text += f": {taken} fits them as well as any and is used"
            self._warn_assumed(text, TAKEN)
        is_from_logs = status is not Status.FIXED
        self.judged[setting] = again if is_from_logs else first
        self.shared[TAKEN], self.status = value, {TAKEN: status}
        self.sharing = replace(
            self.sharing,
            taken={TAKEN: setting} if is_from_logs else {},
            held=(MEAN,) if is_refined and is_from_logs else (),
        )

    def _warn(self, code: str, text: str) -> None:
        self.warnings.append(warning(code, text))

    def _warn_assumed(self, text: str, name: str) -> None:
        """Say that a value is used which the logs do not determine."""
        fix, advice = Option("fix", "VALUE", name), "give {fix} if yours is known."
        self.warnings.append(warning("assumed", f"{text}; {advice}", fix=fix))


def _is_good(first: FitResult) -> bool:
    """Whether a fit ended where a fit should end."""
    return first.is_sound or lacks_stiffness_alone(first)


def _tells_r_m3(judged: FitResult) -> bool:
    """Whether a fit knows R_m3 well enough for all settings to use it."""
    return judged.status[TAKEN] == Status.FITTED and judged.errors[TAKEN] < NOT_FIT_TO_SHARE


def _is_contradicted(block: Block, best: FitResult, r_m3: float, f_f: float | None) -> bool:
    """Whether the misfit with R_m3 held at a value is more than noise above the best."""
    start = best.values.replace(r_m3=r_m3)
    free = tuple(n for n in block.free if n != TAKEN and (f_f is None or n != MEAN))
    try:
        other = minimised(replace(block, free=free), start)
    except FitCancelledError:
        raise
    except DamperfitError:
        return True
    rise = other.mse_percent / best.mse_percent - 1.0
    return rise * best.n_independent > CHI_SQUARED_95


def _with_mean_friction(block: Block, judged: FitResult, f_f: float, r_m3: float) -> FitResult:
    """The setting of R_m3 with the mean friction, which halves its error, where that is better."""
    free = tuple(name for name in block.free if name != MEAN)
    start = judged.values.replace(f_f=f_f)
    if not _tells_r_m3(judged):  # it starts from a value that can be seen
        limit = cavitation_limit(block.traces, cast("Damper", block.model))
        start = start.replace(r_m3=min(r_m3, limit))
    try:
        again = fit_setting(replace(block, free=free), start, spent=judged.evaluations)
    except FitCancelledError:
        raise
    except DamperfitError:
        return judged
    is_better = again.is_sound if judged.is_sound else again.outcome.is_minimum
    return again if is_better else judged
