"""What an FMU holds of a damper: the text of ``resources/damper.txt`` and its numbers.

`c/reading.c` reads the text, `c/exported.h` numbers the variables; both are held together by tests.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.damper.network import BODY_NUMBERS
from damperfit.damper.purdy.parameters import Damper
from damperfit.damper.valve_dampers import ValveDamper
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.damper.model import Values
    from damperfit.damper.quantity import Quantity
    from damperfit.handover.handed_over import HandedOver

__all__ = ["FRICTION_BAND", "NUMBERS", "STATES", "ExportedDamper", "Number", "exported_damper"]

NUMBERS = 100  # value reference of the first number of the damper
STATES = ("oil_1", "oil_2", "outside", "grip")  # all that any damper may have
# With the fit's dead band of 0.1 mm/s a car at rest shakes at steps of 1 ms.
FRICTION_BAND = 0.005
_MAX_STEPS = 10_000
# N a step, of valves: inputs that go on by their slope make the force jump at communication points
# of 1 ms, and to resolve these jumps takes far longer.
_TOLERANCE_OF_VALVES = 0.03
# What is the rig's: rod ends, frame and load cell in series, their play.
_OF_THE_RIG = ("series_stiffness", "play")


@dataclass(frozen=True, slots=True)
class Number:
    """A number of the damper that an importer may change.

    Attributes
    ----------
    place : int
        Its column in the text.
    name, unit, meaning : str
        As its quantity has them.
    start : float
        At the setting that is set at the beginning, SI.
    has_sign : bool
        Either sign is allowed.
    """

    place: int
    name: str
    unit: str
    meaning: str
    start: float
    has_sign: bool = False


@dataclass(frozen=True, slots=True)
class ExportedDamper:
    """A damper as its FMU holds it.

    Attributes
    ----------
    token : str
        Hash of everything in the text.
    text : str
        Of ``resources/damper.txt``.
    numbers : tuple of Number
        In the order of the text's columns.
    settings : dict of int to str
        By the number that an importer sets: what people call the setting.
    start : int
        The setting that is set at the beginning.
    states : tuple of str
        Of `STATES` those that it has, in their order.
    is_of_valves : bool
        Its passages are any; otherwise it is the paper's.
    """

    token: str
    text: str
    numbers: tuple[Number, ...]
    settings: dict[int, str]
    start: int
    states: tuple[str, ...]
    is_of_valves: bool = False


def exported_damper(handed: HandedOver) -> ExportedDamper:
    """Return the damper with all its settings.

    Settings that are whole numbers of one adjuster keep them; others are counted from 1.

    Raises
    ------
    ConfigurationError
        The model is none that an FMU can hold.
    """
    damper = handed.damper
    if not isinstance(damper, Damper | ValveDamper):
        raise ConfigurationError(
            f"a damper of the model {damper.name} cannot be an FMU, only one of the paper's or of "
            f"valves; hand it over as a table: --to {_tables()}"
        )
    cells = [one.setting.cell for one in handed.settings]
    whole = [cell for cell in cells if isinstance(cell, int)]
    places = whole if len(whole) == len(cells) else range(1, len(cells) + 1)
    named = dict(zip(places, (str(one.setting) for one in handed.settings), strict=True))
    start = sorted(named)[len(named) // 2]
    columns = _columns(damper)
    rows = {
        place: tuple(_value(damper, one.values, name) for name in columns)
        for place, one in zip(named, handed.settings, strict=True)
    }
    body = "\n".join([*_head(handed, damper, columns), *_settings(handed, rows, start)])
    token = "{" + hashlib.sha256(body.encode()).hexdigest()[:32] + "}"
    text = f"damperfit-damper 1\ntoken {token}\n{body}\n"
    numbers = tuple(_numbers(damper, columns, rows[start]))
    is_of_valves = isinstance(damper, ValveDamper)
    return ExportedDamper(
        token, text, numbers, named, start, _states(damper, columns, rows), is_of_valves
    )


def _states(
    damper: Damper | ValveDamper, columns: Sequence[str], rows: dict[int, tuple[float, ...]]
) -> tuple[str, ...]:
    """With a floating piston chamber 2 is at the gas pressure; friction may be a state."""
    left_out = set()
    if isinstance(damper, ValveDamper) and damper.network.has_floating_piston:
        left_out.add("oil_2")
    place = columns.index("presliding") if "presliding" in columns else None
    if place is None or not any(row[place] > 0.0 for row in rows.values()):
        left_out.add("grip")
    return tuple(one for one in STATES if one not in left_out)


def _tables() -> str:
    """The targets that take any model."""
    from damperfit.handover.targets import TARGETS  # which know this one

    return ", ".join(name for name, one in TARGETS.items() if one.has_table)


def _columns(damper: Damper | ValveDamper) -> tuple[str, ...]:
    """Names of the numbers, in the order of `read_purdy` in reading.c or of a network's numbers."""
    if isinstance(damper, Damper):
        return (*damper.names, "gas_pressure", "gas_exponent")
    return damper.network.numbers


def _value(damper: Damper | ValveDamper, values: Values, name: str) -> float:
    if name in _OF_THE_RIG or (name in values.names and values.quantity(name).is_offset):
        return 0.0
    if name in values.names:
        return float(getattr(values, name))
    return float(getattr(damper, name)) if name.startswith("gas_") else 0.0


def _head(handed: HandedOver, damper: Damper | ValveDamper, columns: Sequence[str]) -> list[str]:
    if isinstance(damper, Damper):
        geometry = (
            damper.annulus_area,
            damper.piston_area,
            damper.rod_area,
            damper.chamber_1_volume,
            damper.chamber_2_volume,
            damper.gas_volume,
            damper.oil_density,
            damper.rod_area * damper.ambient_pressure,
        )
        return [f"purdy {_joined(geometry)}"]
    network = damper.network
    place = {"": -1} | {name: k for k, name in enumerate(columns)}
    body = (
        damper.annulus_area,
        damper.piston_area,
        damper.chamber_1_volume,
        damper.chamber_2_volume,
        damper.oil_density,
        damper.rod_area * network.ambient_pressure,
        handed.solver.rounding,
    )
    counts = (int(network.has_floating_piston), len(network.passages), len(columns))
    rows = (
        (one.start, one.end, *(place[name] for name in one.numbers), int(one.is_two_way))
        for one in network.passages
    )
    return [
        f"network {_joined(body)} {' '.join(map(str, counts))}",
        *(" ".join(map(str, row)) for row in rows),
    ]


def _settings(handed: HandedOver, rows: dict[int, tuple[float, ...]], start: int) -> list[str]:
    tested, tolerance = handed.tested, handed.solver.tolerance
    if isinstance(handed.damper, ValveDamper):
        tolerance = max(tolerance, _TOLERANCE_OF_VALVES)
    return [
        f"solver {tolerance!r} {_MAX_STEPS}",
        f"tested {tested.stroke or 0.0!r} {tested.speed or 0.0!r}",
        f"friction_band {FRICTION_BAND!r}",
        f"start {start}",
        f"settings {len(rows)}",
        *(f"{place} {_joined(row)}" for place, row in rows.items()),
    ]


def _joined(numbers: Sequence[float]) -> str:
    return " ".join(repr(float(one)) for one in numbers)


def _numbers(
    damper: Damper | ValveDamper, columns: Sequence[str], row: Sequence[float]
) -> list[Number]:
    """The numbers that mean something for this damper."""
    quantities: dict[str, Quantity] = {one.name: one for one in damper.quantities}
    numbers = {
        "gas_pressure": ("Pa", "pressure at rest, absolute"),
        "gas_exponent": ("1", "polytropic exponent of the gas"),
        "gas_volume": ("m3", "volume of the gas at x = 0"),
    }
    found = []
    for place, name in enumerate(columns):
        if name in quantities and name not in _OF_THE_RIG:
            one = quantities[name]
            found.append(
                Number(place, name, one.unit, one.meaning, row[place], not one.is_logarithmic)
            )
        elif name in numbers:
            unit, meaning = numbers[name]
            found.append(Number(place, name, unit, meaning, row[place]))
        elif name not in BODY_NUMBERS:
            raise AssertionError(name)  # a passage's number is always a quantity
    return found
