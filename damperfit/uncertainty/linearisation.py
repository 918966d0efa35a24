"""A fit made linear at its end: what the logs of one setting say there about all parameters.

One more simulation of the setting, with every sensitivity; of its mean cycles alone, where it was
fitted on them. In u (ln y; an offset in N), with the residual r = f - f_hat in N and its Jacobian
J = d f_hat/du, both behind the filter, and the weights w of the stretches (1 where their noise is
alike)::

    information  H = J^T w^2 J    scores  g_t = w_t^2 J_t r_t    M = covariance of sum g_t

A fit of any subset of the parameters has, to first order, the error H_ff^-1 (sum g)_f.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.identification.model_versus_log import compare
from damperfit.identification.outcome import Status
from damperfit.identification.weights import weights
from damperfit.simulation import SolverOptions, simulate
from damperfit.uncertainty.correlated_noise import (
    correlation_length,
    cycle_covariance,
    larger,
    score_covariance,
    stationary_covariance,
)
from damperfit.uncertainty.few_samples import ShortStretch, filter_correlation, widening

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification import Fit, LogFit, SimulatedLog
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["Linearisation", "LogLinearisation", "linearise_at_fit"]

# Residuals still correlated after this share of a cycle repeat with the cycle: a misfit, no noise.
_LONGEST_CORRELATION = 0.25
# s; where nothing repeats, a chamber that cavitates remembers noise for as long as it is empty.
_LONGEST_MOVING = 1.0
# Samples in which a chamber that was empty is full again.
_REFILLING = 2
# Of that, the share of the information that counts: with all or half of it too few intervals of
# R_m3 hold on a road that cavitates, with none too many
# (`python -m tests.uncertainty.motion_coverage --motions "rough road"`).
_SEEN = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class LogLinearisation:
    """One log at the fitted point, over its compared samples, n of them.

    Attributes
    ----------
    residuals : numpy.ndarray
        Shape (n,), measured minus modelled force, N.
    weights : numpy.ndarray
        Shape (n,), what the fit multiplied them by.
    jacobian : numpy.ndarray
        Shape (n, k): derivative of the modelled force by u, in the order of the model.
    gas : numpy.ndarray
        Shape (n, c): derivative by the logarithms of the model's conditions, such as gas pressure.
    force : numpy.ndarray
        Shape (n,), modelled force behind the filter, N.
    pressures : numpy.ndarray
        Shape (3,), lowest absolute pressure of each chamber, Pa.
    """

    residuals: FloatArray
    weights: FloatArray
    jacobian: FloatArray
    gas: FloatArray
    force: FloatArray
    pressures: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """The fit of one setting, made linear at its end; matrices are (k, k) in the model's order.

    Attributes
    ----------
    fit : Fit
        The fit it belongs to.
    information : numpy.ndarray
        H, N^2.
    scores : numpy.ndarray
        Covariance of the summed scores, correlation allowed for, N^4.
    cycle_scores : numpy.ndarray
        The same from the scatter between whole cycles; NaN for a single cycle.
    gradient : numpy.ndarray
        Shape (k,), sum of the scores.
    logs : tuple of LogLinearisation
        Log by log.
    conditions : tuple of str
        Names of the columns of each log's `gas`.
    misfit : numpy.ndarray or None
        In place of `scores` what a misfit that repeats does; None where nothing repeats.
    supposed : numpy.ndarray or None
        Summed scores by what is held at a default that nobody has measured, each column for one
        standard error of that; None where there is none.
    flaws : tuple of str
        Which flaws its residuals may be said to show.
    """

    fit: Fit
    information: FloatArray
    scores: FloatArray
    cycle_scores: FloatArray
    gradient: FloatArray
    logs: tuple[LogLinearisation, ...]
    conditions: tuple[str, ...] = ()
    misfit: FloatArray | None = None
    supposed: FloatArray | None = None
    flaws: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rows and columns: the model's quantities, in its order."""
        return self.fit.parameters.names

    def places(self, names: Sequence[str]) -> NDArray[np.intp]:
        """Return the rows of some quantities."""
        return np.array([self.names.index(name) for name in names], dtype=np.intp)


def linearise_at_fit(
    fit: Fit, damper: Model, *, solver: SolverOptions = SolverOptions()
) -> Linearisation:
    """Take the derivative of a fit's logs by every parameter, on mean cycles where they repeat.

    Raises
    ------
    SimulationError
        When the model cannot be integrated.
    """
    values = fit.parameters
    own = [getattr(values, one.name) if one.is_logarithmic else 1.0 for one in values.quantities]
    slopes = np.array([*own, *(getattr(damper, name) for name in damper.conditions)])
    n = len(own)
    ignorance = _ignorance(fit)
    pulls: list[FloatArray] = []
    logs: list[LogLinearisation] = []
    covariances: list[FloatArray] = []
    lags: list[int] = []
    traces = [log.trace for log in fit.logs]
    for log, weight in zip(fit.logs, weights(traces), strict=True):
        trace, part = log.trace, log.trace.compared
        seen, rows = _seen(log, fit.parameters, damper, solver)
        columns = (rows * slopes[:, None]).T
        logs.append(
            LogLinearisation(
                residuals=trace.force[part] - seen.force[part],
                weights=np.ones(trace.n_samples) if weight is None else weight,
                jacobian=np.ascontiguousarray(columns[:, :n]),
                gas=columns[:, n:],
                force=seen.force[part],
                pressures=seen.response.pressures[:, part].min(axis=1),
            )
        )
        weighted = logs[-1].jacobian * (logs[-1].weights ** 2)[:, None]
        pulls.append(weighted.T @ (rows[:n] * ignorance[:, None]).T)
        for lag, found in _covariances(trace, logs[-1]):
            lags.append(lag)
            covariances.append(found)
    scores = [_scores(log) for log in logs]
    pieces, edges = [], []
    for log, of_log in zip(fit.logs, scores, strict=True):
        for stretch, place in zip(log.trace.stretches, log.trace.places, strict=True):
            pieces.append(of_log[place])
            edges.append(stretch.cycle_starts - stretch.first)
    wider = widening(_short_stretches(fit, logs, lags))
    return Linearisation(
        fit=fit,
        information=np.asarray(sum(_information(log) for log in logs)),
        scores=np.asarray(wider * sum(covariances)),
        cycle_scores=wider * cycle_covariance(pieces, edges),
        gradient=np.asarray(sum(part.sum(axis=0) for part in scores)),
        logs=tuple(logs),
        conditions=damper.conditions,
        supposed=np.asarray(sum(pulls)) if np.any(ignorance) else None,
        flaws=damper.flaws,
    )


def _seen(
    log: LogFit, parameters: Values, damper: Model, solver: SolverOptions
) -> tuple[SimulatedLog, FloatArray]:
    """A log beside the model, and the sensitivities over what is compared, (k, n).

    What repeats has the mean cycle's sensitivities: they differ from those of the log by what the
    noise of the displacement does, and cost far less.
    """
    names = (*damper.names, *damper.conditions)
    trace, kept = log.trace, log.seen
    if kept is not None and kept.cycles and kept.is_of(parameters, trace, damper, solver):
        rows = np.empty((len(names), trace.n_samples))
        for cycle, stretch, place in zip(kept.cycles, trace.stretches, trace.places, strict=True):
            response = simulate(
                parameters,
                damper,
                cycle.motion,
                sensitivities=names,
                options=cycle.solver(solver),
            )
            rows[:, place] = cycle.slopes_over(stretch, response)
        return kept.comparison, rows
    seen = compare(parameters, trace, damper, sensitivities=names, solver=solver)
    return seen, _sensitivities(trace, seen)[:, trace.compared]


def _ignorance(fit: Fit) -> FloatArray:
    """One standard error of what stands at a default that nobody has measured, in its unit."""
    values = fit.parameters
    found = np.zeros(len(values.names))
    for place, one in enumerate(values.quantities):
        value = getattr(values, one.name)
        if fit.status[one.name] is Status.FIXED and value == one.default:
            found[place] = one.ignorance * (1.0 if one.may_vanish else value)
    return found


def _sensitivities(trace: Trace, seen: SimulatedLog) -> FloatArray:
    """Return the sensitivities behind the filter, with part of what a sample sees of a refilling.

    A chamber that has been empty fills within a millisecond. Whether a sample falls into that, and
    then shows the moment to some microseconds, changes with the parameters by less than their
    errors: the slope of that one point promises too much, and without it too little is promised.
    """
    empty = seen.response.pressures[:2] <= 0.0
    filled = np.flatnonzero((empty[:, :-1] & ~empty[:, 1:]).any(axis=0)) + 1
    if not len(filled) or all(stretch.n_cycles for stretch in trace.stretches):
        return seen.sensitivities  # cycles meet a refilling at other moments of it
    rows = np.stack(list(seen.response.sensitivities.values()))
    luck = np.unique(np.add.outer(filled, np.arange(_REFILLING)))
    luck = luck[luck < rows.shape[1] - 1]
    known = np.setdiff1d(np.arange(rows.shape[1]), luck)
    for row in rows:
        beside = np.interp(luck, known, row[known])
        row[luck] = beside + math.sqrt(_SEEN) * (row[luck] - beside)
    return apply_filter(trace.model_filter, rows)


def _short_stretches(
    fit: Fit, logs: Sequence[LogLinearisation], lags: Sequence[int]
) -> list[ShortStretch]:
    """Return what each stretch gives to the parameters that the fit found."""
    names = fit.parameters.names
    fitted = {Status.FITTED, Status.NOT_IDENTIFIABLE}
    columns = [k for k, name in enumerate(names) if fit.status[name] in fitted]
    places = [
        (log.trace, seen, place)
        for log, seen in zip(fit.logs, logs, strict=True)
        for place in log.trace.places
    ]
    return [
        ShortStretch(
            seen.jacobian[place][:, columns] * seen.weights[place, None],
            filter_correlation(trace.model_filter, place.stop - place.start),
            lag,
        )
        for (trace, seen, place), lag in zip(places, lags, strict=True)
    ]


def _covariances(trace: Trace, seen: LogLinearisation) -> Iterator[tuple[int, FloatArray]]:
    """Correlation length and covariance of the summed scores of each stretch.

    Nothing is correlated across a gap.
    """
    scores = _scores(seen)
    for stretch, place in zip(trace.stretches, trace.places, strict=True):
        period = 1.0 / stretch.frequency
        longest = _LONGEST_CORRELATION * period if stretch.n_cycles else _LONGEST_MOVING
        longest = round(longest / trace.interval)
        lag = correlation_length(seen.residuals[place], longest=longest)
        found = score_covariance(scores[place], lag)
        if not stretch.n_cycles:
            # Cycles repeat what a few samples tell; elsewhere those few may be all there is.
            weights = seen.weights[place]
            alike = stationary_covariance(
                seen.jacobian[place] * weights[:, None], seen.residuals[place] * weights, lag
            )
            found = larger(found, alike)
        yield lag, found


def _scores(log: LogLinearisation) -> FloatArray:
    return log.jacobian * (log.weights**2 * log.residuals)[:, None]


def _information(log: LogLinearisation) -> FloatArray:
    weighted = log.jacobian * log.weights[:, None]
    return np.asarray(weighted.T @ weighted)
