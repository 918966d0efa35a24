"""Which law the logs tell: a row for each law that was tried, the chosen one at each setting."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from damperfit.damper.rivals import Rival
from damperfit.laws import UNTOLD
from damperfit.report.sheets.rounding import number
from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.laws import Ladder, LawFit, Tried

__all__ = [
    "chosen_records",
    "chosen_sheet",
    "ladder_records",
    "ladder_sheet",
    "rival_records",
    "rival_sheet",
]


def ladder_sheet(ladder: Ladder) -> Sheet:
    """Return one row a law, in the order in which they were tried."""
    return Sheet(
        headings=("", "law", "free", "MSE", "held out"),
        units=("", "", "", "%", "%"),
        rows=tuple(
            (
                "*" if rung.is_taken else "",
                rung.tried.title,
                str(rung.tried.n_quantities),
                _percent(rung.tried.mse_percent),
                _percent(rung.tried.held_out_percent),
            )
            for rung in ladder.rungs
        ),
        is_number=(False, False, True, True, True),
    )


def ladder_records(ladder: Ladder) -> list[dict[str, Any]]:
    """Return the same as numbers, with the reasons, for JSON."""
    return [
        {
            "law": rung.tried.title,
            "model": rung.tried.fits[0].model.name,
            "is_chosen": rung.is_taken,
            "free": list(rung.tried.fits[0].free),
            "at_bound": list(rung.tried.at_bound),
            "mse_percent": rung.tried.mse_percent,
            "held_out_mse_percent": _finite(rung.tried.held_out_percent),
            "bic": _finite(rung.bic),
            "reason": rung.reason,
        }
        for rung in ladder.rungs
    ]


def rival_sheet(rivals: Sequence[Tried]) -> Sheet:
    """Return one row a model of the literature, the best prediction first."""
    return Sheet(
        headings=("model of the literature", "source", "free", "MSE", "held out"),
        units=("", "", "", "%", "%"),
        rows=tuple(
            (
                one.title,
                _source(one),
                str(one.n_quantities),
                _percent(one.mse_percent),
                _percent(one.held_out_percent),
            )
            for one in rivals
        ),
        is_number=(False, False, True, True, True),
        notes=("Some equations are those of later texts, not of the original; --json says which.",),
    )


def rival_records(rivals: Sequence[Tried]) -> list[dict[str, Any]]:
    """Return the same as numbers, for JSON."""
    return [
        {
            "title": one.title,
            "model": one.fits[0].model.name,
            "source": _source(one),
            "caveat": _caveat(one),
            "free": list(one.fits[0].free),
            "at_bound": list(one.at_bound),
            "mse_percent": one.mse_percent,
            "held_out_mse_percent": _finite(one.held_out_percent),
        }
        for one in rivals
    ]


def _source(one: Tried) -> str:
    model = one.fits[0].model
    return model.source if isinstance(model, Rival) else ""


def _caveat(one: Tried) -> str:
    model = one.fits[0].model
    return model.caveat if isinstance(model, Rival) else ""


def chosen_sheet(fits: Sequence[LawFit]) -> Sheet:
    """Return what the chosen law found: a row a quantity, a column a setting."""
    shown = [one for one in fits[0].model.quantities if one.name in fits[0].free]
    rows = [
        (
            one.label,
            one.shown_unit or one.unit,
            *(
                number(getattr(fit.values, one.name) / 10.0**one.power, digits=4)
                + ("!" if one.name in fit.at_bound else "?" * (one.name in fit.untold))
                for fit in fits
            ),
        )
        for one in shown
    ]
    rows.append(("MSE", "%", *(_percent(fit.mse_percent) for fit in fits)))
    rows.append(("MSE held out", "%", *(_percent(fit.held_out_percent) for fit in fits)))
    marks = {
        "! at the edge of its range: not told by these logs": any(fit.at_bound for fit in fits),
        f"? not told by these logs: {UNTOLD:g} times as much or as little would do as well": any(
            fit.untold for fit in fits
        ),
    }
    return Sheet(
        headings=("setting", "", *(str(fit.setting) for fit in fits)),
        units=("",) * (len(fits) + 2),
        rows=tuple(rows),
        is_number=(False, False, *(True for _ in fits)),
        notes=tuple(mark for mark, is_there in marks.items() if is_there),
    )


def chosen_records(fits: Sequence[LawFit]) -> list[dict[str, Any]]:
    """Return the same as numbers in SI, for JSON."""
    return [
        {
            "setting": fit.setting.cell,
            "values": dict(zip(fit.values.names, fit.values.numbers, strict=True)),
            "free": list(fit.free),
            "at_bound": list(fit.at_bound),
            "not_told": list(fit.untold),
            "mse_percent": fit.mse_percent,
            "stretch_mse_percent": list(fit.stretches),
            "held_out_mse_percent": _finite(fit.held_out_percent),
            "held_out": fit.held_out or None,
            "evaluations": fit.evaluations,
        }
        for fit in fits
    ]


def _percent(value: float) -> str:
    if math.isnan(value):
        return "-"
    return number(value, digits=3) if value >= 1e-4 else "<0.0001"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
