"""A fit made linear at its end: what the logs of one setting say there about all parameters.

One more simulation of the setting, with every sensitivity; of its mean cycles alone, where it was
fitted on them. In u (ln y; an offset in N), with the residual r = f - f_hat in N and its Jacobian
J = d f_hat/du, both behind the filter, and the weights w of the stretches (1 where their noise is
alike)::

    information  H = J^T w^2 J    scores  g_t = w_t^2 J_t r_t    M = covariance of sum g_t

A fit of any subset of the parameters has, to first order, the error H_ff^-1 (sum g)_f.

All of it lies behind the filter, whose band takes a few samples of a log that is sampled at 1 kHz:
where cycles repeat, sums are those over the middle ones of every few
(`damperfit.uncertainty.thinning`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.identification.model_versus_log import compare
from damperfit.identification.outcome import Status
from damperfit.identification.weights import all_alike, weights
from damperfit.simulation import SolverOptions, simulate
from damperfit.uncertainty.correlated_noise import (
    correlation_length,
    cycle_covariance,
    larger,
    score_covariance,
    stationary_covariance,
)
from damperfit.uncertainty.few_samples import (
    ShortStretch,
    filter_correlation,
    independent_samples,
    is_enough,
    widening,
)
from damperfit.uncertainty.suppositions import ignorance, other_frictions
from damperfit.uncertainty.thinning import middles, stride_of
from damperfit.uncertainty.unopened import pressed_on

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

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
        Shape (m, k): derivative of the modelled force by u, in the order of the model, at the
        middle one of every ``stride`` samples of each stretch.
    gas : numpy.ndarray
        Shape (m, c): derivative by the logarithms of the model's conditions, such as gas pressure.
    force : numpy.ndarray
        Shape (n,), modelled force behind the filter, N.
    pressures : numpy.ndarray
        Shape (3,), lowest absolute pressure of each chamber, Pa.
    stride : int
        Samples for each row of the derivatives.
    """

    residuals: FloatArray
    weights: FloatArray
    jacobian: FloatArray
    gas: FloatArray
    force: FloatArray
    pressures: FloatArray
    stride: int = 1

    def thinned(self, trace: Trace, values: FloatArray) -> FloatArray:
        """Return what belongs to the derivatives' rows of values at the compared samples."""
        if self.stride == 1:
            return values
        taken = [
            values[place].take(middles(place.stop - place.start, self.stride)[0])
            for place in trace.places
        ]
        return taken[0] if len(taken) == 1 else np.concatenate(taken)

    def rows(self, trace: Trace) -> Iterator[slice]:
        """Yield where the rows of each stretch lie among those of the derivatives."""
        end = 0
        for stretch in trace.stretches:
            first, end = end, end - (-stretch.n_samples // self.stride)
            yield slice(first, end)

    def counts(self, trace: Trace) -> FloatArray:
        """Return for how many samples each row stands."""
        return np.concatenate([middles(one.n_samples, self.stride)[1] for one in trace.stretches])


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
        standard error of that, and by other forms of the friction; None where there is none.
    flaws : tuple of str
        Which flaws its residuals may be said to show.
    precision : float
        One over the mean square of the weighed residuals, 1/N^2.
    pressed : mapping of str to float
        Highest pressure across each blow-off in the compared samples, Pa, by its opening's name.
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
    precision: float = math.nan
    pressed: Mapping[str, float] = field(default_factory=dict)

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
    errors = ignorance(fit)
    traces = [log.trace for log in fit.logs]
    is_short = not _is_long(fit, traces)
    found = _Sums()
    logs: list[LogLinearisation] = []
    pressed: list[dict[str, float]] = []
    for log, weight in zip(fit.logs, weights(traces), strict=True):
        trace, part = log.trace, log.trace.compared
        stride = 1 if is_short else stride_of(trace, weight)
        force, pressures, rows = _seen(log, fit.parameters, damper, solver, stride=stride)
        taken = [middles(one.n_samples, stride)[0] for one in trace.stretches]
        others = other_frictions(log, fit, damper, solver=solver, places=taken, slopes=rows[:n])
        known = _supposed(errors, rows[:n], others)
        pressed.append(pressed_on(damper, pressures[:, part]))
        rows *= slopes[:, None]
        logs.append(
            LogLinearisation(
                residuals=trace.force[part] - force[part],
                weights=all_alike(trace.n_samples) if weight is None else weight,
                jacobian=rows[:n].T,
                gas=rows[n:].T,
                force=force[part],
                pressures=pressures[:, part].min(axis=1).astype(np.float64),
                stride=stride,
            )
        )
        counts = None if weight is None else logs[-1].thinned(trace, weight)
        found.add(trace, logs[-1], counts, known)
    wider = widening(_short_stretches(fit, logs, found.lags)) if is_short else 1.0
    return Linearisation(
        fit=fit,
        information=np.asarray(sum(found.information)),
        scores=np.asarray(wider * sum(found.covariances)),
        cycle_scores=wider * cycle_covariance(found.pieces, found.edges),
        gradient=np.asarray(sum(part.sum(axis=0) for part in found.pieces)),
        logs=tuple(logs),
        conditions=damper.conditions,
        supposed=np.asarray(sum(found.pulls)) if found.pulls else None,
        flaws=damper.flaws,
        precision=_precision(logs),
        pressed={name: max(one[name] for one in pressed) for name in pressed[0]},
    )


def _supposed(errors: FloatArray, rows: FloatArray, others: FloatArray | None) -> FloatArray | None:
    """What each supposition may put into the force, (k, m), the forms of the friction last."""
    if others is None:
        return errors[:, None] * rows if np.any(errors) else None
    return np.vstack([errors[:, None] * rows, others])


def _precision(logs: Sequence[LogLinearisation]) -> float:
    squares = sum(float(np.sum((log.weights * log.residuals) ** 2)) for log in logs)
    return sum(len(log.residuals) for log in logs) / max(squares, 1e-300)


@dataclass(slots=True, eq=False)
class _Sums:
    """What is summed over the logs of a setting, stretch by stretch."""

    information: list[FloatArray] = field(default_factory=list)
    pulls: list[FloatArray] = field(default_factory=list)
    covariances: list[FloatArray] = field(default_factory=list)
    lags: list[int] = field(default_factory=list)
    pieces: list[FloatArray] = field(default_factory=list)
    edges: list[FloatArray] = field(default_factory=list)

    def add(
        self,
        trace: Trace,
        log: LogLinearisation,
        weight: FloatArray | None,
        supposed: FloatArray | None,
    ) -> None:
        """Add a log with the weights of its rows; each row counts for as many samples.

        With the force, (k, m), that a standard error of what is merely supposed makes.
        """
        jacobian, stride = log.jacobian, log.stride
        residuals = log.thinned(trace, log.residuals)
        if weight is not None:
            jacobian, residuals = jacobian * weight[:, None], residuals * weight
        # Each row summed over the samples that it stands for.
        summed = jacobian if stride == 1 else jacobian * log.counts(trace)[:, None]
        self.information.append(summed.T @ jacobian)
        if supposed is not None:
            self.pulls.append(summed.T @ (supposed if weight is None else supposed * weight).T)
        scores = summed * residuals[:, None]
        for lag, covariance in _covariances(trace, log, jacobian, scores):
            self.lags.append(lag)
            self.covariances.append(covariance)
        for stretch, place in zip(trace.stretches, log.rows(trace), strict=True):
            self.pieces.append(scores[place])
            self.edges.append((stretch.cycle_starts - stretch.first) / stride)


def _seen(
    log: LogFit, parameters: Values, damper: Model, solver: SolverOptions, *, stride: int
) -> tuple[FloatArray, NDArray[np.floating[Any]], FloatArray]:
    """The model's force and pressures, and the sensitivities at every few compared samples, (k, m).

    What repeats has the mean cycle's sensitivities: they differ from those of the log by what the
    noise of the displacement does, and cost far less.
    """
    names = (*damper.names, *damper.conditions)
    trace, kept = log.trace, log.seen
    if kept is not None and kept.cycles and kept.is_of(parameters, trace, damper, solver):
        parts = []
        for cycle, stretch in zip(kept.cycles, trace.stretches, strict=True):
            response = simulate(
                parameters,
                damper,
                cycle.motion,
                sensitivities=names,
                options=cycle.solver(solver),
            )
            parts.append(
                cycle.slopes_over(stretch, response, middles(stretch.n_samples, stride)[0])
            )
        return kept.force, kept.pressures, parts[0] if len(parts) == 1 else np.hstack(parts)
    seen = compare(parameters, trace, damper, sensitivities=names, solver=solver)
    whole = _sensitivities(trace, seen)
    taken = [one.first + middles(one.n_samples, stride)[0] for one in trace.stretches]
    return seen.force, seen.response.pressures, whole[:, np.concatenate(taken)]


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


def _is_long(fit: Fit, traces: Sequence[Trace]) -> bool:
    """Whether the logs have so many independent samples that errors are hardly short."""
    independent = (
        independent_samples(trace.model_filter, stretch.n_samples)
        for trace in traces
        for stretch in trace.stretches
    )
    return is_enough(independent, len(_fitted(fit)))


def _fitted(fit: Fit) -> list[int]:
    """The columns of what the fit found."""
    fitted = {Status.FITTED, Status.NOT_IDENTIFIABLE}
    return [k for k, name in enumerate(fit.parameters.names) if fit.status[name] in fitted]


def _short_stretches(
    fit: Fit, logs: Sequence[LogLinearisation], lags: Sequence[int]
) -> list[ShortStretch]:
    """Return what each stretch gives to the parameters that the fit found."""
    columns = _fitted(fit)
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


def _covariances(
    trace: Trace, seen: LogLinearisation, weighted: FloatArray, scores: FloatArray
) -> Iterator[tuple[int, FloatArray]]:
    """Correlation length and covariance of the summed scores of each stretch.

    Nothing is correlated across a gap.
    """
    places = zip(trace.stretches, trace.places, seen.rows(trace), strict=True)
    for stretch, place, rows in places:
        period = 1.0 / stretch.frequency
        longest = _LONGEST_CORRELATION * period if stretch.n_cycles else _LONGEST_MOVING
        longest = round(longest / trace.interval)
        lag = correlation_length(seen.residuals[place], longest=longest)
        found = score_covariance(scores[rows], lag, stride=seen.stride)
        if not stretch.n_cycles:
            # Cycles repeat what a few samples tell; elsewhere those few may be all there is.
            residuals = seen.residuals[place] * seen.weights[place]
            found = larger(found, stationary_covariance(weighted[rows], residuals, lag))
        yield lag, found
