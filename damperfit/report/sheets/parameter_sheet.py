"""The parameters, one row per setting, with how each parameter is shown: symbol, unit, mark."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from damperfit.report.sheets.notes_below import units_and_marks
from damperfit.report.sheets.rounding import NOTHING, percent, with_error
from damperfit.report.sheets.sheet import Sheet
from damperfit.tables import PAPER_QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.damper.quantity import Quantity

    Row = Mapping[str, Any]

__all__ = [
    "PARAMETER_MARKS",
    "Scale",
    "is_one_for_all",
    "limit_text",
    "parameter_line",
    "parameter_sheet",
    "scale_of",
    "scaled_units",
    "shared_sentence",
    "shown_quantities",
    "total_error",
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
        if len(self.unit) <= _SHORT:
            return self.unit
        return f"1e{self.power}" if self.power else "SI"

    @property
    def unit_with_power(self) -> str:
        """For a column of units: "1e3 s sqrt(N)/(m kg)"."""
        if len(self.unit) <= _SHORT or not self.power:
            return self.unit
        return f"1e{self.power} {self.unit}"

    def say(self, text: str) -> str:
        """Return a shown value, with or without its error, and its unit."""
        if len(self.unit) <= _SHORT:
            return f"{text} {self.unit}"
        return f"{f'({text})' if '±' in text else text}e{self.power} {self.unit}"


_SHORT = 5
_SAME = 1e-9  # of a value that went through a file
# Within this factor of an edge a value at its bound is the edge, not a number that was found.
_AT_EDGE = 2.0


def scale_of(quantity: Quantity) -> Scale:
    """Return how a quantity is shown."""
    shown = quantity.shown_unit
    has_power = shown[:2] == "10"  # "10³ s √N / (m kg)" is for an axis alone
    unit = shown if shown and not has_power else quantity.unit
    return Scale(quantity.symbol, quantity.label, unit, quantity.power, shown or quantity.unit)


def shown_quantities(rows: Sequence[Row], quantities: Sequence[Quantity]) -> list[Quantity]:
    """Return the quantities without those that are held at their default at every setting."""
    return [
        one
        for one in quantities
        if one.default is None or not all(_is_idle(row, one) for row in rows)
    ]


def _is_idle(row: Row, one: Quantity) -> bool:
    if one.default is None:
        return False
    is_default = row[one.name] in (None, one.default)
    return is_default and row[f"{one.name}_status"] in ("fixed", None)


PARAMETER_MARKS = {
    "absent": "none",
    "fixed": "f",
    "shared": "s",
    "at_bound": "!",
    "not_identifiable": "?",
}


def parameter_sheet(
    rows: Sequence[Row],
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
    *,
    says_shared_once: bool = False,
) -> Sheet:
    """Return one row per setting: parameters with their standard errors, MSE, grade, outcome.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table of parameters.
    quantities : sequence of Quantity
        What was fitted.
    says_shared_once : bool
        What all settings have in common is a line below, no column.
    """
    shown = shown_quantities(rows, quantities)
    once = ""
    if says_shared_once:
        once = shared_sentence(rows, quantities)
        shown = [one for one in shown if not is_one_for_all(rows, one.name)]
    scales = [scale_of(one) for one in shown]
    return Sheet(
        headings=("set", *(scale.symbol for scale in scales), "MSE", "grade", "outcome"),
        units=("", *(scale.short_unit for scale in scales), "%", "", ""),
        rows=tuple(
            (
                str(row["setting"]),
                *(_parameter_cell(row, one) for one in shown),
                percent(row["mse_percent"]),
                row["grade"] or NOTHING,
                (row["outcome"] or NOTHING).replace("_", " "),
            )
            for row in rows
        ),
        is_number=(True, *(True for _ in shown), True, False, False),
        notes=(
            *([once] if once else []),
            *units_and_marks(rows, [one.name for one in shown], scaled_units(shown)),
        ),
    )


def scaled_units(quantities: Sequence[Quantity]) -> str:
    """Return which quantities stand in a power of ten of a long unit; empty where none does."""
    groups: dict[str, list[str]] = {}
    for one in quantities:
        scale = scale_of(one)
        if scale.short_unit != scale.unit:
            power = f"1e{scale.power} " if scale.power else ""
            groups.setdefault(f"{power}{scale.unit}", []).append(scale.symbol)
    return ", ".join(f"{_listed(symbols)} in {unit}" for unit, symbols in groups.items())


def _listed(symbols: Sequence[str]) -> str:
    *first, last = symbols
    return f"{', '.join(first)} and {last}" if first else last


def parameter_line(row: Row, quantities: Sequence[Quantity] = PAPER_QUANTITIES) -> str:
    """Return the parameters of one setting in a sentence, those not known left out."""
    parts = []
    for one in quantities:
        name, scale, status = one.name, scale_of(one), row[f"{one.name}_status"]
        if row[name] is None or _is_idle(row, one):
            continue
        if status == "absent":
            parts.append(f"no {one.label}")
            continue
        if status == "not_identifiable":
            parts.append(f"{scale.symbol} cannot be determined")
            continue
        error = total_error(row, name)
        at_edge = status == "at_bound" and limit_text(one, row[name], scale.factor)
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


def _parameter_cell(row: Row, quantity: Quantity) -> str:
    name, factor = quantity.name, scale_of(quantity).factor
    value, error, status = row[name], total_error(row, name), row[f"{name}_status"]
    if status in {"absent", "not_identifiable"}:
        return PARAMETER_MARKS[status]  # no number that pretends to be known
    at_edge = status == "at_bound" and value is not None and limit_text(quantity, value, factor)
    text = at_edge or with_error(
        None if value is None else value * factor, None if error is None else error * factor
    )
    mark = PARAMETER_MARKS.get(status or "", "")
    return f"{text} {mark}" if mark else text


def total_error(row: Row, name: str) -> float | None:
    """Return the standard error of noise and of the misfit together, SI; None where none is known.

    Older results have no misfit in them.
    """
    error = row[f"{name}_se"]
    bend = row.get(f"{name}_misfit_se")
    return math.hypot(error, bend) if error is not None and bend else error


def is_one_for_all(rows: Sequence[Row], name: str) -> bool:
    """Whether several settings have one value, shared or held, and none by a fit of its own."""
    values = [row[name] for row in rows if row[name] is not None]
    held = {row[f"{name}_status"] for row in rows if row[name] is not None} <= {"fixed", "shared"}
    return len(values) > 1 and held and max(values) - min(values) <= _SAME * abs(values[0])


def shared_sentence(rows: Sequence[Row], quantities: Sequence[Quantity]) -> str:
    """Return what all settings have in common, in a line; empty where there is nothing."""
    said = []
    for one in shown_quantities(rows, quantities):
        if not is_one_for_all(rows, one.name):
            continue
        row, scale = next(row for row in rows if row[one.name] is not None), scale_of(one)
        error = total_error(row, one.name)
        value = with_error(
            scale.factor * row[one.name], None if error is None else scale.factor * error
        )
        status = row[f"{one.name}_status"]
        how = "shared by all settings" if status == "shared" else "fixed"
        said.append(f"{scale.symbol} = {scale.say(value)}, {how}")
    return "; ".join(said)


def limit_text(quantity: Quantity, value: float, factor: float) -> str:
    """Return a value that ran to an edge of its range as the limit it ran into.

    Empty where it is none: a friction too small to be determined may be far from the edge.
    """
    if not quantity.is_logarithmic:
        return ""
    low, high = quantity.plausible
    if value < _AT_EDGE * low:
        return f"<{max(value, low) * factor:.2g}"
    return f">{min(value, high) * factor:.2g}" if value > high / _AT_EDGE else ""
