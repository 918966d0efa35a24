"""Models from the literature on the same logs: same filter, weights, loop and hold-out as the laws.

They say what a physical law gains over a curve or a hysteresis of a few numbers, and what can be
taken where nothing physical is known. None of them is ever chosen by this search.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from damperfit.damper.rivals import RIVALS, RestoringForceSurface
from damperfit.errors import SimulationError
from damperfit.laws.choosing import Tried
from damperfit.laws.law_fit import fit_law
from damperfit.simulation import SolverOptions
from damperfit.workers import executor

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from damperfit.damper.rivals import Rival
    from damperfit.laws.law_fit import LawFit, SettingLogs

__all__ = ["rank_rivals"]


def rank_rivals(
    evidence: Sequence[SettingLogs],
    *,
    solver: SolverOptions = SolverOptions(),
    on_rival: Callable[[Tried], None] = lambda _: None,
    jobs: int = 1,
) -> tuple[Tried, ...]:
    """Fit every model of the literature to the settings; the best prediction comes first.

    Parameters
    ----------
    evidence : sequence of SettingLogs
        What the laws were compared by.
    solver : SolverOptions
        Half width of the friction's band; the rest is the physical models'.
    on_rival : callable
        Called with each that was fitted.
    jobs : int
        Workers; the result does not depend on them.

    Returns
    -------
    tuple of Tried
        By what was held out, else by what was fitted. One that cannot be simulated is left out.
    """

    def fit(job: tuple[type[Rival], SettingLogs]) -> LawFit | None:
        kind, one = job
        try:
            return fit_law(_on_scale(kind, one), one, solver=solver)
        except SimulationError:
            return None

    with executor(jobs) as pool:
        fits = list(pool.map(fit, [(kind, one) for kind in RIVALS for one in evidence]))
    found = []
    for place, kind in enumerate(RIVALS):
        own = [one for one in fits[place * len(evidence) :][: len(evidence)] if one is not None]
        if len(own) == len(evidence):
            found.append(Tried(kind.title, tuple(own)))
            on_rival(found[-1])
    return tuple(sorted(found, key=_rank))


def _rank(rival: Tried) -> tuple[float, float]:
    held = rival.held_out_percent
    return (0.0 if math.isnan(held) else held, rival.mse_percent)


def _on_scale(kind: type[Rival], one: SettingLogs) -> Rival:
    """The model; a surface is laid over the strokes and speeds of the logs that are fitted."""
    if kind is not RestoringForceSurface:
        return kind()
    widest = max(float(np.max(np.abs(t.displacement[t.compared]))) for t in one.fitted)
    fastest = max(float(np.max(np.abs(t.velocity[t.compared]))) for t in one.fitted)
    return RestoringForceSurface(half_stroke=widest, top_speed=fastest)
