"""Values of keys by themselves: quantities with their unit, words, and what no rig has."""

from __future__ import annotations

from pydantic import BeforeValidator

from damperfit.units.quantities import parse_quantity

__all__ = ["known_or_detect", "not_in_mhz", "not_in_mm", "quantity", "quantity_or_word"]

_LONGEST = 2.0  # m, beyond any rig's amplitude: mm were meant
_FASTEST = 500.0  # Hz, beyond any rig's test: rpm or mHz were meant


def quantity(dimension: str) -> BeforeValidator:
    """Return what takes text with a unit of a dimension, or a bare number in SI."""

    def convert(value: object) -> object:
        return parse_quantity(value, dimension) if isinstance(value, str) else value

    return BeforeValidator(convert)


def quantity_or_word(dimension: str, word: str) -> BeforeValidator:
    """Return what takes the same, or one word."""

    def convert(value: object) -> object:
        is_text = isinstance(value, str) and value != word
        return parse_quantity(str(value), dimension) if is_text else value

    return BeforeValidator(convert)


def known_or_detect(value: object) -> object:
    """Take true, false or "detect"."""
    if value == "detect" or isinstance(value, bool):
        return value
    raise ValueError("expected true, false or 'detect'")


def _believable(value: float, most: float, unit: str, example: str) -> float:
    if value > most:
        told = f"expected at most {most:g} {unit}; a bare number is in {unit}, as in {example!r}"
        raise ValueError(told)
    return value


def not_in_mm(length: float) -> float:
    """Refuse an amplitude that no rig has, m."""
    return _believable(length, _LONGEST, "m", "32mm")


def not_in_mhz(frequency: float) -> float:
    """Refuse a frequency that no rig has, Hz."""
    return _believable(frequency, _FASTEST, "Hz", "1.5Hz")
