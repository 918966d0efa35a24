"""The parameters, one row per setting, with how each parameter is shown: symbol, unit, mark."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.damper.parameters import PARAMETER_NAMES
from damperfit.damper.purdy.quantities import QUANTITIES
from damperfit.report.rows.notes_below_tables import units_and_marks
from damperfit.report.rows.rounding import NOTHING, percent, with_error
from damperfit.report.rows.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Row = Mapping[str, Any]

__all__ = [
    "PARAMETER_MARKS",
    "PARAMETER_SCALES",
    "Scale",
    "has_offset",
    "limit_text",
    "parameter_line",
    "parameter_sheet",
]


class Scale(NamedTuple):
    """How a parameter is shown: symbol, meaning, unit, power of ten, and both on an axis."""

    symbol: str
    meaning: str
    unit: str
    power: int
    axis: str

    @property
    def factor(self) -> float:
        """From SI to what is shown."""
        return 10.0**-self.power

    @property
    def short_unit(self) -> str:
        """For the head of a narrow column."""
        return self.unit if len(self.unit) <= _SHORT else f"1e{self.power}"

    def say(self, text: str) -> str:
        """Return a shown value, with or without its error, and its unit."""
        if len(self.unit) <= _SHORT:
            return f"{text} {self.unit}"
        return f"{f'({text})' if '±' in text else text}e{self.power} {self.unit}"


_SHORT = 3
# Within this factor of an edge a value at its bound is the edge, not a number that was found.
_AT_EDGE = 2.0
# The powers keep the numbers between 1 and 1000.
PARAMETER_SCALES: dict[str, Scale] = {
    "r_m1": Scale("R_m1", "valve 1 (adjuster)", "s sqrt(N)/(m kg)", 3, "10³ s √N / (m kg)"),
    "r_m2": Scale("R_m2", "valve 2 (bump)", "N s/(m2 kg)", 6, "10⁶ N s / (m² kg)"),
    "r_m3": Scale("R_m3", "valve 3 (rebound)", "N s/(m2 kg)", 6, "10⁶ N s / (m² kg)"),
    "k_e": Scale("K_e", "bulk modulus of oil and chamber", "MPa", 6, "MPa"),
    "f_f": Scale("f_f", "friction", "N", 0, "N"),
    "f_0": Scale("f_0", "force offset", "N", 0, "N"),
}

PARAMETER_MARKS = {"fixed": "f", "shared": "s", "at_bound": "!", "not_identifiable": "?"}


def parameter_sheet(rows: Sequence[Row]) -> Sheet:
    """Return one row per setting: parameters with their standard errors, MSE, grade, outcome."""
    names = [n for n in PARAMETER_NAMES if n != "f_0" or has_offset(rows)]
    scales = [PARAMETER_SCALES[name] for name in names]
    return Sheet(
        headings=("set", *(scale.symbol for scale in scales), "MSE", "grade", "outcome"),
        units=("", *(scale.short_unit for scale in scales), "%", "", ""),
        rows=tuple(
            (
                str(row["setting"]),
                *(_parameter_cell(row, name) for name in names),
                percent(row["mse_percent"]),
                row["grade"] or NOTHING,
                (row["outcome"] or NOTHING).replace("_", " "),
            )
            for row in rows
        ),
        is_number=(True, *(True for _ in names), True, False, False),
        notes=units_and_marks(rows, names),
    )


def parameter_line(row: Row) -> str:
    """Return the parameters of one setting in a sentence, those not known left out."""
    parts = []
    for name in PARAMETER_NAMES:
        scale, status = PARAMETER_SCALES[name], row[f"{name}_status"]
        if row[name] is None or (name == "f_0" and not has_offset([row])):
            continue
        if status == "not_identifiable":
            parts.append(f"{scale.symbol} cannot be told")
            continue
        error = row[f"{name}_se"]
        at_edge = status == "at_bound" and limit_text(name, row[name], scale.factor)
        if at_edge:
            words = "below" if at_edge.startswith("<") else "above"
            parts.append(f"{scale.symbol} {words} {scale.say(at_edge[1:])} (at bound)")
            continue
        value = with_error(
            scale.factor * row[name], None if error is None else scale.factor * error
        )
        words = "" if status in {"fitted", None} else f" ({status.replace('_', ' ')})"
        parts.append(f"{scale.symbol} = {scale.say(value)}{words}")
    return f"{', '.join(parts)}." if parts else ""


def _parameter_cell(row: Row, name: str) -> str:
    factor = PARAMETER_SCALES[name].factor
    value, error, status = row[name], row[f"{name}_se"], row[f"{name}_status"]
    if status == "not_identifiable":
        return PARAMETER_MARKS[status]  # no number that pretends to be known
    at_edge = status == "at_bound" and value is not None and limit_text(name, value, factor)
    text = at_edge or with_error(
        None if value is None else value * factor, None if error is None else error * factor
    )
    mark = PARAMETER_MARKS.get(status or "", "")
    return f"{text} {mark}" if mark else text


def limit_text(name: str, value: float, factor: float) -> str:
    """Return a value that ran to an edge of its range as the limit it ran into.

    Empty where it is none: a friction too small to be told may be far from the edge.
    """
    known = next((one for one in QUANTITIES if one.name == name), None)
    if known is None or not known.is_logarithmic:
        return ""
    low, high = known.plausible
    if value < _AT_EDGE * low:
        return f"<{max(value, low) * factor:.2g}"
    return f">{min(value, high) * factor:.2g}" if value > high / _AT_EDGE else ""


def has_offset(rows: Sequence[Row]) -> bool:
    """Return whether a force offset is part of the model anywhere."""
    return any(row["f_0"] or row["f_0_status"] not in {"fixed", None} for row in rows)
