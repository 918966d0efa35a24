"""``damperfit inspect``: what is in the logs; fits nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from damperfit import api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import (
    one_line,
    print_json,
    print_lines,
    print_table,
    say,
    say_failures,
    screen_columns,
)

if TYPE_CHECKING:
    from damperfit.run.logs import LogBatch

__all__ = ["inspect"]

_WIDEST = 80  # columns of sentences: longer lines are hard to read


@command(api.inspect)
def inspect(how: Shown, **given: Any) -> int:
    """Show what is in the logs and what is wrong with them; fit nothing.

    Example: damperfit inspect runs/*.csv
    """
    batch = api.inspect(**given).batch

    say_failures(batch.failures, is_debug=how.debug)
    if not how.quiet:
        for note in batch.notes:
            say(f"note: {note}")
        for warning in (*batch.skipped_files, *batch.remarks):
            say(f"warning: {warning}")
    if how.json:
        print_json(batch.document())
    else:
        _show(batch, has_notes=not how.quiet)
    return int(batch.ending.value)


def _show(batch: LogBatch, *, has_notes: bool) -> None:
    from damperfit.reporting.inspection import (
        VERDICT_COLOURS,
        curve_sheet,
        finding_lines,
        inspection_sheet,
        stretch_sheet,
    )

    facts = [log.facts for log in batch.logs]
    if not facts:
        return
    print_table(inspection_sheet(facts), VERDICT_COLOURS)
    if (stretches := stretch_sheet(facts)).rows:
        print_lines([""])
        print_table(stretches)
    if (curves := curve_sheet(facts)).rows:
        print_lines([""])
        print_table(curves)
    columns = min(screen_columns(), _WIDEST)
    lines = (one_line(line) for line in finding_lines(facts, has_notes=has_notes, columns=columns))
    print_lines(["", *lines])
