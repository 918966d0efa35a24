"""Forces between tested settings: the damper with the values that lie between theirs.

An adjuster moves areas and preloads. These are smooth along the clicks; the force is not, it bends
where a valve opens. So the values are interpolated, each by the logarithm, with a monotone cubic
(PCHIP), and the force is the quasi-static one of the damper that has them. The difference of the
given forces (measured ones, most of all) from these is interpolated likewise and added, so that the
curve passes every given force.

Alternative curves show what may hide between settings: straight lines of the values, and straight
lines of areas (1/y), as a needle that is turned opens a port. A valve that stays closed at a
setting determines neither its preload nor its slope there: it has those of the nearest setting that
determines them, as far as its own logs allow it, and may have half or twice of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from damperfit.adjustment.force_at import STROKES, Stage
from damperfit.arrays import FloatArray
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import SimulationError

if TYPE_CHECKING:
    from damperfit.damper.model import Model, Quantity, Values
    from damperfit.tested.setting import Setting

# What a closed valve does not determine lies within this factor of the nearest setting where it is
# determined: a step of a preload adjuster changes the preload by 1.5 to 2.3 times.
_FACTOR = 2.0
_MOVES = 1e-3  # of a force: less is invisible
SMOOTH, STRAIGHT, AREAS, LEAST, MOST = "smooth", "straight", "areas", "least", "most"
BENDS = (STRAIGHT, AREAS)
# How far truth may lie from the curve, as a multiple of the distance of the alternative curves: of
# the paper's settings left out 90 of 100 intervals hold with 1.4 (ten known), 94 to 98 with this.
BEND = 2.5
_CURVE = 3  # settings; two alone show no curve


class Interpolated(NamedTuple):
    """A setting that was not tested, between two that were."""

    values: Values
    neighbours: tuple[Stage, Stage]
    others: Mapping[str, Values]  # by the alternative curves

    def spread(self, damper: Model, speed: float) -> float:
        """Return how far the force at a speed, m/s, may be off between the two settings, N."""
        force = quasi_static(damper, self.values, [speed]).forces[0]
        others = {k: quasi_static(damper, v, [speed]).forces[0] for k, v in self.others.items()}
        return max((BEND if k in BENDS else 1.0) * abs(float(f - force)) for k, f in others.items())


def values_between(damper: Model, stages: Sequence[Stage], setting: Setting) -> Interpolated | None:
    """Return the parameters of a setting between two tested ones; None: too few were tested.

    An offset, which is each test's own, is the mean of theirs.
    """
    for adjuster, place in setting.places:
        turned = {
            number: stage
            for stage in stages
            if (number := stage.setting.number(adjuster)) is not None
            and dict(stage.setting.places) | {adjuster: place} == dict(setting.places)
        }
        at, places = setting.number(adjuster), sorted(turned)
        if at is not None and len(places) >= _CURVE and places[0] < at < places[-1]:
            line = [turned[number] for number in places]
            curve = Between(damper, line, np.array(places), np.zeros(len(line)))
            first = line[0].parameters
            means = {q.name for q in first.quantities if q.is_offset}
            values, *alternatives = (
                first.replace({
                    name: float(np.mean(row))
                    if name in means
                    else float(curve.values_at(first.quantity(name), np.array([at]), kind)[0])
                    for name, row in curve.values.items()
                })
                for kind in curve.kinds
            )  # fmt: skip
            above = int(np.searchsorted(places, at))
            by_kind = dict(zip(curve.kinds[1:], alternatives, strict=True))
            return Interpolated(values, (line[above - 1], line[above]), by_kind)
    return None


class Between:
    """The model's force along the clicks of one adjuster, at one speed and stroke."""

    def __init__(
        self,
        damper: Model | None,
        stages: Sequence[Stage],
        places: FloatArray,
        forces: FloatArray,
        *,
        speed: float = math.nan,
        stroke: str = STROKES[0],
    ) -> None:
        self.damper, self.stages, self.places, self.given = damper, stages, places, forces
        self.speed = speed if stroke == STROKES[0] else -speed
        names = [q.name for q in stages[0].parameters.quantities] if damper and stages else []
        # Values that differ between settings, and limits of those that closed valves leave open.
        self.values = {
            name: np.array([getattr(stage.parameters, name) for stage in stages]) for name in names
        }
        self.values = {name: row for name, row in self.values.items() if np.ptp(row) > 0.0}
        by_stage = [dict(stage.open_limits) for stage in stages]
        self.limits = {
            name: limits
            for name in self.values
            if None in (limits := [by_name.get(name) for by_name in by_stage]) and any(limits)
        }
        self.kinds = [SMOOTH, STRAIGHT, AREAS] if self.values else [SMOOTH, STRAIGHT]
        self.kinds += [LEAST, MOST] if self.limits else []
        self._offsets: dict[str, FloatArray] = {}  # given less modelled forces of the settings

    def forces(self, at: Sequence[float] | FloatArray, kind: str = SMOOTH) -> FloatArray:
        """Return the forces at some positions, by one kind of curve, N."""
        at = np.asarray(at, dtype=np.float64)
        plain = _along(self.places, self.given, at, is_smooth=kind != STRAIGHT)
        if kind not in self._offsets:
            self._offsets[kind] = self.given - self._modelled(self.places, kind)
        if not np.all(np.isfinite(self._offsets[kind])):
            return plain
        forces = self._modelled(at, kind) + _along(self.places, self._offsets[kind], at)
        return forces if np.all(np.isfinite(forces)) else plain  # of one kind: no jump between

    def undetermined(self, gap: int, place: float) -> tuple[str, ...]:
        """What a closed valve leaves open at a gap's settings and moves the force there, in words.

        Values of the other stroke's valve move no force of this one.
        """
        labels = []
        for name, limits in self.limits.items():
            at = np.array([place])
            extremes = [self._modelled(at, kind, only=name)[0] for kind in (LEAST, MOST)]
            if abs(extremes[1] - extremes[0]) > _MOVES * max(map(abs, extremes)):
                label = self.stages[0].parameters.quantity(name).label
                ends = (k for k in (gap, gap + 1) if limits[k] is not None)
                labels += [f"{label} at {self.stages[k].setting}" for k in ends]
        return tuple(labels)

    def _modelled(self, at: FloatArray, kind: str, only: str = "") -> FloatArray:
        """Return the model's forces at some positions, else NaN; `only`: `kind` is of one value."""
        forces = np.full(len(at), math.nan)
        if self.damper is None or not self.values:
            return forces
        first = self.stages[0].parameters
        kinds = {name: kind if only in {"", name} else SMOOTH for name in self.values}
        rows = {name: self.values_at(first.quantity(name), at, k) for name, k in kinds.items()}
        try:
            for i in range(len(at)):
                values = first.replace({name: float(row[i]) for name, row in rows.items()})
                forces[i] = quasi_static(self.damper, values, [self.speed]).forces[0]
        except SimulationError:
            forces[:] = math.nan
        return forces

    def values_at(self, quantity: Quantity, at: FloatArray, kind: str) -> FloatArray:
        """Return the values of a quantity at some positions, by one kind of curve."""
        y = self.values[quantity.name]
        if not quantity.is_logarithmic:
            return _along(self.places, y, at, is_smooth=kind == SMOOTH)
        if quantity.name in self.limits:
            y = self._completed(y, self.limits[quantity.name], kind)
        vanishes = any(quantity.edge_at(value) for value in y)
        if kind == AREAS or vanishes:  # a port that closes has no area, and no logarithm of it
            power = 1.0 if vanishes and quantity.idle_edges[:1] == ("below",) else -1.0
            return _along(self.places, y**power, at, is_smooth=kind == SMOOTH) ** (1.0 / power)
        return np.exp(_along(self.places, np.log(y), at, is_smooth=kind == SMOOTH))

    def _completed(
        self, y: FloatArray, limits: Sequence[tuple[float, float] | None], kind: str
    ) -> FloatArray:
        """Values of a quantity that closed valves do not determine at some settings."""
        determined = np.array([k for k, limit in enumerate(limits) if limit is None])
        y = y.copy()
        for k, pair in enumerate(limits):
            if pair is not None:
                nearest = y[determined[np.argmin(np.abs(self.places[determined] - self.places[k]))]]
                factor = {LEAST: 1.0 / _FACTOR, MOST: _FACTOR}.get(kind, 1.0)
                y[k] = min(max(factor * nearest, pair[0]), pair[1])
        return y


def _along(
    places: FloatArray, y: FloatArray, at: FloatArray, *, is_smooth: bool = True
) -> FloatArray:
    from scipy.interpolate import PchipInterpolator

    if is_smooth and len(places) > 1:
        return np.asarray(PchipInterpolator(places, y)(at))
    return np.interp(at, places, y)
