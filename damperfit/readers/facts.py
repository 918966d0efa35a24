"""What one log was tested at, where somebody says so: gas pressure, temperature, tare, skew."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from damperfit.units.quantities import parse_quantity, says_absolute_or_gauge

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["FACTS", "fact_of", "facts_in"]

# What may stand for each log, and its dimension.
FACTS = {
    "gas_pressure": "absolute pressure",
    "temperature": "temperature",
    "tare": "force",
    "skew": "time",
}
# What the test was; a tare or a skew that a log itself names may have been taken off already.
_OF_PREAMBLES = ("gas_pressure", "temperature")


def fact_of(key: str, text: str) -> float:
    """Return what somebody says of a test, SI; a temperature in degrees Celsius.

    Parameters
    ----------
    key : str
        Of `FACTS`.
    text : str
        With its unit.

    Raises
    ------
    ValueError
        It is no such quantity, or does not say what a pressure counts from.

    Examples
    --------
    >>> fact_of("gas_pressure", "5.6bara"), fact_of("temperature", "31")
    (560000.0, 31.0)
    """
    value = parse_quantity(text, FACTS[key])
    if key == "gas_pressure" and not says_absolute_or_gauge(text):
        raise ValueError("expected a unit that says what it counts from, as in 5.6bara or 80psig")
    return value


def facts_in(preamble: Mapping[str, str]) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the facts that a log's own preamble tells, and which lines say too little.

    Parameters
    ----------
    preamble : mapping of str to str
        Lines above the log, by their keys.

    Examples
    --------
    >>> facts_in({"Gas pressure": "8bara", "tare": "3N"})
    ({'gas_pressure': 800000.0}, ())
    """
    facts, notes = {}, []
    for name, text in preamble.items():
        key = re.sub(r"[\W_]+", "_", name.casefold()).strip("_")
        if key not in _OF_PREAMBLES:
            continue
        try:
            facts[key] = fact_of(key, text)
        except ValueError as error:
            notes.append(f"{name}: {text}: not used; {error}")
    return facts, tuple(notes)
