"""The valves of a setting: flow against pressure, as the loops show it and as the law has it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.report.plots.description import Line, Panel, Plot

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from damperfit.tested.setting import Setting

__all__ = ["valve_plots"]

_BAR, _CM3 = 1e5, 1e-6
# Bump is drawn to the left and down, as in every other figure.
_SIDES = (("rebound", 1.0), ("bump", -1.0))


def valve_plots(
    rows: Sequence[Mapping[str, Any]], setting: Setting, *, colour: str
) -> tuple[Plot, ...]:
    """Return the figure of a setting's valves, or nothing where the table has none of them.

    Parameters
    ----------
    rows : sequence of mapping
        Of the table of valves.
    setting : Setting
        Whose.
    colour : str
        Colour of the setting.
    """
    own = [row for row in rows if row["setting"] == setting]
    lines = [line for side in _SIDES for line in _valve(own, *side, setting, colour)]
    if not lines:
        return ()
    order = {"points": 0, "wide": 1, "rings": 2}
    lines.sort(key=lambda line: order[line.style])
    labels: set[str] = set()
    shown = []
    for line in lines:
        is_first = line.label not in labels
        labels.add(line.label)
        shown.append(_with_legend(line, is_first=is_first))
    panel = Panel("pressure across the valve", "bar", "flow", "cm³/s", tuple(shown))
    caption = (
        "Rebound to the right and up, bump to the left and down. Points: what the piston displaces "
        "less what gives way, read off the loops without a law of the valve; where they leave the "
        f"law, the law lacks something. {_openings(own)}"
    ).rstrip()
    title = f"Setting {setting}: the valves, flow against pressure"
    return (Plot(f"setting_{setting.slug}_valves", title, (panel,), caption),)


def _with_legend(line: Line, *, is_first: bool) -> Line:
    return Line(
        line.x, line.y, line.label, line.colour,
        setting=line.setting, style=line.style, in_legend=is_first,
    )  # fmt: skip


def _valve(
    rows: Sequence[Mapping[str, Any]], stroke: str, sign: float, setting: Setting, colour: str
) -> list[Line]:
    lines = []
    law = _points(rows, stroke, "law")
    for curve, ink, style in (("measured", "ink", "points"), ("law", colour, "wide")):
        x, y = _points(rows, stroke, curve)
        if len(x):
            lines.append(
                Line(sign * x / _BAR, sign * y / _CM3, curve, ink, setting=setting, style=style)
            )
    opening = _opening(rows, stroke)
    if opening is not None and len(law[0]) and opening <= law[0].max():
        at = np.array([opening])
        flow = np.interp(at, *law)
        lines.append(
            Line(sign * at / _BAR, sign * flow / _CM3, "blow-off opens", "muted",
                 setting=setting, style="rings")
        )  # fmt: skip
    return lines


def _points(
    rows: Sequence[Mapping[str, Any]], stroke: str, curve: str
) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    points = [
        (row["pressure_Pa"], row["flow_m3_per_s"])
        for row in rows
        if row["stroke"] == stroke
        and row["curve"] == curve
        and row["pressure_Pa"] is not None
        and row["flow_m3_per_s"] is not None
    ]
    x, y = np.array(points, dtype=np.float64).reshape(-1, 2).T
    return x, y


def _opening(rows: Sequence[Mapping[str, Any]], stroke: str) -> float | None:
    found = [r["pressure_Pa"] for r in rows if r["stroke"] == stroke and r["curve"] == "opening"]
    return found[0] if found else None


def _openings(rows: Sequence[Mapping[str, Any]]) -> str:
    """Where the blow-offs open, in words."""
    said = []
    for stroke, _ in _SIDES:
        for row in rows:
            if row["stroke"] != stroke or row["curve"] != "opening":
                continue
            if row["pressure_Pa"] is None or row["valve_force_N"] is None:
                continue
            pressed, _ = _points(rows, stroke, "law")
            is_reached = len(pressed) > 0 and row["pressure_Pa"] <= pressed.max()
            more = "" if is_reached else ", which these logs do not reach"
            said.append(
                f"{stroke} at {row['pressure_Pa'] / _BAR:.3g} bar "
                f"({row['valve_force_N']:.3g} N){more}"
            )
    return f"Blow-offs open in {'; in '.join(said)}." if said else ""
