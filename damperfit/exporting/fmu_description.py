"""The variables of an FMU, and what describes it: once for FMI 2.0 and 3.0."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from damperfit.damper.signals import PRESSURES
from damperfit.report.sheet import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.exporting.fmu import ExportedDamper
    from damperfit.exporting.source import ExportedRun

__all__ = ["FRICTION_BAND", "NUMBERS", "STATES", "Number", "descriptions", "rendered", "variables"]

NUMBERS = 100  # value reference of the first number of the damper
STATES = ("oil_1", "oil_2", "outside", "grip")  # all that any damper may have
# With the fit's dead band of 0.1 mm/s a car at rest shakes at steps of 1 ms.
FRICTION_BAND = 0.005
# By unit: exponents of kg, m, s. Half exponents, as R_m1 has them, FMI does not know.
_UNITS: dict[str, dict[str, int] | None] = {
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
# By state: its reference and that of its rate, unit, unit of the rate, size, and what both are.
_OF_STATES = {
    "oil_1": (11, 14, "kg", "kg/s", 1e-4, "oil in chamber 1 beyond what fills it at rest"),
    "oil_2": (12, 15, "kg", "kg/s", 1e-4, "oil in chamber 2 beyond what fills it at rest"),
    "outside": (13, 16, "s", "1", 1.0, "seconds outside the tested range"),
    "grip": (21, 22, "1", "1/s", 1.0, "friction that is built up, as a share of what slides"),
}
_RATES = {
    "oil_1": ("flow_1", "of that oil"),
    "oil_2": ("flow_2", "of that oil"),
    "outside": ("is_outside", "1 outside the tested range"),
    "grip": ("grip_rate", "of that share"),
}


@dataclass(frozen=True, slots=True)
class Number:
    """A number of the damper that an importer may change: its column in the text, and what it is.

    `start` is its value at the setting that is set at the beginning, SI; `has_sign`: either sign is
    allowed.
    """

    place: int
    name: str
    unit: str
    meaning: str
    start: float
    has_sign: bool = False


@dataclass(frozen=True, slots=True)
class Variable:
    """One variable: its number in ``exported.h``, words of the standard, range and size.

    Without a unit it is a whole number; without a start it is calculated. `derivative_of` is the
    reference of the state whose rate it is.
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

    @property
    def initial(self) -> str:
        """Word of the standard; inputs have none."""
        if self.causality == "input":
            return ""
        return "calculated" if self.start is None else "exact"

    @property
    def numbers(self) -> dict[str, str]:
        """Attributes that say unit, range and size."""
        known = {"min": self.low, "max": self.high, "nominal": self.nominal, "start": self.start}
        return ({"unit": self.unit} if self.unit else {}) | {
            key: repr(float(value)) if self.unit else str(int(value))
            for key, value in known.items()
            if value is not None
        }


@dataclass(frozen=True, slots=True)
class _Unknown:
    """What an unknown follows from: references of inputs and states, and of parameters."""

    reference: int
    dependencies: tuple[int, ...]
    parameters: tuple[int, ...] = ()


def variables(damper: ExportedDamper) -> tuple[Variable, ...]:
    """Return all variables but time, in the order of the files."""
    rod = "of the rod, positive in rebound (rod out)"
    named = ", ".join(
        str(place) if str(place) == name else f"{place}: {name}"
        for place, name in damper.settings.items()
    )
    places = sorted(damper.settings)
    signals = (
        Variable(1, "displacement", f"{rod}, from mid-stroke", "input", unit="m", start=0.0),
        Variable(2, "velocity", rod, "input", unit="m/s", start=0.0),
        Variable(3, "force", "positive where it resists rebound", "output", unit="N", nominal=1e3),
        *(
            Variable(
                r, one.name, f"absolute pressure {one.where}", "output", unit=one.unit, nominal=1e5
            )
            for r, one in enumerate(PRESSURES, start=4)
        ),
        Variable(
            7,
            "seconds_outside_tested_range",
            "time spent beyond the stroke or the speed of the tests by more than 1 %",
            "output",
            unit="s",
        ),
    )
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
    choices = (
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
        *(
            [Variable(
                23, "carry_derivatives", "1: in co-simulation derivatives by parameters are "
                "carried along from the beginning, which takes two to three times as long; model "
                "exchange has them always", "parameter", "fixed", start=0, low=0, high=1,
            )] if damper.is_of_valves else []
        ),
        Variable(
            24, "with_rig", "0: the damper alone; 1: as in the log, with mounting, lag, moving "
            "mass and tare of the rig (co-simulation)", "parameter", "fixed", start=0, low=0,
            high=1,
        ),
    )  # fmt: skip
    states, rates = [], []
    for name in damper.states:
        state, rate, unit, rate_unit, nominal, what = _OF_STATES[name]
        states.append(Variable(state, name, what, "local", unit=unit, nominal=nominal))
        named_rate, of_it = _RATES[name]
        rates.append(
            Variable(rate, named_rate, of_it, "local", unit=rate_unit, derivative_of=state)
        )
    return (*signals, *choices, *states, *rates)


def _unknowns(damper: ExportedDamper) -> dict[str, tuple[_Unknown, ...]]:
    """Return outputs, derivatives, event indicators and initial unknowns with what they follow."""
    numbers = tuple(NUMBERS + one.place for one in damper.numbers)
    oil = tuple(_OF_STATES[name][0] for name in damper.states if name.startswith("oil"))
    grip = tuple(_OF_STATES[name][0] for name in damper.states if name == "grip")
    flows = tuple(_OF_STATES[name][1] for name in damper.states if name.startswith("oil"))
    grip_rate = tuple(_OF_STATES[name][1] for name in damper.states if name == "grip")
    point = (1, *oil)
    at_first = (1,), (8, *numbers)
    return {
        "outputs": (
            _Unknown(3, (1, 2, *oil, *grip), (*numbers, 9)),
            *(_Unknown(r, point, numbers) for r in (4, 5, 6)),
            _Unknown(7, (13,)),
        ),
        "rates": (
            *(_Unknown(r, (1, 2, *oil), numbers) for r in flows),
            _Unknown(16, (1, 2)),
            *(_Unknown(r, (2, *grip), numbers) for r in grip_rate),
        ),
        "indicators": (
            _Unknown(17, (2,), (9,)),
            _Unknown(18, (1, oil[0]), numbers),
            _Unknown(19, (1, oil[-1]), numbers),
            _Unknown(20, (1, 2)),
        ),
        "initial": (
            _Unknown(3, (1, 2), (8, *numbers, 9)),
            *(_Unknown(r, *at_first) for r in (4, 5, 6)),
            _Unknown(7, ()),
            *(_Unknown(r, *at_first) for r in oil),
            *(_Unknown(r, ()) for r in (13, *grip)),
            *(_Unknown(r, (1, 2), (8, *numbers)) for r in flows),
            _Unknown(16, (1, 2)),
            *(_Unknown(r, (2,), (8, *numbers)) for r in grip_rate),
        ),
    }


def descriptions(
    run: ExportedRun, damper: ExportedDamper, *, version: int, files: Sequence[str], date: str
) -> dict[str, bytes]:
    """Return ``modelDescription.xml`` and what else describes an FMU, by its name in the zip.

    Parameters
    ----------
    run, damper : ExportedRun, ExportedDamper
        What it holds.
    version : int
        2 or 3.
    files : sequence of str
        The C files among the sources.
    date : str
        When it was written.
    """
    owner = (run.identity[key] for key in ("damper", "serial") if key in run.identity)
    listed = variables(damper)
    found = _unknowns(damper)
    places = {one.reference: i for i, one in enumerate(listed, 1)}
    about = {
        "modelName": printable(" ".join(owner)) or "damper",
        "description": f"{run.damper.title}; {run.damper.sentence}",
        "version": run.version,
        "generationTool": f"damperfit {run.version}",
        "generationDateAndTime": date,
        "license": "the sources: MIT, documentation/licenses",
        "variableNamingConvention": "flat",
    }
    # In FMI 2.0 an unknown is a place in the list, and no parameter counts after the beginning.
    structure = {
        key: sorted(found[key], key=lambda one: places.get(one.reference, 0))
        if version == 2
        else found[key]
        for key in found
    }
    known = {
        "about": about,
        "damper": damper,
        "files": files,
        "unit_definitions": _UNITS,
        "variables": listed,
        "places": places,
        "structure": structure,
    }
    if version == 2:
        return {"modelDescription.xml": rendered("fmi2.xml", **known)}
    return {
        "modelDescription.xml": rendered("fmi3.xml", **known),
        "sources/buildDescription.xml": rendered("build.xml", **known),
        "terminalsAndIcons/terminalsAndIcons.xml": rendered("terminals.xml"),
    }


def rendered(template: str, **known: Any) -> bytes:
    """Return a template of this package filled in, as UTF-8; texts cannot leave their place."""
    text = _environment().get_template(template).render(**known)
    return text.encode("utf-8", "xmlcharrefreplace")


@cache
def _environment() -> Environment:
    return Environment(
        loader=PackageLoader("damperfit.exporting"),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )


def _shown(text: object) -> Markup:
    return text if isinstance(text, Markup) else escape(printable(str(text)))
