"""A fit made linear at its end: what the logs of one setting say there about all parameters.

One more simulation of the setting, with every sensitivity; of its mean cycles alone, where it was
fitted on them. In u (ln y; an offset in N), with the residual r = f - f_hat in N and its Jacobian
J = d f_hat/du, both behind the filter, and the weights w of the stretches (1 where their noise is
alike)::

    information  H = J^T w^2 J    scores  g_t = w_t^2 J_t r_t

A fit of any subset of the parameters has, to first order, the error H_ff^-1 (sum g)_f. The
covariance of sum g has four terms, which `damperfit.uncertainty.covariance` carries to the
parameters of all settings: noise (`Linearisation.scores`), lack of fit that repeats (`misfit`),
what is held at a default that nobody has measured (`supposed`), and flaws that explain what repeats
(`flawed`).

Noise differs from cycle to cycle; what repeats does so in every one, and no number of cycles makes
it less. Had the test been another (other speeds, another stroke), it would weigh otherwise. How
much otherwise is seen inside the cycle: its blocks of phase pull the parameters to and fro, and
their pulls, which cancel at the minimum, are taken for independent::

    M = B/(B - k) sum over blocks of s_b s_b'        s_b = sum over the block of w^2 J r_repeating

A law that is not the damper's misses every log alike. Their pulls in the same block of phase are
therefore summed, over the logs and over the settings, before they are squared, too; the larger of
the two errors is given.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from damperfit.conditioning import apply_filter
from damperfit.damper.friction import other_turns, with_pressed_seal
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import SimulationError, sparing
from damperfit.identification.log_facts import weights
from damperfit.identification.outcome import Status
from damperfit.identification.simulated_log import compare
from damperfit.simulation import SolverOptions, simulate
from damperfit.uncertainty.correlation import (
    correlation_length,
    cycle_covariance,
    independent_samples,
    larger,
    score_covariance,
    stationary_covariance,
    sums_by_cycle,
    widening,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.errors import OnError
    from damperfit.identification import Campaign, Fit, LogFit, SimulatedLog
    from damperfit.recording import Stretch, Trace

    FloatArray = NDArray[np.float64]

# Blocks of a cycle whose pulls are taken for independent. Misfits behind a 30 Hz filter at 1.5 Hz
# have some 20 independent values.
_BLOCKS = 16
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
# Cycles, to tell a drift from scatter.
_SEEN_TO_DRIFT = 4
_SURE = 4.0  # standard errors
_FOUND = frozenset({Status.FITTED, Status.NOT_IDENTIFIABLE})


class LogLinearisation(NamedTuple):
    """One log at the fitted point, over its compared samples, n of them; SI."""

    residuals: FloatArray  # (n,), measured minus modelled force
    weights: FloatArray  # (n,), what the fit multiplied them by
    jacobian: FloatArray  # (n, k), of the modelled force by u, in the order of the model
    gas: FloatArray  # (n, c), by the logarithms of the model's conditions, such as gas pressure
    force: FloatArray  # (n,), modelled, behind the filter
    # Of each stretch velocity, and what the filter takes off the model's force there; of what
    # repeats in one cycle.
    rounding: tuple[tuple[FloatArray, FloatArray], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """The fit of one setting, made linear at its end; matrices are (k, k) in the model's order."""

    fit: Fit
    information: FloatArray  # H, N^2
    scores: FloatArray  # covariance of the summed scores, correlation allowed for, N^4
    cycle_scores: FloatArray  # the same from the scatter of whole cycles; NaN for a single one
    gradient: FloatArray  # (k,), sum of the scores
    logs: tuple[LogLinearisation, ...]
    conditions: tuple[str, ...] = ()  # of the columns of each log's `gas`
    # In place of `scores` what a misfit that repeats does; None where nothing repeats.
    misfit: FloatArray | None = None
    # What pulls in each block of phase, (B, k), all stretches summed; None likewise.
    repeating: FloatArray | None = None
    # Summed scores by what is held at a default that nobody has measured, each column for one
    # standard error of that, and by other forms of the friction; None where there is none.
    supposed: FloatArray | None = None
    flaws: tuple[str, ...] = ()  # which its residuals may be said to show
    precision: float = math.nan  # one over the mean square of the weighed residuals, 1/N^2
    # Highest pressure across each blow-off in the compared samples, Pa, by its opening's name.
    pressed: Mapping[str, float] = field(default_factory=dict)
    # Summed scores, (k,), by the flaws that its residuals do show, by name; of several that cannot
    # be told apart each by the root of its share in the doubt.
    flawed: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the rows and columns: the model's quantities, in its order."""
        return self.fit.parameters.names

    def places(self, names: Sequence[str]) -> NDArray[np.intp]:
        """Return the rows of some quantities."""
        return np.array([self.names.index(name) for name in names], dtype=np.intp)

    def stretches(self) -> Iterator[tuple[Stretch, FloatArray, FloatArray, FloatArray]]:
        """Yield each stretch with its residuals, squared weights and Jacobian."""
        for log, seen in zip(self.fit.logs, self.logs, strict=True):
            for stretch, place in zip(log.trace.stretches, log.trace.places, strict=True):
                squares = seen.weights[place] ** 2
                yield stretch, seen.residuals[place], squares, seen.jacobian[place]

    def summed(
        self, *, is_structured: bool, pulls: Mapping[str, FloatArray] = MappingProxyType({})
    ) -> Linearisation:
        """Return the same with what its misfit does, without curves, which fill the memory.

        `pulls`, (k,) each, are those of the flaws that explain it; structured is a residual of
        which more repeats than noise can explain.
        """
        flawed = {name: np.asarray(pull / math.sqrt(len(pulls))) for name, pull in pulls.items()}
        flawed["drift"] = _drift_pull(self)
        misfit, repeating = _misfit_scores(self) if is_structured else (None, None)
        return replace(self, logs=(), misfit=misfit, repeating=repeating, flawed=flawed)


def linearise_settings(
    campaign: Campaign,
    damper: Model,
    *,
    solver: SolverOptions = SolverOptions(tolerance=1e-2),
    on_error: OnError | None = None,
) -> tuple[Linearisation, ...]:
    """Linearise the fit of every setting, by rising setting; one simulation for each log.

    A setting that cannot be simulated at its fitted point is left out. So is one with another
    error, where ``on_error`` is there to be told of it.
    """
    found = []
    for fit in campaign.fits:
        with sparing(fit.setting, on_error), suppress(SimulationError):
            found.append(linearise_at_fit(fit, damper, solver=solver))
    return tuple(found)


def linearise_at_fit(
    fit: Fit, damper: Model, *, solver: SolverOptions = SolverOptions()
) -> Linearisation:
    """Take the derivative of a fit's logs by every parameter, on mean cycles where they repeat.

    A SimulationError: the model cannot be integrated.
    """
    values = fit.parameters
    own = [getattr(values, one.name) if one.is_logarithmic else 1.0 for one in values.quantities]
    scales = np.array([*own, *(getattr(damper, name) for name in damper.conditions)])
    n, errors = len(own), _ignorance(fit)
    information, covariance, gradient = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    supposed: FloatArray | None = None
    cycles: list[FloatArray] = []
    counted: list[tuple[int, float, int]] = []
    logs: list[LogLinearisation] = []
    pressed: dict[str, float] = {}
    squares = 0.0
    for log, weight in zip(fit.logs, weights([log.trace for log in fit.logs]), strict=True):
        trace, part = log.trace, log.trace.compared
        force, pressures, slopes, rounding = _simulated(log, values, damper, solver)
        others = _other_frictions(log, values, damper, solver, slopes)
        for name, here in _pressed_on(damper, pressures[:, part]).items():
            pressed[name] = max(here, pressed.get(name, here))
        own_weights = np.ones(trace.n_samples) if weight is None else weight
        residuals = trace.force[part] - force[part]
        squares += float(np.sum((own_weights * residuals) ** 2))
        by = [np.ascontiguousarray((rows * scales[:, None]).T) for rows in slopes]
        for k, (stretch, place) in enumerate(zip(trace.stretches, trace.places, strict=True)):
            jacobian, rest = by[k][:, :n], residuals[place]
            unknown = errors[:, None] * slopes[k][:n] if np.any(errors) or others else None
            if others is not None and unknown is not None:
                unknown = np.vstack([unknown, others[k]])
            if weight is not None:
                jacobian, rest = jacobian * weight[place, None], rest * weight[place]
                unknown = None if unknown is None else unknown * weight[place]
            if unknown is not None:
                pull = jacobian.T @ unknown.T
                supposed = pull if supposed is None else supposed + pull
            is_cyclic = bool(stretch.n_cycles)
            longest = _LONGEST_CORRELATION / stretch.frequency if is_cyclic else _LONGEST_MOVING
            lag = correlation_length(rest, longest=round(longest / trace.interval))
            scores = jacobian * rest[:, None]
            noise = score_covariance(scores, lag)
            if not is_cyclic:
                # Cycles repeat what a few samples tell; elsewhere those few may be all there is.
                noise = larger(noise, stationary_covariance(jacobian, rest, lag))
            information += jacobian.T @ jacobian
            covariance += noise
            gradient += scores.sum(axis=0)
            cycles.append(sums_by_cycle(scores, stretch.cycle_starts - stretch.first))
            counted.append((len(rest), independent_samples(trace.model_filter, len(rest)), lag))
        whole = np.vstack(by)
        logs.append(
            LogLinearisation(
                residuals=residuals,
                weights=own_weights,
                jacobian=whole[:, :n],
                gas=whole[:, n:],
                force=force[part],
                rounding=tuple(rounding),
            )
        )
    wider = widening(counted, sum(status in _FOUND for status in fit.status.values()))
    return Linearisation(
        fit=fit,
        information=information,
        scores=wider * covariance,
        cycle_scores=wider * cycle_covariance(cycles),
        gradient=gradient,
        logs=tuple(logs),
        conditions=damper.conditions,
        supposed=supposed,
        flaws=damper.flaws,
        precision=sum(size for size, *_ in counted) / max(squares, 1e-300),
        pressed=pressed,
    )


def _simulated(
    log: LogFit, values: Values, damper: Model, solver: SolverOptions
) -> tuple[
    FloatArray,
    NDArray[np.floating[Any]],
    list[FloatArray],
    list[tuple[FloatArray, FloatArray]],
]:
    """The model's force and pressures, the sensitivities of each stretch, (k, n), the `rounding`.

    What repeats has the mean cycle's sensitivities: they differ from those of the log by what the
    noise of the displacement does, and cost far less.
    """
    names = (*damper.names, *damper.conditions)
    trace, kept = log.trace, log.seen
    slopes: list[FloatArray] = []
    rounding: list[tuple[FloatArray, FloatArray]] = []
    if kept is not None and (cycles := log.cycles_of(values, damper, solver)):
        for cycle, stretch in zip(cycles, trace.stretches, strict=True):
            options = cycle.solver(solver)
            response = simulate(values, damper, cycle.motion, sensitivities=names, options=options)
            slopes.append(cycle.over(stretch, list(response.sensitivities.values())))
            taken = cycle.taken_by_filter(response.force)
            rounding.append((cycle.motion.velocity[-len(taken) :], taken))
        return kept.force, kept.pressures, slopes, rounding
    seen = compare(values, trace, damper, sensitivities=names, solver=solver)
    whole, taken = _sensitivities(trace, seen), seen.response.force - seen.force
    for stretch in trace.stretches:
        slopes.append(whole[:, stretch.window])
        rounding.append((trace.velocity[stretch.window], taken[stretch.window]))
    return seen.force, seen.response.pressures, slopes, rounding


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


def _pressed_on(damper: Model, pressures: NDArray[np.floating[Any]]) -> dict[str, float]:
    """Return the highest pressure across each preloaded passage, Pa, by the name of its opening.

    One that lifts gradually lets oil through below its opening, and has none.
    """
    network = getattr(
        damper.damper if isinstance(damper, WithTemperature) else damper, "network", None
    )
    most: dict[str, float] = {}
    for one in () if network is None else network.passages:
        if one.opening and not one.width:
            here = float((pressures[one.start - 1] - pressures[one.end - 1]).max())
            most[one.opening] = max(here, most.get(one.opening, 0.0))
    return most


# What a fit supposes and nobody has measured: defaults of the model, each by one standard error;
# the form in which friction turns; what the pressure on the seal adds to it.


def _ignorance(fit: Fit) -> FloatArray:
    """Return one standard error of what stands at a default that nobody has measured, (k,)."""
    values = fit.parameters
    errors = np.zeros(len(values.names))
    for place, one in enumerate(values.quantities):
        value = getattr(values, one.name)
        if fit.status[one.name] is Status.FIXED and value == one.default:
            errors[place] = one.ignorance * (1.0 if one.may_vanish else value)
    return errors


def _other_frictions(
    log: LogFit,
    values: Values,
    damper: Model,
    solver: SolverOptions,
    slopes: Sequence[FloatArray],
) -> list[FloatArray] | None:
    """Return what the force would be more with a friction of another form, (2, n) a stretch.

    One that turns otherwise; one that the pressure on the seal adds to, as large as the fitted one
    at the pressure of the gas at rest. None for a damper of which no other form is doubted.
    """
    turns, pressed = other_turns(damper, values), with_pressed_seal(damper, values)
    if not turns and pressed is None:
        return None
    cycles = log.cycles_of(values, damper, solver)

    def force(law: Model, at: Values) -> list[FloatArray]:
        if not cycles:
            whole = compare(at, log.trace, law, solver=solver).force
            return [whole[stretch.window] for stretch in log.trace.stretches]
        found = []
        for cycle, stretch in zip(cycles, log.trace.stretches, strict=True):
            response = simulate(at, law, cycle.motion, options=cycle.solver(solver))
            found.append(cycle.over(stretch, [response.force])[0])
        return found

    here = force(damper, values)
    more = [np.zeros((2, len(of))) for of in here]
    for share, law, at in turns:
        for into, there in zip(more, force(law, at), strict=True):
            into[0] += share * there
    if turns:
        for into, now in zip(more, here, strict=True):
            into[0] -= now
    if pressed is not None:
        own = next(place for place, one in enumerate(values.quantities) if one.is_friction)
        at_rest = pressed[1].seal_area * values.gas_pressure
        for into, there, now, rows in zip(more, force(*pressed), here, slopes, strict=True):
            into[1] = there - now - at_rest * rows[own]
    return more


# What a misfit, and a zero that drifts, do to the summed scores


def _misfit_scores(linearised: Linearisation) -> tuple[FloatArray, FloatArray]:
    """The matrix M of a setting's repeating misfit, and its pulls; see the module's docstring."""
    pulls: list[FloatArray] = []
    for stretch, residuals, squares, jacobian in linearised.stretches():
        block, repeating = _blocks(stretch, residuals)
        scores = jacobian * (squares * repeating)[:, None]
        pulls.extend(scores[block == k].sum(axis=0) for k in range(_BLOCKS))
    table = np.array(pulls)
    few = len(table) / max(len(table) - len(linearised.names), 1)
    by_phase = table.reshape(-1, _BLOCKS, table.shape[1]).sum(axis=0)
    return np.asarray(few * table.T @ table), np.asarray(math.sqrt(few) * by_phase)


def _blocks(stretch: Stretch, residuals: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the block of each sample, and the residual without what differs between cycles."""
    n = len(residuals)
    if stretch.n_cycles < 2:
        return np.arange(n) * _BLOCKS // n, residuals
    starts = stretch.cycle_starts - stretch.first
    phase = np.interp(np.arange(n), starts, np.arange(len(starts))) % 1.0
    n_bins = max(_BLOCKS, round(float(np.mean(np.diff(starts)))))
    bins = np.minimum((phase * n_bins).astype(np.int64), n_bins - 1)
    counts = np.maximum(np.bincount(bins, minlength=n_bins), 1)
    mean = np.bincount(bins, weights=residuals, minlength=n_bins) / counts
    return bins * _BLOCKS // n_bins, mean[bins]


def _drift_pull(linearised: Linearisation) -> FloatArray:
    """Summed scores by a zero that moves: as much as a log drifts by may be in its mean force."""
    pull = np.zeros(len(linearised.names))
    for stretch, residuals, squares, jacobian in linearised.stretches():
        if stretch.n_cycles < _SEEN_TO_DRIFT:
            continue
        starts = np.rint(stretch.cycle_starts - stretch.first).astype(np.intp)
        starts = np.clip(starts, 0, len(residuals))
        sums = np.add.reduceat(residuals[: starts[-1]], starts[:-1])
        phase = np.linspace(-0.5, 0.5, len(sums))
        means = sums / np.diff(starts)
        drift = float(phase @ means / (phase @ phase))
        rest = means - means.mean() - drift * phase
        error = math.sqrt(float(rest @ rest / (phase @ phase)) / (len(means) - 2))
        if abs(drift) > _SURE * error:
            pull += drift * (jacobian.T @ squares)
    return pull
