"""What was held out and how well it is predicted, as rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.report.sheets.rounding import number, percent
from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Iterable

    from damperfit.uncertainty import Prediction

__all__ = ["held_out_sheet"]

_NO_ONE = "varies"


def held_out_sheet(predictions: Iterable[Prediction], *, is_narrow: bool = False) -> Sheet:
    """Return one row per prediction: the motion, its MSE beside the fitted logs', the verdict.

    Parameters
    ----------
    predictions : iterable of Prediction
        What was held out.
    is_narrow : bool
        Leave out the motion, for a terminal.
    """
    rows = []
    for one in predictions:
        # What moves beside the steady cycles has no frequency of its own.
        has_one = one.trace.frequency > 0.0
        motion = (
            number(1e3 * one.trace.amplitude, digits=3),
            number(one.trace.frequency, digits=3) if has_one else _NO_ONE,
        )
        rows.append(
            (
                str(one.setting),
                one.trace.name,
                one.cycles,
                *(() if is_narrow else motion),
                percent(one.mse_percent),
                percent(one.fitted_mse_percent),
                one.verdict,
            )
        )
    middle = ((), (), ()) if is_narrow else (("ampl.", "freq."), ("mm", "Hz"), (True, True))
    return Sheet(
        headings=("set", "held out", "cycles", *middle[0], "MSE", "fitted", "verdict"),
        units=("", "", "", *middle[1], "%", "%", ""),
        rows=tuple(rows),
        is_number=(True, False, False, *middle[2], True, True, False),
    )
