"""Which structure the logs support: one search over one fit of all settings.

    1  the paper's model, setting by setting; it is taken where it leaves less than
       `ENOUGH_PERCENT`
    2  bleed and blow-off in each stroke on everything that a mounting may have, in each layout,
       from each setting's own loops and from each other's; then all settings in one fit, with one
       value for what is the damper's or the rig's
    3  from the best layout on, moves of one part (`structures.moves`): each is started from the
       structure at hand and from the loops, screened in a few evaluations, the best four are
       followed to their minimum, and the best by the criterion is taken, until none is better
    4  the parts in the other layouts; models that yield, where the logs do (before the moves, too:
       where these fit far better there are none); the paper's model again

The criterion of a structure at all settings together, of logs with MSE m and
held-out MSE h (per cent of the variance)::

    C = sum over settings of n ln(m + m_0) + n_h ln(h + h_0)  +  sum over numbers of ln(n_k) + 2 p

n is the effective number of samples of what the largest structure leaves (`effective_samples`), n_k
that of all settings that a number is in, m_0
a misfit below which laws count as equal, h_0 the same of a prediction, p the number of parts that
a damper or its rig may well be without. A friction that seals hardly have costs a little, too, and
so does a default that is freed and runs far away.

What is neither the damper's nor the rig's is each setting's own, until the logs bear out that it
follows one adjuster, or none (`_Linear`): before parts are removed, for they may be worth their
numbers where these are fewer.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.damper.model import Model, Values
from damperfit.damper.valve_dampers import ValveDamper, ValveReading, read_loops
from damperfit.errors import SimulationError
from damperfit.identification.blas_threads import one_blas_thread
from damperfit.identification.fit_problem import (
    BELIEVED_FRICTION,
    FRICTION_SPREAD,
    Block,
    Point,
)
from damperfit.identification.fit_setting import spread_starts
from damperfit.identification.least_squares import (
    Minimum,
    Quadratic,
    Stopping,
    inverse_information,
)
from damperfit.identification.logs import compare, effective_samples
from damperfit.identification.sharing import Follows, Unknown, one_by_one, unknown_at
from damperfit.laws.law_fit import (
    GAIN,
    SEEN_APART,
    Candidate,
    Exchange,
    JudgedLaw,
    LawFit,
    LawSearch,
    SettingLogs,
    are_alike,
    descended,
    fit_at,
    fit_law,
    times_worse,
    undetermined,
)
from damperfit.laws.one_model import OneModel
from damperfit.laws.rivals import YIELDING, held_against, is_open_to, unbelievable
from damperfit.laws.structures import (
    BOTH,
    STROKES,
    Structure,
    everything,
    exchanges,
    in_words,
    moves,
    times_in,
    with_part,
)
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting, nearest_setting
from damperfit.workers import executor

# Per cent of the variance: misfits below count as equal, whatever the number of samples.
FLOOR_PERCENT = 0.0003
# The same of what was held out, which counts as so many effective samples a setting.
_HELD_FLOOR_PERCENT, _HELD_SAMPLES = 0.05, 10.0
# What a part costs, beside its numbers, that a damper or rig may well be without: where it does as
# well as a number that every damper has (oil, returns), that number is off.
_NEEDLESS = 2.0
# What a default that was freed may lie away from it for nothing, in units of what is known of it.
_FREED = 2.0
# The most that a friction costs which seals hardly have.
_MOST_UNBELIEVED = 9.0
# Settings that moves are screened at; the chosen structure is fitted at all.
_MOST_COMPARED = 5
# Candidates that are followed to their minimum after each screening.
_FOLLOWED = 4
# A screened candidate may promise so much more misfit, in logarithms, than would be a gain.
_MARGIN = 0.05
# One that promised so many times that to be worse is not screened again.
_HOPELESS = 4.0
# Candidates that are looked at beside all settings, of those that two settings show.
_LOOKED_AT = 8
_ROUNDS = 20
# Beside the best a structure with less than so much of its weight, exp(-C/2), moves no interval.
_UNLIKELY = 0.01
# Largest standard error, of its logarithm, of a value that can speak for or against a tie.
_DETERMINED = 0.3
# Numbers that a blow-off has beside its opening and slope: one for all settings until the logs ask.
_OF_STACK = {"port", "width", "power"}
_STEP = 1e-8
_GLANCE = Stopping(cost_tolerance=2e-2, step_tolerance=_STEP, max_evaluations=4, rest=math.inf)
_LOOK = _GLANCE._replace(max_evaluations=10)
_ONE = Stopping(max_evaluations=1)
# Of the directions of a linearised problem: shorter ones promise nothing.
_NO_LENGTH = 1e-6
_END = Stopping(cost_tolerance=1e-3, step_tolerance=_STEP, max_evaluations=40, rest=math.inf)
# The first fit of a layout that did so many times worse is not followed up.
_FAR_WORSE = 8.0
# Two predictions this near each other differ by noise.
_NO_WORSE = 1.1


@dataclass(frozen=True, eq=False)
class _Fit:
    """A structure at the minimum of one fit of several settings."""

    structure: Structure
    model: OneModel
    minimum: Minimum[Point]
    began: str = ""  # which of its starts beside another structure led here

    @property
    def values(self) -> Mapping[Setting, Values]:
        return self.minimum.extra.values

    @cached_property
    def promised(self) -> float:
        """The cost at the minimum of the linearised problem: what a minimisation may come to."""
        return max(self.minimum.cost - self.minimum.promised(_NO_LENGTH), 0.0)

    @cached_property
    def percent(self) -> dict[Setting, float]:
        """MSE of each setting on its mean cycles."""
        return {s: 100.0 * block.cost(self.values[s]) for s, block in self.model.blocks.items()}

    def above_floor(self, cost: float) -> float:
        """The logarithm of another cost over its own, each with the floor of the criterion."""
        here = self.minimum.cost
        floor = here * float(np.mean([FLOOR_PERCENT / max(x, 1e-9) for x in self.percent.values()]))
        return math.log((cost + floor) / (here + floor))


class _Search:
    """The logs, and what has been tried."""

    def __init__(
        self,
        evidence: Sequence[SettingLogs],
        follows: Callable[[Model, Sequence[str]], Follows],
        solver: SolverOptions,
        on_law: Callable[[JudgedLaw], None],
        n_starts: int,
        jobs: int,
    ) -> None:
        self.n_starts = n_starts
        self.alike: tuple[str, ...] = ()
        self.fits_alike: list[_Fit] = []
        self.first_layouts: dict[str, float] = {}
        self.held_share, self.is_held_by_some = math.nan, False
        self.also, self.doubt, self.may_tie = "", "", False
        self.evidence = {x.setting: x for x in sorted(evidence, key=lambda logs: logs.setting)}
        self.follows, self.solver, self.on_law, self.jobs = follows, solver, on_law, jobs
        self.compared = self.most_unlike(self.evidence, _MOST_COMPARED)
        self.n_eff: dict[Setting, float] = {}
        self.laws: list[JudgedLaw] = []
        self._starts: dict[tuple[Structure, Setting], Values] = {}
        self._readings: dict[tuple[object, ...], list[ValveReading]] = {}
        self._misfits: dict[Setting, Block] = {}
        self._yielding: list[Candidate] | None = None
        self._judged: dict[int, tuple[_Fit, Candidate]] = {}
        self.ends: list[_Fit] = []
        self.spread: dict[Setting, dict[str, float]] = {}

    def most_unlike(self, settings: Iterable[Setting], most: int = 2) -> list[Setting]:
        """Settings to compare at: the weakest and the strongest force, and some between them."""

        def strength(setting: Setting) -> float:
            logs = self.evidence[setting].fitted
            return float(np.std(np.concatenate([trace.force[trace.compared] for trace in logs])))

        ranked = sorted(settings, key=strength)
        places = np.linspace(0, len(ranked) - 1, min(most, len(ranked))).round().astype(int)
        return sorted(ranked[place] for place in places)

    # fits

    def model(self, structure: Structure, settings: Sequence[Setting]) -> OneModel:
        """The fit of a structure at some settings, with what they have in common."""
        held = {*structure.held}
        misfits = {}
        for setting in settings:
            logs = self.evidence[setting]
            fixed = {*logs.fixed}
            free = tuple(n for n in structure.damper.names if n not in held and n not in fixed)
            if setting not in self._misfits:
                block = Block(structure.damper, logs.fitted, free, self.solver, is_candidate=True)
                self._misfits[setting] = block.on_cycles()
            misfits[setting] = replace(self._misfits[setting], model=structure.damper, free=free)
        free = misfits[settings[0]].free
        follows = self.follows(structure.damper, free)
        if self.may_tie:  # a click moves the preload of a stack, seldom what it is made of
            follows = {n: a for n, a in follows.items() if n.partition("_")[2] not in _OF_STACK}
        follows = structure.follows(follows)
        weights = dict.fromkeys(settings, 1.0)
        return OneModel(misfits, free, follows, weights=weights, jobs=self.jobs)

    def held(self, structure: Structure, setting: Setting) -> dict[str, float]:
        """What is held at a setting."""
        fixed, names = self.evidence[setting].fixed, structure.damper.names
        return structure.held | {n: x for n, x in fixed.items() if n in names}

    def first(self, structure: Structure, settings: Sequence[Setting] = ()) -> _Fit:
        """A structure from each setting's own loops, then from each other, then as one fit."""
        settings = settings or self.compared
        model = self.model(structure, settings)

        def own(setting: Setting) -> Values:
            logs = self.evidence[setting]
            held = self.held(structure, setting)
            misfit = model.blocks[setting]
            ended = descended(misfit, held, logs.more_start)
            for start in spread_starts(misfit, ended.extra, setting, self.n_starts - 1):
                with suppress(SimulationError):
                    other = misfit.descend(start, _END)
                    ended = min(ended, other, key=lambda end: end.cost)
            return ended.extra

        with executor(self.jobs) as pool:
            alone = dict(zip(settings, pool.map(own, settings), strict=True))
        model = model.weighed_at(alone)
        best = model.best_of(list(model.starts(alone)))
        return self.ended_at(_Fit(structure, model, best))

    def ended_at(self, fit: _Fit) -> _Fit:
        """The minimum with the weights that it gives the settings itself."""
        model = fit.model.weighed_at(fit.values)
        return replace(fit, model=model, minimum=model.minimise(fit.values, _END))

    def starts(
        self, structure: Structure, model: OneModel, near: _Fit
    ) -> dict[str, dict[Setting, Values]]:
        """Starts beside another structure: what is new as the loops show it, or little of it.

        A valve of another kind starts, as well, wholly as the loops show it: a bleed that takes
        over from a blow-off, or shares with a new part, is another one.
        """
        changed = tuple(
            f"{stroke}_" for stroke in STROKES
            if getattr(structure.damper, stroke) != getattr(near.structure.damper, stroke)
        )  # fmt: skip
        full, little, anew = {}, {}, {}
        for setting in model.settings:
            own = near.values[setting]
            if "breakaway" in own.names and "breakaway" not in structure.damper.names:
                # All friction that it has at rest: next to nothing may slide beside it, and what is
                # nothing has no slope: no fit finds it again.
                name = next(quantity.name for quantity in own.quantities if quantity.is_friction)
                own = own.replace({name: getattr(own, name) + own.breakaway})
            start = self.start(structure, setting)
            known = {n: x for n in model.free if n in own.names and (x := getattr(own, n))}
            full[setting] = start.replace(known)
            absent = model.blocks[setting].absent_beside(known)
            half = {n: math.sqrt(a * getattr(start, n)) for n, a in absent.items()}
            little[setting] = full[setting].replace(half)
            beside = {n: x for n, x in known.items() if not n.startswith(changed or "-")}
            anew[setting] = start.replace(beside)
        begun = {"full": full}
        for words, at in (("little", little), ("anew", anew)):
            if at not in begun.values():
                begun[words] = at
        return {words: model.with_common(at) for words, at in begun.items()}

    def start(self, structure: Structure, setting: Setting) -> Values:
        """The model's own first start at a setting."""
        key = structure, setting
        if key not in self._starts:
            damper, logs = structure.damper, self.evidence[setting].fitted
            held = self.held(structure, setting)
            place = damper.name, damper.mounting.moving_mass, held.get("return_slope"), setting
            if place not in self._readings:
                self._readings[place] = read_loops(damper, logs, held)
            known = self._readings[place]
            self._starts[key] = ValveDamper.start(damper, logs, held, known)[0]
        return self._starts[key]

    def glanced(self, structure: Structure, near: _Fit, began: str = "") -> _Fit | None:
        """A few evaluations from the structure at hand, from the start that promises most.

        Where it is known which start leads on, from that one alone.
        """
        model = replace(self.model(structure, near.model.settings), weights=near.model.weights)
        try:
            starts = self.starts(structure, model, near)
        except (SimulationError, ValueError):
            return None
        fits: list[_Fit] = []
        for words, at in starts.items():
            if began in starts and words != began:
                continue
            with suppress(SimulationError, np.linalg.LinAlgError):
                fits.append(_Fit(structure, model, model.minimise(at, _GLANCE), words))
                if fits[-1].minimum.cost < near.minimum.cost:
                    break  # the others are for where this one leads away
        return min(fits, key=lambda fit: fit.promised, default=None)

    # the criterion

    def criterion(self, fit: _Fit) -> float:
        """C of the module's text."""
        percent, n = fit.percent, self.n_eff
        cost = sum(n[s] * math.log(p + FLOOR_PERCENT) for s, p in percent.items())
        cost += self.price(fit.structure, fit.model.settings) + self.unbelieved(fit)
        return cost + self.of_held_out(fit)

    def price(self, structure: Structure, settings: Sequence[Setting]) -> float:
        """What the numbers and parts of a structure cost: a number by the samples that see it."""
        unknowns = self.model(structure, settings).border
        seen = [sum(self.n_eff[s] for s in settings if unknown.holds_at(s)) for unknown in unknowns]
        return sum(map(math.log, seen)) + _NEEDLESS * structure.n_needless

    def unbelieved(self, fit: _Fit) -> float:
        """The part of C for a friction that seals hardly have, and for defaults that were freed."""
        values = list(fit.values.values())
        frictions = [
            math.log(max(getattr(at, quantity.name), 1e-9) / BELIEVED_FRICTION) / FRICTION_SPREAD
            for at in values
            for quantity in at.quantities
            if quantity.is_friction and quantity.name in fit.model.free
        ]
        price = float(np.mean([min(x**2, _MOST_UNBELIEVED) for x in frictions] or [0.0]))
        for quantity in (values[0].quantity(name) for name in fit.structure.freed):
            if quantity.ignorance and quantity.default is not None:
                away = [quantity.away_from_default(getattr(at, quantity.name)) for at in values]
                price += float(np.mean([min((x / _FREED) ** 2, _MOST_UNBELIEVED) for x in away]))
        return price

    def of_held_out(self, fit: _Fit) -> float:
        """The part of C that what was held out adds."""
        known = [result.held_out_percent for result in self.judged(fit).fits]
        return sum(
            _HELD_SAMPLES * math.log(min(x, 100.0) + _HELD_FLOOR_PERCENT)
            for x in known
            if not math.isnan(x)
        )

    def judged(self, fit: _Fit) -> Candidate:
        """The fit on the whole logs."""
        known = self._judged.get(id(fit))
        if known is not None:
            return known[1]
        loose = undetermined(fit.minimum, fit.model.blocks.values(), fit.model.border)

        def at(setting: Setting) -> LawFit:
            return fit_at(
                replace(fit.model.blocks[setting], solver=self.solver, cycles=None),
                self.evidence[setting],
                fit.values[setting],
                evaluations=fit.minimum.evaluations,
                undetermined=loose,
            )

        with executor(self.jobs) as pool:
            tried = Candidate(fit.structure.title, tuple(pool.map(at, fit.model.settings)))
        self._judged[id(fit)] = fit, tried
        return tried

    # moves

    def improved(self, fit: _Fit) -> _Fit:
        """Take moves until none is better by the criterion.

        First those that add or replace: a part is missed where another one's absence hides it.
        Of them those that were near a gain when they were last screened, and were not refused since
        the structure grew; then those that remove; when these gain nothing either, all the others.
        """
        rises: dict[str, float] = {}  # by move, when it was last screened
        refused = set[str]()
        for _ in range(_ROUNDS):
            known = {w: c for w, c in moves(fit.structure).items() if self.may_gain(c, fit)}
            size = len(fit.structure.free)
            removals = {w: known.pop(w) for w, c in [*known.items()] if len(c.free) < size}
            margin = self.margin(fit)
            near = {w for w in known if w not in refused and rises.get(w, 0.0) <= margin}
            hopeful = {w for w in known if rises.get(w, 0.0) <= _HOPELESS * margin}
            ended = self.followed(fit, known, near, rises) or self.with_ties(fit)
            if ended is not None:
                refused.clear()
            elif (ended := self.followed(fit, removals, {*removals}, rises)) is not None:
                refused |= near
            elif (ended := self.followed(fit, known, hopeful - near, rises)) is not None:
                refused.clear()
            else:
                break
            fit = ended
        self.spread = self.between(fit)
        return fit

    def between(self, fit: _Fit) -> dict[Setting, dict[str, float]]:
        """Deviation of each ln y over the structures that were tried, by what each is likely."""
        here, likely = self.criterion(fit), dict[Structure, tuple[float, _Fit]]()
        for end in (end for end in self.ends if end.model.settings == fit.model.settings):
            weight = math.exp(-0.5 * max(self.criterion(end) - here, 0.0))
            if weight > max(_UNLIKELY, likely.get(end.structure, (0.0, end))[0]):
                likely[end.structure] = weight, end
        total, spreads = 1.0 + sum(weight for weight, _ in likely.values()), {}
        for setting, values in fit.values.items():
            squares = dict.fromkeys(fit.model.free, 0.0)
            for weight, end in likely.values():
                there = end.values[setting]
                for name in (n for n in squares if n in end.model.free):
                    if values.quantity(name).is_logarithmic:
                        away = math.log(getattr(there, name) / getattr(values, name))
                        squares[name] += weight / total * away**2
            spreads[setting] = {name: math.sqrt(square) for name, square in squares.items()}
        return spreads

    def margin(self, fit: _Fit) -> float:
        """By how much a screened candidate may promise to be worse, and is followed."""
        return _MARGIN * sum(self.n_eff[s] for s in fit.values)

    def followed(
        self, fit: _Fit, known: Mapping[str, Structure], which: set[str], rises: dict[str, float]
    ) -> _Fit | None:
        """The best of some candidates that screening puts first, at its minimum; None: no better.

        What is better beside the best is tried on top of it.
        """
        began: Mapping[str, str] = {}
        candidates = {words: structure for words, structure in known.items() if words in which}
        pair = self.most_unlike(fit.values)
        if len(fit.values) > len(pair) and candidates:
            few = self.screened(candidates, self.at(fit, pair, _ONE), fit, {})
            rises |= {words: rise for rise, words, _ in few}
            near = {w: g.began for rise, w, g in few[:_LOOKED_AT] if rise <= self.margin(fit)}
            candidates, began = {words: candidates[words] for words in near}, near
        screened = self.screened(candidates, fit, fit, began)
        rises |= {words: rise for rise, words, _ in screened}
        ends = []
        for rise, words, glance in screened[:_FOLLOWED]:
            if rise > self.margin(fit):
                break
            if (ended := self.candidate(glance, fit, words)) is not None:
                ends.append((self.criterion(ended), words, ended))
        ends = sorted(ends, key=lambda end: end[0])
        if not ends or ends[0][0] >= self.criterion(fit) - 1e-6:
            return None
        before, best = self.criterion(fit), ends[0][2]
        for cost, words, _ in ends[1:]:
            again = moves(best.structure).get(words) if cost < before else None
            begun = None if again is None else self.glanced(again, best)
            ended = None if begun is None else self.candidate(begun, best, words)
            if ended is not None and self.criterion(ended) < self.criterion(best) - 1e-6:
                best = ended
        return best

    def candidate(self, glance: _Fit, beside: _Fit, words: str) -> _Fit | None:
        """A candidate followed to its minimum, and kept with what it gains."""
        try:
            ended = self.ended_at(glance)
            gain = self.criterion(beside) - self.criterion(ended)
        except SimulationError:
            return None
        self.record(ended, beside, words, gain, is_taken=gain > 1e-6)
        self.ends.append(ended)
        return ended

    def may_gain(self, structure: Structure, fit: _Fit) -> bool:
        """Whether a structure has less, or what it has more may be worth its price."""
        if len(structure.free) < len(fit.structure.free):
            return True
        gain = 0.0  # without a price, where nothing but noise is left
        for setting, percent in fit.percent.items():
            noise = 100.0 * fit.model.blocks[setting].scatter
            gain += self.n_eff[setting] * math.log(
                (percent + FLOOR_PERCENT) / (min(noise, percent) + FLOOR_PERCENT)
            )
        n_held = sum(bool(self.evidence[s].held_out) for s in self.compared)
        nothing = n_held * _HELD_SAMPLES * math.log(_HELD_FLOOR_PERCENT)
        gain += max(self.of_held_out(fit) - nothing, 0.0)
        return gain > math.log(sum(self.n_eff[s] for s in fit.values))

    def screened(
        self,
        candidates: Mapping[str, Structure],
        near: _Fit,
        fit: _Fit,
        began: Mapping[str, str],
    ) -> list[tuple[float, str, _Fit]]:
        """By how much the criterion of each promises to rise above that of a fit.

        All after a few evaluations beside the fit, which may be at fewer settings, the first of
        them after some more.
        """
        glances: list[tuple[float, str, _Fit]] = []
        rises: dict[ValveDamper, float] = {}
        for words, structure in candidates.items():
            halves = [rises[d] for d in structure.strokes_beside(fit.structure) if d in rises]
            if min(halves, default=-math.inf) > self.margin(fit):
                continue  # what neither stroke gains both do not
            glance = self.glanced(structure, near, began.get(words, ""))
            if glance is not None:
                glances.append((self.rise(glance, near, fit), words, glance))
                rises[structure.damper] = glances[-1][0]
        glances.sort(key=lambda item: item[0])
        for k, (rise, words, glance) in enumerate(glances[:_LOOKED_AT]):
            if rise <= 0.0 and glance.minimum.status == 0:
                minimum = glance.model.minimise(glance.values, _LOOK)
                again = replace(glance, minimum=minimum)
                glances[k] = (self.rise(again, near, fit), words, again)
        return sorted(glances, key=lambda item: item[0])

    def rise(self, glance: _Fit, near: _Fit, fit: _Fit) -> float:
        """By how much the criterion, without what was held out, promises to rise.

        At all settings of a fit, by what is gained beside it at those of `near`: a number of the
        damper gains at each of them, and is paid once.
        """
        n = sum(self.n_eff[s] for s in fit.values)
        price = self.price(glance.structure, fit.model.settings) - self.price(
            fit.structure, fit.model.settings
        )
        return n * near.above_floor(max(glance.promised, 1e-6 * near.minimum.cost)) + price

    def record(self, fit: _Fit, beside: _Fit, words: str, gain: float, *, is_taken: bool) -> None:
        """Keep a candidate, and say it to who waits for it."""
        tried, other = self.judged(fit), self.judged(beside)
        small, large = (
            (tried, other) if len(fit.model.border) < len(beside.model.border) else (other, tried)
        )
        is_larger = large is tried
        moved = f"MSE {other.mse_percent:.2g} to {tried.mse_percent:.2g} %"
        held = other.held_out_percent, tried.held_out_percent
        if not math.isnan(held[1]):
            moved += f", held out {held[0]:.2g} to {held[1]:.2g} %"
        self.judge(
            tried, f"{moved}; criterion {'lower' if gain > 0.0 else 'higher'} by {abs(gain):.0f}",
            is_taken=is_taken, change=words, bic=gain if is_larger else -gain,
            gain=small.mse_percent / max(large.mse_percent, 1e-300),
        )  # fmt: skip

    def judge(
        self, tried: Candidate, reason: str, *, is_taken: bool, change: str = "", **figures: float
    ) -> None:
        """Keep what was judged beside another than its neighbour."""
        self.laws.append(JudgedLaw(tried, is_taken, reason, change=change, **figures))
        self.on_law(self.laws[-1])

    # layouts

    def best_layout(self, layouts: Sequence[ValveDamper]) -> _Fit | None:
        """Bleed and blow-off in each stroke and everything that a mounting may have."""
        fits: list[_Fit] = []
        pair = self.most_unlike(self.compared)
        for layout in layouts:
            whole = replace(
                layout, rebound=BOTH, compression=BOTH, mounting=everything(layout.mounting)
            )
            structure = Structure(whole)
            with suppress(SimulationError):
                fits.append(self.first(structure, pair))
        if not fits:
            return None
        tried = [self.judged(fit) for fit in fits]
        best = min(tried, key=lambda candidate: candidate.score)
        near = []
        for fit, candidate in zip(fits, tried, strict=True):
            times = times_worse(best, candidate)
            self.first_layouts[fit.structure.damper.name] = times
            is_alone, is_near = len(fits) == 1, times < SEEN_APART
            reason = _of_layout(best, candidate, is_alone=is_alone, is_near=is_near)
            self.judge(candidate, reason, is_taken=candidate is best, change="layout")
            near += [fit] if is_near else []
        near = [self.extended(fit, self.compared) for fit in near]
        taken = min(near, key=lambda fit: self.judged(fit).score)
        for law in self.judged(taken).fits:  # the effective samples of what it leaves
            segments = [x for trace in self.evidence[law.setting].fitted for x in trace.segments]
            self.n_eff[law.setting] = sum(
                effective_samples(rest, max(x.n_cycles, 1))
                for rest, x in zip(law.residuals, segments, strict=True)
            )
        return taken

    def in_its_layout(
        self, fit: _Fit, layouts: Sequence[ValveDamper], *, is_again: bool = False
    ) -> _Fit:
        """The parts that were found in the other layouts: those that do as well are alike.

        Where another layout is taken, moves from there, and once more the other layouts.
        """
        law, others = self.judged(fit), dict[int, _Fit]()
        for layout in layouts:
            is_far = self.first_layouts.get(layout.name, math.inf) > _FAR_WORSE
            if layout.name == fit.structure.damper.name or is_far:
                continue
            with suppress(SimulationError):
                other = self.laid_out(fit, layout)
                others[id(self.judged(other))] = other
        tried = [self.judged(other) for other in others.values()]
        best = min((law, *tried), key=lambda candidate: candidate.score)
        best = law if are_alike(best, law) else best
        alike = [c for c in (law, *tried) if c is not best and are_alike(best, c)]
        for candidate in tried:
            reason = _of_layout(best, candidate, is_alone=False, is_near=candidate in alike)
            self.judge(candidate, reason, is_taken=candidate is best, change="layout")
        fits = {id(law): fit, **others}
        near = [fits[id(candidate)] for candidate in (best, *alike)]
        # Of layouts that do as well, that which takes the least for it.
        taken = min(near, key=self.criterion)
        self.fits_alike = [other for other in near if other is not taken]
        self.alike = tuple(other.structure.damper.name for other in self.fits_alike)
        if taken is fit or is_again:
            return taken
        return self.in_its_layout(self.improved(taken), layouts, is_again=True)

    def laid_out(self, fit: _Fit, layout: ValveDamper) -> _Fit:
        """The parts of a fit in another layout, from valves that press as hard there."""
        structure = fit.structure.laid_out(layout)
        model = replace(self.model(structure, fit.model.settings), weights=fit.model.weights)
        start = {}
        for setting, values in fit.values.items():
            known = {}
            for name in (name for name in model.free if name in values.names):
                power = getattr(values, f"{name.partition('_')[0]}_power", 1.0)
                times = times_in(layout.name, fit.structure.damper, name, power)
                known[name] = times * getattr(values, name)
            start[setting] = self.start(structure, setting).replace(known)
        ended = model.minimise(model.with_common(start), _END)
        return self.ended_at(_Fit(structure, model, ended))

    # against what is no candidate of the search

    def simplest(self, plain: Model) -> Candidate | None:
        """The model as declared, setting by setting, at the weakest and the strongest force.

        Its offset is free where the model leaves something without.
        """
        offsets = tuple(q.name for q in plain.quantities if q.is_offset and q.default is not None)
        ends = self.most_unlike(self.evidence)
        tried = self.separately(plain, ends)
        if offsets and (tried is None or tried.leaves_something):
            tried = self.separately(plain, ends, freed=offsets)
        return tried

    def separately(
        self,
        model: Model,
        settings: Sequence[Setting],
        *,
        freed: tuple[str, ...] = (),
        near: Candidate | None = None,
        is_whole: bool = False,
    ) -> Candidate | None:
        """A model at some settings, each by itself; None where it cannot be simulated at one."""
        known = {} if near is None else {result.setting: result for result in near.fits}

        def fit(setting: Setting) -> LawFit | None:
            beside = known.get(setting) or known.get(nearest_setting(setting, known) or setting)
            try:
                return fit_law(
                    model, self.evidence[setting], freed=freed, solver=self.solver,
                    near=None if beside is None else beside.values, is_whole=is_whole,
                )  # fmt: skip
            except SimulationError:
                return None

        with executor(self.jobs) as pool:
            fits = [result for result in pool.map(fit, settings) if result is not None]
        complete = len(fits) == len(settings) or (known and fits)
        return Candidate(in_words(model, freed), tuple(fits)) if complete else None

    def held_against_paper(self, simplest: Candidate, fit: _Fit) -> Candidate:
        """The paper's model where the valves are not worth their numbers."""
        settings = [result.setting for result in simplest.fits]
        law = self.judged(fit)
        beside = Candidate(law.title, tuple(r for r in law.fits if r.setting in settings))
        n, more = sum(self.n_eff.values()), len(law.fits[0].free) - len(simplest.fits[0].free)
        gain = simplest.mse_percent / max(beside.mse_percent, 1e-300)
        bic = n * math.log(gain) - more * len(law.fits) * math.log(n)
        is_worse = beside.held_out_percent > _NO_WORSE * simplest.held_out_percent
        is_taken = gain < GAIN or bic <= 0.0 or is_worse
        if more <= 0:
            is_taken = simplest.score < beside.score
        reason = f"MSE {simplest.mse_percent:.2g} to {beside.mse_percent:.2g} % with valves"
        self.judge(simplest, reason, is_taken=is_taken, change="smallest law", bic=bic, gain=gain)
        if is_taken:
            self.alike = ()
        return simplest if is_taken else law

    def held_against_declared(self, fit: _Fit, declared: ValveDamper) -> _Fit:
        """The valves as declared, where they do as well."""
        try:
            other = self.first(Structure(declared))
        except SimulationError:
            return fit
        gain = self.criterion(fit) - self.criterion(other)
        self.record(other, fit, "as declared", gain, is_taken=gain > 0.0)
        return other if gain > 0.0 else fit

    def beside_yielding(self, law: Candidate) -> tuple[Candidate, list[Candidate]]:
        """A law at the weakest and the strongest force, and there the models that yield."""
        ends = self.most_unlike(self.evidence)
        if self._yielding is None:
            tried = (self.separately(kind(), ends) for kind in YIELDING)
            self._yielding = [candidate for candidate in tried if candidate is not None]
        fits = tuple(result for result in law.fits if result.setting in ends)
        return Candidate(law.title, fits), self._yielding

    def is_hopeless(self, fit: _Fit) -> bool:
        """Whether what yields fits and predicts far better than every part of valves together.

        Friction that builds up over a distance yields as well: valves are given up only beside it.
        """

        def is_far(fit: _Fit) -> bool:
            beside, others = self.beside_yielding(self.judged(fit))
            return any(times_worse(other, beside) > _FAR_WORSE for other in others)

        if not is_far(fit):
            return False
        sliding = Structure(with_part(fit.structure.damper, "presliding"))
        with suppress(SimulationError):
            if (glance := self.glanced(sliding, fit)) is not None:
                return is_far(self.ended_at(glance))
        return True

    def yielding(self, law: Candidate, share: float, by_some: float) -> Candidate:
        """A model that yields before it slides, where the logs do and valves fit them less well."""
        is_unasked = math.isnan(share) and not math.isnan(by_some)
        if is_unasked and (law.leaves_something or unbelievable(law)):
            share, self.is_held_by_some = by_some, True
        self.held_share = share
        if math.isnan(share):
            return law
        beside, others = self.beside_yielding(law)
        best = min(others, key=lambda other: other.score, default=beside)
        taken = law
        for other in others:
            is_better, reason = held_against(beside, other, share)
            taken = other if is_better and other is best else taken
            self.judge(other, reason, is_taken=is_better and other is best, change="what yields")
        if taken is not law:
            self.alike = ()
        elif others and is_open_to(beside, best):
            self.also = best.title
        else:
            self.doubt = unbelievable(beside)
        return taken

    def ended(self, chosen: Candidate, fit: _Fit | None = None) -> LawSearch:
        """What was tried, and the structure to take, at every setting."""
        is_of_one_model = fit is not None and chosen is self.judged(fit)
        whole: Candidate | None = chosen
        if not is_of_one_model:
            free = chosen.freed
            whole = self.separately(
                chosen.fits[0].model, list(self.evidence), freed=free, near=chosen, is_whole=True
            )
        whole = whole or chosen
        laws = [replace(law, is_taken=False) for law in self.laws if law.candidate is not chosen]
        last = next((law for law in reversed(self.laws) if law.candidate is chosen), None)
        last = last or JudgedLaw(whole, True, "the lowest criterion of all settings together")
        laws.append(replace(last, candidate=whole, is_taken=True))
        n_eff = float(sum(self.n_eff.values())) or math.nan
        search = LawSearch(
            tuple(laws), whole, n_eff, self.alike, self.held_share, self.also,
            is_held_by_some=self.is_held_by_some, doubt=self.doubt,
        )  # fmt: skip
        if fit is None or not is_of_one_model:
            return search
        return replace(
            search, is_of_one_model=True, follows=fit.model.follows, offsets=self.offsets(whole),
            exchanges=tuple(self.exchanged(fit)), spread=self.spread,
        )  # fmt: skip

    def exchanged(self, fit: _Fit) -> Iterator[Exchange]:
        """Yield what one part in place of another fits about as well."""
        for part, instead, structure in exchanges(fit.structure):
            glance = self.glanced(structure, fit)
            if glance is None or glance.promised > GAIN * fit.minimum.cost:
                continue
            with suppress(SimulationError):
                ended = self.ended_at(glance)
                here, there = fit.percent, ended.percent
                rises = [math.log((there[s] + FLOOR_PERCENT) / (here[s] + FLOOR_PERCENT))
                         for s in here]  # fmt: skip
                if (times := math.exp(np.mean(rises))) < GAIN:
                    yield Exchange(part, instead, times, ended.values)

    def offsets(self, law: Candidate) -> dict[str, float]:
        """By how much each log's offset lies beside the mean one of its setting."""
        beside: dict[str, float] = {}
        for fit in law.fits:
            logs = self.evidence[fit.setting].fitted
            if len(logs) < 2 or not any(fit.model.quantity(n).is_offset for n in fit.free):
                continue
            missing = {}
            for log in logs:
                model = compare(fit.values, log, fit.model, solver=self.solver)
                missing[log.name] = float(np.mean((log.force - model.force)[log.compared]))
            mean = float(np.mean([*missing.values()]))
            beside |= {name: own - mean for name, own in missing.items()}
        return beside

    # ties

    def with_ties(self, fit: _Fit) -> _Fit | None:
        """The fit with other ties, if the criterion is lower; None where it is not."""
        setting = fit.model.settings[0]
        if not self.may_tie or len(fit.values) < 2:
            return None
        ways = [(), *((name,) for name, _ in setting.evident if len(setting.evident) > 1)]
        linear = _Linear(self, fit)
        steps = linear.better(dict(fit.structure.ties), [*ways, setting.adjusters])
        for ties in (steps[-1], steps[0]) if len(steps) > 1 else steps:
            structure = replace(fit.structure, ties=tuple(sorted(ties.items())))
            model = replace(self.model(structure, fit.model.settings), weights=fit.model.weights)
            try:
                minimum = model.minimise(model.with_common(linear.values(ties)), _END)
                tied = self.ended_at(_Fit(structure, model, minimum))
                gain = self.criterion(fit) - self.criterion(tied)
            except SimulationError:
                continue
            self.record(tied, fit, "with other ties", gain, is_taken=gain > 0.0)
            if gain > 0.0:
                return tied
        return None

    def tied(self, fit: _Fit, follows: Callable[[Model, Sequence[str]], Follows]) -> _Fit:
        """The structure with what settings have in common by their adjusters; and moves from there.

        Only then: beside valves that are tied wrongly every other part would be chosen for them.
        """
        self.follows, before = follows, fit.model
        if self.model(fit.structure, before.settings).border == before.border:
            return fit
        candidates = []
        for near in (fit, *self.fits_alike):
            with suppress(SimulationError):
                known = self.extended(near, before.settings)
                model = self.model(known.structure, before.settings)
                model = model.weighed_at(known.values)
                ended = model.best_of(list(model.starts(known.values)))
                candidates.append(self.ended_at(_Fit(known.structure, model, ended)))
                # A part that single settings do without may be what all of them need.
                damper = replace(near.structure.damper, rebound=BOTH, compression=BOTH)
                whole = Structure(damper, near.structure.freed)
                candidates.append(self.first(whole, before.settings))
        best = min(candidates, key=self.criterion, default=fit)
        names = [near.structure.damper.name for near in (fit, *self.fits_alike)]
        self.alike = tuple(name for name in names if name != best.structure.damper.name)
        return self.improved(best)

    # all settings

    def at(self, fit: _Fit, settings: Sequence[Setting], stopping: Stopping = _END) -> _Fit:
        """A fit at fewer settings."""
        model = self.model(fit.structure, settings)
        values = {s: fit.values[s] for s in settings}
        model = model.weighed_at(values)
        return _Fit(fit.structure, model, model.minimise(values, stopping))

    def at_all(self, fit: _Fit) -> _Fit:
        """The structure at every setting."""
        usual = float(np.median([*self.n_eff.values()]))
        for setting in self.evidence:
            self.n_eff.setdefault(setting, usual)
        return self.extended(fit, list(self.evidence))

    def extended(self, fit: _Fit, settings: Sequence[Setting]) -> _Fit:
        """The structure at more settings, these beside what the others know of the damper."""
        missing = [s for s in settings if s not in fit.values]
        if not missing:
            return fit
        model = self.model(fit.structure, settings)
        own = model.own

        def at(setting: Setting) -> Values:
            near = fit.values[nearest_setting(setting, fit.values) or next(iter(fit.values))]
            misfit = replace(model.blocks[setting], free=own)
            common = {n: getattr(near, n) for n in near.names if n not in own}
            starts = fit.structure.damper.start(self.evidence[setting].fitted, common)
            ends = []
            for start in (near, *starts[:2]):
                with suppress(SimulationError):
                    at = near.replace({n: getattr(start, n) for n in own})
                    ends.append(misfit.descend(at, _END))
            if not ends:
                raise SimulationError(
                    f"{fit.structure.title} cannot be simulated at {setting}.",
                    code="not-integrated",
                )
            return min(ends, key=lambda end: end.cost).extra

        with executor(self.jobs) as pool:
            values = dict(fit.values) | dict(zip(missing, pool.map(at, missing), strict=True))
        values = model.with_common(values)
        model = model.weighed_at(values)
        return self.ended_at(_Fit(fit.structure, model, model.minimise(values, _END)))


class _Linear:
    """The effect of ties on a fit, by linear least squares at its untied minimum."""

    def __init__(self, search: _Search, fit: _Fit) -> None:
        self.search, self.fit = search, fit
        settings = fit.model.settings
        self.structure = replace(fit.structure, ties=())
        scoped = search.model(self.structure, settings)
        self.by_scope = scoped.follows
        stack = [name for name in scoped.free if name.partition("_")[2] in _OF_STACK]
        untied = replace(self.structure, ties=tuple((n, settings[0].adjusters) for n in stack))
        base = replace(search.model(untied, settings), weights=fit.model.weights)
        self.base, self.minimum = base, base.minimise(fit.values, _ONE)
        self.untied = _Fit(untied, base, self.minimum)
        jacobian, slope = self.minimum.system.triangle, self.minimum.system.gradient
        curvature = jacobian.T @ jacobian
        curvature += 1e-9 * np.diag(np.diag(curvature) + 1e-12)
        here = self.minimum.cost, self.minimum.variables
        self.quadratic = Quadratic(*here, slope, curvature)
        self.whose = [
            (u.name, next(s for s in base.settings if u.holds_at(s))) for u in base.border
        ]
        per_cost = sum(search.n_eff[s] for s in base.settings) / max(self.minimum.cost, 1e-300)
        errors = np.sqrt(np.diag(inverse_information(jacobian)) / per_cost)
        self.is_determined = errors < _DETERMINED

    def solved(
        self, ties: Mapping[str, tuple[str, ...]]
    ) -> tuple[float, FloatArray, list[Unknown]]:
        """The cost of tied unknowns, the variables there, and the unknowns."""
        follows = replace(self.structure, ties=tuple(ties.items())).follows(self.by_scope)
        unknowns = [unknown_at(name, follows, setting) for name, setting in self.whose]
        return *self.quadratic.tied(unknowns), list(dict.fromkeys(unknowns))

    def rise(self, ties: Mapping[str, tuple[str, ...]]) -> float:
        """By how much the criterion promises to lie above nothing."""
        cost, _, unknowns = self.solved(ties)
        n = {s: self.search.n_eff[s] for s in self.base.settings}
        price = sum(math.log(sum(n[s] for s in n if u.holds_at(s))) for u in unknowns)
        return sum(n.values()) * self.untied.above_floor(max(cost, 0.0)) + price

    def better(
        self, ties: dict[str, tuple[str, ...]], ways: Sequence[tuple[str, ...]]
    ) -> list[dict[str, tuple[str, ...]]]:
        """Change what one quantity follows until nothing is gained by it; after each change."""
        damper = self.structure.damper
        names = [name for name in self.base.own if not damper.quantity(name).is_offset]
        changes = [(name, way) for name in names for way in ways if self.is_shown(name, way)]
        return one_by_one(ties, changes, self.rise, 1e-6)[1:]

    def is_shown(self, name: str, way: tuple[str, ...]) -> bool:
        """Whether each adjuster that a preload or bleed follows no more has two determined values.

        One that is reached at one place of the adjuster, and never at another, agrees with all.
        """
        if self.structure.damper.quantity(name).part not in {"opening", "bleed", "leak"}:
            return True
        own = [
            (dict(setting.evident), is_determined)
            for (other, setting), is_determined in zip(self.whose, self.is_determined, strict=True)
            if other == name
        ]
        determined = [places for places, is_determined in own if is_determined]
        return all(
            len({places.get(adjuster) for places in determined}) > 1
            for adjuster in own[0][0]
            if adjuster not in way and len({places.get(adjuster) for places, _ in own}) > 1
        )

    def values(self, ties: Mapping[str, tuple[str, ...]]) -> dict[Setting, Values]:
        """The values at the linear minimum."""
        variables, base = self.solved(ties)[1], self.base
        values = {}
        for setting in base.settings:
            own = {
                unknown.name: math.exp(min(max(u, -600.0), 600.0))
                for unknown, u in zip(base.border, variables.tolist(), strict=True)
                if unknown.holds_at(setting) and base.model.quantity(unknown.name).is_logarithmic
            }
            values[setting] = self.fit.values[setting].replace(own)
        return values


def _of_layout(best: Candidate, candidate: Candidate, *, is_alone: bool, is_near: bool) -> str:
    """Say why a layout is taken, or is not, beside the best."""
    what = "fits" if math.isnan(best.held_out_percent) else "fits and predicts"
    if is_alone:
        return "the only layout that was tried"
    if candidate is best:
        return f"the layout that {what} best"
    words = best.fits[0].model.name.replace("_", " ")
    return f"{words} {what} {'hardly ' if is_near else ''}better"


def follows_by_scope(model: Model, free: Sequence[str], adjusters: tuple[str, ...]) -> Follows:
    """Return what each quantity follows: all adjusters, unless it is the damper's or the rig's."""
    of = {name: model.quantity(name) for name in free}
    return {name: adjusters for name, q in of.items() if q.is_offset or not q.is_shared}


@one_blas_thread()
def search_laws(  # noqa: PLR0913 - what a user may ask of it
    plain: Model,
    layouts: Sequence[ValveDamper],
    evidence: Sequence[SettingLogs],
    *,
    follows: Callable[[Model, Sequence[str]], Follows] | None = None,
    adjusted: Callable[[Model, Sequence[str]], Follows] | None = None,
    solver: SolverOptions = SolverOptions(),
    on_law: Callable[[JudgedLaw], None] = lambda _: None,
    n_starts: int = 1,
    jobs: int = 1,
    held_share: float = math.nan,
    held_by_some: float = math.nan,
    is_tying: bool = False,
) -> LawSearch:
    """Return which structure the logs of all settings support, fitted at all of them.

    Parameters
    ----------
    plain : Model
        The paper's damper, or one of valves as it is declared.
    layouts : sequence of ValveDamper
        The damper in each layout that it may have.
    evidence : sequence of SettingLogs
        The logs of all settings.
    follows : callable, optional
        From a model and what is free to the adjusters that each quantity follows; by default all of
        them, but none for what is the damper's or the rig's.
    adjusted : callable, optional
        The same where adjusters are declared: the structure that was found is fitted so at the end.
    solver : SolverOptions
        How exactly to integrate.
    on_law : callable
        Called with every structure that was judged.
    n_starts : int
        Starts of the first fit at each setting, spread over a factor of ten to both sides.
    jobs : int
        Workers; the result does not depend on them.
    held_share : float
        Of their force that the logs hold down to a tenth of the speed, where they yield before they
        slide; NaN where they do not.
    held_by_some : float
        The most that one holds, where not all of them yield. Asked where valves leave something.

    Raises
    ------
    SimulationError
        No structure can be simulated on these logs.
    """
    adjusters = min(logs.setting for logs in evidence).adjusters

    def by_scope(model: Model, free: Sequence[str]) -> Follows:
        return follows_by_scope(model, free, adjusters)

    search = _Search(evidence, follows or by_scope, solver, on_law, n_starts, jobs)
    search.may_tie = follows is None or is_tying
    simplest = search.simplest(plain)
    has_valves = isinstance(plain, ValveDamper)
    if simplest is not None and not has_valves and not simplest.leaves_something:
        search.judge(simplest, "its misfit is too small to matter", is_taken=True)
        return search.ended(simplest)
    fit = search.best_layout(layouts)
    if fit is None:
        if simplest is None:
            raise SimulationError(
                "no structure can be simulated on these logs.", code="not-integrated"
            )
        search.judge(simplest, "no other can be simulated on these logs", is_taken=True)
        return search.ended(simplest)
    if math.isnan(held_share) or not search.is_hopeless(fit):
        fit = search.improved(fit)
        if isinstance(plain, ValveDamper):
            fit = search.held_against_declared(fit, plain)
        fit = search.at_all(search.in_its_layout(fit, layouts))
        if adjusted is not None:
            fit = search.tied(fit, adjusted)
    chosen = search.judged(fit)
    if simplest is not None and not has_valves:
        chosen = search.held_against_paper(simplest, fit)
    return search.ended(search.yielding(chosen, held_share, held_by_some), fit)
