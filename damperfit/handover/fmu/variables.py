"""The variables of an FMU, once for FMI 2.0 and 3.0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.handover.fmu.exported_damper import FRICTION_BAND, NUMBERS

if TYPE_CHECKING:
    from damperfit.handover.fmu.exported_damper import ExportedDamper

__all__ = ["UNITS", "Unknown", "Variable", "unknowns", "variables"]

# By unit: exponents of kg, m, s. Half exponents, as R_m1 has them, FMI does not know.
UNITS: dict[str, dict[str, int] | None] = {
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "kg/s": {"kg": 1, "s": -1},
    "m2": {"m": 2},
    "m3": {"m": 3},
    "N s/m": {"kg": 1, "s": -1},
    "N/m": {"kg": 1, "s": -2},
    "N s/(m2 kg)": {"m": -1, "s": -1},
    "1": {},
    "s sqrt(N)/(m kg)": None,
}


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable.

    Attributes
    ----------
    reference : int
        As in ``exported.h``.
    name, description : str
        For people.
    causality, variability : str
        Words of the standard.
    unit : str
        A key of `UNITS`; empty: a whole number.
    start : float or None
        None: calculated.
    low, high : float or None
        Range.
    nominal : float or None
        Size.
    derivative_of : int or None
        Reference of the state whose rate it is.
    """

    reference: int
    name: str
    description: str
    causality: str
    variability: str = "continuous"
    unit: str = ""
    start: float | None = None
    low: float | None = None
    high: float | None = None
    nominal: float | None = None
    derivative_of: int | None = None


@dataclass(frozen=True, slots=True)
class Unknown:
    """What an unknown follows from: references of inputs and states, and of parameters."""

    reference: int
    dependencies: tuple[int, ...]
    parameters: tuple[int, ...] = ()


def variables(damper: ExportedDamper) -> tuple[Variable, ...]:
    """Return all variables but time, in the order of the files."""
    return (*_fixed(), *_parameters(damper), *(_states() if damper.has_equations else ()))


def _fixed() -> tuple[Variable, ...]:
    rod = "of the rod, positive in rebound (rod out)"
    pressures = (
        (4, "pressure_1", "in chamber 1, which rebound presses"),
        (5, "pressure_2", "in chamber 2, which bump presses"),
        (6, "pressure_3", "of the gas"),
    )
    return (
        Variable(1, "displacement", f"{rod}, from mid-stroke", "input", unit="m", start=0.0),
        Variable(2, "velocity", rod, "input", unit="m/s", start=0.0),
        Variable(3, "force", "positive where it resists rebound", "output", unit="N", nominal=1e3),
        *(
            Variable(r, name, f"absolute pressure {where}", "output", unit="Pa", nominal=1e5)
            for r, name, where in pressures
        ),
        Variable(
            7,
            "seconds_outside_tested_range",
            "time spent beyond the stroke or the speed of the tests by more than 1 %",
            "output",
            unit="s",
        ),
    )


def _parameters(damper: ExportedDamper) -> tuple[Variable, ...]:
    named = ", ".join(
        str(place) if str(place) == name else f"{place}: {name}"
        for place, name in damper.settings.items()
    )
    places = sorted(damper.settings)
    own = tuple(
        Variable(
            NUMBERS + one.place,
            one.name,
            f"{one.meaning}; follows the setting unless it is changed from its start value",
            "parameter",
            "tunable",
            one.unit,
            one.start,
            None if one.has_sign else 0.0,
        )
        for one in damper.numbers
    )
    return (
        Variable(
            8, "setting", f"of the adjuster, may change in mid-run; one of {named}", "parameter",
            "tunable", start=damper.start, low=places[0], high=places[-1],
        ),
        *own,
        Variable(
            9, "friction_band", "speed at which friction is fully there", "parameter", "tunable",
            "m/s", FRICTION_BAND, 0.0,
        ),
        Variable(
            10,
            "input_extrapolation",
            "inputs are of the beginning of a step and go on by the velocity and its slope (2), by "
            "the velocity (1), or they are of its end (0); model exchange: 1 and 2 go on by the "
            "velocity where an importer holds its inputs",
            "parameter", "tunable", start=2, low=0, high=2,
        ),
    )  # fmt: skip


def _states() -> tuple[Variable, ...]:
    oil = tuple(
        Variable(
            10 + i,
            f"oil_{i}",
            f"oil in chamber {i} beyond that at rest and x = 0",
            "local",
            unit="kg",
            nominal=1e-3,
        )
        for i in (1, 2)
    )
    rates = tuple(
        Variable(
            13 + i,
            f"flow_{i}",
            f"oil into chamber {i}",
            "local",
            unit="kg/s",
            derivative_of=10 + i,
        )
        for i in (1, 2)
    )
    return (
        *oil,
        Variable(13, "outside", "seconds outside the tested range", "local", unit="s", nominal=1.0),
        *rates,
        Variable(
            16, "is_outside", "1 outside the tested range", "local", unit="1", derivative_of=13
        ),
    )


def unknowns(damper: ExportedDamper) -> dict[str, tuple[Unknown, ...]]:
    """Return outputs, derivatives, event indicators and initial unknowns with what they follow."""
    numbers = tuple(NUMBERS + one.place for one in damper.numbers)
    if not damper.has_equations:
        outputs = (
            Unknown(3, (1, 2), (*numbers, 9)),
            *(Unknown(r, (1,), numbers) for r in (4, 5, 6)),
        )
        outputs = (*outputs, Unknown(7, (1, 2)))
        return {"outputs": outputs, "rates": (), "indicators": (), "initial": outputs}
    point = (1, 11, 12)
    outputs = (
        Unknown(3, (1, 2, 11, 12), (*numbers, 9)),
        *(Unknown(r, point, numbers) for r in (4, 5, 6)),
        Unknown(7, (13,)),
    )
    rates = (Unknown(14, point, numbers), Unknown(15, point, numbers), Unknown(16, (1, 2)))
    indicators = (
        Unknown(17, (2,), (9,)),
        Unknown(18, (1, 11), numbers),
        Unknown(19, (1, 12), numbers),
        Unknown(20, (1, 2)),
    )
    at_first = (1,), (8, *numbers)
    initial = (
        Unknown(3, (1, 2), (8, *numbers, 9)),
        *(Unknown(r, *at_first) for r in (4, 5, 6)),
        Unknown(7, ()),
        *(Unknown(r, *at_first) for r in (11, 12)),
        Unknown(13, ()),
        *(Unknown(r, *at_first) for r in (14, 15)),
        Unknown(16, (1, 2)),
    )
    return {"outputs": outputs, "rates": rates, "indicators": indicators, "initial": initial}
