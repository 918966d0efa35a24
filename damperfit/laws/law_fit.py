"""One law fitted to the logs of one setting, for comparing laws: short, and with a prediction.

It descends on the logs' settled cycles and ends, where asked, on the whole logs. What runs into an
edge of its plausible range stays there and is told: a play or a lag that is not there goes to
nothing, and a law that has such a quantity has one too many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from damperfit.errors import SimulationError
from damperfit.identification import compare, normalised_mse
from damperfit.identification.law_misfit import COMPARING, LawMisfit, followed
from damperfit.laws.choosing import FEWEST_SAMPLES
from damperfit.simulation import SolverOptions

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification.minimiser import Minimum, Point
    from damperfit.recording import Trace
    from damperfit.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["UNTOLD", "LawFit", "SettingLogs", "fit_law"]

_SHORTEST = 0.25  # s; less that is not compared tells nothing
# A standard error of this factor to both sides, and a quantity is not told.
UNTOLD = 1.65


@dataclass(frozen=True, slots=True, eq=False)
class SettingLogs:
    """What one setting gives to compare laws by.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    fitted, held_out : tuple of Trace
        Logs that are fitted, and those that are only predicted.
    told : mapping of str to float
        A place more to start from, as far as a law has these quantities.
    """

    setting: Setting
    fitted: tuple[Trace, ...]
    held_out: tuple[Trace, ...] = ()
    told: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class LawFit:
    """A law at the logs of one setting.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    model : Model
        The law.
    values : Values
        At the best point found.
    free : tuple of str
        What was fitted.
    at_bound : tuple of str
        What ran into an edge of its plausible range.
    mse_percent : float
        Eq. (22) over all that is compared in the fitted logs.
    stretches : tuple of float
        Eq. (22) of each of their stretches alone.
    held_out_percent : float
        Eq. (22) over what is compared in the logs that were held out. Without any over what lies
        between the stretches of those that were fitted, the changes of speed; NaN without any.
    held_out : str
        What that was: "logs", "transients", or nothing.
    residuals : tuple of numpy.ndarray
        Model less measurement over each stretch, N.
    evaluations : int
        Simulations with sensitivities.
    untold : tuple of str
        What may as well be `UNTOLD` times as much or as little: these logs do not determine it.
    """

    setting: Setting
    model: Model
    values: Values
    free: tuple[str, ...]
    at_bound: tuple[str, ...]
    mse_percent: float
    stretches: tuple[float, ...]
    held_out_percent: float
    held_out: str
    residuals: tuple[FloatArray, ...]
    evaluations: int
    untold: tuple[str, ...] = ()


def fit_law(
    model: Model,
    evidence: SettingLogs,
    *,
    freed: Sequence[str] = (),
    near: Values | None = None,
    solver: SolverOptions = SolverOptions(),
    is_whole: bool = True,
) -> LawFit:
    """Fit a law to the logs of a setting and predict those that were held out.

    Parameters
    ----------
    model : Model
        The law; what has a default is held there unless it is freed.
    evidence : SettingLogs
        The logs.
    freed : sequence of str
        What is fitted although it has a default.
    near : Values, optional
        Of a law fitted before, to start from as far as both have the same quantities.
    solver : SolverOptions
        How exactly to integrate.
    is_whole : bool
        Whether the descent ends on the whole logs; else on their settled cycles, for comparing.
        What is told of the fit is of the whole logs in both cases.

    Raises
    ------
    SimulationError
        The law cannot be simulated at any start.
    """
    held = {
        one.name: one.default
        for one in model.quantities
        if one.default is not None and one.name not in freed
    }
    free = tuple(name for name in model.names if name not in held)
    misfit = LawMisfit(model, evidence.fitted, free, solver)
    coarse = misfit.on_cycles()
    ended, spent = _descended(coarse, near, held, evidence.told)
    if is_whole:
        ended = misfit.descend(ended.point.extra, COMPARING)
        spent += ended.evaluations
    values = ended.point.extra
    residuals, alone, mse = _misses(model, values, evidence.fitted, solver)
    held_out, kind = math.nan, "logs" if evidence.held_out else "transients"
    try:
        if evidence.held_out:
            held_out = _misses(model, values, evidence.held_out, solver)[2]
        else:
            held_out = _missed_between(model, values, evidence.fitted, solver)
    except SimulationError:
        held_out = math.inf
    return LawFit(
        setting=evidence.setting,
        model=model,
        values=values,
        free=free,
        at_bound=tuple(name for name in free if misfit.is_at_edge(values, name)),
        mse_percent=mse,
        stretches=alone,
        held_out_percent=held_out,
        held_out="" if math.isnan(held_out) else kind,
        residuals=residuals,
        evaluations=spent,
        untold=_untold(ended.point, model, free, len(alone)),
    )


def _descended(
    misfit: LawMisfit, near: Values | None, held: Mapping[str, float], told: Mapping[str, float]
) -> tuple[Minimum[Values], int]:
    """Where the law's own starts, what was told and a law fitted before lead, and evaluations."""
    starts = misfit.model.start(misfit.traces, held)
    said = {name: told[name] for name in misfit.free if name in told}
    if said:
        starts = (starts[0].replace(said), *starts)
    if near is None:
        ended = followed(misfit, starts)
        return ended, ended.evaluations
    known = dict(zip(near.names, near.numbers, strict=True))
    shared = {name: known[name] for name in misfit.free if name in known}
    ended = followed(misfit, (starts[0].replace(shared), *starts), known=1)
    spent = ended.evaluations
    # A law that holds the other one fits no worse than that; if it does, it starts from there.
    absent = {name: misfit.absent(name) for name in misfit.free if name not in known}
    inside = starts[0].replace(shared | absent)
    try:
        if absent and misfit.cost(inside) < ended.point.cost:
            again = misfit.descend(inside, COMPARING)
            spent += again.evaluations
            ended = min(ended, again, key=lambda one: one.point.cost)
    except SimulationError:
        pass
    return ended, spent


def _untold(
    point: Point[Values], model: Model, free: Sequence[str], n_stretches: int
) -> tuple[str, ...]:
    """Return the quantities whose logarithm has too large a standard error, to first order.

    What a law leaves over is not white: a stretch counts as `FEWEST_SAMPLES`, not as thousands.
    """
    lengths = np.sqrt(np.sum(point.jacobian**2, axis=0))
    columns = point.jacobian / np.maximum(lengths, 1e-300)
    spread = np.linalg.inv(columns.T @ columns + 1e-12 * np.eye(len(free)))
    variance = np.diag(spread) * point.cost / (FEWEST_SAMPLES * n_stretches)
    errors = np.sqrt(variance) / np.maximum(lengths, 1e-300)
    return tuple(
        name
        for name, error in zip(free, errors.tolist(), strict=True)
        if model.quantity(name).is_logarithmic and error > math.log(UNTOLD)
    )


def _misses(
    model: Model, values: Values, traces: Sequence[Trace], solver: SolverOptions
) -> tuple[tuple[FloatArray, ...], tuple[float, ...], float]:
    """Residuals of each stretch, the MSE of each, and that of all."""
    residuals, alone, measured = [], [], []
    for trace in traces:
        force = compare(values, trace, model, solver=solver).force
        for stretch in trace.stretches:
            part = stretch.window
            residuals.append(force[part] - trace.force[part])
            alone.append(normalised_mse(trace.force[part], force[part]))
            measured.append(trace.force[part])
    together = np.concatenate(measured)
    mse = normalised_mse(together, together + np.concatenate(residuals))
    return tuple(residuals), tuple(alone), mse


def _missed_between(
    model: Model, values: Values, traces: Sequence[Trace], solver: SolverOptions
) -> float:
    """The MSE over what lies between the stretches of a log, by what is compared's variance.

    Before its first stretch the model's state is not yet that of the damper.
    """
    misses, measured = [], []
    for trace in traces:
        between = np.zeros(len(trace.force), dtype=bool)
        between[trace.stretches[0].stop : trace.stretches[-1].first] = True
        between[trace.compared] = False
        if np.count_nonzero(between) * trace.interval < _SHORTEST:
            continue
        force = compare(values, trace, model, solver=solver).force
        misses.append((force - trace.force)[between])
        measured.append(trace.force[trace.compared])
    if not misses:
        return math.nan
    rest = np.concatenate(misses)
    return float(100.0 * np.mean(rest * rest) / np.var(np.concatenate(measured)))
