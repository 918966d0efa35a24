"""Measured curves of force over speed: one row a curve and stroke, forces at named speeds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from damperfit.readers import ForceCurve
from damperfit.report.sheets.inspection_sheet import MANY_ROWS
from damperfit.report.sheets.rounding import number
from damperfit.report.sheets.sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

__all__ = ["curve_forces_sheet", "curve_sheet"]

_SPEEDS = (0.05, 0.1, 0.13, 0.26, 0.52)  # m/s, of the speeds that damper tests name
_STROKES = ("rebound", "bump")


def curve_sheet(logs: Iterable[Mapping[str, Any]]) -> Sheet:
    """Return one row per curve and stroke of the files without time; no rows without.

    Parameters
    ----------
    logs : iterable of mapping
        Facts of `damperfit.run.logs.LogFacts`, also of logs with time.
    """
    files = [log for log in logs if log.get("curves")]
    curves = [
        _from_facts(one, "" if len(files) == 1 else str(log["name"]))
        for log in files
        for one in log["curves"]
    ]
    return curve_forces_sheet(curves, _SPEEDS)


def _from_facts(facts: Mapping[str, Any], file: str) -> ForceCurve:
    velocity, force = (np.array(facts[name]) for name in ("velocity_m_per_s", "force_N"))
    label = str(facts["label"])
    label = f"{file}: {label}" if file and label != file else label
    return ForceCurve("", "", "", label, velocity, force)


def curve_forces_sheet(curves: Sequence[ForceCurve], speeds: Sequence[float]) -> Sheet:
    """Return one row per curve and stroke: its points, its peaks and its forces at some speeds.

    Parameters
    ----------
    curves : sequence of ForceCurve
        As measured.
    speeds : sequence of float
        m/s.
    """
    rows = []
    for curve in curves:
        name = curve.label
        for stroke in _STROKES:
            v, f = curve.points(stroke)
            if not len(v):
                continue
            middle = 0.5 * float(v.max())
            rows.append(
                (
                    name,
                    stroke,
                    str(len(v)),
                    number(float(v.max()), digits=3),
                    number(float(f[np.argmax(np.abs(f))]), digits=4),
                    *(number(curve.force_at(speed, stroke), digits=4) for speed in speeds),
                    number(curve.hysteresis_at(middle, stroke), digits=3),
                )
            )
            name = ""
    has_loops = any(row[-1] != "-" for row in rows)
    kept = [row if has_loops else row[:-1] for row in rows]
    n = 5 + len(speeds) + has_loops
    notes = ["forces are read between measured points, of loops the mean of both branches"]
    if len(kept) > MANY_ROWS:
        notes.append(f"{len(kept) - MANY_ROWS} more rows are not shown; --json lists them all")
    return Sheet(
        headings=("curve", "stroke", "points", "to", "peak", *map("{:g}".format, speeds), "hyst.")[
            :n
        ],
        units=("", "", "", "m/s", "N", *("m/s, N" for _ in speeds), "N")[:n],
        rows=tuple(kept[:MANY_ROWS]),
        is_number=(False, False, *(True,) * (n - 2)),
        notes=tuple(notes),
    )
