"""The MSE, one row per setting and log; the grades counted; what makes a fit less than plain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit.report.sheets.rounding import NOTHING, percent
from damperfit.report.sheets.sheet import Sheet
from damperfit.tables import PAPER_QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.damper.quantity import Quantity
    from damperfit.tested.setting import Setting

    Row = Mapping[str, Any]

__all__ = ["flags", "grade_counts", "mse_sheet"]


_GRADES = ("excellent", "good", "poor", "withheld")


def mse_sheet(
    everything: Sequence[Row],
    parameters: Sequence[Row],
    quantities: Sequence[Quantity] = PAPER_QUANTITIES,
) -> Sheet:
    """Return one row per setting and log: MSE, noise floor, grade; the outcome per setting."""
    settings = {row["setting"]: row for row in parameters}
    logs: dict[Setting, list[str]] = {}
    for row in everything:
        is_fitted_log = row["log"] and not _role(row)
        logs.setdefault(row["setting"], []).extend([row["log"]] if is_fitted_log else [])
    rows = []
    for row in everything:
        mine = logs[row["setting"]]
        is_whole = not row["log"]
        if mine == [row["log"]]:  # the row of its setting says the same
            continue
        setting = settings.get(row["setting"], {})  # one that was only predicted has no parameters
        name = row["log"] or (mine[0] if len(mine) == 1 else "all logs")
        rows.append(
            (
                str(row["setting"]) if is_whole or not setting else "",
                name,
                percent(row["mse_percent"]),
                percent(row["noise_floor_percent"]),
                row["grade"] or NOTHING,
                str(row["n_samples"]),
                setting["outcome"].replace("_", " ") if is_whole else "",
                flags(setting, quantities) if is_whole else _role(row),
            )
        )
    return Sheet(
        headings=("setting", "log", "MSE", "noise floor", "grade", "samples", "outcome", "flags"),
        units=("", "", "%", "%", "", "", "", ""),
        rows=tuple(rows),
        is_number=(True, False, True, True, False, True, False, False),
    )


def grade_counts(rows: Iterable[Row]) -> str:
    """Return how many rows of a table have each grade, as a sentence."""
    grades = [row["grade"] for row in rows]
    counts = [f"{grades.count(g)} {g}" for g in _GRADES if g in grades]
    return f"Grades: {', '.join(counts)} (excellent below 1 %, good below 5 %)."


def flags(row: Row, quantities: Sequence[Quantity] = PAPER_QUANTITIES) -> str:
    """Return what makes a setting's parameters less than plainly fitted, in words."""
    symbols = {one.name: one.symbol for one in quantities}
    marks = {
        key.removesuffix("_status"): status
        for key, status in row.items()
        if key.endswith("_status")
    }
    found = [
        f"{symbols.get(name, name)} {words}"
        for status, words in (("at_bound", "at bound"), ("not_identifiable", "not identifiable"))
        for name, found in marks.items()
        if found == status
    ]
    if row.get("cavitation_fraction"):
        found.append(f"cavitates for {100.0 * row['cavitation_fraction']:.1f} % of the cycle")
    return "; ".join(found)


def _role(row: Row) -> str:
    return "held out: predicted, not fitted" if row.get("role") == "held_out" else ""
