"""The units in which forces, speeds and lengths are shown; inside everything is SI."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, TypeVar

from damperfit.problem import Option, Where
from damperfit.units.quantities import QuantityError, Unit, find_unit, is_unit, units_of

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Number = TypeVar("Number", float, NDArray[np.float64])

_DIMENSIONS = {"force": "N", "velocity": "m/s", "length": "m"}
_OF_SI = {si: kind for kind, si in _DIMENSIONS.items()}
_NEWTON, _METRE_PER_SECOND, _METRE = (find_unit(si, kind) for kind, si in _DIMENSIONS.items())


@dataclass(frozen=True, slots=True)
class ShownUnits:
    """One unit for each of force, velocity and length; SI by default."""

    force: Unit = _NEWTON
    velocity: Unit = _METRE_PER_SECOND
    length: Unit = _METRE

    @property
    def is_si(self) -> bool:
        """Whether nothing is converted."""
        return all(getattr(self, name).factor == 1.0 for name in _DIMENSIONS)

    def of(self, unit: str) -> str:
        """Return the unit that is shown in place of an SI unit."""
        target = self._named(unit)
        return unit if target is None else target.symbol

    def show(self, value: Number, unit: str) -> Number:
        """Return a number, or an array of numbers, in the unit that is shown for an SI unit."""
        target = self._named(unit)
        return value if target is None else value / target.factor

    def write(self, value: float, unit: str, form: str) -> str:
        """Return a number with its unit in words, by a format specification."""
        return f"{self.show(value, unit):{form}} {self.of(unit)}".rstrip()

    def write_speed(self, speed: float) -> str:
        """Return a speed, m/s, in words: as it was named, or rounded where it is converted."""
        return self.write(speed, "m/s", "g" if self._named("m/s") is None else ".4g")

    def column(self, name: str, unit: str) -> str:
        """Return the name of a column whose unit stands at its end, with the unit shown."""
        end = "_" + unit.replace("/", "_per_")
        if self.of(unit) == unit or not name.endswith(end):
            return name
        return f"{name.removesuffix(end)}_{self.of(unit).replace('/', '_per_')}"

    def say(self, text: str) -> str:
        """Return a text whose forces and speeds are converted already with the units' names."""
        text = re.sub(r"(?<![\w/])m/s(?![\w/])", self.velocity.symbol, text)
        return re.sub(r"(?<![\w/.])N(?![\w/])", self.force.symbol, text)

    def write_length(self, metres: float, form: str) -> str:
        """Return a length in words; in mm where it is not converted."""
        is_si = self._named("m") is None
        return f"{1e3 * metres:{form}} mm" if is_si else self.write(metres, "m", form)

    def _named(self, unit: str) -> Unit | None:
        """Return the unit shown for an SI unit; None where that is itself."""
        chosen: Unit | None = getattr(self, _OF_SI.get(unit, ""), None)
        return None if chosen is None or chosen.factor == 1.0 else chosen


SI = ShownUnits()


@cache
def parse_units(text: str, where: Where | None = None) -> ShownUnits:
    """Return the units of a list such as "lbf,in/s", in any order; what is not named stays SI.

    `where` it stands is by itself the option ``--units``. A `QuantityError`: a unit is unknown, or
    two are of one kind.
    """
    where = where or Option("units", text)
    chosen: dict[str, Unit] = {}
    for name in map(str.strip, text.split(",")):
        kind = next((kind for kind in _DIMENSIONS if is_unit(name, kind)), None)
        if kind is None:
            listed = "; ".join(f"{kind} {', '.join(units_of(kind))}" for kind in _DIMENSIONS)
            raise QuantityError(f"no unit {name!r}; there are {listed}", where=where)
        unit = find_unit(name, kind)
        if kind in chosen:
            raise QuantityError(
                f"{chosen[kind].symbol} and {unit.symbol} are both of {kind}; give one",
                where=where,
            )
        chosen[kind] = unit
    return ShownUnits(**chosen)
