"""One law fitted to the logs of one setting, for comparing laws: short, and with a prediction.

It descends on the logs' settled cycles and ends, where asked, on the whole logs. What runs into an
edge of its plausible range stays there and is reported: a play or a lag that is not there goes to
nothing, and a law that has such a quantity has one too many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from damperfit.conditioning import TRANSIENTS, transients
from damperfit.errors import SimulationError
from damperfit.identification.fit_problem import LawMisfit
from damperfit.identification.log_facts import FEWEST_SAMPLES
from damperfit.identification.starts import COMPARING, best_of_starts
from damperfit.laws.missed import misses
from damperfit.simulation import SolverOptions

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from damperfit.damper.model import Model, Values
    from damperfit.identification.least_squares import Minimum
    from damperfit.recording import Trace
    from damperfit.tested.setting import Setting

    FloatArray = NDArray[np.float64]

__all__ = [
    "UNDETERMINED",
    "LawFit",
    "SettingLogs",
    "descended",
    "fit_at",
    "fit_law",
    "with_whole_friction",
]

# A standard error of this factor to both sides, and a quantity is not determined.
UNDETERMINED = 1.65
_AT_REST = "breakaway"


@dataclass(frozen=True, slots=True, eq=False)
class SettingLogs:
    """What one setting gives to compare laws by.

    Attributes
    ----------
    setting : Setting
        Adjuster setting.
    fitted, held_out : tuple of Trace
        Logs that are fitted, and those that are only predicted; without any, what moves beside the
        steady cycles of the fitted ones, if anything does.
    more_start : mapping of str to float
        A place more to start from, as far as a law has these quantities.
    fixed : mapping of str to float
        What is held, and where, in every law that has these quantities.
    """

    setting: Setting
    fitted: tuple[Trace, ...]
    held_out: tuple[Trace, ...] = ()
    more_start: Mapping[str, float] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Hold out run-up, coast-down and changes of speed where nothing else is."""
        if not self.held_out:
            beside = tuple(one for one in map(transients, self.fitted) if one is not None)
            object.__setattr__(self, "held_out", beside)

    @property
    def is_part(self) -> bool:
        """Whether what is predicted is the rest of the logs that are fitted."""
        names = {one.name for one in self.fitted}
        return all(one.name in names and not one.n_cycles for one in self.held_out)


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
        Eq. (22) over what is compared in what was held out; NaN without any.
    held_out : str
        What that was: "logs", "transients", or nothing.
    residuals : tuple of numpy.ndarray
        Model less measurement over each stretch, N.
    evaluations : int
        Simulations with sensitivities.
    undetermined : tuple of str
        What these logs do not determine: it may as well be `UNDETERMINED` times as much or as
        little.
    worst_force_percent : float
        100 times the force by which the model is off at the speed where it is off most, over the
        force there or a fifth of half the range.
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
    undetermined: tuple[str, ...] = ()
    worst_force_percent: float = math.nan


def fit_law(  # noqa: PLR0913 - what a search may ask of it
    model: Model,
    evidence: SettingLogs,
    *,
    freed: Sequence[str] = (),
    near: Values | None = None,
    fixed: Mapping[str, float] = MappingProxyType({}),
    solver: SolverOptions = SolverOptions(),
    is_whole: bool = True,
    hopeless_percent: float = math.inf,
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
    fixed : mapping of str to float
        What is held, and where, beside what has a default.
    solver : SolverOptions
        How exactly to integrate.
    is_whole : bool
        Whether the descent ends on the whole logs; else on their settled cycles, for comparing.
        What is said of the fit is of the whole logs in both cases.
    hopeless_percent : float
        MSE that a few evaluations must come below; a fit that does not is left where it is.

    Raises
    ------
    SimulationError
        The law cannot be simulated at any start.
    """
    held, misfit = _misfit(model, evidence, freed, solver, fixed)
    free, coarse = misfit.free, misfit.on_cycles()
    ended, spent = descended(coarse, near, held, evidence.more_start, hopeless_percent / 100.0)
    if is_whole:
        ended = misfit.descend(ended.extra, COMPARING)
        spent += ended.evaluations
    return fit_at(
        misfit,
        evidence,
        ended.extra,
        evaluations=spent,
        undetermined=_undetermined(
            ended, model, free, sum(len(one.stretches) for one in evidence.fitted)
        ),
    )


def fit_at(
    misfit: LawMisfit,
    evidence: SettingLogs,
    values: Values,
    *,
    evaluations: int,
    undetermined: tuple[str, ...] = (),
) -> LawFit:
    """Return what a law leaves at some values, of what was fitted and of what was held out.

    Parameters
    ----------
    misfit : LawMisfit
        The law, and what was free.
    evidence : SettingLogs
        The logs.
    values : Values
        Where a fit has ended.
    evaluations : int
        What it took.
    undetermined : tuple of str
        As of `LawFit`.

    Raises
    ------
    SimulationError
        The law cannot be simulated there.
    """
    model, free, solver = misfit.model, misfit.free, misfit.solver
    has_own_offsets = misfit.offset is not None
    missed = misses(model, values, evidence.fitted, solver, has_own_offsets=has_own_offsets)
    held_out, kind = math.nan, TRANSIENTS if evidence.is_part else "logs"
    try:
        if evidence.held_out:
            held_out = misses(
                model, values, evidence.held_out, solver,
                has_own_offsets=not evidence.is_part
                and any(model.quantity(name).is_offset for name in free),
            ).mse_percent  # fmt: skip
    except SimulationError:
        held_out = math.inf
    at_bound = tuple(name for name in free if misfit.is_at_edge(values, name))
    return LawFit(
        setting=evidence.setting,
        model=model,
        values=values,
        free=free,
        at_bound=at_bound,
        held_out_percent=held_out,
        held_out="" if math.isnan(held_out) else kind,
        evaluations=evaluations,
        undetermined=undetermined,
        **missed._asdict(),
    )


def with_whole_friction(near: Values, model: Model) -> Values:
    """Return values whose friction is all that they have at rest, where a law has no more there.

    Of the friction that slides next to nothing may be left beside it: what is nothing has no slope,
    and no descent leads back.

    Parameters
    ----------
    near : Values
        Of a law fitted before.
    model : Model
        The law.
    """
    if _AT_REST not in near.names or _AT_REST in model.names:
        return near
    name = next(one.name for one in near.quantities if one.is_friction)
    return near.replace({name: getattr(near, name) + getattr(near, _AT_REST)})


def _misfit(
    model: Model,
    evidence: SettingLogs,
    freed: Sequence[str],
    solver: SolverOptions,
    fixed: Mapping[str, float] = MappingProxyType({}),
) -> tuple[dict[str, float], LawMisfit]:
    """What is held, and the misfit of the rest."""
    held = {
        one.name: one.default
        for one in model.quantities
        if one.default is not None and one.name not in freed
    } | {name: one for name, one in {**evidence.fixed, **fixed}.items() if name in model.names}
    free = tuple(name for name in model.names if name not in held)
    return held, LawMisfit(model, evidence.fitted, free, solver)


def _beside(misfit: LawMisfit, near: Values) -> tuple[dict[str, float], dict[str, float]]:
    """What a law has of one fitted before, and the rest of it at next to nothing."""
    near = with_whole_friction(near, misfit.model)
    # What stands at nothing there was held: from there no descent would find it.
    known = {name: one for name, one in zip(near.names, near.numbers, strict=True) if one}
    shared = {name: known[name] for name in misfit.free if name in known}
    return shared, misfit.absent_beside(shared)


def descended(
    misfit: LawMisfit,
    near: Values | None,
    held: Mapping[str, float],
    more_start: Mapping[str, float],
    hopeless: float,
) -> tuple[Minimum[Values], int]:
    """Where the law's own starts, what was given and a law fitted before lead, and evaluations."""
    starts = misfit.model.start(misfit.traces, held)
    said = {name: more_start[name] for name in misfit.free if name in more_start}
    if said:
        # The valves as the loops show them beside the friction and the mounting that are known.
        beside = misfit.model.start(misfit.traces, {**held, **said})
        starts = (starts[0].replace(said), *beside, *starts)
    if near is None:
        ended = best_of_starts(misfit, starts)
        return ended, ended.evaluations
    shared, absent = _beside(misfit, near)
    inside = starts[0].replace(shared | absent)
    ended = best_of_starts(misfit, (starts[0].replace(shared), *starts), known=1, hopeless=hopeless)
    spent = ended.evaluations
    # A law that holds the other one fits no worse than that; if it does, a few evaluations told
    # its starts badly: it starts with a little of what is new, with more, and from the other law.
    others = (starts[0].replace(shared | _little(starts[0], absent)), starts[0].replace(shared))
    try:
        least = misfit.cost(inside) if absent else -math.inf
        for other in (*others, inside):
            if ended.cost <= least:
                break
            again = misfit.descend(other, COMPARING)
            spent += again.evaluations
            ended = min(ended, again, key=lambda one: one.cost)
    except SimulationError:
        pass
    return ended, spent


def _little(start: Values, absent: Mapping[str, float]) -> dict[str, float]:
    """Values half way, in logarithms, between where a part does nothing and where it starts."""
    return {name: math.sqrt(low * getattr(start, name)) for name, low in absent.items()}


def _undetermined(
    ended: Minimum[Values], model: Model, free: Sequence[str], n_stretches: int
) -> tuple[str, ...]:
    """Return the quantities whose logarithm has too large a standard error, to first order.

    What a law leaves over is not white: a stretch counts as `FEWEST_SAMPLES`, not as thousands.
    """
    lengths = np.sqrt(np.sum(ended.jacobian**2, axis=0))
    columns = ended.jacobian / np.maximum(lengths, 1e-300)
    # Of quantities that do the same an inverse may be negative by rounding; this is never below 0.
    sizes, ways = np.linalg.eigh(columns.T @ columns)
    spread = np.sum(ways**2 / (np.maximum(sizes, 0.0) + 1e-12), axis=1)
    variance = spread * ended.cost / (FEWEST_SAMPLES * n_stretches)
    errors = np.sqrt(variance) / np.maximum(lengths, 1e-300)
    return tuple(
        name
        for name, error in zip(free, errors.tolist(), strict=True)
        if model.quantity(name).is_logarithmic and error > math.log(UNDETERMINED)
    )
