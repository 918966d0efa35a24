"""Valves as parts: what a fitted resistance or opening is in the workshop's terms.

An orifice passes w = sgn(dP) sqrt(abs(dP)) / S, and a hole of area A at discharge coefficient C_d
passes C_d A sqrt(2 rho abs(dP)), so

    C_d A = 1 / (S sqrt(2 rho)),    diameter = sqrt(4 A / pi)

A blow-off opens at the pressure p on its seat of area A_s, with the preload p A_s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConfigurationError
from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import NOTHING, Column, Sheet, laid_out, number
from damperfit.tables.files import json_values
from damperfit.tested.setting import clicks_between

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.results import Run, SettingResult

_ORIFICE = "s sqrt(N)/(m kg)"  # unit of S
_OPENING = "opening"
_SHOWN = {True: (1e-5, "bar"), False: (1e6, "mm2")}  # of a preload, of a hole
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
    """The valves of all settings by quantity, and clicks at which they jump or go the other way."""

    holes: tuple[Hole, ...]
    preloads: tuple[Preload, ...]
    remarks: tuple[str, ...]
    sized: tuple[Sized, ...] = ()  # for a force that was asked for
    sentence: str = ""

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of the table "valve_parts"."""
        names = ("area_m2", "area_ci_low_m2", "area_ci_high_m2", "diameter_m", "area_change_m2")
        others = (
            "pressure_Pa",
            "pressure_ci_low_Pa",
            "pressure_ci_high_Pa",
            "",
            "pressure_change_Pa",
        )
        both: list[tuple[Any, tuple[str, ...]]] = [(one, names) for one in self.holes]
        both += [(one, others) for one in self.preloads]
        return [
            {
                "setting": one.setting,
                "quantity": one.quantity,
                **dict(zip(of, one[2:], strict=True)),
            }
            for one, of in both
        ]

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        tables: dict[str, Sequence[Any]] = {
            "holes": self.holes,
            "preloads": self.preloads,
            "sized": self.sized,
        }
        shown = {name: [one._asdict() for one in rows] for name, rows in tables.items()}
        document: dict[str, Any] = json_values(shown | {"remarks": list(self.remarks)})
        return document

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the tables of holes and of preloads, and of what a wanted force takes."""

        def table(rows: Sequence[Any], named: str, what: str, last: Column) -> Sheet:
            size, unit = _SHOWN[what == "preload"]

            def interval(row: Any) -> str:
                ends = [number(size * end, digits=3) for end in row[3:5]]
                return NOTHING if {*ends} == {NOTHING} else " to ".join(ends)

            def change(row: Any) -> str:
                return NOTHING if row.change is None else f"{size * row.change:+.3g}"

            columns = (
                Column("set", "", lambda row: row.setting, is_number=False),
                Column(named, "", lambda row: row.quantity, is_number=False),
                Column(what, unit, lambda row: f"{size * row[2]:.4g}"),
                Column("95 %", unit, interval),
                last,
                Column("a click", unit, change),
            )
            return laid_out(rows, columns)

        def in_unit(name: str) -> Column:
            def cell(row: Sized) -> str:
                size, unit = _SHOWN[math.isnan(row.diameter)]
                return f"{size * getattr(row, name):.4g} {unit}"

            return Column(name, "", cell)

        def as_part(row: Sized) -> str:
            if not math.isnan(row.diameter):
                return f"hole of {1e3 * row.diameter:.4g} mm"
            on_seat = number(row.seat_force)
            return on_seat if on_seat == NOTHING else f"{row.seat_force:.4g} N on the seat"

        hole = Column("one hole", "mm", lambda row: f"{1e3 * row.diameter:.4g}")
        seat = Column("on seat", "N", lambda row: number(row.force, digits=4))
        wanted = (
            Column("set", "", lambda row: row.setting, is_number=False),
            Column("part", "", lambda row: row.quantity, is_number=False),
            *(in_unit("now"), in_unit("wanted")),
            Column("that is", "", as_part),
        )
        return (
            table(self.holes, "orifice", "area", hole),
            table(self.preloads, "opening", "preload", seat),
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
    seat_area, spread = math.pi * (seat or math.nan) ** 2 / 4.0, discharge_spread / discharge
    holes: list[Hole] = []
    preloads: list[Preload] = []
    remarks = [] if reference is None else list(unlike(run, reference))
    for quantity in run.damper.quantities:
        is_opening = quantity.part == _OPENING
        if not is_opening and quantity.unit != _ORIFICE:
            continue
        steps: list[tuple[str, str, float]] = []  # of one click, between two settings
        before: tuple[SettingResult, float] | None = None
        shown, unit = _SHOWN[is_opening]
        for setting in run.settings:
            value, low, high = _read(setting, quantity)
            size, limits = value, (low, high)
            if not is_opening and value <= 0.0:  # as only an edited file has it
                remarks.append(
                    f"{quantity.symbol} of setting {setting.label}: {value:g}, expected above 0; "
                    "left out"
                )
                continue
            if not is_opening:  # a large S is a small hole; the errors of S and C_d add in squares
                size = factor / value
                below, above = (math.hypot(x, spread) for x in (1 - value / high, value / low - 1))
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
            why = "a port opens or closes, or a jet is blocked"
            yield f"{place}, {times} the clicks beside it: {why}"
        elif step * way < -0.5 * usual:
            yield f"{place}, against the other clicks: play in the adjuster, or a damaged needle"


def _worn(quantity: Quantity, run: Run, reference: Run) -> Iterator[str]:
    """Say where a valve has changed since an earlier run by more than both intervals."""
    earlier = {setting.label: _read(setting, quantity) for setting in reference.settings}
    for setting in run.settings:
        now, low, high = _read(setting, quantity)
        then, first, last = earlier.get(setting.label, (0.0, 0.0, 0.0))
        if then and (first > high or last < low):
            yield (
                f"{quantity.symbol} of setting {setting.label}: {100.0 * (now / then - 1.0):+.2g} "
                f"% since {reference.name}, beyond both intervals"
            )


def unlike(run: Run, reference: Run) -> Iterator[str]:
    """Say in what a reference is of another damper."""
    for key in ("serial", "damper"):
        own, other = run.identity.get(key), reference.identity.get(key)
        if own and other and own != other:
            yield f"{key} {own}, but {reference.name} is of {key} {other}"
    if run.damper.plain != reference.damper.plain:
        yield f"the damper of {reference.name} is declared otherwise"


# The inverse: the part for a force


def sized(found: Orifices, run: Run, force: float, speed: float) -> Orifices:
    """Return the valves with what each alone must be for a force at a signed speed."""
    from scipy.optimize import brentq

    settings, rows = {one.label: one for one in run.settings}, []
    reach = math.log(_FACTOR)
    parts: list[Hole | Preload] = [*found.holes, *found.preloads]
    for part in parts:
        values, name = settings[part.setting].parameters, part.quantity

        def missing(step: float, values: Values = values, name: str = name) -> float:
            changed = values.replace({name: values[name] * math.exp(step)})
            return float(quasi_static(run.damper, changed, [speed]).forces[0]) - force

        try:
            if missing(-reach) * missing(reach) > 0.0:
                continue  # no value of it gives that force
            times = math.exp(brentq(missing, -reach, reach, xtol=1e-6))
        except ConfigurationError:  # nor can it be asked
            continue
        if isinstance(part, Hole):  # its area goes with 1/S
            wanted = (part.area / times, part.diameter / math.sqrt(times), math.nan)
        else:
            wanted = (part.pressure * times, math.nan, part.force * times)
        rows.append(Sized(part.setting, name, part[2], *wanted))
    sentence = f"{force:.5g} N at {speed:g} m/s: no orifice or preload alone gives it"
    if rows:
        n = len({one.setting for one in rows})
        words = f"what one part alone must be for it, at {n} of {len(settings)} settings"
        sentence = f"{force:.5g} N at {speed:g} m/s: {words}"
    return replace(found, sized=tuple(rows), sentence=sentence)
