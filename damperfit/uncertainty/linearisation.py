"""A fit made linear at its end: what the logs of one setting say there about all parameters.

One more simulation of the setting, with every sensitivity; of its mean cycles alone, where it was
fitted on them. In u (ln y; an offset in N), with the residual r = f - f_hat in N and its Jacobian
J = d f_hat/du, both behind the filter, and the weights w of the stretches (1 where their noise is
alike)::

    information  H = J^T w^2 J    scores  g_t = w_t^2 J_t r_t    M = covariance of sum g_t

A fit of any subset of the parameters has, to first order, the error H_ff^-1 (sum g)_f.

All of it lies behind the filter, whose band takes a few samples of a log that is sampled at 1 kHz:
where cycles repeat, sums are those over some phases of each (`damperfit.uncertainty.rows`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.identification.log_facts import all_alike, weights
from damperfit.identification.outcome import Status
from damperfit.identification.simulated_log import compare
from damperfit.simulation import SolverOptions, simulate
from damperfit.uncertainty.correlated_noise import cycle_covariance
from damperfit.uncertainty.few_samples import (
    ShortStretch,
    filter_correlation,
    independent_samples,
    is_enough,
    widening,
)
from damperfit.uncertainty.rows import EverySample, Phases, phases_of
from damperfit.uncertainty.score_sums import ScoreSums, Slopes
from damperfit.uncertainty.suppositions import ignorance, other_frictions
from damperfit.uncertainty.unopened import pressed_on

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification import Fit, LogFit, SimulatedLog
    from damperfit.identification.mean_cycle import SettledCycle
    from damperfit.recording import Trace

    FloatArray = NDArray[np.float64]

__all__ = ["Linearisation", "LogLinearisation", "linearise_at_fit"]

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
    slopes : tuple of Slopes
        Of each stretch.
    force : numpy.ndarray
        Shape (n,), modelled force behind the filter, N.
    pressures : numpy.ndarray
        Shape (3,), lowest absolute pressure of each chamber, Pa.
    rounding : tuple of (numpy.ndarray, numpy.ndarray)
        Of each stretch velocity, m/s, and what the filter takes off the model's force there, N;
        of what repeats in one cycle.
    """

    residuals: FloatArray
    weights: FloatArray
    slopes: tuple[Slopes, ...]
    force: FloatArray
    pressures: FloatArray
    rounding: tuple[tuple[FloatArray, FloatArray], ...] = ()

    @property
    def jacobian(self) -> FloatArray:
        """Shape (m, k): derivatives by u, a row for each of all rows of all cycles."""
        return np.vstack([np.tile(one.by, (one.rows.n_cycles, 1)) for one in self.slopes])

    @property
    def gas(self) -> FloatArray:
        """Shape (m, c): those by the conditions."""
        return np.vstack([np.tile(one.gas, (one.rows.n_cycles, 1)) for one in self.slopes])

    @property
    def samples(self) -> FloatArray:
        """Shape (m,): how many samples each row stands for."""
        return np.concatenate(
            [np.full(one.residuals.size, one.rows.spacing) for one in self.slopes]
        )

    def read(self, values: FloatArray) -> FloatArray:
        """Return what belongs to the rows of `jacobian` of values at the compared samples."""
        return np.concatenate([one.read(values).ravel() for one in self.slopes])


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
    scales = np.array([*own, *(getattr(damper, name) for name in damper.conditions)])
    n = len(own)
    errors = ignorance(fit)
    traces = [log.trace for log in fit.logs]
    is_short = not _is_long(fit, traces)
    sums = ScoreSums()
    logs: list[LogLinearisation] = []
    pressed: list[dict[str, float]] = []
    for log, weight in zip(fit.logs, weights(traces), strict=True):
        trace, part = log.trace, log.trace.compared
        cycles = log.cycles_of(values, damper, solver)
        rows = _rows(log, weight, () if is_short else cycles)
        force, pressures, seen, rounding = _seen(log, rows, values, damper, solver)
        others = other_frictions(log, values, damper, solver=solver, rows=rows, slopes=seen)
        pressed.append(pressed_on(damper, pressures[:, part]))
        residuals, slopes = trace.force[part] - force[part], []
        places = zip(rows, trace.places, seen, strict=True)
        for where, place, of in places:
            scaled = np.ascontiguousarray((of * scales[:, None]).T)
            by = np.ascontiguousarray(scaled[:, :n])
            slopes.append(Slopes(where, place, by, scaled[:, n:], where.read(residuals[place])))
        for one, of, other in zip(slopes, seen, others, strict=True):
            sums.add(trace, one, weight, _supposed(errors, of[:n], other))
        logs.append(
            LogLinearisation(
                residuals=residuals,
                weights=all_alike(trace.n_samples) if weight is None else weight,
                slopes=tuple(slopes),
                force=force[part],
                pressures=pressures[:, part].min(axis=1).astype(np.float64),
                rounding=tuple(rounding),
            )
        )
    wider = widening(_short_stretches(fit, logs, sums.lags)) if is_short else 1.0
    return Linearisation(
        fit=fit,
        information=np.asarray(sum(sums.information)),
        scores=np.asarray(wider * sum(sums.covariances)),
        cycle_scores=wider * cycle_covariance(sums.cycles),
        gradient=np.asarray(sum(sums.gradients)),
        logs=tuple(logs),
        conditions=damper.conditions,
        supposed=np.asarray(sum(sums.pulls)) if sums.pulls else None,
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


def _rows(
    log: LogFit, weight: FloatArray | None, cycles: Sequence[SettledCycle]
) -> list[EverySample | Phases]:
    """Where the derivatives of each stretch of a log are taken."""
    trace, kept = log.trace, log.seen
    if kept is None or not cycles:
        return [EverySample(stretch) for stretch in trace.stretches]
    return [
        phases_of(
            trace,
            stretch,
            cycle,
            weight=None if weight is None else weight[place],
            residuals=trace.force[stretch.window] - kept.force[stretch.window],
        )
        for cycle, stretch, place in zip(cycles, trace.stretches, trace.places, strict=True)
    ]


def _seen(
    log: LogFit,
    rows: Sequence[EverySample | Phases],
    parameters: Values,
    damper: Model,
    solver: SolverOptions,
) -> tuple[
    FloatArray,
    NDArray[np.floating[Any]],
    list[FloatArray],
    list[tuple[FloatArray, FloatArray]],
]:
    """The model's force and pressures, the sensitivities at rows, (k, m), and the `rounding`.

    What repeats has the mean cycle's sensitivities: they differ from those of the log by what the
    noise of the displacement does, and cost far less.
    """
    names = (*damper.names, *damper.conditions)
    trace, kept = log.trace, log.seen
    if kept is not None and (cycles := log.cycles_of(parameters, damper, solver)):
        parts, rounding = [], []
        for cycle, where in zip(cycles, rows, strict=True):
            response = simulate(
                parameters,
                damper,
                cycle.motion,
                sensitivities=names,
                options=cycle.solver(solver),
            )
            parts.append(where.seen(cycle, list(response.sensitivities.values())))
            taken = cycle.taken_by_filter(response.force)
            rounding.append((cycle.motion.velocity[-len(taken) :], taken))
        return kept.force, kept.pressures, parts, rounding
    seen = compare(parameters, trace, damper, sensitivities=names, solver=solver)
    whole = _sensitivities(trace, seen)
    parts = [whole[:, stretch.window] for stretch in trace.stretches]
    taken = seen.response.force - seen.force
    windows = [stretch.window for stretch in trace.stretches]
    rounding = [(trace.velocity[one], taken[one]) for one in windows]
    return seen.force, seen.response.pressures, parts, rounding


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
    stretches = [
        (log.trace, seen, slopes)
        for log, seen in zip(fit.logs, logs, strict=True)
        for slopes in seen.slopes
    ]
    return [
        ShortStretch(
            slopes.by[:, columns] * seen.weights[slopes.place, None],
            filter_correlation(trace.model_filter, slopes.rows.stretch.n_samples),
            lag,
        )
        for (trace, seen, slopes), lag in zip(stretches, lags, strict=True)
    ]
