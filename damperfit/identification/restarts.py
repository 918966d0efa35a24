"""A fit that may lie in a wrong valley starts again from elsewhere.

Suspicious is a misfit well above the noise that no known flaw explains or that drove a number to
the edge of its range, and a chamber that cavitates beside a misfit that is more than noise. Short
descents then begin where the model itself would have started (of valves what the loops show: a fit
may have begun elsewhere, from numbers that were given, a neighbour's, or by chance) and far from
the start: K_e by a factor of 10 either way, friction and valves likewise. The first that gets lower
than the fit is followed to its end, and is used when it fits better by more than noise, or as well
and sound.

A fit that is not suspicious costs nothing more, or one evaluation where its misfit is large. The
short descents cost no more than the fit has cost, or than three ordinary ones where that is more.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import DamperfitError, FitCancelledError
from damperfit.identification.descent import Misfit, descend, linearise
from damperfit.identification.law_misfit import LawMisfit, best_fitting
from damperfit.identification.one_speed import inseparable
from damperfit.identification.outcome import Outcome
from damperfit.identification.plausible import kept_within
from damperfit.identification.setting import Judged, attempt, fit_setting, is_sound
from damperfit.identification.signatures import gain, signatures
from damperfit.identification.weights import weights
from damperfit.statistics import CHI_SQUARED_95

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from damperfit.damper.model import Values

__all__ = ["is_suspicious", "noise_percent", "reconsidered"]

# Misfit over noise. Noise of the displacement alone makes some of it at the reversals, where the
# friction is strong; of a damper that cavitates as its model does next to none is left.
WELL_ABOVE = 4.0
CAVITATING_ABOVE = 1.5
# MSE in per cent, a thirtieth of a per cent of the force's deviation squared: 1 N of 300 N.
LEAST = 1e-3
# Share of the misfit that one flaw must explain, as in `damperfit.uncertainty.flaws`.
EXPLAINED = 0.5

# Factors on where the fit began: stiffness, friction, the first of the other quantities, and those
# that come after it (check valves: a chamber that they hardly fill).
_ELSEWHERE = (
    (1.0, 1.0, 1.0, 10.0),
    (0.1, 1.0, 1.0, 1.0),
    (10.0, 1.0, 1.0, 1.0),
    (1.0, 10.0, 0.5, 1.0),
    (1.0, 0.1, 2.0, 1.0),
    (0.3, 1.0, 5.0, 1.0),
    (3.0, 1.0, 0.2, 1.0),
)
_OWN = 2  # of the model's own starts
_SHORT = 12  # evaluations of a short descent
_LEAST_ALLOWED = 60
# As good as the best, for a short descent that cavitates nowhere while the best does.
_AS_GOOD = 1.05


def noise_percent(misfit: Misfit) -> float:
    """Return what noise alone makes of the MSE of a fit; NaN where no stretch knows its noise.

    Parameters
    ----------
    misfit : Misfit
        What is fitted.
    """
    total, known = 0.0, 0
    for trace, weight in zip(misfit.traces, weights(misfit.traces), strict=True):
        for stretch, place in zip(trace.stretches, trace.places, strict=True):
            if not np.isfinite(stretch.noise):
                continue
            power = 1.0 if weight is None else float(np.mean(weight[place] ** 2))
            total += stretch.n_samples * power * stretch.noise**2
            known += stretch.n_samples
    return 100.0 * total / known / misfit.deviation**2 if known else float("nan")


def is_suspicious(misfit: Misfit, judged: Judged) -> bool:
    """Whether a fit may lie in a wrong valley; one evaluation, where the misfit is large.

    Parameters
    ----------
    misfit : Misfit
        What was fitted.
    judged : Judged
        Where it ended.
    """
    mse, noise = judged.solution.mse_percent, noise_percent(misfit)
    if not misfit.free or not mse > LEAST:
        return False
    if judged.solution.is_cavitating and mse > CAVITATING_ABOVE * noise:
        return True
    if not mse > WELL_ABOVE * noise:
        return False
    # A flaw may explain a wrong valley too, but does not drive a fit to the edge of what there is.
    return judged.outcome is Outcome.AT_BOUND or not _is_explained(misfit, judged, noise)


def _is_explained(misfit: Misfit, judged: Judged, noise: float) -> bool:
    """Whether one known flaw explains most of what is missed beyond the noise."""
    residuals, slopes = linearise(misfit.whole, judged.solution.parameters)
    lengths = np.sqrt(np.sum(slopes * slopes, axis=0))
    basis, _ = np.linalg.qr(slopes[:, lengths > 0.0] / lengths[lengths > 0.0])
    factors = weights(misfit.traces)
    tables = [signatures(trace, trace.force[trace.compared]) for trace in misfit.traces]
    power = float(residuals @ residuals) * (1.0 - noise / judged.solution.mse_percent)
    for name, candidates in tables[0].items():
        if name not in misfit.damper.flaws:
            continue
        for k in range(len(candidates)):
            column = np.concatenate(
                [
                    table[name][k] if factor is None else table[name][k] * factor
                    for table, factor in zip(tables, factors, strict=True)
                ]
            )
            if gain(column, basis, residuals)[0] > EXPLAINED * power:
                return True
    return False


def reconsidered(misfit: Misfit, first: Judged, start: Values) -> Judged:
    """Return a fit as it is, or where it is suspicious the best of it and of others.

    Parameters
    ----------
    misfit : Misfit
        What is fitted.
    first : Judged
        The fit.
    start : Values
        Where it began.

    Raises
    ------
    FitCancelledError
        When the caller asked to stop.
    """
    if inseparable(misfit.facts, misfit.free, misfit.damper.quantities) or not is_suspicious(
        misfit, first
    ):
        return first
    return _started_again(misfit, first, start)


def _started_again(misfit: Misfit, first: Judged, start: Values) -> Judged:
    """The best of a suspicious fit and of what begins elsewhere, with a sentence on it."""
    allowed = max(first.solution.evaluations, _LEAST_ALLOWED)
    best, spent, n_places = first, 1, 0
    own, is_elsewhere = _own_starts(misfit, start)
    has_tried = allowed > _LEAST_ALLOWED  # detours of its own, which cost about as much
    if own and is_elsewhere and has_tried and first.solution.is_cavitating:
        n_places = 1
        best, spent = _led_round(misfit, own[0], first)
    is_done = best is not first and not is_suspicious(misfit, best)
    for place in () if is_done else _places(misfit, start, own[n_places:]):
        if spent + _SHORT > allowed:
            break
        n_places += 1
        found, cost = _from(misfit, place, best)
        spent += cost
        if found is not best:
            best = found
            if not is_suspicious(misfit, best):
                break
    if not n_places:
        return first
    evaluations = first.solution.evaluations + spent
    said = _sentence(first, best, n_places, spent)
    best = replace(best, solution=replace(best.solution, evaluations=evaluations))
    return replace(best, said=(*first.said, said))


def _led_round(misfit: Misfit, place: Values, best: Judged) -> tuple[Judged, int]:
    """The better of a fit that cavitates and of what the model's detours make of its own start.

    A fit that began at numbers that were given has had detours from there alone, and every short
    descent from elsewhere ends in that valley too.
    """
    try:
        other = fit_setting(misfit, place)
    except FitCancelledError:
        raise
    except DamperfitError:
        return best, 1
    return (other if _is_better(other, best) else best), 1 + other.solution.evaluations


def _from(misfit: Misfit, place: Values, best: Judged) -> tuple[Judged, int]:
    """The better of the best so far and of a descent from a place, and evaluations spent."""
    try:
        most = min(_SHORT, misfit.max_evaluations)
        short = descend(replace(misfit, max_evaluations=most), place)
        spent = short.evaluations
        is_full = best.solution.is_cavitating and not short.is_cavitating
        bar = best.solution.mse_percent * (_AS_GOOD if is_full else 1.0)
        if short.mse_percent > bar:
            return best, spent
        other = attempt(misfit, short.parameters, 0)
    except FitCancelledError:
        raise
    except DamperfitError:
        return best, _SHORT
    spent += other.solution.evaluations
    return (other if _is_better(other, best) else best), spent


def _is_better(other: Judged, best: Judged) -> bool:
    """Whether a fit is better by more than noise, or as good and sound where the best is not."""
    rise = best.solution.mse_percent / max(other.solution.mse_percent, 1e-300) - 1.0
    is_clear = rise * other.solution.n_independent > CHI_SQUARED_95
    is_level = abs(rise) * other.solution.n_independent <= CHI_SQUARED_95
    return is_clear or (is_level and is_sound(other) and not is_sound(best))


def _places(misfit: Misfit, start: Values, own: Iterable[Values]) -> Iterator[Values]:
    """Yield the model's own starts, then such as are far from where the fit began."""
    yield from own
    free = [misfit.damper.quantity(name) for name in misfit.free]
    free = [one for one in free if one.is_logarithmic]
    stiff = [one.name for one in free if one.is_open]
    friction = [one.name for one in free if one.unit == "N"]
    others = [one.name for one in free if one.name not in {*stiff, *friction}]
    seen: list[dict[str, float]] = [{}]
    for factors in _ELSEWHERE:
        moved = {
            name: factor * getattr(start, name)
            for names, factor in zip(
                (stiff, friction, others[:1], others[1:]), factors, strict=True
            )
            for name in names
            if factor != 1.0
        }
        if moved not in seen:
            seen.append(moved)
            yield kept_within(start.replace(moved), misfit.free)


def _own_starts(misfit: Misfit, start: Values) -> tuple[list[Values], bool]:
    """Where the model would start on these logs, the best fitting first; not where the fit did.

    And whether the fit began elsewhere.
    """
    held = {name: getattr(start, name) for name in start.names if name not in misfit.free}
    try:
        found = misfit.damper.start(misfit.traces, held)
    except DamperfitError:
        return [], False
    kept = [kept_within(one, misfit.free) for one in found]
    others = [one for one in kept if one != kept_within(start, misfit.free)]
    own = LawMisfit(misfit.damper, misfit.traces, misfit.free, misfit.solver)
    best = best_fitting(replace(own, cancelled=misfit.cancelled), others)[:_OWN]
    return best, len(others) == len(kept)


def _sentence(first: Judged, best: Judged, n_places: int, spent: int) -> str:
    before, after = first.solution.mse_percent, best.solution.mse_percent
    many = f"{n_places} other place{'s' if n_places > 1 else ''} ({spent} evaluations)"
    if best.solution.parameters == first.solution.parameters:
        return (
            f"a misfit that noise does not explain (MSE {before:.2g} %): the fit started again "
            f"from {many} and found no better minimum; either the model or the log is at fault."
        )
    return (
        f"the first fit ended in a local minimum (MSE {before:.2g} %): started again from {many}, "
        f"it found a better one ({after:.2g} %), which is used."
    )
