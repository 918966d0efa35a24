"""``damperfit simulate``: force, velocity and pressures of one setting."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from damperfit import api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import (
    print_json,
    print_lines,
    print_table,
    say,
    screen_columns,
    spark_levels,
)

if TYPE_CHECKING:
    from damperfit.answers import Simulation

__all__ = ["simulate"]


@command(api.simulate)
def simulate(how: Shown, **given: Any) -> int:
    """Print forces, energy and pressures of one setting.

    Example: damperfit simulate --setting 10 --amplitude 32mm --frequency 1.5Hz
    """
    done = api.simulate(**given)
    if not how.quiet:
        say(f"damperfit: {done.damper}")
        say(f"damperfit: {done.test.choice.source}")
        for note in (*done.configured_notes, *done.notes):
            say(f"note: {note}")
        for warning in done.warnings:
            say(f"warning: {warning}")
    if how.json:
        print_json(done.document())
    elif not how.quiet or given["out"] is None:
        _show(done)
    return 0


def _show(done: Simulation) -> None:
    from damperfit.reporting.simulated import (
        cycle_force_sheet,
        cycle_pressure_sheet,
        cycle_sparklines,
    )

    simulated = done.test
    print_lines([done.title, ""])
    print_table(cycle_force_sheet(simulated.characteristics))
    if not math.isnan(simulated.characteristics.pressure_ranges[0][0]):
        print_lines([""])
        print_table(cycle_pressure_sheet(simulated.characteristics))
    cycle = cycle_sparklines(
        simulated.response, simulated.frequency, columns=screen_columns(), levels=spark_levels()
    )
    print_lines(["", "last cycle", *cycle])
