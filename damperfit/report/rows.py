"""Tables as rows of strings, rounded for reading; every renderer starts from these.

A value with a standard error is rounded by it, to two digits of the error (``1.26 +- 0.12``).
Without one, five significant digits are shown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from damperfit.damper.parameters import PARAMETER_NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pyarrow as pa

__all__ = [
    "Sheet",
    "flags",
    "mse_sheet",
    "number",
    "parameter_sheet",
    "percent",
    "with_error",
]

NOTHING = "-"

# Heading and factor from SI of each parameter; the factors keep the numbers between 1 and 1000.
_SCALES: dict[str, tuple[str, str, float]] = {
    "r_m1": ("R_m1", "1e3", 1e-3),
    "r_m2": ("R_m2", "1e6", 1e-6),
    "r_m3": ("R_m3", "1e6", 1e-6),
    "k_e": ("K_e", "MPa", 1e-6),
    "f_f": ("f_f", "N", 1.0),
    "f_0": ("f_0", "N", 1.0),
}
# A mark behind a number that was not simply fitted; the legend stands below the table.
_MARKS = {"fixed": "f", "shared": "s", "at_bound": "!", "not_identifiable": "?"}
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
    if value is None or error is None or not math.isfinite(error) or error <= 0.0:
        return number(value, digits=digits)
    place = math.floor(math.log10(error)) - 1
    if round(error / 10.0**place) >= 100:  # 0.0996 rounds up to 0.10
        place += 1
    decimals = max(0, -place)
    step = 10.0**place

    def rounded(x: float) -> str:
        return f"{round(x / step) * step:.{decimals}f}"

    return f"{rounded(value)} ± {rounded(error)}"


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
        f"{name} {words}"
        for status, words in (("at_bound", "at bound"), ("not_identifiable", "not identifiable"))
        for name in PARAMETER_NAMES
        if row.get(f"{name}_status") == status
    ]
    if row.get("cavitation_fraction"):
        found.append(f"cavitates for {100.0 * row['cavitation_fraction']:.1f} % of the cycle")
    return "; ".join(found)


def parameter_sheet(table: pa.Table, *, digits: int = 5, has_errors: bool = True) -> Sheet:
    """Return one row per setting: parameters, MSE, grade and outcome.

    Numbers without a standard error, or all with ``has_errors`` False for a narrow screen, are
    shown with ``digits`` significant digits.
    """
    rows = table.to_pylist()
    names = [n for n in PARAMETER_NAMES if n != "f_0" or _has_offset(rows)]
    scales = [_SCALES[name] for name in names]
    return Sheet(
        headings=("set", *(heading for heading, _, _ in scales), "MSE", "grade", "outcome"),
        units=("", *(unit for _, unit, _ in scales), "%", "", ""),
        rows=tuple(
            (
                str(row["setting"]),
                *(
                    _parameter_cell(row, name, digits=digits, has_errors=has_errors)
                    for name in names
                ),
                percent(row["mse_percent"]),
                row["grade"] or NOTHING,
                _words(row["outcome"]),
            )
            for row in rows
        ),
        is_number=(True, *(True for _ in names), True, False, False),
        notes=_legend(rows, names),
    )


def mse_sheet(mse: pa.Table, parameters: pa.Table) -> Sheet:
    """Return one row per setting and log: MSE, noise floor, grade; the outcome per setting."""
    settings = {row["setting"]: row for row in parameters.to_pylist()}
    rows = []
    for row in mse.to_pylist():
        is_whole = row["log"] == ""
        setting = settings[row["setting"]]
        rows.append(
            (
                str(row["setting"]) if is_whole else "",
                "all logs" if is_whole else row["log"],
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


def _parameter_cell(row: Mapping[str, Any], name: str, *, digits: int, has_errors: bool) -> str:
    _, _, factor = _SCALES[name]
    value, status = row[name], row[f"{name}_status"]
    error = row[f"{name}_se"] if has_errors else None
    if status == "not_identifiable":
        return _MARKS[status]  # no number that pretends to be known
    text = with_error(
        None if value is None else value * factor,
        None if error is None else error * factor,
        digits=digits,
    )
    mark = _MARKS.get(status or "", "")
    return f"{text} {mark}" if mark else text


def _has_offset(rows: Sequence[Mapping[str, Any]]) -> bool:
    return any(row["f_0"] or row["f_0_status"] not in {"fixed", None} for row in rows)


def _legend(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> tuple[str, ...]:
    used = {row[f"{name}_status"] for row in rows for name in names}
    marks = ", ".join(text for status, text in _LEGEND.items() if status in used)
    units = "R_m1 in 1e3 s sqrt(N)/(m kg), R_m2 and R_m3 in 1e6 N s/(m2 kg)"
    return (units, marks) if marks else (units,)


def _words(outcome: str) -> str:
    return outcome.replace("_", " ")
