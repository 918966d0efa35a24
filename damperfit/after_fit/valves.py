"""Valves as parts: what a fitted resistance or opening is in the workshop's terms.

An orifice passes w = sgn(dP) sqrt(abs(dP)) / S, and a hole of area A at discharge coefficient C_d
passes C_d A sqrt(2 rho abs(dP)), so

    C_d A = 1 / (S sqrt(2 rho)),    diameter = sqrt(4 A / pi)

A blow-off opens at the pressure p on its seat of area A_s, with the preload p A_s.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING, Any

from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConfigurationError
from damperfit.reporting.sheet import Sheet
from damperfit.tables.files import json_values

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.damper.model import Model, Values
    from damperfit.damper.quantity import Quantity
    from damperfit.results import Run, SettingResult

__all__ = ["Hole", "Orifices", "Preload", "read_valves", "sized_for"]

_ORIFICE = "s sqrt(N)/(m kg)"  # unit of S
_OPENING = "opening"
_JUMP = 2.5  # times the change of the clicks beside it
_FACTOR = 1e3  # within which a part is sized
_CLOSE = 1e-4  # of the wanted force


@dataclass(frozen=True, slots=True)
class Hole:
    """An orifice of one setting as one hole.

    Attributes
    ----------
    setting, quantity : str
        Whose it is.
    area, area_low, area_high : float
        m2, with a 95 % interval from the fit and the spread of C_d; NaN: not limited there.
    change : float or None
        Area less that of the setting before, m2.
    """

    setting: str
    quantity: str
    area: float
    area_low: float
    area_high: float
    change: float | None = None

    @property
    def diameter(self) -> float:
        """Of one round hole, m."""
        return math.sqrt(4.0 * self.area / math.pi)


@dataclass(frozen=True, slots=True)
class Preload:
    """The opening of a blow-off at one setting.

    Attributes
    ----------
    setting, quantity : str
        Whose it is.
    pressure, low, high : float
        Pa, with its 95 % interval; NaN: not limited there.
    force : float
        On the declared seat, N; NaN: no seat is declared.
    change : float or None
        Pressure less that of the setting before, Pa.
    """

    setting: str
    quantity: str
    pressure: float
    low: float
    high: float
    force: float
    change: float | None = None


@dataclass(frozen=True, slots=True)
class Orifices:
    """The valves of all settings, and what is odd about them.

    Attributes
    ----------
    holes, preloads : tuple
        By quantity, then setting.
    remarks : tuple of str
        Clicks at which an area or a preload jumps or goes the other way.
    """

    holes: tuple[Hole, ...]
    preloads: tuple[Preload, ...]
    remarks: tuple[str, ...]

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        holes = [asdict(hole) | {"diameter": hole.diameter} for hole in self.holes]
        document = {
            "holes": holes,
            "preloads": [asdict(preload) for preload in self.preloads],
            "remarks": list(self.remarks),
        }
        return {name: json_values(rows) for name, rows in document.items()}

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the tables of holes and of preloads."""
        holes = tuple(
            (
                hole.setting,
                hole.quantity,
                f"{1e6 * hole.area:.4g}",
                f"{1e6 * hole.area_low:.3g} to {1e6 * hole.area_high:.3g}",
                f"{1e3 * hole.diameter:.4g}",
                "-" if hole.change is None else f"{1e6 * hole.change:+.3g}",
            )
            for hole in self.holes
        )
        preloads = tuple(
            (
                preload.setting,
                preload.quantity,
                f"{1e-5 * preload.pressure:.4g}",
                f"{1e-5 * preload.low:.3g} to {1e-5 * preload.high:.3g}",
                "-" if math.isnan(preload.force) else f"{preload.force:.4g}",
                "-" if preload.change is None else f"{1e-5 * preload.change:+.3g}",
            )
            for preload in self.preloads
        )
        is_number = (False, False, True, True, True, True)
        return (
            Sheet(
                ("set", "orifice", "area", "95 %", "one hole", "click"),
                ("", "", "mm2", "mm2", "mm", "mm2"),
                holes,
                is_number,
            ),
            Sheet(
                ("set", "opening", "preload", "95 %", "on seat", "click"),
                ("", "", "bar", "bar", "N", "bar"),
                preloads,
                is_number,
            ),
        )


def read_valves(
    run: Run,
    *,
    discharge: float = 0.7,
    discharge_spread: float = 0.1,
    seat: float | None = None,
    reference: Run | None = None,
) -> Orifices:
    """Return the orifices and preloads of a run.

    Parameters
    ----------
    run : Run
        Of any model that has orifices or blow-offs.
    discharge, discharge_spread : float
        C_d, and how far it may be off; 0.1 covers sharp and rounded edges.
    seat : float, optional
        Diameter of the blow-off's seat, m.
    reference : Run, optional
        Of the same damper earlier: what has changed beyond both intervals is wear.

    Raises
    ------
    ConfigurationError
        The model has no such valve.
    """
    density = float(getattr(run.damper, "oil_density", math.nan))
    quantities = [q for q in run.damper.quantities if q.unit == _ORIFICE or q.part == _OPENING]
    if not quantities:
        raise ConfigurationError(
            f"{run.name}: the model {run.damper.name} has no orifices or preloaded valves",
            code="no-valves",
        )
    factor = 1.0 / (discharge * math.sqrt(2.0 * density))
    spread = discharge_spread / discharge
    seat_area = math.nan if seat is None else math.pi * seat**2 / 4.0
    holes: list[Hole] = []
    preloads: list[Preload] = []
    remarks: list[str] = []
    for quantity in quantities:
        rows = [_read(setting, quantity) for setting in run.settings]
        if quantity.part == _OPENING:
            found = [
                Preload(label, quantity.name, value, low, high, value * seat_area, change)
                for (label, value, low, high), change in _changes(rows)
            ]
            preloads += found
            remarks += _jumps(quantity, [(one.setting, one.pressure / 1e5) for one in found], "bar")
        else:
            areas = [
                (label, factor / value, *_area_limits(factor, value, low, high, spread))
                for label, value, low, high in rows
            ]
            sized = [
                Hole(label, quantity.name, area, low, high, change)
                for (label, area, low, high), change in _changes(areas)
            ]
            holes += sized
            remarks += _jumps(quantity, [(one.setting, 1e6 * one.area) for one in sized], "mm2")
        if reference is not None:
            remarks += _worn(quantity, run, reference)
    return Orifices(tuple(holes), tuple(preloads), tuple(remarks))


def sized_for(run: Run, setting: SettingResult, quantity: str, force: float, speed: float) -> float:
    """Return the value of a bleed or an opening that gives a force at a speed, SI.

    Parameters
    ----------
    force, speed : float
        N and m/s, both with the sign of the stroke.

    Raises
    ------
    ConfigurationError
        No value within a factor of a thousand gives it.
    """
    values = setting.parameters
    if quantity not in values.names:
        raise ConfigurationError(
            f"found {quantity!r}; expected one of {', '.join(values.names)}", code="no-quantity"
        )
    if not (math.isfinite(force) and math.isfinite(speed)):
        raise ConfigurationError(
            f"expected finite numbers, found {force:g} N at {speed:g} m/s", code="not-finite"
        )

    def missing(step: float) -> float:
        return _force(run.damper, values, quantity, math.exp(step), speed) - force

    low, high = -math.log(_FACTOR), math.log(_FACTOR)
    ends = missing(low), missing(high)
    if ends[0] * ends[1] > 0.0:
        reach = sorted(end + force for end in ends)
        raise ConfigurationError(
            f"no {quantity} gives {force:g} N at {speed:g} m/s: from a thousandth to a thousand "
            f"times the fitted one the force goes from {reach[0]:.4g} to {reach[1]:.4g} N",
            code="out-of-reach",
        )
    rises = ends[1] > ends[0]
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        gap = missing(middle)
        if abs(gap) < _CLOSE * abs(force):
            break
        low, high = (low, middle) if (gap > 0.0) == rises else (middle, high)
    return float(values[quantity]) * math.exp(0.5 * (low + high))


def _force(damper: Model, values: Values, quantity: str, factor: float, speed: float) -> float:
    changed = values.replace({quantity: values[quantity] * factor})
    return float(quasi_static(damper, changed, [speed]).forces[0])


def _read(setting: SettingResult, quantity: Quantity) -> tuple[str, float, float, float]:
    low, high = setting.intervals[quantity.name]
    value = float(setting.parameters[quantity.name])
    return setting.label, value, _or_nan(low), _or_nan(high)


def _or_nan(limit: float | None) -> float:
    return math.nan if limit is None else float(limit)


def _area_limits(
    factor: float, value: float, low: float, high: float, spread: float
) -> tuple[float, float]:
    """A large S is a small hole; the relative errors of S and C_d add in squares."""
    area = factor / value
    below = math.hypot(1.0 - value / high, spread)
    above = math.hypot(value / low - 1.0, spread)
    return area * (1.0 - below), area * (1.0 + above)


def _changes(
    rows: Sequence[tuple[str, float, float, float]],
) -> Iterator[tuple[tuple[str, float, float, float], float | None]]:
    before: float | None = None
    for row in rows:
        yield row, None if before is None else row[1] - before
        before = row[1]


def _jumps(quantity: Quantity, curve: Sequence[tuple[str, float]], unit: str) -> Iterator[str]:
    """Say where a click changes a valve far more than the others, or the other way."""
    steps = [(first[0], second[0], second[1] - first[1]) for first, second in pairwise(curve)]
    if len(steps) < 4:
        return
    way = math.copysign(1.0, sum(step for *_, step in steps))
    for k, (first, second, step) in enumerate(steps):
        near = [abs(other) for *_, other in (*steps[max(k - 2, 0) : k], *steps[k + 1 : k + 3])]
        usual = median(near)
        if abs(step) > _JUMP * usual:
            yield (
                f"{quantity.symbol}: {step:+.3g} {unit} from setting {first} to {second}, "
                f"{abs(step) / usual:.2g} times the clicks beside it: a port opens or closes, or a "
                "jet is blocked"
            )
        elif step * way < -0.5 * usual:
            yield (
                f"{quantity.symbol}: {step:+.3g} {unit} from setting {first} to {second}, against "
                "the other clicks: play in the adjuster, or a damaged needle"
            )


def _worn(quantity: Quantity, run: Run, reference: Run) -> Iterator[str]:
    """Say where a valve has changed since an earlier run by more than both intervals."""
    earlier = {setting.label: setting for setting in reference.settings}
    for setting in run.settings:
        other = earlier.get(setting.label)
        if other is None or quantity.name not in other.parameters.names:
            continue
        _, now, low, high = _read(setting, quantity)
        _, then, first, last = _read(other, quantity)
        if first > high or last < low:
            yield (
                f"{quantity.symbol} of setting {setting.label}: "
                f"{100.0 * (now / then - 1.0):+.2g} % since {reference.name}, beyond both intervals"
            )
