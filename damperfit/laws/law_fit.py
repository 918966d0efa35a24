"""One law fitted to the logs of one setting, for comparing laws: short, and with a prediction.

The misfit and the loop are those of every fit (`damperfit.identification`): each stretch weighed by
its own noise, steps in logarithms. What runs into an edge of its plausible range stays there and is
told: a play or a lag that is not there goes to nothing, and a law that has such a quantity has one
too many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.errors import SimulationError
from damperfit.identification import compare, normalised_mse
from damperfit.identification.minimiser import Minimum, Point, Transformation, minimise
from damperfit.identification.trust_region import Stopping
from damperfit.identification.weights import weights
from damperfit.laws.choosing import FEWEST_SAMPLES
from damperfit.simulation import SolverOptions
from damperfit.simulation.motion import motion_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.recording import Trace
    from damperfit.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = ["UNTOLD", "LawFit", "SettingLogs", "fit_law"]

# Laws are compared by factors of their MSE: a fall of a few in ten thousand changes nothing.
_STOPPING = Stopping(cost_tolerance=3e-4, step_tolerance=1e-4, max_evaluations=60, rest=math.inf)
_SHORTEST = 0.25  # s; less that is not compared tells nothing
# A standard error of this factor to both sides, and a quantity is not told.
UNTOLD = 1.65
# Starts that are followed for a few evaluations before the best is followed to its end.
_TRIED = 2
_SHORT = Stopping(cost_tolerance=1e-2, step_tolerance=1e-3, max_evaluations=8, rest=math.inf)


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
    misfit = _LawMisfit(model, evidence.fitted, free, solver)
    starts = model.start(evidence.fitted, held)
    if near is not None:
        shared = {n: v for n, v in zip(near.names, near.numbers, strict=True) if n in free}
        starts = (starts[0].replace(shared), *starts)
    told = {name: evidence.told[name] for name in free if name in evidence.told}
    if told:
        starts = (starts[0].replace(told), *starts)
    ranked = _ranked(misfit, starts)
    spent = 0
    candidates = []
    for start in ranked[:_TRIED]:
        try:
            short = misfit.descend(start, _SHORT)
        except SimulationError:
            continue
        spent += short.evaluations
        candidates.append(short)
    if not candidates:
        raise SimulationError(f"{model.name} cannot be simulated from any of its starts.")
    best = min(candidates, key=lambda one: one.point.cost)
    ended = misfit.descend(best.point.extra, _STOPPING)
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
        evaluations=spent + ended.evaluations,
        untold=_untold(ended.point, model, free, len(alone)),
    )


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


@dataclass(frozen=True, slots=True, eq=False)
class _LawMisfit:
    """A law, logs, and what moves."""

    model: Model
    traces: tuple[Trace, ...]
    free: tuple[str, ...]
    solver: SolverOptions

    @property
    def deviation(self) -> float:
        return float(np.std(np.concatenate([t.force[t.compared] for t in self.traces])))

    def is_at_edge(self, values: Values, name: str) -> bool:
        low, high = self.model.quantity(name).plausible
        return not low < getattr(values, name) < high

    def descend(self, start: Values, stopping: Stopping) -> Minimum[Values]:
        """Minimise from a start; the sum of squares of a useless law is 1."""
        n = sum(trace.n_samples for trace in self.traces)
        scale = 1.0 / (self.deviation * math.sqrt(n))
        factors = weights(self.traces)
        quantities = [self.model.quantity(name) for name in self.free]
        low, high = (np.array([one.plausible[k] for one in quantities]) for k in (0, 1))

        def residuals(numbers: FloatArray) -> tuple[FloatArray, FloatArray, Values]:
            within = np.clip(numbers, low, high)
            values = start.replace(dict(zip(self.free, within.tolist(), strict=True)))
            parts = []
            for trace, weight in zip(self.traces, factors, strict=True):
                rows = self.rows(values, trace)
                parts.append(rows * (scale if weight is None else scale * weight))
            whole = np.hstack(parts)
            # Beyond the edge nothing changes any more.
            slopes = np.where(within == numbers, whole[1:].T, 0.0)
            return whole[0], slopes, values

        transformation = Transformation(
            np.array([one.is_logarithmic for one in quantities], dtype=bool),
            np.array([self.deviation if not one.is_logarithmic else 1.0 for one in quantities]),
        )
        at = np.array([getattr(start, name) for name in self.free])
        return minimise(residuals, np.clip(at, low, high), transformation, stopping)

    def rows(self, values: Values, trace: Trace) -> FloatArray:
        """Residuals and their derivatives by what moves, over what is compared: (1 + k, n)."""
        response = self.model.simulate(
            values, motion_of(trace), sensitivities=self.free, options=self.solver
        )
        rows = np.stack([response.force, *response.sensitivities.values()])
        rows = apply_filter(trace.model_filter, rows)[:, trace.compared]
        rows[0] -= trace.force[trace.compared]
        if not np.all(np.isfinite(rows)):
            raise SimulationError("simulation failed: the force is no number.")
        return rows


def _ranked(misfit: _LawMisfit, starts: Sequence[Values]) -> list[Values]:
    """Starts by how well they fit the log with the strongest force, the best first."""
    trace = max(misfit.traces, key=lambda one: float(np.std(one.force[one.compared])))
    found = []
    for place, start in enumerate(starts):
        try:
            force = compare(start, trace, misfit.model, solver=misfit.solver).force
        except SimulationError:
            continue
        part = trace.compared
        found.append((normalised_mse(trace.force[part], force[part]), place, start))
    return [start for _, _, start in sorted(found, key=lambda one: one[:2])]


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
