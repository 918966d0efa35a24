"""The variables of an FMU, and what describes it: once for FMI 2.0 and 3.0."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any

from damperfit import __version__
from damperfit.damper.signals import PRESSURES
from damperfit.exporting.writers import rendered
from damperfit.report.sheet import printable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.exporting.fmu import ExportedDamper
    from damperfit.exporting.source import ExportedRun

__all__ = ["FRICTION_BAND", "NUMBERS", "STATES", "Number", "descriptions", "variables"]

_FIXED = tomllib.loads(
    resources.files("damperfit.exporting").joinpath("fmu_variables.toml").read_text("utf-8")
)
_STATES: Mapping[str, Mapping[str, Any]] = _FIXED["states"]
NUMBERS = 100  # value reference of the first number of the damper
STATES = tuple(_STATES)  # all that any damper may have
FRICTION_BAND: float = _FIXED["choices"][0]["start"]


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
    places = sorted(damper.settings)
    named = ", ".join(
        str(place) if str(place) == name else f"{place}: {name}"
        for place, name in damper.settings.items()
    )
    signals = [Variable(**one) for one in _FIXED["signals"]]
    pressures = (
        Variable(r, p.name, f"absolute pressure {p.where}", "output", unit=p.unit, nominal=1e5)
        for r, p in enumerate(PRESSURES, start=4)
    )
    setting = Variable(
        8, "setting", f"of the adjuster, may change in mid-run; one of {named}", "parameter",
        "tunable", start=damper.start, low=places[0], high=places[-1],
    )  # fmt: skip
    follows = "follows the setting unless it is changed from its start value"
    own = (
        Variable(
            NUMBERS + one.place, one.name, f"{one.meaning}; {follows}", "parameter", "tunable",
            one.unit, one.start, None if one.has_sign else 0.0,
        )
        for one in damper.numbers
    )  # fmt: skip
    choices = (
        Variable(**one)
        for one in _FIXED["choices"]
        if damper.is_of_valves or one["name"] != "carry_derivatives"
    )
    states, rates = [], []
    for name in damper.states:
        known = {key: value for key, value in _STATES[name].items() if key != "rate"}
        states.append(Variable(name=name, causality="local", **known))
        rate = _STATES[name]["rate"]
        rates.append(Variable(causality="local", derivative_of=known["reference"], **rate))
    return (*signals[:3], *pressures, signals[3], setting, *own, *choices, *states, *rates)


def _unknowns(damper: ExportedDamper) -> dict[str, tuple[_Unknown, ...]]:
    """Return outputs, derivatives, event indicators and initial unknowns with what they follow."""
    numbers = tuple(NUMBERS + one.place for one in damper.numbers)
    oil = tuple(_STATES[name]["reference"] for name in damper.states if name.startswith("oil"))
    grip = tuple(_STATES[name]["reference"] for name in damper.states if name == "grip")
    flows = tuple(3 + reference for reference in oil)
    grip_rate = tuple(1 + reference for reference in grip)
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
    owner = (run.run.identity[key] for key in ("damper", "serial") if key in run.run.identity)
    listed = variables(damper)
    found = _unknowns(damper)
    places = {one.reference: i for i, one in enumerate(listed, 1)}
    about = {
        "modelName": printable(" ".join(owner)) or "damper",
        "description": f"{run.damper.title}; {run.damper.sentence}",
        "version": __version__,
        "generationTool": f"damperfit {__version__}",
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
        "unit_definitions": _FIXED["units"],
        "variables": listed,
        "places": places,
        "structure": structure,
    }
    if version == 2:
        return {"modelDescription.xml": rendered("fmi2.xml", **known).encode()}
    return {
        "modelDescription.xml": rendered("fmi3.xml", **known).encode(),
        "sources/buildDescription.xml": rendered("build.xml", **known).encode(),
        "terminalsAndIcons/terminalsAndIcons.xml": rendered("terminals.xml").encode(),
    }
