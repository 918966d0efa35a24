"""The paper's figures 4 to 9: one parameter after the other scaled, everything else held."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FAMILIES", "Family"]


@dataclass(frozen=True, slots=True)
class Family:
    """One family of curves.

    Attributes
    ----------
    name : str
        The parameter.
    number : int
        Of the figure.
    factors : tuple of float
        What the parameter is multiplied with.
    of_pressures : int
        Number of the figure of its chamber pressures; 0: there is none.
    """

    name: str
    number: int
    factors: tuple[float, ...]
    of_pressures: int = 0


FAMILIES = (
    Family("r_m1", 4, (0.8, 1.0, 1.2)),
    Family("r_m2", 5, (0.8, 1.0, 1.2)),
    Family("r_m3", 6, (0.5, 1.0, 1.5), of_pressures=7),
    Family("k_e", 8, (0.2, 1.0, 2.0)),
    Family("f_f", 9, (0.0, 1.0, 2.0)),
)
