"""The variables of an FMU, once for FMI 2.0 and 3.0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.damper.signals import PRESSURES
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
    "1/s": {"s": -1},
    "m2": {"m": 2},
    "m3": {"m": 3},
    "N s/m": {"kg": 1, "s": -1},
    "N/m": {"kg": 1, "s": -2},
    "N s/(m2 kg)": {"m": -1, "s": -1},
    "1/Pa": {"kg": -1, "m": 1, "s": 2},
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
    return (*_fixed(), *_parameters(damper), *_states(damper))


def _fixed() -> tuple[Variable, ...]:
    rod = "of the rod, positive in rebound (rod out)"
    inner = enumerate(PRESSURES, start=4)  # value references
    return (
        Variable(1, "displacement", f"{rod}, from mid-stroke", "input", unit="m", start=0.0),
        Variable(2, "velocity", rod, "input", unit="m/s", start=0.0),
        Variable(3, "force", "positive where it resists rebound", "output", unit="N", nominal=1e3),
        *(
            Variable(
                r, one.name, f"absolute pressure {one.where}", "output", unit=one.unit, nominal=1e5
            )
            for r, one in inner
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
        *((_CARRIES,) if damper.is_of_valves else ()),
    )  # fmt: skip


_CARRIES = Variable(
    23, "carry_derivatives", "1: in co-simulation derivatives by parameters are carried along from "
    "the beginning, which takes two to three times as long; model exchange has them always",
    "parameter", "fixed", start=0, low=0, high=1,
)  # fmt: skip


def _states(damper: ExportedDamper) -> tuple[Variable, ...]:
    """States in their order, then their rates."""
    states, rates = [], []
    for name in damper.states:
        state, rate, unit, nominal = _OF_STATES[name]
        of_it, is_of = _DESCRIPTIONS[name]
        states.append(Variable(state, name, of_it, "local", unit=unit, nominal=nominal))
        rates.append(
            Variable(rate, is_of[0], is_of[1], "local", unit=_RATE_UNITS[unit], derivative_of=state)
        )
    return (*states, *rates)


# By state: its reference and that of its rate, unit, size.
_OF_STATES = {
    "oil_1": (11, 14, "kg", 1e-4),
    "oil_2": (12, 15, "kg", 1e-4),
    "outside": (13, 16, "s", 1.0),
    "grip": (21, 22, "1", 1.0),
}
_RATE_UNITS = {"kg": "kg/s", "s": "1", "1": "1/s"}
_DESCRIPTIONS = {
    "oil_1": ("oil in chamber 1 beyond what fills it at rest", ("flow_1", "of that oil")),
    "oil_2": ("oil in chamber 2 beyond what fills it at rest", ("flow_2", "of that oil")),
    "outside": (
        "seconds outside the tested range", ("is_outside", "1 outside the tested range"),
    ),
    "grip": (
        "friction that is built up, as a share of what slides", ("grip_rate", "of that share"),
    ),
}  # fmt: skip


def unknowns(damper: ExportedDamper) -> dict[str, tuple[Unknown, ...]]:
    """Return outputs, derivatives, event indicators and initial unknowns with what they follow."""
    numbers = tuple(NUMBERS + one.place for one in damper.numbers)
    oil = tuple(_OF_STATES[name][0] for name in damper.states if name.startswith("oil"))
    grip = tuple(_OF_STATES[name][0] for name in damper.states if name == "grip")
    flows = tuple(_OF_STATES[name][1] for name in damper.states if name.startswith("oil"))
    grip_rate = tuple(_OF_STATES[name][1] for name in damper.states if name == "grip")
    point = (1, *oil)
    outputs = (
        Unknown(3, (1, 2, *oil, *grip), (*numbers, 9)),
        *(Unknown(r, point, numbers) for r in (4, 5, 6)),
        Unknown(7, (13,)),
    )
    rates = (
        *(Unknown(r, (1, 2, *oil), numbers) for r in flows),
        Unknown(16, (1, 2)),
        *(Unknown(r, (2, *grip), numbers) for r in grip_rate),
    )
    indicators = (
        Unknown(17, (2,), (9,)),
        Unknown(18, (1, oil[0]), numbers),
        Unknown(19, (1, oil[-1]), numbers),
        Unknown(20, (1, 2)),
    )
    at_first = (1,), (8, *numbers)
    initial = (
        Unknown(3, (1, 2), (8, *numbers, 9)),
        *(Unknown(r, *at_first) for r in (4, 5, 6)),
        Unknown(7, ()),
        *(Unknown(r, *at_first) for r in oil),
        *(Unknown(r, ()) for r in (13, *grip)),
        *(Unknown(r, (1, 2), (8, *numbers)) for r in flows),
        Unknown(16, (1, 2)),
        *(Unknown(r, (2,), (8, *numbers)) for r in grip_rate),
    )
    return {"outputs": outputs, "rates": rates, "indicators": indicators, "initial": initial}
