"""The change of force from click to click, one row per click."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.report.sheets.notes_below import simulated_clicks_at
from damperfit.report.sheets.rounding import NOTHING, with_interval
from damperfit.report.sheets.sheet import Sheet
from damperfit.tested.setting import clicks_between

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.adjustment import Click
    from damperfit.tested.setting import Setting

__all__ = ["click_sheet"]


def click_sheet(clicks: Sequence[Click], of_offset: Sequence[str] = ()) -> Sheet:
    """Return one row per click: the change of force at the highest speed, by stroke.

    Parameters
    ----------
    clicks : sequence of Click
        Of all speeds.
    of_offset : sequence of str
        What became of the rigs' offsets, told below the table.
    """
    fastest = max((click.speed for click in clicks), default=0.0)
    shown = [click for click in clicks if click.speed == fastest]
    steps = sorted({(click.first, click.second) for click in shown})
    cells = {(click.first, click.second, click.stroke): click for click in shown}

    def change_of(step: tuple[Setting, Setting], stroke: str) -> str:
        click = cells.get((*step, stroke))
        return NOTHING if click is None else with_interval(click.change, click.high, plus="+")

    return Sheet(
        headings=("click", "rebound", "bump"),
        units=("", "N", "N"),
        rows=tuple(
            (_words(*step), change_of(step, "rebound"), change_of(step, "bump")) for step in steps
        ),
        is_number=(False, True, True),
        notes=(simulated_clicks_at(fastest), *of_offset) if steps else (),
    )


def _words(first: Setting, second: Setting) -> str:
    """Two settings apart are more than one click, and what lies between was not tested."""
    clicks = clicks_between(first, second) or 0.0
    apart = f" ({clicks:g} clicks)" if clicks > 1.0 else ""
    return f"{first} to {second}{apart}"
