"""Tables as rows of strings, rounded for reading; every renderer starts from these.

A value with a standard error is rounded by it, to two digits of the error (``1.26 +- 0.12``).
Without one, five significant digits are shown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeGuard

from damperfit.damper.parameters import PARAMETER_NAMES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import pyarrow as pa

__all__ = [
    "NOTHING",
    "PARAMETER_MARKS",
    "PARAMETER_SCALES",
    "Scale",
    "Sheet",
    "flags",
    "grade_counts",
    "has_offset",
    "legend",
    "mse_sheet",
    "number",
    "parameter_line",
    "parameter_sheet",
    "percent",
    "rounded_by_error",
    "sheet_width",
    "with_error",
]

NOTHING = "-"


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
# The powers keep the numbers between 1 and 1000.
PARAMETER_SCALES: dict[str, Scale] = {
    "r_m1": Scale("R_m1", "valve 1 (adjuster)", "s sqrt(N)/(m kg)", 3, "10³ s √N / (m kg)"),
    "r_m2": Scale("R_m2", "valve 2 (bump)", "N s/(m2 kg)", 6, "10⁶ N s / (m² kg)"),
    "r_m3": Scale("R_m3", "valve 3 (rebound)", "N s/(m2 kg)", 6, "10⁶ N s / (m² kg)"),
    "k_e": Scale("K_e", "bulk modulus of oil and chamber", "MPa", 6, "MPa"),
    "f_f": Scale("f_f", "friction", "N", 0, "N"),
    "f_0": Scale("f_0", "force offset", "N", 0, "N"),
}
# A mark behind a number that was not simply fitted; the legend stands below the table.
PARAMETER_MARKS = {"fixed": "f", "shared": "s", "at_bound": "!", "not_identifiable": "?"}
_LEGEND = {
    "fixed": "f fixed",
    "shared": "s shared by all settings",
    "at_bound": "! ran into a bound",
    "not_identifiable": "? these logs cannot tell it",
}


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table of strings.

    Attributes
    ----------
    headings, units : tuple of str
        One per column; units may be empty strings.
    rows : tuple of tuple of str
        Cells.
    is_number : tuple of bool
        Columns that are aligned to the right.
    notes : tuple of str
        Lines that belong below the table.
    """

    headings: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    is_number: tuple[bool, ...]
    notes: tuple[str, ...] = ()


def number(value: float | None, *, digits: int = 5) -> str:
    """Return a number with ``digits`` significant digits and no exponent where that reads well.

    Examples
    --------
    >>> number(23.9451234), number(0.0), number(None), number(1234567.0)
    ('23.945', '0', '-', '1.2346e+06')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if not 1e-3 <= abs(value) < 10.0**digits:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{_decimals(value, digits)}f}"


def with_error(value: float | None, error: float | None, *, digits: int = 5) -> str:
    """Return value and standard error, both rounded to two digits of the error.

    Without an error, ``digits`` significant digits are shown.

    Examples
    --------
    >>> with_error(1.2634, 0.1234), with_error(45678.9, 321.0), with_error(2.0, None)
    ('1.26 ± 0.12', '45680 ± 320', '2.0000')
    """
    if value is None or not _is_error(error):
        return number(value, digits=digits)
    shown, place = _round_by(value, error), _place(error)
    return f"{shown} ± {_round_at(error, place)}"


def rounded_by_error(
    value: float | None, error: float | None, *, has_error: bool = True, digits: int = 4
) -> str:
    """Return value and standard error in few characters, the error in units of the last digit.

    Without an error, ``digits`` significant digits are shown; ``has_error`` False rounds by the
    error but leaves it out.

    Examples
    --------
    >>> rounded_by_error(14.00512, 0.0112), rounded_by_error(45678.9, 321.0)
    ('14.005(11)', '45680(320)')
    >>> rounded_by_error(14.00512, 0.0112, has_error=False), rounded_by_error(2.0, None)
    ('14.005', '2.000')
    """
    if value is None or not _is_error(error):
        return number(value, digits=digits)
    shown = _round_by(value, error)
    if not has_error:
        return shown
    place = _place(error)
    step = 10.0 ** min(place, 0)
    return f"{shown}({round(round(error / 10.0**place) * 10.0**place / step)})"


def _is_error(error: float | None) -> TypeGuard[float]:
    return error is not None and math.isfinite(error) and error > 0.0


def _place(error: float) -> int:
    """Return the decimal place of the second digit of an error."""
    place = math.floor(math.log10(error)) - 1
    return place + 1 if round(error / 10.0**place) >= 100 else place  # 0.0996 rounds up to 0.10


def _round_at(value: float, place: int) -> str:
    step = 10.0**place
    return f"{round(value / step) * step:.{max(0, -place)}f}"


def _round_by(value: float, error: float) -> str:
    return _round_at(value, _place(error))


def percent(value: float | None) -> str:
    """Return a percentage with three significant digits.

    Examples
    --------
    >>> percent(0.012345), percent(12.3456), percent(None)
    ('0.0123', '12.3', '-')
    """
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    if abs(value) < 1e-4:
        return f"{value:.1e}"
    return f"{value:.{_decimals(value, 3)}f}"


def _decimals(value: float, digits: int) -> int:
    """Return the decimals that show ``digits`` significant digits of the rounded value."""
    power = int(f"{value:.{digits - 1}e}".partition("e")[2])
    return max(0, digits - 1 - power)


def flags(row: Mapping[str, Any]) -> str:
    """Return what makes a setting's parameters less than plainly fitted, in words."""
    found = [
        f"{PARAMETER_SCALES[name].symbol} {words}"
        for status, words in (("at_bound", "at bound"), ("not_identifiable", "not identifiable"))
        for name in PARAMETER_NAMES
        if row.get(f"{name}_status") == status
    ]
    if row.get("cavitation_fraction"):
        found.append(f"cavitates for {100.0 * row['cavitation_fraction']:.1f} % of the cycle")
    return "; ".join(found)


def grade_counts(rows: Iterable[Mapping[str, Any]]) -> str:
    """Return how many rows of a table have each grade, as a sentence."""
    grades = [row["grade"] for row in rows]
    counts = [f"{grades.count(g)} {g}" for g in ("excellent", "good", "poor") if g in grades]
    return f"Grades: {', '.join(counts)} (excellent below 1 %, good below 5 %)."


def sheet_width(sheet: Sheet, *, gap: int) -> int:
    """Return the characters of the widest row with ``gap`` blanks between columns."""
    columns = zip(sheet.headings, sheet.units, *sheet.rows, strict=True)
    widths = [max(len(cell) for cell in column) for column in columns]
    return sum(widths) + gap * (len(widths) - 1)


def parameter_sheet(table: pa.Table) -> Sheet:
    """Return one row per setting: parameters with their standard errors, MSE, grade, outcome."""
    rows = table.to_pylist()
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
                _words(row["outcome"]),
            )
            for row in rows
        ),
        is_number=(True, *(True for _ in names), True, False, False),
        notes=legend(rows, names),
    )


def parameter_line(row: Mapping[str, Any]) -> str:
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
        value = with_error(
            scale.factor * row[name], None if error is None else scale.factor * error
        )
        words = "" if status in {"fitted", None} else f" ({status.replace('_', ' ')})"
        parts.append(f"{scale.symbol} = {scale.say(value)}{words}")
    return f"{', '.join(parts)}." if parts else ""


def mse_sheet(mse: pa.Table, parameters: pa.Table) -> Sheet:
    """Return one row per setting and log: MSE, noise floor, grade; the outcome per setting."""
    settings = {row["setting"]: row for row in parameters.to_pylist()}
    everything = mse.to_pylist()
    logs: dict[int, list[str]] = {}
    for row in everything:
        is_fitted_log = row["log"] and not _role(row)
        logs.setdefault(row["setting"], []).extend([row["log"]] if is_fitted_log else [])
    rows = []
    for row in everything:
        mine = logs[row["setting"]]
        is_whole = row["log"] == ""
        if mine == [row["log"]]:  # the row of its setting says the same
            continue
        setting = settings[row["setting"]]
        name = row["log"] or (mine[0] if len(mine) == 1 else "all logs")
        rows.append(
            (
                str(row["setting"]) if is_whole else "",
                name,
                percent(row["mse_percent"]),
                percent(row["noise_floor_percent"]),
                row["grade"],
                str(row["n_samples"]),
                _words(setting["outcome"]) if is_whole else "",
                flags(setting) if is_whole else _role(row),
            )
        )
    return Sheet(
        headings=("setting", "log", "MSE", "noise floor", "grade", "samples", "outcome", "flags"),
        units=("", "", "%", "%", "", "", "", ""),
        rows=tuple(rows),
        is_number=(True, False, True, True, False, True, False, False),
    )


def _role(row: Mapping[str, Any]) -> str:
    return "held out: predicted, not fitted" if row.get("role") == "held_out" else ""


def _parameter_cell(row: Mapping[str, Any], name: str) -> str:
    factor = PARAMETER_SCALES[name].factor
    value, error, status = row[name], row[f"{name}_se"], row[f"{name}_status"]
    if status == "not_identifiable":
        return PARAMETER_MARKS[status]  # no number that pretends to be known
    text = with_error(
        None if value is None else value * factor, None if error is None else error * factor
    )
    mark = PARAMETER_MARKS.get(status or "", "")
    return f"{text} {mark}" if mark else text


def has_offset(rows: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether a force offset is part of the model anywhere."""
    return any(row["f_0"] or row["f_0_status"] not in {"fixed", None} for row in rows)


def legend(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> tuple[str, ...]:
    """Return what the units and the marks of a table of parameters mean."""
    used = {row[f"{name}_status"] for row in rows for name in names}
    marks = ", ".join(text for status, text in _LEGEND.items() if status in used)
    units = "R_m1 in 1e3 s sqrt(N)/(m kg), R_m2 and R_m3 in 1e6 N s/(m2 kg)"
    return (units, marks) if marks else (units,)


def _words(outcome: str) -> str:
    return outcome.replace("_", " ")
