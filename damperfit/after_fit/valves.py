"""Valves as parts: what a fitted resistance or opening is in the workshop's terms.

An orifice passes w = sgn(dP) sqrt(abs(dP)) / S, and a hole of area A at discharge coefficient C_d
passes C_d A sqrt(2 rho abs(dP)), so

    C_d A = 1 / (S sqrt(2 rho)),    diameter = sqrt(4 A / pi)

A blow-off opens at the pressure p on its seat of area A_s, with the preload p A_s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING, Any

from damperfit.damper.model import Quantity, Values
from damperfit.damper.quasi_static import quasi_static
from damperfit.errors import ConfigurationError
from damperfit.reporting.answer import Answer
from damperfit.reporting.sheet import NOTHING, Column, Sheet, laid_out, number, with_interval
from damperfit.tables.files import finite, json_values
from damperfit.tested.setting import Setting, clicks_between, lines_of

if TYPE_CHECKING:
    from damperfit.results import Run
    from damperfit.settings_and_logs import SettingResult

    Row = Mapping[str, Any]

_ORIFICE = "s sqrt(N)/(m kg)"  # unit of S
_OPENING = "opening"
_JUMP = 2.5  # times the change of the clicks beside it
_FEWEST = 4  # steps of which one can stand out
_FACTOR = 1e3  # within which a part is sized
# How a size stands in the rows, its name and unit in SI, and how it is shown.
_HOLE, _PRELOAD = ("area", "m2", 1e6, "mm2"), ("pressure", "Pa", 1e-5, "bar")


@dataclass(frozen=True, repr=False, eq=False)
class Orifices(Answer):
    """The valves of all settings by quantity, and clicks at which they jump or go the other way.

    `rows` are those of the table "valve_parts", SI: orifices as holes, with the 95 % interval of
    the fit and of the spread of C_d, and openings as preloads, with their "seat_force_N" where a
    seat is declared. What is not limited is None. `sized` are rows of what each part is "now" and
    must be, "wanted", in its "unit", for a force that was asked for.
    """

    rows: tuple[Row, ...]
    remarks: tuple[str, ...]
    sized: tuple[Row, ...] = ()
    sentence: str = ""

    @property
    def holes(self) -> tuple[Row, ...]:
        """The orifices."""
        return tuple(row for row in self.rows if row.get("area_m2") is not None)

    @property
    def preloads(self) -> tuple[Row, ...]:
        """The openings."""
        return tuple(row for row in self.rows if row.get("pressure_Pa") is not None)

    def document(self) -> dict[str, Any]:
        """Return all of it as JSON values."""
        names = ("holes", "preloads", "sized", "remarks")
        document: dict[str, Any] = json_values({name: getattr(self, name) for name in names})
        return document

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the tables of holes and of preloads, and of what a wanted force takes."""

        def table(rows: Sequence[Row], kind: Any, named: str, shown: str, last: Column) -> Sheet:
            what, si, factor, unit = kind
            steps = (abs(row[f"{what}_change_{si}"] or 0.0) for row in rows)
            # All clicks are shown to the third digit of the largest.
            largest = factor * max(steps, default=0.0) or 1.0
            decimals = max(0, 2 - math.floor(math.log10(largest)))

            def size(row: Row) -> str:
                ends = (row[f"{what}{end}_{si}"] for end in ("", "_ci_low", "_ci_high"))
                return with_interval(*(end and factor * end for end in ends), digits=3)

            def change(row: Row) -> str:
                step = row[f"{what}_change_{si}"]
                return NOTHING if step is None else f"{factor * step:+.{decimals}f}"

            columns = (
                *(Column.text("set", "setting"), Column.text(named, "quantity")),
                *(Column(shown, f"{unit} ±95 %", size), last, Column("a click", unit, change)),
            )
            return laid_out(rows, columns)

        def in_unit(name: str) -> Column:
            def cell(row: Row) -> str:
                *_, factor, unit = _HOLE if row["unit"] == "m2" else _PRELOAD
                return f"{number(factor * row[name], digits=4)} {unit}"

            return Column(name, "", cell)

        def that_is(row: Row) -> str:
            if row["diameter_m"] is not None:
                return f"hole of {number(1e3 * row['diameter_m'], digits=4)} mm"
            force = number(row["seat_force_N"], digits=4)
            return force if force == NOTHING else f"{force} N on the seat"

        hole = Column.of("one hole", "mm", "diameter_m", digits=3, factor=1e3)
        on_seat = Column.of("on seat", "N", "seat_force_N", digits=3)
        wanted = (
            *(Column.text("set", "setting"), Column.text("part", "quantity")),
            *(in_unit("now"), in_unit("wanted"), Column("that is", "", that_is)),
        )
        return (
            table(self.holes, _HOLE, "orifice", "area", hole),
            table(self.preloads, _PRELOAD, "opening", "preload", on_seat),
            laid_out(self.sized, wanted),
        )


def read_valves(
    run: Run, discharge: float, spread: float, *, seat: float | None, reference: Run | None
) -> Orifices:
    """Return the orifices and preloads of a run of any model that has them.

    The discharge coefficient has a `spread`; the seat's diameter is in m.
    """
    rows: list[dict[str, Any]] = []
    remarks = [] if reference is None else list(unlike(run, reference))
    for quantity in run.damper.quantities:
        if quantity.part != _OPENING and quantity.unit != _ORIFICE:
            continue
        mine = list(_rows(run, quantity, discharge, spread / discharge))
        shown = {row["setting"] for row in mine}
        remarks += (
            f"{quantity.symbol} of setting {setting.label}: {setting.values[quantity.name]:g}, "
            "expected above 0; left out"
            for setting in run.settings
            if setting.setting not in shown
        )
        remarks += _jumps(run, quantity, mine)
        remarks += () if reference is None else _worn(quantity, run, reference)
        rows += mine
    if not rows:
        raise ConfigurationError(
            f"{run.name}: the model {run.damper.name} has no orifices or preloaded valves",
            code="no-valves",
        )
    for row in rows:
        if seat is not None and row.get("pressure_Pa") is not None:
            row["seat_force_N"] = math.pi * seat**2 / 4.0 * row["pressure_Pa"]
    return Orifices(tuple(rows), tuple(remarks))


def _rows(
    run: Run, quantity: Quantity, discharge: float, spread: float
) -> Iterator[dict[str, Any]]:
    """Yield a valve at each setting that has it; the spread is relative."""
    factor = 1.0 / (discharge * math.sqrt(2.0 * getattr(run.damper, "oil_density", math.nan)))
    what, si, *_ = _kind(quantity)
    sizes: dict[Setting, float] = {}
    before = {b: a for line in _lines(run, quantity) for a, b in pairwise(line)}
    for setting in run.settings:
        (size, low, high), more = _read(setting, quantity), {}
        if what == "area":
            if size <= 0.0:  # as only an edited file has it
                continue
            # A large S is a small hole; the errors of S and C_d add in squares.
            below, above = (math.hypot(x, spread) for x in (1 - size / high, size / low - 1))
            size = factor / size
            low, high = size * (1.0 - below), size * (1.0 + above)
            more = {"diameter_m": math.sqrt(4.0 * size / math.pi)}
        first = before.get(setting.setting)
        clicks = clicks_between(first, setting.setting) if first in sizes else None
        change = (size - sizes[first]) / clicks if first and clicks else math.nan
        ends = {"": size, "_ci_low": low, "_ci_high": high, "_change": change}
        numbers = {f"{what}{end}_{si}": finite(value) for end, value in ends.items()}
        yield {"setting": setting.setting, "quantity": quantity.name, **numbers, **more}
        sizes[setting.setting] = size


def _lines(run: Run, quantity: Quantity) -> list[tuple[Setting, ...]]:
    """Return the lines of settings along the adjuster that moves a valve most."""
    sizes = {s.setting: float(s.parameters[quantity.name]) for s in run.settings}
    lines = lines_of(sizes)

    def moved(adjuster: str) -> float:
        own = (line.settings for line in lines if line.adjuster == adjuster)
        return median([abs(sizes[b] - sizes[a]) for line in own for a, b in pairwise(line)] or [0])

    adjuster = max((line.adjuster for line in lines), key=moved, default="")
    return [line.settings for line in lines if line.adjuster == adjuster]


def _kind(quantity: Quantity) -> tuple[str, str, float, str]:
    return _PRELOAD if quantity.part == _OPENING else _HOLE


def _read(setting: SettingResult, quantity: Quantity) -> tuple[float, float, float]:
    low, high = (end or math.nan for end in setting.intervals[quantity.name])
    return float(setting.parameters[quantity.name]), low, high


def _jumps(run: Run, quantity: Quantity, mine: Sequence[Row]) -> Iterator[str]:
    """Say where a click changes a valve far more than the others, or the other way."""
    what, si, factor, unit = _kind(quantity)
    name, change = f"{what}_{si}", f"{what}_change_{si}"
    rows = {row["setting"]: row for row in mine}
    errors = {}  # half of the interval; what C_d may be off is common to all
    for setting in run.settings:
        size, low, high = _read(setting, quantity)
        if setting.setting in rows and size > 0.0 and low < high:
            errors[setting.setting] = rows[setting.setting][name] * 0.5 * (high - low) / size
    for line in _lines(run, quantity):
        along = pairwise(setting for setting in line if setting in rows)
        steps = [(a, b, factor * rows[b][change]) for a, b in along if rows[b][change] is not None]
        way = math.copysign(1.0, sum(step for *_, step in steps))
        for k, (a, b, step) in enumerate(steps if len(steps) >= _FEWEST else ()):
            error = math.hypot(errors.get(a, 0.0), errors.get(b, 0.0))
            if not abs(rows[b][name] - rows[a][name]) > error:
                continue
            near = *steps[max(k - 2, 0) : k], *steps[k + 1 : k + 3]
            usual = median(abs(beside) for *_, beside in near)
            place = f"{quantity.symbol}: {step:+.3g} {unit} a click from setting {a} to {b}"
            if abs(step) > _JUMP * usual:
                times = f"{abs(step) / usual:.2g} times" if usual else "unlike"
                why = "a port opens or closes, or a jet is blocked"
                yield f"{place}, {times} the clicks beside it: {why}"
            elif step * way < -0.5 * usual:
                why = "play in the adjuster, or a damaged needle"
                yield f"{place}, against the other clicks: {why}"


def _worn(quantity: Quantity, run: Run, reference: Run) -> Iterator[str]:
    """Say where a valve has changed since an earlier run by more than both intervals."""
    earlier = {setting.label: _read(setting, quantity) for setting in reference.settings}
    for setting in run.settings:
        now, low, high = _read(setting, quantity)
        then, first, last = earlier.get(setting.label, (0.0, 0.0, 0.0))
        if then and (first > high or last < low):
            is_hole = _kind(quantity) is _HOLE
            what, change = ("area", then / now - 1.0) if is_hole else ("preload", now / then - 1.0)
            yield (
                f"{quantity.symbol} of setting {setting.label}: {what} {100.0 * change:+.2g} % "
                f"since {reference.name}, beyond the errors of both fits, at the same C_d"
            )


def unlike(run: Run, reference: Run) -> Iterator[str]:
    """Say in what a reference is of another damper."""
    for key in ("serial", "damper"):
        own, other = run.identity.get(key), reference.identity.get(key)
        if own and other and own != other:
            yield f"{key} {own}, but {reference.name} is of {key} {other}"
    if run.damper.plain != reference.damper.plain:
        yield f"the damper of {reference.name} is declared otherwise"


def sized(valves: Orifices, run: Run, force: float, speed: float) -> Orifices:
    """Return the valves with what each alone must be for a force at a signed speed."""
    from scipy.optimize import brentq

    rows, reach = [], math.log(_FACTOR)
    for part in (*valves.holes, *valves.preloads):
        values, name = run.setting(str(part["setting"])).parameters, part["quantity"]

        def missing(step: float, values: Values = values, name: str = name) -> float:
            changed = values.replace({name: values[name] * math.exp(step)})
            return float(quasi_static(run.damper, changed, [speed]).forces[0]) - force

        try:
            if missing(-reach) * missing(reach) > 0.0:
                continue  # no value of it gives that force
            times = math.exp(brentq(missing, -reach, reach, xtol=1e-6))
        except ConfigurationError:  # nor can it be asked
            continue
        row = {"setting": part["setting"], "quantity": name, "diameter_m": None}
        if "area_m2" in part:  # it goes with 1/S
            now, times, unit = part["area_m2"], 1.0 / times, "m2"
            row["diameter_m"] = part["diameter_m"] * math.sqrt(times)
        else:
            now, unit, seat = part["pressure_Pa"], "Pa", part.get("seat_force_N")
            row["seat_force_N"] = seat and times * seat
        rows.append(row | {"now": now, "wanted": now * times, "unit": unit})
    n = len({row["setting"] for row in rows})
    words = "no orifice or preload alone gives it"
    if rows:
        words = f"what one part alone must be for it, at {n} of {len(run.settings)} settings"
    sentence = f"{force:.5g} N at {speed:g} m/s: {words}"
    return replace(valves, sized=tuple(rows), sentence=sentence)
