"""What an FMU holds of a damper: the text of ``resources/damper.txt`` and its variables.

`c/reading.c` reads the text, `c/exported.h` numbers the variables; both are held together by tests.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from damperfit.damper.purdy.parameters import Damper
from damperfit.errors import ConfigurationError

if TYPE_CHECKING:
    from damperfit.export.handed_over import HandedOver, HandedSetting

__all__ = ["FRICTION_BAND", "NUMBERS", "ExportedDamper", "exported_damper"]

NUMBERS = 100  # value reference of the first number of the damper
# With the fit's dead band of 0.1 mm/s a car at rest shakes at steps of 1 ms.
FRICTION_BAND = 0.005
_MAX_STEPS = 10_000


@dataclass(frozen=True, slots=True)
class Number:
    """A number of the damper that an importer may change.

    Attributes
    ----------
    name, unit, meaning : str
        As its quantity has them.
    start : float
        At the setting that is set at the beginning, SI.
    may_vanish : bool
        Zero is allowed.
    has_sign : bool
        Either sign is allowed.
    """

    name: str
    unit: str
    meaning: str
    start: float
    may_vanish: bool = False
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
    """

    token: str
    text: str
    numbers: tuple[Number, ...]
    settings: dict[int, str]
    start: int


def exported_damper(handed: HandedOver) -> ExportedDamper:
    """Return the paper's damper with all its settings.

    Settings that are whole numbers of one adjuster keep them; others are counted from 1.

    Raises
    ------
    ConfigurationError
        The model is none that an FMU can hold.
    """
    damper = handed.damper
    if not isinstance(damper, Damper):
        raise ConfigurationError(
            f"a damper of the model {damper.name} cannot be an FMU yet, only one of the paper's; "
            f"hand it over as a table: --to {_tables()}"
        )
    cells = [one.setting.cell for one in handed.settings]
    whole = [cell for cell in cells if isinstance(cell, int)]
    places = whole if len(whole) == len(cells) else range(1, len(cells) + 1)
    named = dict(zip(places, (str(one.setting) for one in handed.settings), strict=True))
    start = sorted(named)[len(named) // 2]
    rows = {place: _row(damper, one) for place, one in zip(named, handed.settings, strict=True)}
    body = "\n".join(_lines(handed, damper, rows, start))
    token = "{" + hashlib.sha256(body.encode()).hexdigest()[:32] + "}"
    text = f"damperfit-damper 1\ntoken {token}\n{body}\n"
    return ExportedDamper(token, text, _numbers(handed, rows[start]), named, start)


def _tables() -> str:
    """The targets that take any model."""
    from damperfit.export.targets import TARGETS  # which know this one

    return ", ".join(name for name, one in TARGETS.items() if one.has_table)


def _row(damper: Damper, one: HandedSetting) -> tuple[float, ...]:
    """In the order of `df_parameters`; the rig's tare is not the damper's."""
    values = [0.0 if q.is_offset else getattr(one.values, q.name) for q in one.values.quantities]
    return (*values, damper.gas_pressure, damper.gas_exponent)


def _lines(
    handed: HandedOver, damper: Damper, rows: dict[int, tuple[float, ...]], start: int
) -> list[str]:
    geometry = (
        damper.annulus_area,
        damper.piston_area,
        damper.rod_area,
        damper.chamber_1_volume,
        damper.chamber_2_volume,
        damper.gas_volume,
        damper.oil_density,
    )
    tested = handed.tested
    return [
        f"geometry {_joined(geometry)}",
        f"solver {handed.solver.tolerance!r} {_MAX_STEPS}",
        f"tested {tested.stroke or 0.0!r} {tested.speed or 0.0!r}",
        f"friction_band {FRICTION_BAND!r}",
        f"start {start}",
        f"settings {len(rows)}",
        *(f"{place} {_joined(row)}" for place, row in rows.items()),
    ]


def _joined(numbers: tuple[float, ...]) -> str:
    return " ".join(repr(float(one)) for one in numbers)


def _numbers(handed: HandedOver, row: tuple[float, ...]) -> tuple[Number, ...]:
    quantities = handed.damper.quantities
    fitted = [
        Number(
            q.name,
            q.unit,
            q.meaning,
            value,
            may_vanish=q.is_friction,
            has_sign=not q.is_logarithmic,
        )
        for q, value in zip(quantities, row, strict=False)
    ]
    pressure, exponent = row[len(quantities) :]
    return (
        *fitted,
        Number("gas_pressure", "Pa", "pressure at rest, absolute", pressure),
        Number("gas_exponent", "1", "polytropic exponent of the gas", exponent),
    )
