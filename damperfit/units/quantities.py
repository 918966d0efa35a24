"""Unit names with their factors to SI: the only conversions in the program.

Temperatures are degrees Celsius inside, as in `Recording`; every other dimension is SI.
"""

from __future__ import annotations

import math
import re
from difflib import get_close_matches
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Number = TypeVar("Number", float, NDArray[np.float64])

_INCH = 0.0254  # m, exact (international yard and pound agreement, 1959)
_POUND = 0.45359237  # kg, exact (the same)
_GRAVITY = 9.80665  # m/s^2, exact (standard gravity, CGPM 1901)
_ATMOSPHERE = 101325.0  # Pa, exact (standard atmosphere, CGPM 1954): what a gauge counts from
_PSI = _POUND * _GRAVITY / _INCH**2


class QuantityError(ConfigurationError, ValueError):
    """A number or unit that cannot be understood; also a ValueError for validators."""


class Unit(NamedTuple):
    """One unit: value in SI = factor * value + offset; temperatures in degrees Celsius."""

    symbol: str  # shown to people
    dimension: str  # as in "length"
    factor: float
    offset: float = 0.0  # of temperatures and gauge pressures only

    def to_si(self, value: Number) -> Number:
        """Return the value, or the array of values, in SI."""
        if self.factor == 1.0 and self.offset == 0.0:
            return value
        return value * self.factor + self.offset


# Where it matters what a pressure counts from; without a letter it is absolute.
_ABSOLUTE: dict[str, float | tuple[float, float]] = {
    "bar": 1e5, "bara barA bar(a) bar(abs)": 1e5, "barg barG bar(g)": (1e5, _ATMOSPHERE),
    "psi": _PSI, "psia psiA psi(a)": _PSI, "psig psiG psi(g)": (_PSI, _ATMOSPHERE),
    "MPa": 1e6, "MPaa MPa(a)": 1e6, "MPag MPa(g)": (1e6, _ATMOSPHERE),
    "kPa": 1e3, "kPaa kPa(a)": 1e3, "kPag kPa(g)": (1e3, _ATMOSPHERE),
    "Pa": 1.0, "Paa Pa(a)": 1.0,
}  # fmt: skip
# Dimension -> spelling(s) divided by blanks -> factor (or factor and offset) to SI.
# Case matters: MN and mN, or MPa and mPa, are a billion apart. Spellings in capitals are listed
# only where they can mean nothing else; words of five letters or more may begin with one, or be all
# of them.
_TABLE: dict[str, dict[str, float | tuple[float, float]]] = {
    "length": {
        "m": 1.0,
        "mm MM millimeter millimeters millimetre millimetres": 1e-3,
        "cm": 1e-2,
        "um µm μm micron microns": 1e-6,  # micro sign and Greek mu both occur
        "in in. IN inch Inch INCH inches": _INCH,
    },
    "force": {
        "N newton newtons": 1.0,
        "mN": 1e-3,
        "daN DAN": 10.0,
        "kN KN": 1e3,
        "lbf lb Lbf LBF lbs Lbs LBS pound pounds": _POUND * _GRAVITY,
        "kgf kp Kgf KGF": _GRAVITY,
        "gf": 1e-3 * _GRAVITY,
        "kip kips Kip Kips KIP KIPS klbf KLBF": 1e3 * _POUND * _GRAVITY,  # a thousand pounds
        "tf": 1e3 * _GRAVITY,
    },
    "time": {
        "s sec Sec SEC secs second seconds Sek sek": 1.0,
        "ms msec mSec millisecond milliseconds": 1e-3,
        "us µs μs": 1e-6,
        "min minute minutes": 60.0,
        "h hr hour hours": 3600.0,
        "day days": 86_400.0,
    },
    "pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "bar": 1e5, "psi": _PSI},
    "absolute pressure": _ABSOLUTE,
    "frequency": {"Hz": 1.0, "kHz": 1e3},
    "power": {"W": 1.0, "kW": 1e3},
    "temperature": {
        "degC °C ºC ˚C C": 1.0,  # the sign is U+00B0, U+00BA or U+02DA in real files
        "degF °F ºF ˚F F": (5.0 / 9.0, -160.0 / 9.0),
        "K": (1.0, -273.15),
    },
    "velocity": {
        "m/s m_per_s m_s": 1.0,
        "mm/s mm_per_s mm_s": 1e-3,
        "cm/s cm_per_s cm_s": 1e-2,
        "in/s in_per_s in_s": _INCH,
        "km/h kmh kph": 1.0 / 3.6,
        "mph": 0.44704,
    },
    "mass": {"kg": 1.0, "lb lbm": _POUND},
    "density": {"kg/m3 kg/m^3 kg/m³": 1.0, "g/cm3 g/cm^3 g/cm³": 1e3},
    "area": {"m2 m^2 m²": 1.0, "cm2 cm^2 cm²": 1e-4, "mm2 mm^2 mm²": 1e-6},
    "volume": {"m3 m^3 m³": 1.0, "l L": 1e-3, "cm3 cm^3 cm³ ml cc": 1e-6},
    "stiffness": {"N/m": 1.0, "N/mm kN/m": 1e3, "kN/mm": 1e6},
    "voltage": {"V": 1.0, "mV": 1e-3},
}


def _is_word(name: str) -> bool:
    return len(name) >= _WORD and name.isascii() and name.isalpha() and name.islower()


_WORD = 5  # letters; a slip in a shorter name is another unit: kip and kp are 454 apart
_UNITS = {
    dimension: {
        spelling: Unit(
            spellings.split()[0], dimension, *(value if isinstance(value, tuple) else (value,))
        )
        for spellings, value in table.items()
        for word in spellings.split()
        for spelling in ({word, word.capitalize(), word.upper()} if _is_word(word) else {word})
    }
    for dimension, table in _TABLE.items()
}
_QUANTITY = re.compile(
    r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\d\s.+-].*?)?\s*",
    re.ASCII,
)


def units_of(dimension: str) -> tuple[str, ...]:
    """Return the symbols of a dimension, without their other spellings."""
    return tuple(dict.fromkeys(unit.symbol for unit in _UNITS[dimension].values()))


def is_unit(name: str | None, dimension: str = "") -> bool:
    """Say whether a dimension, or any where none is given, has a unit of this name."""
    return any(name in units for kind, units in _UNITS.items() if dimension in ("", kind))


def dimension_of(unit: str) -> str:
    """Return the dimension of a unit of SI, as "force" of "N"; empty where there is none."""
    kinds = (kind for kind, units in _UNITS.items() if unit in units and units[unit].factor == 1.0)
    return next(kinds, "")


def find_unit(name: str, dimension: str) -> Unit:
    """Return the unit of a dimension ("length", "force", ...) by its name, in which case matters.

    A `QuantityError`: the dimension has no such unit.

    Examples
    --------
    >>> find_unit("degF", "temperature").to_si(212.0)
    100.0
    """
    units, name = _UNITS[dimension], name.strip()
    if name not in units:
        hint = _hint(name, units)
        expected = ", ".join(units_of(dimension)) + ("." if hint else "")
        raise QuantityError(f"no unit of {dimension} {name!r}; expected {expected}{hint}")
    return units[name]


# What may stand before a unit and makes another one of it.
_PREFIXES = (
    *"TGMkhdcmunpµμ", "da", "giga", "mega", "kilo", "hecto", "deca", "deci", "centi", "milli",
    "micro", "nano",
)  # fmt: skip
_SLIP = 0.85  # likeness of a word with one letter wrong; millimetre and centimetre have 0.73


def _hint(name: str, units: dict[str, Unit]) -> str:
    """Return " Did you mean 'X'?" where nothing but a slip makes the name another than X."""
    if any(name == prefix + unit for prefix in _PREFIXES for unit in units):
        return ""
    if (weight := f"{name.lower()}f") in units:
        return f" {name} is a unit of mass: its weight, as a load, is {weight!r}"
    # Whoever writes a capital M means mega.
    near = [
        unit for unit in units if unit.lower() == name.lower() and (name[0], unit[0]) != ("M", "m")
    ]
    if not near and len(name) >= _WORD:
        words = [unit for unit in units if len(unit) >= _WORD - 1 and unit[0] == name[0]]
        near = get_close_matches(name, words, n=1, cutoff=_SLIP)
    return f" Did you mean {near[0]!r}?" if near else ""


def parse_quantity(text: str | float, dimension: str, *, option: Option | None = None) -> float:
    """Return a number with an optional unit as a float in SI (temperature: degrees Celsius).

    A bare number is SI. `option` is where it was given, to be named where it cannot be read.

    Raises
    ------
    QuantityError
        The text is no finite number with a unit of the dimension.

    Examples
    --------
    >>> parse_quantity("32mm", "length"), parse_quantity("4.6bar", "pressure")
    (0.032, 460000.0)
    >>> parse_quantity("0.032", "length")
    0.032
    """
    try:
        value = _converted(text, dimension)
        if not math.isfinite(value):
            raise QuantityError(f"{text} is not a finite {dimension}")  # noqa: TRY301  # gets its place
    except QuantityError as error:
        raise error.at(option) from error
    return value


def _converted(text: str | float, dimension: str) -> float:
    """Return the nearest float to the decimal number times its unit: 4.6bar is 460000.0 Pa."""
    example = f"1.5{units_of(dimension)[0]}"
    if not isinstance(text, str):
        try:
            return float(text)
        except (TypeError, ValueError, OverflowError):
            raise QuantityError(
                f"expected a number or a text such as '{example}' for a {dimension}, found {text!r}"
            ) from None
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise QuantityError(
            f"{text!r} cannot be read as {dimension}; expected a finite number with a unit, "
            f"as in {example}, or a bare number in {example[3:]}"
        )
    number = float(match["number"])
    if match["unit"] is None:
        return number
    unit = find_unit(match["unit"], dimension)
    if unit.offset != 0.0 or not 1e-200 < abs(number) < 1e200:  # Fraction(1e-999999) never ends
        return unit.to_si(number)
    from fractions import Fraction

    return float(Fraction(match["number"]) * Fraction(repr(unit.factor)))


def says_absolute_or_gauge(text: str) -> bool:
    """Say whether the unit of a pressure says absolute or gauge."""
    match = _QUANTITY.fullmatch(text)
    units = _UNITS["absolute pressure"].keys() - _UNITS["pressure"].keys()
    return match is not None and match["unit"] in units


def engineering(value: float, *, digits: int = 4) -> str:
    """Return a number for a sentence, with a power of ten that is a multiple of three."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    decade = int(f"{value:.{digits - 1}e}".partition("e")[2])  # of the rounded value
    power = 0 if decade == 3 else 3 * (decade // 3)  # 1039, but 10.39e3
    text = f"{value / 10.0**power:.{max(0, digits - 1 - decade + power)}f}"
    return f"{text}e{power}" if power else text
