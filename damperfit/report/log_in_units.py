"""The figures of a log in the units that people want; its signals stay as they are."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, TypeVar

from damperfit.simulation import Characteristics, SpeedForce

if TYPE_CHECKING:
    from damperfit.recording import StretchFigures
    from damperfit.report.evaluated_log import EvaluatedLog
    from damperfit.units.shown_units import ShownUnits

    Figures = TypeVar("Figures", Characteristics, StretchFigures)

__all__ = ["log_in_units"]

_UNITS = {
    "peak_force": "N",
    "peak_speed": "m/s",
    "hysteresis_speed": "m/s",
    "hysteresis_rebound": "N",
    "hysteresis_bump": "N",
}


def log_in_units(view: EvaluatedLog, units: ShownUnits) -> EvaluatedLog:
    """Return a log whose forces and speeds, read off it, are scaled."""
    if units.is_si:
        return view
    return replace(
        view,
        measured=view.measured and _figures(view.measured, units),
        simulated=view.simulated and _figures(view.simulated, units),
        stretches=tuple(
            replace(
                one,
                measured=_figures(one.measured, units),
                simulated=_figures(one.simulated, units),
            )
            for one in view.stretches
        ),
    )


def _figures(read: Figures, units: ShownUnits) -> Figures:
    scaled = {
        one.name: units.show(getattr(read, one.name), unit)
        for one in fields(read)
        for start, unit in _UNITS.items()
        if one.name.startswith(start)
    }
    if isinstance(read, Characteristics):
        at = tuple(
            SpeedForce(
                units.show(one.speed, "m/s"),
                units.show(one.rebound, "N"),
                units.show(one.bump, "N"),
            )
            for one in read.speed_forces
        )
        return replace(read, **scaled, speed_forces=at)
    return replace(read, **scaled)
