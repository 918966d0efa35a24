"""Tables for people in the units they want: rows scaled first, then laid out, then relabelled."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from damperfit.adjustment import Click
    from damperfit.damper.quantity import Quantity
    from damperfit.report.sheets.sheet import Sheet
    from damperfit.units.shown_units import ShownUnits

__all__ = ["clicks_in_units", "parameters_in_units", "rows_in_units", "sheet_in_units"]


_OF_A_PARAMETER = ("", "_se", "_ci_low", "_ci_high", "_misfit_se")


def sheet_in_units(sheet: Sheet, units: ShownUnits) -> Sheet:
    """Return a table whose forces and speeds are scaled already with the names of the units.

    Names stand in the headings, the units, the first column and the notes.
    """
    if units.is_si:
        return sheet
    speed = units.of("m/s")
    return replace(
        sheet,
        headings=tuple(map(units.say, sheet.headings)),
        units=tuple(map(units.say, sheet.units)),
        # "hysteresis at 5.9 m/s"; a setting may be called N.
        rows=tuple((row[0].replace(" m/s", f" {speed}"), *row[1:]) for row in sheet.rows),
        notes=tuple(map(units.say, sheet.notes)),
    )


def rows_in_units(rows: Iterable[Mapping[str, Any]], units: ShownUnits) -> list[dict[str, Any]]:
    """Return rows whose columns end in ``_N`` and ``_m_per_s`` with these numbers scaled."""
    return [{name: _scaled(name, cell, units) for name, cell in row.items()} for row in rows]


def _scaled(name: str, cell: Any, units: ShownUnits) -> Any:
    if isinstance(cell, float):
        for end, unit in (("_N", "N"), ("_m_per_s", "m/s")):
            if name.endswith(end):
                return units.show(cell, unit)
    return cell


def parameters_in_units(
    rows: Sequence[Mapping[str, Any]], quantities: Sequence[Quantity], units: ShownUnits
) -> tuple[list[dict[str, Any]], tuple[Quantity, ...]]:
    """Return rows of parameters with what is a force scaled, and the quantities as they are shown.

    What has units of its own, as R_m1 does, keeps them.
    """
    forces = [one.name for one in quantities if one.unit == "N" and units.of("N") != "N"]
    names = {f"{name}{end}" for name in forces for end in _OF_A_PARAMETER}

    def cell(name: str, value: Any) -> Any:
        is_force = name in names and value is not None
        return units.show(float(value), "N") if is_force else value

    shown = tuple(
        replace(
            one,
            unit=units.of("N"),
            shown_unit="",
            plausible=(units.show(one.plausible[0], "N"), units.show(one.plausible[1], "N")),
            size=units.show(one.size, "N"),
        )
        if one.name in forces
        else one
        for one in quantities
    )
    return [{name: cell(name, value) for name, value in row.items()} for row in rows], shown


def clicks_in_units(clicks: Iterable[Click], units: ShownUnits) -> tuple[Click, ...]:
    """Return changes of force with forces and speeds scaled."""
    return tuple(
        replace(
            one,
            speed=units.show(one.speed, "m/s"),
            **{name: units.show(getattr(one, name), "N") for name in ("change", "low", "high")},
        )
        for one in clicks
    )
