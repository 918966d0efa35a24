"""Valves as parts: what a fitted resistance or opening is in the workshop's terms.

An orifice passes w = sgn(dP) sqrt(abs(dP)) / S, and a hole of area A at discharge coefficient C_d
passes C_d A sqrt(2 rho abs(dP)), so

    C_d A = 1 / (S sqrt(2 rho)),    diameter = sqrt(4 A / pi)

A blow-off opens at the pressure p on its seat of area A_s, with the preload p A_s.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConfigurationError
from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import Column, Sheet, laid_out, number
from damperfit.tables.files import json_values
from damperfit.tested.setting import clicks_between

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.damper.quantity import Quantity
    from damperfit.results import Run, SettingResult

_ORIFICE = "s sqrt(N)/(m kg)"  # unit of S
_OPENING = "opening"
_JUMP = 2.5  # times the change of the clicks beside it
_FEWEST = 4  # steps of which one can stand out
_FACTOR = 1e3  # within which a part is sized


class Hole(NamedTuple):
    """An orifice of one setting as one hole.

    The 95 % interval is of the fit and of the spread of C_d; NaN: not limited there.
    """

    setting: str
    quantity: str
    area: float  # m2
    area_low: float
    area_high: float
    diameter: float  # of one round hole, m
    change: float | None  # a click, since the setting before on the adjuster's line, m2


class Preload(NamedTuple):
    """The opening of a blow-off at one setting, with its 95 % interval; NaN: not limited there."""

    setting: str
    quantity: str
    pressure: float  # Pa
    low: float
    high: float
    force: float  # on the declared seat, N; NaN: no seat is declared
    change: float | None  # a click, since the setting before on the adjuster's line, Pa


class Sized(NamedTuple):
    """What an orifice (m2) or a preload (Pa) is at one setting, and what it must be for a force."""

    setting: str
    quantity: str
    now: float
    wanted: float
    diameter: float  # of one hole of the wanted area, m; NaN: it is a preload
    seat_force: float  # of the wanted preload, N; NaN: a hole, or no seat is declared


@dataclass(frozen=True, repr=False, eq=False)
class Orifices(Answer):
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
    sized: tuple[Sized, ...] = ()  # for a force that was asked for
    sentence: str = ""

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        return {
            "holes": json_values([hole._asdict() for hole in self.holes]),
            "preloads": json_values([preload._asdict() for preload in self.preloads]),
            "sized": json_values([one._asdict() for one in self.sized]),
            "remarks": list(self.remarks),
        }

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the tables of holes and of preloads, and of what a wanted force takes."""

        def columns(name: str, unit: str, size: float, last: Column) -> list[Column]:
            def change(row: Any) -> str:
                return "-" if row.change is None else f"{size * row.change:+.3g}"

            def interval(row: Any) -> str:
                low, high = (number(size * end, digits=3) for end in row[3:5])
                return "-" if low == high == "-" else f"{low} to {high}"

            return [
                Column("set", "", lambda row: row.setting, is_number=False),
                Column(name, "", lambda row: row.quantity, is_number=False),
                Column(
                    "preload" if unit == "bar" else "area", unit, lambda row: f"{size * row[2]:.4g}"
                ),
                Column("95 %", unit, interval),
                last,
                Column("a click", unit, change),
            ]

        def on_seat(row: Preload) -> str:
            return "-" if math.isnan(row.force) else f"{row.force:.4g}"

        hole = Column("one hole", "mm", lambda row: f"{1e3 * row.diameter:.4g}")
        seat = Column("on seat", "N", on_seat)
        sizes = {True: (1e-5, "bar"), False: (1e6, "mm2")}

        def size(name: str) -> Column:
            def cell(row: Sized) -> str:
                factor, unit = sizes[math.isnan(row.diameter)]
                return f"{factor * getattr(row, name):.4g} {unit}"

            return Column(name, "", cell)

        def as_part(row: Sized) -> str:
            if not math.isnan(row.diameter):
                return f"hole of {1e3 * row.diameter:.4g} mm"
            return "-" if math.isnan(row.seat_force) else f"{row.seat_force:.4g} N on the seat"

        wanted = (
            Column("set", "", lambda row: row.setting, is_number=False),
            Column("part", "", lambda row: row.quantity, is_number=False),
            *(size("now"), size("wanted")),
            Column("that is", "", as_part),
        )
        return (
            laid_out(self.holes, columns("orifice", "mm2", 1e6, hole)),
            laid_out(self.preloads, columns("opening", "bar", 1e-5, seat)),
            laid_out(self.sized, wanted),
        )


def read_valves(
    run: Run,
    *,
    discharge: float = 0.7,
    discharge_spread: float = 0.1,
    seat: float | None = None,
    reference: Run | None = None,
) -> Orifices:
    """Return the orifices and preloads of a run of any model that has them."""
    factor = 1.0 / (discharge * math.sqrt(2.0 * getattr(run.damper, "oil_density", math.nan)))
    seat_area = math.nan if seat is None else math.pi * seat**2 / 4.0
    holes: list[Hole] = []
    preloads: list[Preload] = []
    remarks = [] if reference is None else list(unlike(run, reference))
    for quantity in run.damper.quantities:
        is_opening = quantity.part == _OPENING
        if not is_opening and quantity.unit != _ORIFICE:
            continue
        steps: list[tuple[str, str, float]] = []  # of one click, between two settings
        before: tuple[SettingResult, float] | None = None
        shown, unit = (1e-5, "bar") if is_opening else (1e6, "mm2")
        for setting in run.settings:
            value, low, high = _read(setting, quantity)
            if is_opening:
                size, limits = value, (low, high)
            elif value <= 0.0:  # as only an edited file has it
                remarks.append(
                    f"{quantity.symbol} of setting {setting.label}: {value:g}, expected above 0; "
                    "left out"
                )
                continue
            else:  # a large S is a small hole; the errors of S and C_d add in squares
                size, spread = factor / value, discharge_spread / discharge
                below, above = (
                    math.hypot(1.0 - value / high, spread),
                    math.hypot(value / low - 1.0, spread),
                )
                limits = size * (1.0 - below), size * (1.0 + above)
            clicks = clicks_between(before[0].setting, setting.setting) if before else None
            change = (size - before[1]) / clicks if before and clicks else None
            place = (setting.label, quantity.name, size, *limits)
            if is_opening:
                preloads.append(Preload(*place, size * seat_area, change))
            else:
                holes.append(Hole(*place, math.sqrt(4.0 * size / math.pi), change))
            if before and change is not None:
                steps.append((before[0].label, setting.label, shown * change))
            before = setting, size
        remarks += _jumps(quantity, steps, unit) if len(steps) >= _FEWEST else ()
        remarks += () if reference is None else _worn(quantity, run, reference)
    if not holes and not preloads:
        raise ConfigurationError(
            f"{run.name}: the model {run.damper.name} has no orifices or preloaded valves",
            code="no-valves",
        )
    return Orifices(tuple(holes), tuple(preloads), tuple(remarks))


def sized(found: Orifices, run: Run, force: float, speed: float) -> Orifices:
    """Return the valves with what each alone must be for a force at a signed speed."""
    settings, rows = {one.label: one for one in run.settings}, []
    parts: list[Hole | Preload] = [*found.holes, *found.preloads]
    for part in parts:
        setting = settings[part.setting]
        with suppress(ConfigurationError):  # no value of it gives that force
            value = sized_for(run, setting, part.quantity, force, speed)
            times = value / float(setting.parameters[part.quantity])
            now, wanted, diameter, seat_force = part[2], value, math.nan, math.nan
            if isinstance(part, Preload):
                seat_force = part.force * times
            else:  # its area goes with 1/S
                wanted, diameter = part.area / times, part.diameter / math.sqrt(times)
            rows.append(Sized(part.setting, part.quantity, now, wanted, diameter, seat_force))
    asked = f"{force:.5g} N at {speed:g} m/s"
    sentence = f"{asked}: no orifice or preload alone gives it"
    if rows:
        n = len({one.setting for one in rows})
        sentence = (
            f"{asked}: what one part alone must be for it, at {n} of {len(settings)} settings"
        )
    return replace(found, sized=tuple(rows), sentence=sentence)


def sized_for(run: Run, setting: SettingResult, quantity: str, force: float, speed: float) -> float:
    """Return the value of a bleed or an opening that gives a force at a speed, SI."""
    from scipy.optimize import brentq

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
        changed = values.replace({quantity: values[quantity] * math.exp(step)})
        return float(quasi_static(run.damper, changed, [speed]).forces[0]) - force

    reach = math.log(_FACTOR)
    low, high = sorted((missing(-reach), missing(reach)))
    if low * high > 0.0:
        raise ConfigurationError(
            f"no {quantity} gives {force:g} N at {speed:g} m/s: from a thousandth to a thousand "
            f"times the fitted one the force goes from {low + force:.4g} to {high + force:.4g} N",
            code="out-of-reach",
        )
    return float(values[quantity]) * math.exp(brentq(missing, -reach, reach, xtol=1e-6))


def _read(setting: SettingResult, quantity: Quantity) -> tuple[float, float, float]:
    low, high = (one or math.nan for one in setting.intervals[quantity.name])
    return float(setting.parameters[quantity.name]), low, high


def _jumps(quantity: Quantity, steps: Sequence[tuple[str, str, float]], unit: str) -> Iterator[str]:
    """Say where a click changes a valve far more than the others, or the other way."""
    way = math.copysign(1.0, sum(step for *_, step in steps))
    for k, (first, second, step) in enumerate(steps):
        usual = median(abs(near) for *_, near in (*steps[max(k - 2, 0) : k], *steps[k + 1 : k + 3]))
        place = f"{quantity.symbol}: {step:+.3g} {unit} a click from setting {first} to {second}"
        if abs(step) > _JUMP * usual:
            times = f"{abs(step) / usual:.2g} times" if usual else "unlike"
            yield (
                f"{place}, {times} the clicks beside it: a port opens or closes, or a jet is "
                "blocked"
            )
        elif step * way < -0.5 * usual:
            yield (f"{place}, against the other clicks: play in the adjuster, or a damaged needle")


def _worn(quantity: Quantity, run: Run, reference: Run) -> Iterator[str]:
    """Say where a valve has changed since an earlier run by more than both intervals."""
    earlier = {setting.label: setting for setting in reference.settings}
    for setting in run.settings:
        if setting.label in earlier:
            now, low, high = _read(setting, quantity)
            then, first, last = _read(earlier[setting.label], quantity)
            if then and (first > high or last < low):
                yield (
                    f"{quantity.symbol} of setting {setting.label}: "
                    f"{100.0 * (now / then - 1.0):+.2g} % since {reference.name}, beyond both "
                    "intervals"
                )


def unlike(run: Run, reference: Run) -> Iterator[str]:
    """Say in what a reference is of another damper."""
    for key in ("serial", "damper"):
        own, other = run.identity.get(key), reference.identity.get(key)
        if own and other and own != other:
            yield f"{key} {own}, but {reference.name} is of {key} {other}"
    if run.damper.plain != reference.damper.plain:
        yield f"the damper of {reference.name} is declared otherwise"
