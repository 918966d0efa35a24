"""Structures fitted to all settings as one model: what these have in common is equal in all.

For comparing structures, as `law_fit` does for single settings: on settled cycles, each setting
weighed by what is left there, so that a factor of one setting's MSE counts as much as another's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from damperfit.damper.model import Model, Values
from damperfit.damper.network import BLOW_OFF_PARTS
from damperfit.damper.valve_dampers import ValveDamper, ValveReading, read_loops
from damperfit.errors import SimulationError
from damperfit.identification.fit_problem import Block, FitProblem, Point, kept_within
from damperfit.identification.fit_setting import spread_starts
from damperfit.identification.least_squares import Minimum, Stopping
from damperfit.identification.sharing import Follows, Unknown, unknown_at
from damperfit.laws.law_fit import (
    Candidate,
    LawFit,
    SettingLogs,
    descended,
    fit_at,
    fit_law,
    undetermined,
)
from damperfit.laws.structures import STROKES, Structure, in_words, times_in
from damperfit.simulation import SolverOptions
from damperfit.tested.setting import Setting, nearest_setting
from damperfit.workers import executor

# Steps are short beside numbers known to a thousandth: no step is too short to be tried.
_SHORTEST = 1e-8
GLANCE = Stopping(cost_tolerance=2e-2, step_tolerance=_SHORTEST, max_evaluations=4, rest=math.inf)
LOOK = GLANCE._replace(max_evaluations=10)
END = Stopping(cost_tolerance=1e-3, step_tolerance=_SHORTEST, max_evaluations=40, rest=math.inf)
# Of the starts of all settings: those of how many settings, and how many of them are looked at and
# followed to their end.
_FIRST, _LOOKED_AT, _FOLLOWED = 6, 6, 3
_LEAST = 2e-6  # of what a setting leaves, per unit of its variance
# Of the directions of a linearised problem: shorter ones promise nothing.
_NO_LENGTH = 1e-6
# Numbers that a blow-off has beside its opening and slope: one for all settings until the logs ask.
OF_STACK = {*BLOW_OFF_PARTS} - {"opening", "slope"}


@dataclass(frozen=True, slots=True, eq=False)
class OneModel(FitProblem):
    """A law, the logs of settings, and what these have in common: all that is free is in `border`.

    What is each setting's own follows all adjusters.
    """

    @property
    def model(self) -> Model:
        """The law."""
        return self.blocks[self.settings[0]].model

    @property
    def own(self) -> tuple[str, ...]:
        """What is free, and each setting's own."""
        adjusters = self.settings[0].adjusters
        return tuple(name for name in self.free if self.follows.get(name) == adjusters)

    def weighed_at(self, at: Mapping[Setting, Values]) -> OneModel:
        """Return the same with the weights that values of the settings leave them.

        What is left counts as `_LEAST` at least, and as much as the cycles differ.
        """
        blocks = self.blocks.items()
        left = {setting: max(b.cost(at[setting]), b.scatter, _LEAST) for setting, b in blocks}
        return replace(self, weights={setting: 1.0 / cost for setting, cost in left.items()})

    def cost(self, at: Mapping[Setting, Values]) -> float:
        """Return the weighed sum of squares; infinite where the law cannot be simulated."""
        weights = self.weights or {}
        try:
            return sum(weights[s] * block.cost(at[s]) for s, block in self.blocks.items())
        except SimulationError:
            return math.inf

    def with_common(self, at: Mapping[Setting, Values]) -> dict[Setting, Values]:
        """Return values with what settings have in common at the mean of theirs."""
        means = {}
        for unknown in self.border:
            name, having = unknown.name, [s for s in self.settings if unknown.holds_at(s)]
            own = np.array([getattr(at[s], name) for s in having])
            is_positive = self.model.quantity(name).is_logarithmic and own.min() > 0.0
            mean = math.exp(np.mean(np.log(own))) if is_positive else float(np.mean(own))
            means[unknown] = mean
        return self._with(at, means)

    def starts(self, at: Mapping[Setting, Values]) -> Iterator[dict[Setting, Values]]:
        """Yield starts: what is common at its mean, then as single settings have it, in turn.

        One setting in a wrong local minimum, with bleed and blow-off changed over, spoils a mean.
        """
        yield self.with_common(at)
        settings, weights = self.settings, self.weights or {}
        for setting in sorted(settings, key=lambda s: -weights[s])[:_FIRST]:
            order = setting, *(other for other in settings if other != setting)
            first = {
                unknown: getattr(at[next(s for s in order if unknown.holds_at(s))], unknown.name)
                for unknown in self.border
            }
            yield self._with(at, first)

    def _with(
        self, at: Mapping[Setting, Values], numbers: Mapping[Unknown, float]
    ) -> dict[Setting, Values]:
        values = {}
        for s in self.settings:
            own = {name: numbers[unknown_at(name, self.follows, s)] for name in self.free}
            values[s] = kept_within(at[s].replace(own), self.free)
        return values

    def best_of(self, starts: Sequence[Mapping[Setting, Values]]) -> Minimum[Point]:
        """The minimum from the best of some starts; a `SimulationError` if none can be run."""
        seen = []
        for start in sorted(starts, key=self.cost)[:_LOOKED_AT]:
            with suppress(SimulationError):
                seen.append(self.minimise(start, LOOK))
        if not seen:
            raise SimulationError(
                f"{self.model.name} cannot be simulated at all settings at once.",
                code="not-integrated",
            )
        seen.sort(key=lambda look: look.cost)
        ends = [self.minimise(look.extra.values, END) for look in seen[:_FOLLOWED]]
        return min(ends, key=lambda end: end.cost)


@dataclass(frozen=True, eq=False)
class StructureFit:
    """A structure at the minimum of one fit of several settings."""

    structure: Structure
    model: OneModel
    minimum: Minimum[Point]
    began: str = ""  # which of its starts beside another structure led here

    @property
    def values(self) -> Mapping[Setting, Values]:
        """Those of each setting there."""
        return self.minimum.extra.values

    @cached_property
    def promised(self) -> float:
        """The cost at the minimum of the linearised problem: what a minimisation may come to."""
        return max(self.minimum.cost - self.minimum.promised(_NO_LENGTH), 0.0)

    @cached_property
    def percent(self) -> dict[Setting, float]:
        """MSE of each setting on its mean cycles."""
        return {s: 100.0 * block.cost(self.values[s]) for s, block in self.model.blocks.items()}


@dataclass(eq=False)
class StructureFits:
    """The logs of all settings, and how structures are fitted to them."""

    evidence: Mapping[Setting, SettingLogs]  # by rising setting
    follows: Callable[[Model, Sequence[str]], Follows]  # from a model and what is free
    solver: SolverOptions
    n_starts: int
    jobs: int
    may_tie: bool  # whether the logs may show what follows an adjuster
    _blocks: dict[Setting, Block] = field(default_factory=dict)
    _starts: dict[tuple[Structure, Setting], Values] = field(default_factory=dict)
    _readings: dict[tuple[object, ...], list[ValveReading]] = field(default_factory=dict)
    _candidates: dict[StructureFit, Candidate] = field(default_factory=dict)

    def model(self, structure: Structure, settings: Sequence[Setting]) -> OneModel:
        """The fit of a structure at some settings, with what they have in common."""
        blocks = {}
        for setting in settings:
            logs = self.evidence[setting]
            fixed = {*structure.held, *logs.fixed}
            free = tuple(name for name in structure.damper.names if name not in fixed)
            if setting not in self._blocks:
                block = Block(structure.damper, logs.fitted, free, self.solver, is_candidate=True)
                self._blocks[setting] = block.on_cycles()
            blocks[setting] = replace(self._blocks[setting], model=structure.damper, free=free)
        free = blocks[settings[0]].free
        follows = self.follows(structure.damper, free)
        if self.may_tie:  # a click moves the preload of a stack, seldom what it is made of
            follows = {n: a for n, a in follows.items() if n.partition("_")[2] not in OF_STACK}
        weights = dict.fromkeys(settings, 1.0)
        return OneModel(blocks, free, structure.follows(follows), weights=weights, jobs=self.jobs)

    def minimised(
        self,
        structure: Structure,
        model: OneModel,
        values: Mapping[Setting, Values],
        stopping: Stopping = END,
    ) -> StructureFit:
        """The minimum from values, with the weights that these give the settings."""
        model = model.weighed_at(values)
        return StructureFit(structure, model, model.minimise(values, stopping))

    def settled(self, fit: StructureFit) -> StructureFit:
        """The minimum with the weights that it gives the settings itself."""
        return self.minimised(fit.structure, fit.model, fit.values)

    def from_single(
        self, structure: Structure, model: OneModel, alone: Mapping[Setting, Values]
    ) -> StructureFit:
        """One fit from what single settings have, and from each other."""
        model = model.weighed_at(alone)
        best = model.best_of(list(model.starts(alone)))
        return self.minimised(structure, model, best.extra.values)

    def first(self, structure: Structure, settings: Sequence[Setting]) -> StructureFit:
        """A structure from each setting's own loops, then from each other, then as one fit."""
        model = self.model(structure, settings)

        def own(setting: Setting) -> Values:
            block, held = model.blocks[setting], self.held(structure, setting)
            best = descended(block, held, self.evidence[setting].more_start)
            for start in spread_starts(block, best.extra, setting, self.n_starts - 1):
                with suppress(SimulationError):
                    best = min(best, block.descend(start, END), key=lambda end: end.cost)
            return best.extra

        with executor(self.jobs) as pool:
            alone = dict(zip(settings, pool.map(own, settings), strict=True))
        return self.from_single(structure, model, alone)

    def held(self, structure: Structure, setting: Setting) -> dict[str, float]:
        """What is held at a setting."""
        fixed, names = self.evidence[setting].fixed, structure.damper.names
        return structure.held | {n: x for n, x in fixed.items() if n in names}

    def start(self, structure: Structure, setting: Setting) -> Values:
        """The model's own first start at a setting."""
        key = structure, setting
        if key not in self._starts:
            damper, logs = structure.damper, self.evidence[setting].fitted
            held = self.held(structure, setting)
            place = damper.name, damper.mounting.moving_mass, held.get("return_slope"), setting
            if place not in self._readings:
                self._readings[place] = read_loops(damper, logs, held)
            self._starts[key] = ValveDamper.start(damper, logs, held, self._readings[place])[0]
        return self._starts[key]

    def starts(
        self, structure: Structure, model: OneModel, near: StructureFit
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
            # What is held at nothing beside it is new, too.
            shared = {n: x for n in model.free if n in own.names and (x := getattr(own, n))}
            full[setting] = start.replace(shared)
            absent = model.blocks[setting].absent_beside(shared)
            half = {n: math.sqrt(a * getattr(start, n)) for n, a in absent.items()}
            little[setting] = full[setting].replace(half)
            beside = {n: x for n, x in shared.items() if not n.startswith(changed or "-")}
            anew[setting] = start.replace(beside)
        begun = {"full": full}
        for words, at in (("little", little), ("anew", anew)):
            if at not in begun.values():
                begun[words] = at
        return {words: model.with_common(at) for words, at in begun.items()}

    def glanced(
        self, structure: Structure, near: StructureFit, began: str = ""
    ) -> StructureFit | None:
        """A few evaluations from the structure at hand, from the start that promises most.

        Where it is clear which start leads on, from that one alone.
        """
        model = replace(self.model(structure, near.model.settings), weights=near.model.weights)
        try:
            starts = self.starts(structure, model, near)
        except (SimulationError, ValueError):
            return None
        fits: list[StructureFit] = []
        for words, at in starts.items():
            if began in starts and words != began:
                continue
            with suppress(SimulationError, np.linalg.LinAlgError):
                fits.append(StructureFit(structure, model, model.minimise(at, GLANCE), words))
                if fits[-1].minimum.cost < near.minimum.cost:
                    break  # the others are for where this one leads away
        return min(fits, key=lambda fit: fit.promised, default=None)

    def at(
        self, fit: StructureFit, settings: Sequence[Setting], stopping: Stopping = END
    ) -> StructureFit:
        """A fit at fewer settings."""
        values = {s: fit.values[s] for s in settings}
        return self.minimised(fit.structure, self.model(fit.structure, settings), values, stopping)

    def extended(self, fit: StructureFit, settings: Sequence[Setting]) -> StructureFit:
        """The structure at more settings, these beside what the others have of the damper."""
        missing = [s for s in settings if s not in fit.values]
        if not missing:
            return fit
        model = self.model(fit.structure, settings)
        own = model.own

        def at(setting: Setting) -> Values:
            near = fit.values[nearest_setting(setting, fit.values) or next(iter(fit.values))]
            block = replace(model.blocks[setting], free=own)
            common = {n: getattr(near, n) for n in near.names if n not in own}
            starts = fit.structure.damper.start(self.evidence[setting].fitted, common)
            ends = []
            for start in (near, *starts[:2]):
                with suppress(SimulationError):
                    at = near.replace({n: getattr(start, n) for n in own})
                    ends.append(block.descend(at, END))
            if not ends:
                raise SimulationError(
                    f"{fit.structure.title} cannot be simulated at {setting}.",
                    code="not-integrated",
                )
            return min(ends, key=lambda end: end.cost).extra

        with executor(self.jobs) as pool:
            values = dict(fit.values) | dict(zip(missing, pool.map(at, missing), strict=True))
        values = model.with_common(values)
        return self.settled(self.minimised(fit.structure, model, values))

    def laid_out(self, fit: StructureFit, layout: ValveDamper) -> StructureFit:
        """The parts of a fit in another layout, from valves that press as hard there."""
        structure = fit.structure.laid_out(layout)
        model = replace(self.model(structure, fit.model.settings), weights=fit.model.weights)
        start = {}
        for setting, values in fit.values.items():
            there = {}
            for name in (name for name in model.free if name in values.names):
                power = getattr(values, f"{name.partition('_')[0]}_power", 1.0)
                times = times_in(layout.name, fit.structure.damper, name, power)
                there[name] = times * getattr(values, name)
            start[setting] = self.start(structure, setting).replace(there)
        first = model.minimise(model.with_common(start), END)
        return self.minimised(structure, model, first.extra.values)

    def candidate(self, fit: StructureFit) -> Candidate:
        """The fit on the whole logs."""
        if fit in self._candidates:
            return self._candidates[fit]
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
            fits = tuple(pool.map(at, fit.model.settings))
        self._candidates[fit] = Candidate(fit.structure.title, fits)
        return self._candidates[fit]

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
        near_by = {} if near is None else {result.setting: result.values for result in near.fits}

        def fit(setting: Setting) -> LawFit | None:
            start = near_by.get(nearest_setting(setting, near_by) or setting)
            try:
                return fit_law(
                    model, self.evidence[setting], freed=freed, solver=self.solver,
                    near=start, is_whole=is_whole,
                )  # fmt: skip
            except SimulationError:
                return None

        with executor(self.jobs) as pool:
            fits = [result for result in pool.map(fit, settings) if result is not None]
        is_complete = len(fits) == len(settings) or (near_by and fits)
        return Candidate(in_words(model, freed), tuple(fits)) if is_complete else None
