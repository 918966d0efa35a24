"""``damperfit settings``: force by setting and click, and the setting that gives a force."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, Any

from damperfit import api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import (
    print_json,
    print_lines,
    print_table,
    say,
    say_lines,
    screen_columns,
)

if TYPE_CHECKING:
    from damperfit.answers import SettingForces
    from damperfit.queries.settings import ForcesBySetting
    from damperfit.reporting.sheet import Sheet

__all__ = ["settings"]


@command(api.settings)
def settings(how: Shown, **given: Any) -> int:
    """Show force by setting and what a click changes; find the setting for a force.

    Example: damperfit settings --force 900N --velocity 0.2m/s
    """
    done = api.settings(**{**given, "results": given["results"] or []})
    for remark in done.remarks:
        say(f"damperfit: {done.places[0]}: {remark}")
    if done.forces is None:
        print_json(done.document()) if how.json else _show_curves(done, is_quiet=how.quiet)
        return 0
    for trace in done.forces.traces if how.debug else ():
        say_lines(trace)
    for note in done.notes:
        say(f"note: {note}")
    if how.json:
        print_json(done.document())
    else:
        _show(done.forces, done, is_quiet=how.quiet)
    return 1 if done.remarks else 0


def _show_curves(done: SettingForces, *, is_quiet: bool) -> None:
    """Answer from curves that were measured without time."""
    from damperfit.reporting.inspection import curve_forces_sheet

    if done.sentence:
        print_lines(wrap(done.sentence, screen_columns()))
        if is_quiet:
            return
        print_lines([""])
    for note in () if is_quiet else done.notes:
        say(f"note: {note}")
    if done.curves is not None:
        sheet = curve_forces_sheet(done.curves.curves, done.curves.speeds[-5:])
        print_table(sheet)


def _show(forces: ForcesBySetting, done: SettingForces, *, is_quiet: bool) -> None:
    from damperfit.reporting.forces import (
        force_by_setting_sheet,
        force_sheets,
        measured_force_sheet,
    )
    from damperfit.reporting.sheet import rows_in_units, sheet_in_units
    from damperfit.tables.rows import adjustment_rows

    question, units = done.question, done.units

    def shown(sheet: Sheet) -> Sheet:
        return sheet_in_units(sheet, units)

    if forces.wanted:
        if is_quiet:
            print_lines([one.said_in(units) for one in forces.wanted])
            return
        print_lines(
            [part for one in forces.wanted for part in wrap(one.said_in(units), screen_columns())]
            + [""]
        )
    rows = rows_in_units(adjustment_rows(forces.forces, forces.clicks), units)
    print_lines([f"force by setting, {forces.source}", ""])
    if question.speed is not None:
        both = question.stroke is None or question.force is not None
        strokes = ("rebound", "bump") if both else (question.stroke or "",)
        print_table(shown(force_by_setting_sheet(rows, strokes)))
        measured = measured_force_sheet(rows)
        if measured.rows:
            print_lines([""])
            print_table(shown(measured))
        return
    for sheet in force_sheets(rows, (question.stroke,) if question.stroke else ("rebound", "bump")):
        print_table(shown(sheet))
        print_lines([""])
    measured = measured_force_sheet(rows)
    if measured.rows:
        print_table(shown(measured))
