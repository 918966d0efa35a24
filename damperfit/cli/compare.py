"""``damperfit compare``: runs side by side, and whether what differs is more than chance."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damperfit.cli.console import (
    print_json,
    print_lines,
    print_renderable,
    say,
    say_lines,
    screen_columns,
)
from damperfit.cli.options import (
    ConfigOption,
    DebugOption,
    JobsOption,
    JsonOption,
    QuietOption,
    VersionOption,
)

if TYPE_CHECKING:
    from damperfit.comparison import RunComparison
    from damperfit.queries.comparisons import Compared

__all__ = ["compare"]


def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="A B...", help="Results folders, or folders of several; A is the reference."
        ),
    ],
    repeats: Annotated[
        list[Path] | None,
        typer.Option(metavar="RESULTS", help="Another run of A: their scatter is the measure."),
    ] = None,
    measured: Annotated[
        bool, typer.Option("--measured", help="Measured curves alone; also logs and curve files.")
    ] = False,
    velocity: Annotated[
        list[str] | None, typer.Option(metavar="SPEED", help="Speeds.  [the named test speeds]")
    ] = None,
    amplitude: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Of the sine.  [the tests' own]")
    ] = None,
    frequency: Annotated[
        str | None, typer.Option(metavar="FREQ", help="Of the sine.  [the tests' own]")
    ] = None,
    jobs: JobsOption = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Show what differs between runs, and whether it is more than chance.

    A folder of folders stands for all in it; two such are paired by name.

    Example: damperfit compare before after
    """
    from damperfit.queries.comparisons import compare_all, comparison_options
    from damperfit.run.logs import available_cores

    options = comparison_options(
        velocities=velocity or (),
        amplitude=amplitude,
        frequency=frequency,
        is_measured=measured,
        jobs=jobs or available_cores(),
    )
    found = compare_all(runs, options, repeats=repeats or (), config=config)
    _tell(found, is_debug=debug)
    if json:
        print_json(_document(found))
    else:
        for one in found.comparisons:
            _show(one, is_quiet=quiet)
    return 1 if found.remarks else 0


def _tell(found: Compared, *, is_debug: bool) -> None:
    for remark in (*found.remarks, *found.alone):
        say(f"damperfit: {remark}")
    for one in found.comparisons if is_debug else ():
        for trace in one.traces:
            say_lines(trace)


def _show(comparison: RunComparison, *, is_quiet: bool) -> None:
    from damperfit.report import (
        comparison_figure_sheet,
        comparison_force_sheet,
        comparison_parameter_sheet,
        terminal_table,
    )

    lines = [f"A: {comparison.first.place}", f"B: {comparison.second.place}"]
    if comparison.repeats:
        names = ", ".join(run.place for run in comparison.repeats)
        lines.append(f"measure: the scatter of A and its repeats {names}")
    told = [one.sentence for one in comparison.circumstances]
    lines += [*(f"differs besides: {one}" for one in told), *comparison.sentences]
    lines += [f"note: {one}" for one in comparison.notes]
    columns = screen_columns()
    print_lines([part for line in lines for part in wrap(line, columns, subsequent_indent="  ")])
    print_lines([""])
    if is_quiet:
        return
    print_lines([f"forces at {comparison.motion}", ""])
    for sheet in (
        comparison_force_sheet(comparison, is_short=True),
        comparison_parameter_sheet(comparison),
        comparison_figure_sheet(comparison),
    ):
        if sheet.rows:
            print_renderable(terminal_table(sheet))
            print_lines([""])


def _document(found: Compared) -> dict[str, Any]:
    from damperfit.report import comparison_record

    return {
        "comparisons": [comparison_record(one) for one in found.comparisons],
        "alone": list(found.alone),
        "remarks": list(found.remarks),
    }
