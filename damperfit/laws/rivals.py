"""What is no candidate of the search: models of the literature, and those that yield."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from damperfit.damper.rivals import RIVALS, Biviscous, BoucWen, Kwok, RestoringForceSurface, Rival
from damperfit.errors import SimulationError
from damperfit.laws.law_fit import (
    Candidate,
    LawFit,
    LawSearch,
    SettingLogs,
    are_alike,
    fit_law,
    times_worse,
)
from damperfit.simulation import SolverOptions
from damperfit.workers import executor


def rank_rivals(
    evidence: Sequence[SettingLogs],
    *,
    solver: SolverOptions = SolverOptions(),
    on_rival: Callable[[Candidate], None] = lambda _: None,
    jobs: int = 1,
) -> tuple[Candidate, ...]:
    """Fit every model of the literature to the settings; the best prediction comes first.

    One that cannot be simulated is left out; `on_rival` is called with each of the others.
    """

    def fit(job: tuple[type[Rival], SettingLogs]) -> LawFit | None:
        kind, logs = job
        model = kind()
        if (
            kind is RestoringForceSurface
        ):  # laid over strokes and speeds of the logs that are fitted
            widest = max(float(np.max(np.abs(t.displacement[t.compared]))) for t in logs.fitted)
            fastest = max(float(np.max(np.abs(t.velocity[t.compared]))) for t in logs.fitted)
            model = RestoringForceSurface(half_stroke=widest, top_speed=fastest)
        try:
            return fit_law(model, logs, solver=solver)
        except SimulationError:
            return None

    with executor(jobs) as pool:
        fits = list(pool.map(fit, [(kind, logs) for kind in RIVALS for logs in evidence]))
    ranked = []
    for place, kind in enumerate(RIVALS):
        own = [fit for fit in fits[place * len(evidence) :][: len(evidence)] if fit is not None]
        if len(own) == len(evidence):
            ranked.append(Candidate(kind.title, tuple(own)))
            on_rival(ranked[-1])
    return tuple(sorted(ranked, key=_rank))


def _rank(rival: Candidate) -> tuple[float, float]:
    held = rival.held_out_percent
    return (0.0 if math.isnan(held) else held, rival.mse_percent)


# Models that yield before they slide, beside the valves that were found.
#
# A magneto-rheological fluid or dry friction holds its force down to no speed, and so do
# preloaded valves. Where logs do, the models that yield are fitted as the valves were, and named
# where they fit and predict better. Valves are named only where they are clearly the better ones.

YIELDING: tuple[type[Rival], ...] = (BoucWen, Biviscous, Kwok)
# Valves that fit and predict so many times better are named and nothing else is. Of synthetic
# dampers of the same kinds as measured ones the true valves are far better than that.
_CLEARLY = 4.0


def held_against(law: Candidate, other: Candidate, share: float) -> tuple[bool, str]:
    """Whether what yields is taken instead of valves, and why.

    `share` is what the logs hold of their force down to a tenth of the speed.
    """
    holds = f"the logs hold {100.0 * share:.0f} % of their force down to a tenth of the speed"
    if times_worse(other, law) > 1.0 and not are_alike(other, law):
        return True, f"{holds}; it {_better(other, law)} than the model with valves"
    beyond = unbelievable(law)
    if is_open_to(law, other) and beyond:
        return True, f"{holds}; it fits them about as well as a model with valves whose {beyond}"
    if is_open_to(law, other):
        return False, f"{holds}; it fits them about as well as the model with valves"
    return False, f"{holds}; the model with valves {_better(law, other)}"


def _better(best: Candidate, other: Candidate) -> str:
    times = times_worse(best, other)
    known = f"{float(f'{times:.2g}'):.0f} times" if 2.0 <= times < 1000.0 else "far"
    return f"fits and predicts {'' if times < 2.0 else known + ' '}better"


def is_open_to(law: Candidate, other: Candidate) -> bool:
    """Return whether the logs leave it open which of both it is."""
    return times_worse(law, other) < _CLEARLY


def unbelievable(law: Candidate) -> str:
    """Return the first value of a law that no damper or rig has, in words; empty for none.

    A law of valves that is bent to what yields has oil as soft as air at one setting, and as stiff
    as steel at another.
    """
    for fit in law.fits:
        for q in fit.model.quantities:
            is_known = q.name in fit.free and q.name not in (*fit.undetermined, *fit.at_bound)
            low, high = q.believable
            if is_known and not low <= (value := getattr(fit.values, q.name)) <= high:
                shown = f"{10.0**-q.power * value:.3g} {q.shown_unit or q.unit}"
                return f"{q.symbol} is beyond any damper's, {shown} at setting {fit.setting}"
    return ""


def yielding_sentences(search: LawSearch, fits: Sequence[LawFit]) -> tuple[str, ...]:
    """Return sentences on a damper that yields; none on one whose valves are named."""
    model = fits[0].model
    up_to = "up to " if search.is_held_by_some else ""
    share = f"{up_to}{100.0 * search.held_share:.0f} %"
    holds = f"It holds {share} of its force down to a tenth of its speed"
    if search.doubt:
        what = (
            "something that yields before it slides, as a magneto-rheological fluid or dry friction"
        )
        return (f"{holds}, and {search.doubt}: it may be {what}; valves are not reported.",)
    if not isinstance(model, YIELDING):
        return ()
    return (
        (
            f"{holds}: it yields before it slides, as a magneto-rheological fluid or dry friction "
            "does."
        ),
        f"{_numbers(fits)}.",
        (
            f"{model.title} fits that better than any valves that a damper may have, so no valve, "
            "mounting or delay is named."
        ),
    )


def _numbers(fits: Sequence[LawFit]) -> str:
    model = fits[0].model
    first = ["f_r", "f_b"] if isinstance(model, Biviscous) else ["alpha"]
    names = (*first, *(name for name in model.names if name in {"c", "c_r", "c_b"}))
    parts = []
    for name in names:
        values = [float(getattr(fit.values, name)) for fit in fits]
        quantity = model.quantity(name)
        low, high = f"{min(values):.3g}", f"{max(values):.3g}"
        span = low if low == high else f"{low} to {high}"
        parts.append(f"{quantity.label} {span}{quantity.unit_after}")
    text = ", ".join(parts)
    return text[0].upper() + text[1:]
