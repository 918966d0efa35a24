"""One setting's fit from many starts: the spread of its minima.

The starts lie in a Latin hypercube over the logarithms of the free parameters, a factor of ten to
both sides of the first result (an offset: 300 N), the same in every run of one setting.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING
from zlib import crc32

import numpy as np

from damperfit.errors import DamperfitError, FitCancelledError
from damperfit.identification.descent import Misfit
from damperfit.identification.outcome import Status
from damperfit.identification.restarts import reconsidered
from damperfit.identification.setting import (
    Judged,
    fit_setting,
    is_sound,
    relative_errors,
)
from damperfit.identification.sharing import of_settings
from damperfit.statistics import CHI_SQUARED_95
from damperfit.tested.setting import Setting

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from damperfit.damper.model import Values
    from damperfit.identification.procedure_input import ProcedureInput

__all__ = [
    "SPREAD",
    "Search",
    "Valley",
    "describe_searches",
    "fit_from",
    "search",
    "spread_starts",
]

# Factor to both sides that the starts are spread over; of a linear quantity, in units of its size.
SPREAD = 10.0
_LINEAR_SPREAD = 3.0
_SEED = 20
_SHOWN = 4
# Two ends are one minimum when their parameters are this near, or this many standard errors.
_SAME = 0.01
_SAME_ERRORS = 1.0


@dataclass(frozen=True, slots=True)
class Valley:
    """A minimum that some of the starts ended in.

    Attributes
    ----------
    parameters : Values
        The best end.
    mse_percent : float
        Eq. (22) there.
    outcome : str
        How that descent ended.
    n_starts : int
        Starts that ended here.
    """

    parameters: Values
    mse_percent: float
    outcome: str
    n_starts: int


@dataclass(frozen=True, slots=True)
class Search:
    """What the starts of one setting found.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    free : tuple of str
        Values that the starts were spread in.
    minima : tuple of Valley
        By rising MSE.
    n_starts, n_failed : int
        Descents, the procedure's own among them, and those whose start could not be simulated.
    is_improved : bool
        Whether a start found a better minimum than the procedure's own; it is used.
    is_ambiguous : bool
        Whether different minima fit equally well.
    """

    setting: Setting
    free: tuple[str, ...]
    minima: tuple[Valley, ...]
    n_starts: int
    n_failed: int
    is_improved: bool
    is_ambiguous: bool

    @property
    def warning(self) -> str:
        """What the reader should know before believing the numbers; empty where all is well."""
        if self.is_ambiguous:
            one, two = self.minima[:2]
            apart = ", ".join(
                f"{name} {getattr(one.parameters, name):.4g} or {getattr(two.parameters, name):.4g}"
                for name in self.free
                if not _is_near(one.parameters, two.parameters, name)
            )
            return f"different minima fit equally well: {apart}"
        if self.is_improved:
            return "a better minimum than from the procedure's own start was found, and is used"
        return ""


def describe_searches(searches: Iterable[Search]) -> tuple[str, ...]:
    """Return what the starts found, for people: one sentence for each kind of ending."""
    said: dict[str, list[Setting]] = defaultdict(list)
    for one in searches:
        said[_ending(one)].append(one.setting)
    return tuple(f"{of_settings(settings)}, {words}" for words, settings in said.items())


def _ending(one: Search) -> str:
    many = f"{', '.join(one.free)} free, {one.n_starts} starts"
    if one.n_failed:
        many += f" of which {one.n_failed} could not be simulated"
    if len(one.minima) == 1:
        return f"{many}: all end in one minimum"
    ends = ", ".join(
        f"{end.mse_percent:.3g} % ({end.n_starts}, {end.outcome})" for end in one.minima[:_SHOWN]
    )
    more = f" and {len(one.minima) - _SHOWN} more" if len(one.minima) > _SHOWN else ""
    return f"{many}: {len(one.minima)} minima, with MSE {ends}{more}"


def fit_from(
    given: ProcedureInput, setting: Setting, misfit: Misfit, start: Values, *, spent: int = 0
) -> tuple[Judged, Search | None]:
    """Fit from a start, and from as many more as the options ask for or a doubt gives reason to."""
    first = fit_setting(misfit, start, spent=spent)
    if given.options.starts < 2 or not misfit.free:
        return reconsidered(misfit, first, start), None
    return search(setting, misfit, first, n_starts=given.options.starts)


def search(
    setting: Setting, misfit: Misfit, first: Judged, *, n_starts: int
) -> tuple[Judged, Search]:
    """Fit from further starts; returns the best sound result and what was found.

    Parameters
    ----------
    setting : Setting
        Adjuster setting; it also seeds the starts.
    misfit : Misfit
        Logs, damper and what is free.
    first : Judged
        Result from the procedure's own start.
    n_starts : int
        Descents in all, the first among them.

    Raises
    ------
    FitCancelledError
        When the caller asked to stop.
    """
    ends = [first]
    for start in spread_starts(misfit, first.solution.parameters, setting, n_starts - 1):
        try:
            ends.append(fit_setting(misfit, start))
        except FitCancelledError:
            raise
        except DamperfitError:
            continue
    groups = _grouped(ends, misfit)
    spent = sum(end.solution.evaluations for end in ends)
    best = groups[0][0]
    is_improved = first not in groups[0] and not _is_level(best, first)
    chosen = best if is_improved else first
    sound = [group[0] for group in groups if is_sound(group[0])]
    found = Search(
        setting=setting,
        free=misfit.free,
        minima=tuple(
            Valley(
                group[0].solution.parameters,
                group[0].solution.mse_percent,
                group[0].outcome.value,
                len(group),
            )
            for group in groups
        ),
        n_starts=n_starts,
        n_failed=n_starts - len(ends),
        is_improved=is_improved,
        is_ambiguous=len(sound) > 1 and sound[0] is best and _is_level(sound[0], sound[1]),
    )
    return replace(chosen, solution=replace(chosen.solution, evaluations=spent)), found


def _seed_of(setting: Setting) -> int:
    """A number of the setting's own, the same in every run; whole clicks are their own."""
    cell = Setting.of(setting).cell
    return cell if isinstance(cell, int) and cell >= 0 else crc32(str(cell).encode())


def spread_starts(
    misfit: Misfit, centre: Values, setting: Setting, number: int
) -> tuple[Values, ...]:
    """Return starts spread over a Latin hypercube around a point; always the same ones."""
    from scipy.stats import qmc  # slow to import: only a search from many starts pays

    random = np.random.default_rng([_SEED, _seed_of(setting)])
    cube = qmc.LatinHypercube(len(misfit.free), rng=random).random(number)
    columns = {}
    for name, away in zip(misfit.free, 2.0 * cube.T - 1.0, strict=True):
        value = getattr(centre, name)
        one = centre.quantity(name)
        columns[name] = (
            value * SPREAD**away if one.is_logarithmic else value + _LINEAR_SPREAD * one.size * away
        )
    return tuple(
        centre.replace({name: float(values[k]) for name, values in columns.items()})
        for k in range(number)
    )


def _grouped(ends: Sequence[Judged], misfit: Misfit) -> list[list[Judged]]:
    """Ends of one minimum together, best first; sound minima before the others."""
    groups: list[list[Judged]] = []
    for end in sorted(ends, key=lambda one: one.solution.mse_percent):
        for group in groups:
            if _is_same(group[0], end, misfit):
                group.append(end)
                break
        else:
            groups.append([end])
    return sorted(groups, key=lambda group: (not is_sound(group[0]), group[0].solution.mse_percent))


def _is_same(one: Judged, other: Judged, misfit: Misfit) -> bool:
    """Whether all parameters that the logs tell agree."""
    errors = relative_errors(one.solution)
    for name, error in zip(misfit.free, errors, strict=True):
        if one.status[name] != Status.FITTED and other.status[name] == one.status[name]:
            continue  # a flat valley is one minimum however far along it a descent stopped
        a, b = one.solution.parameters, other.solution.parameters
        quantity = a.quantity(name)
        if not quantity.is_logarithmic:
            unit = misfit.deviation if quantity.is_offset else quantity.size
            apart = abs(getattr(a, name) - getattr(b, name))
            if apart > max(_SAME * quantity.size, _SAME_ERRORS * error * unit):
                return False
        elif not _is_near(a, b, name, max(_SAME, _SAME_ERRORS * float(error))):
            return False
    return True


def _is_near(a: Values, b: Values, name: str, limit: float = _SAME) -> bool:
    one, other = getattr(a, name), getattr(b, name)
    return bool(abs(one - other) <= limit * max(abs(one), abs(other), 1e-300))


def _is_level(best: Judged, other: Judged) -> bool:
    """Whether noise alone may make the difference of two misfits."""
    rise = other.solution.mse_percent / max(best.solution.mse_percent, 1e-300) - 1.0
    return bool(rise * best.solution.n_independent < CHI_SQUARED_95)
