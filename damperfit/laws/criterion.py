"""The criterion of a structure at all settings together, and what ties would make of it.

Of logs with MSE m and held-out MSE h (per cent of the variance)::

    C = sum over settings of n ln(m + m_0) + n_h ln(h + h_0)  +  sum over numbers of ln(n_k) + 2 p

n is the effective number of samples of what the largest structure leaves (`effective_samples`), n_k
that of all settings that a number is in, m_0 a misfit below which laws count as equal, h_0 the same
of a prediction, p the number of parts that a damper or its rig may well be without. A friction that
seals hardly have costs a little, too, and so does a default that is freed and runs far away.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from damperfit.arrays import FloatArray
from damperfit.damper.model import Values
from damperfit.identification.fit_problem import BELIEVED_FRICTION, FRICTION_SPREAD
from damperfit.identification.least_squares import Quadratic, Stopping, inverse_information
from damperfit.identification.sharing import Unknown, one_by_one, unknown_at
from damperfit.laws.structure_fits import OF_STACK, StructureFit, StructureFits
from damperfit.laws.structures import Structure
from damperfit.tested.setting import Setting

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
# A screened candidate may promise so much more misfit, in logarithms, than would be a gain.
_MARGIN = 0.05
# Beside the best a structure with less than so much of its weight, exp(-C/2), moves no interval.
_UNLIKELY = 0.01
# Largest standard error, of its logarithm, of a value that can speak for or against a tie.
_DETERMINED = 0.3
ONE = Stopping(max_evaluations=1)


class Criterion:
    """C of structures that were fitted to the same logs."""

    def __init__(self, fits: StructureFits) -> None:
        self.fits = fits
        self.n_eff: dict[Setting, float] = {}  # effective samples

    def of(self, fit: StructureFit) -> float:
        """C of the module's text."""
        cost = sum(self.n_eff[s] * math.log(p + FLOOR_PERCENT) for s, p in fit.percent.items())
        cost += self.price(fit.structure, fit.model.settings) + self.unbelieved(fit)
        return cost + self.of_held_out(fit)

    def price(self, structure: Structure, settings: Sequence[Setting]) -> float:
        """What the numbers and parts of a structure cost."""
        unknowns = self.fits.model(structure, settings).border
        return self.of_numbers(unknowns, settings) + _NEEDLESS * structure.n_needless

    def of_numbers(self, unknowns: Iterable[Unknown], settings: Sequence[Setting]) -> float:
        """The part of C for numbers: each by the samples that see it."""
        seen = [self.samples(s for s in settings if unknown.holds_at(s)) for unknown in unknowns]
        return sum(map(math.log, seen))

    def unbelieved(self, fit: StructureFit) -> float:
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

    def of_held_out(self, fit: StructureFit) -> float:
        """The part of C that what was held out adds."""
        percents = (result.held_out_percent for result in self.fits.candidate(fit).fits)
        return sum(
            _HELD_SAMPLES * math.log(min(percent, 100.0) + _HELD_FLOOR_PERCENT)
            for percent in percents
            if not math.isnan(percent)
        )

    def samples(self, settings: Iterable[Setting]) -> float:
        """Effective samples of settings."""
        return sum(self.n_eff[s] for s in settings)

    def above_floor(self, fit: StructureFit, cost: float) -> float:
        """The logarithm of another cost over that of a fit, each with the floor."""
        here = fit.minimum.cost
        floors = [FLOOR_PERCENT / max(x, 1e-9) for x in fit.percent.values()]
        floor = here * float(np.mean(floors))
        return math.log((cost + floor) / (here + floor))

    def times_misfit(self, fit: StructureFit, other: StructureFit) -> float:
        """Geometric mean over the settings of another fit's MSE over that of one."""
        rises = [
            math.log((other.percent[s] + FLOOR_PERCENT) / (percent + FLOOR_PERCENT))
            for s, percent in fit.percent.items()
        ]
        return math.exp(np.mean(rises))

    def margin(self, fit: StructureFit) -> float:
        """By how much a screened candidate may promise to be worse, and is followed."""
        return _MARGIN * self.samples(fit.values)

    def may_gain(self, structure: Structure, fit: StructureFit) -> bool:
        """Whether a structure has less, or what it has more may be worth its price."""
        if len(structure.free) < len(fit.structure.free):
            return True
        gain = 0.0  # without a price, where nothing but noise is left
        for setting, percent in fit.percent.items():
            noise = 100.0 * fit.model.blocks[setting].scatter
            gain += self.n_eff[setting] * math.log(
                (percent + FLOOR_PERCENT) / (min(noise, percent) + FLOOR_PERCENT)
            )
        n_held = sum(not math.isnan(x.held_out_percent) for x in self.fits.candidate(fit).fits)
        nothing = n_held * _HELD_SAMPLES * math.log(_HELD_FLOOR_PERCENT)
        gain += max(self.of_held_out(fit) - nothing, 0.0)
        return gain > math.log(self.samples(fit.values))

    def rise(self, glance: StructureFit, near: StructureFit, fit: StructureFit) -> float:
        """By how much the criterion, without what was held out, promises to rise.

        At all settings of a fit, by what is gained beside it at those of `near`: a number of the
        damper gains at each of them, and is paid once.
        """
        settings = fit.model.settings
        price = self.price(glance.structure, settings) - self.price(fit.structure, settings)
        promised = max(glance.promised, 1e-6 * near.minimum.cost)
        return self.samples(fit.values) * self.above_floor(near, promised) + price

    def spread(
        self, fit: StructureFit, others: Iterable[StructureFit]
    ) -> dict[Setting, dict[str, float]]:
        """Deviation of each ln y over the structures that were tried, by what each is likely."""
        here, likely = self.of(fit), dict[Structure, tuple[float, StructureFit]]()
        for other in (other for other in others if other.model.settings == fit.model.settings):
            weight = math.exp(-0.5 * max(self.of(other) - here, 0.0))
            if weight > max(_UNLIKELY, likely.get(other.structure, (0.0, other))[0]):
                likely[other.structure] = weight, other
        total, spreads = 1.0 + sum(weight for weight, _ in likely.values()), {}
        for setting, values in fit.values.items():
            squares = dict.fromkeys(fit.model.free, 0.0)
            for weight, other in likely.values():
                there = other.values[setting]
                for name in (n for n in squares if n in other.model.free):
                    if values.quantity(name).is_logarithmic:
                        away = math.log(getattr(there, name) / getattr(values, name))
                        squares[name] += weight / total * away**2
            spreads[setting] = {name: math.sqrt(square) for name, square in squares.items()}
        return spreads


class LinearisedTies:
    """The effect of ties on a fit, by linear least squares at its untied minimum."""

    def __init__(self, criterion: Criterion, fit: StructureFit) -> None:
        self.criterion, self.fit = criterion, fit
        settings = fit.model.settings
        self.structure = replace(fit.structure, ties=())
        scoped = criterion.fits.model(self.structure, settings)
        self.by_scope = scoped.follows
        stack = [name for name in scoped.free if name.partition("_")[2] in OF_STACK]
        untied = replace(self.structure, ties=tuple((n, settings[0].adjusters) for n in stack))
        base = replace(criterion.fits.model(untied, settings), weights=fit.model.weights)
        minimum = base.minimise(fit.values, ONE)
        self.base, self.untied = base, StructureFit(untied, base, minimum)
        jacobian, slope = minimum.system.triangle, minimum.system.gradient
        curvature = jacobian.T @ jacobian
        curvature += 1e-9 * np.diag(np.diag(curvature) + 1e-12)
        self.quadratic = Quadratic(minimum.cost, minimum.variables, slope, curvature)
        self.whose = [
            (u.name, next(s for s in base.settings if u.holds_at(s))) for u in base.border
        ]
        per_cost = criterion.samples(base.settings) / max(minimum.cost, 1e-300)
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
        criterion, settings = self.criterion, self.base.settings
        promised = criterion.above_floor(self.untied, max(cost, 0.0))
        price = criterion.of_numbers(unknowns, settings)
        return criterion.samples(settings) * promised + price

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
