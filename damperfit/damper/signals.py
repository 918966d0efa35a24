"""Inner signals of a damper: what a model's response tells besides its force."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["PRESSURES", "Signal"]


@dataclass(frozen=True, slots=True)
class Signal:
    """One signal.

    Attributes
    ----------
    name : str
        As in tables and FMUs, without its unit.
    label : str
        In a figure's legend.
    where : str
        Of what it is, for descriptions.
    unit : str
        SI.
    """

    name: str
    label: str
    where: str
    unit: str


PRESSURES = (
    Signal("pressure_1", "chamber 1 (rod side)", "in chamber 1, which rebound presses", "Pa"),
    Signal("pressure_2", "chamber 2 (full bore)", "in chamber 2, which bump presses", "Pa"),
    Signal("pressure_3", "chamber 3 (gas side)", "of the gas", "Pa"),
)
