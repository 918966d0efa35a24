"""A structure fitted at settings, for comparing: what it misses and predicts, what was tried."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.conditioning.segments import TRANSIENTS, transients
from damperfit.damper.model import Model, Values
from damperfit.damper.rivals import RIVALS, Biviscous, BoucWen, Kwok, RestoringForceSurface, Rival
from damperfit.errors import SimulationError
from damperfit.identification.fit_problem import Block, is_at_edge
from damperfit.identification.fit_setting import COMPARING, best_of_starts
from damperfit.identification.joint import ENOUGH_PERCENT
from damperfit.identification.least_squares import Minimum, inverse_information
from damperfit.identification.logs import FEWEST_SAMPLES, compare, normalised_mse
from damperfit.identification.sharing import Unknown
from damperfit.recording import Trace
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting
from damperfit.workers import executor

# What a law misses of logs.


def _misses(
    model: Model,
    values: Values,
    traces: Sequence[Trace],
    solver: SolverOptions,
    *,
    has_own_offsets: bool = False,
) -> tuple[list[FloatArray], list[float], float]:
    """Residuals of each segment, N, less the offset of a log that is tared anew; their MSEs."""
    residuals, alone, measured = [], [], []
    for trace in traces:
        force = compare(values, trace, model, solver=solver).force
        if has_own_offsets:
            force = force + float(np.mean((trace.force - force)[trace.compared]))
        for segment in trace.segments:
            part = segment.window
            residuals.append(force[part] - trace.force[part])
            alone.append(normalised_mse(trace.force[part], force[part]))
            measured.append(trace.force[part])
    together, rest = np.concatenate(measured), np.concatenate(residuals)
    return residuals, alone, normalised_mse(together, together + rest)


# A standard error of this factor to both sides, and a quantity is not determined.
UNDETERMINED = 1.65


@dataclass(frozen=True, slots=True, eq=False)
class SettingLogs:
    """The logs of one setting, by which structures are compared."""

    setting: Setting
    fitted: tuple[Trace, ...]
    # Only predicted; without any, what moves beside the steady cycles of the fitted ones.
    held_out: tuple[Trace, ...] = ()
    # One more start, and what is held, as far as a structure has these quantities.
    more_start: Mapping[str, float] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Hold out run-up, coast-down and changes of speed where nothing else is."""
        if not self.held_out:
            beside = tuple(trace for trace in map(transients, self.fitted) if trace is not None)
            object.__setattr__(self, "held_out", beside)

    @property
    def is_part(self) -> bool:
        """Whether what is predicted is the rest of the logs that are fitted."""
        names = {trace.name for trace in self.fitted}
        return all(trace.name in names and not trace.n_cycles for trace in self.held_out)


def most_unlike(evidence: Sequence[SettingLogs], most: int = 2) -> list[Setting]:
    """Return settings to compare at: weakest and strongest force, and some between them."""

    def strength(logs: SettingLogs) -> float:
        return float(np.std(np.concatenate([log.force[log.compared] for log in logs.fitted])))

    ranked = sorted(evidence, key=strength)
    places = np.linspace(0, len(ranked) - 1, min(most, len(ranked))).round().astype(int)
    return sorted(ranked[place].setting for place in places)


@dataclass(frozen=True, slots=True, eq=False)
class LawFit:
    """A structure at the logs of one setting."""

    setting: Setting
    model: Model
    values: Values
    free: tuple[str, ...]
    at_bound: tuple[str, ...]
    mse_percent: float  # eq. (22) over all that is compared in the fitted logs
    segment_mses: tuple[float, ...]  # of each of their segments alone
    held_out_percent: float  # of what was held out; NaN without any
    held_out: str  # what that was: "logs", "transients", or nothing
    residuals: tuple[FloatArray, ...]  # model less measurement over each segment, N
    evaluations: int  # simulations with sensitivities
    undetermined: tuple[str, ...] = ()  # `UNDETERMINED` times as much or as little would do


def fit_law(
    model: Model,
    evidence: SettingLogs,
    *,
    freed: Sequence[str] = (),
    near: Values | None = None,
    solver: SolverOptions = SolverOptions(),
    is_whole: bool = True,
) -> LawFit:
    """Fit a model to the logs of a setting and predict those that were held out.

    What has a default is held there unless it is freed; `near` is a start more. The fit ends on
    the whole logs, or on their mean cycles, for comparing. A model that cannot be simulated at any
    start is a `SimulationError`.
    """
    held = {
        quantity.name: quantity.default
        for quantity in model.quantities
        if quantity.default is not None and quantity.name not in freed
    } | {name: x for name, x in evidence.fixed.items() if name in model.names}
    free = tuple(name for name in model.names if name not in held)
    misfit = Block(model, evidence.fitted, free, solver, is_candidate=True)
    minimum = descended(misfit.on_cycles(), held, evidence.more_start, near)
    evaluations = minimum.evaluations
    if is_whole:
        minimum = misfit.descend(minimum.extra, COMPARING)
        evaluations += minimum.evaluations
    known = undetermined(minimum, [misfit], [Unknown(name) for name in free])
    return fit_at(misfit, evidence, minimum.extra, evaluations=evaluations, undetermined=known)


def fit_at(
    misfit: Block,
    evidence: SettingLogs,
    values: Values,
    *,
    evaluations: int,
    undetermined: Sequence[Unknown],
) -> LawFit:
    """Misfit of a model at given values, to the fitted logs and to those held out."""
    model, free, solver = misfit.model, misfit.free, misfit.solver
    has_own_offsets = misfit.offset is not None
    residuals, alone, mse = _misses(
        model, values, evidence.fitted, solver, has_own_offsets=has_own_offsets
    )
    held_out, kind = math.nan, TRANSIENTS if evidence.is_part else "logs"
    try:
        if evidence.held_out:
            is_tared = not evidence.is_part and any(model.quantity(n).is_offset for n in free)
            of_held_out = model, values, evidence.held_out, solver
            held_out = _misses(*of_held_out, has_own_offsets=is_tared)[-1]
    except SimulationError:
        held_out = math.inf
    at_bound = tuple(name for name in free if is_at_edge(values, name))
    return LawFit(
        setting=evidence.setting,
        model=model,
        values=values,
        free=free,
        at_bound=at_bound,
        mse_percent=mse,
        segment_mses=tuple(alone),
        held_out_percent=held_out,
        held_out="" if math.isnan(held_out) else kind,
        residuals=tuple(residuals),
        evaluations=evaluations,
        undetermined=tuple(u.name for u in undetermined if u.holds_at(evidence.setting)),
    )


def descended(
    misfit: Block,
    held: Mapping[str, float],
    more_start: Mapping[str, float],
    near: Values | None = None,
) -> Minimum[Values]:
    """Minima from the law's own starts, given values and fits of the same law."""
    starts = misfit.model.start(misfit.traces, held)
    given = {name: more_start[name] for name in misfit.free if name in more_start}
    if given:
        # The valves as the loops show them beside the friction and the mounting that are known.
        beside = misfit.model.start(misfit.traces, {**held, **given})
        starts = (starts[0].replace(given), *beside, *starts)
    if near is None:
        return best_of_starts(misfit, starts)
    known = {name: getattr(near, name) for name in misfit.free if name in near.names}
    return best_of_starts(misfit, (starts[0].replace(known), *starts), known=1)


def undetermined(
    minimum: Minimum[Any], blocks: Iterable[Block], unknowns: Sequence[Unknown]
) -> tuple[Unknown, ...]:
    """Return the unknowns of a fit whose logarithm has too large a standard error, to first order.

    What a law leaves over is not white: a segment counts as `FEWEST_SAMPLES`, not as thousands.
    """
    blocks = list(blocks)
    n = FEWEST_SAMPLES * sum(len(trace.segments) for block in blocks for trace in block.traces)
    errors = np.sqrt(np.diag(inverse_information(minimum.system.triangle)) * (minimum.cost / n))
    return tuple(
        unknown
        for unknown, error in zip(unknowns, errors.tolist(), strict=True)
        if blocks[0].model.quantity(unknown.name).is_logarithmic and error > math.log(UNDETERMINED)
    )


# A structure with its fits at several settings, and how well it fits and predicts.

GAIN = 1.5
# A law whose MSE is below that may still predict another speed badly.
ENOUGH_HELD_OUT_PERCENT = 0.2
# Two layouts whose MSE, times that of what was held out, differ by less count as equal.
SEEN_APART = 1.5
# The same where the worse of them leaves and mispredicts nothing that anyone would use: twice each.
_NOTHING_APART = 4.0
_NOTHING_PREDICTED = 100.0  # per cent: a law that predicts nothing, or cannot be simulated there


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A structure with its fits, one a setting that is compared."""

    title: str
    fits: tuple[LawFit, ...]

    @property
    def mse_percent(self) -> float:
        """Geometric mean over the settings of eq. (22)."""
        return _mean([fit.mse_percent for fit in self.fits])

    @property
    def held_out_percent(self) -> float:
        """Likewise of what was predicted; NaN without any."""
        known = [x.held_out_percent for x in self.fits if not math.isnan(x.held_out_percent)]
        return _mean(known) if known else math.nan

    @property
    def left_over(self) -> float:
        """Its misfit over what is enough: MSE, a held-out log."""
        logs = [fit.held_out_percent for fit in self.fits if fit.held_out == "logs"]
        known = [percent / ENOUGH_HELD_OUT_PERCENT for percent in logs if not math.isnan(percent)]
        return max([self.mse_percent / ENOUGH_PERCENT, *known])

    @property
    def leaves_something(self) -> bool:
        """Whether it leaves enough for a larger law to be looked for."""
        return self.left_over > 1.0

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Quantities at a bound in every setting."""
        names = set(self.fits[0].at_bound).intersection(*(fit.at_bound for fit in self.fits[1:]))
        return tuple(name for name in self.fits[0].free if name in names)

    @property
    def freed(self) -> tuple[str, ...]:
        """Quantities that are free although the model has a default."""
        first = self.fits[0]
        return tuple(name for name in first.free if first.model.quantity(name).default is not None)

    @property
    def score(self) -> float:
        """How well it fits and predicts at once; lower is better."""
        held = self.held_out_percent
        # Where no law can be simulated on what was held out, the fit alone ranks them.
        known = 1.0 if math.isnan(held) else min(held, _NOTHING_PREDICTED)
        return math.log(self.mse_percent) + math.log(known)


def times_worse(best: Candidate, other: Candidate) -> float:
    """Return how many times worse a law fits and predicts than another."""
    return math.exp(other.score - best.score)


def are_alike(best: Candidate, other: Candidate) -> bool:
    """Whether what the same parts fit and predict in two layouts is no reason to choose one."""
    held = other.held_out_percent
    left = max(other.mse_percent, 0.0 if math.isnan(held) else held)
    return times_worse(best, other) < (SEEN_APART if left > ENOUGH_PERCENT else _NOTHING_APART)


def _mean(values: Sequence[float]) -> float:
    return math.exp(float(np.mean([math.log(max(value, 1e-12)) for value in values])))


# What a search has tried, law by law, and the one that it took.


@dataclass(frozen=True, slots=True, eq=False)
class ComparedCandidate:
    """One structure that was tried, beside another."""

    candidate: Candidate
    is_taken: bool  # whether it was the one to go on from
    reason: str  # why, or why not
    bic: float = math.nan  # positive where it is for the larger of the two; NaN for none
    change: str = ""  # what it has more or less than the other, in words
    gain: float = math.nan  # MSE of the smaller over that of the larger; NaN for none


class Exchange(NamedTuple):
    """A structure that fits about as well as the chosen one, one part in place of another."""

    part: str
    instead: str
    times: float  # its MSE over that of the chosen structure
    values: Mapping[Setting, Values]


@dataclass(frozen=True, slots=True, eq=False)
class LawSearch:
    """All structures tried, in their order, and the one to take."""

    laws: tuple[ComparedCandidate, ...]
    chosen: Candidate
    n_eff: float  # effective samples of all settings compared
    alike: tuple[str, ...] = ()  # layouts that fit and predict hardly worse than the one taken
    # Of their force that the logs hold down to a tenth of the speed, where they yield before they
    # slide; NaN where they do not.
    held_share: float = math.nan
    also: str = ""  # what yields and fits about as well as the valves that were taken
    is_of_one_model: bool = False  # taken at all settings together: what they share is equal
    is_held_by_some: bool = False  # some settings hold that share, others do not yield
    doubt: str = ""  # what of the valves that were taken no damper has, where logs yield
    # By log, N: its force beside the mean of its setting's, whose offset is fitted.
    offsets: Mapping[str, float] = field(default_factory=dict)
    # Adjusters that what is free follows; what is not named has one value.
    follows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    exchanges: tuple[Exchange, ...] = ()
    # Deviation of the logarithms over the structures that are about as likely.
    spread: Mapping[Setting, Mapping[str, float]] = field(default_factory=dict)


# What is no candidate of the search: models of the literature, and those that yield.


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
