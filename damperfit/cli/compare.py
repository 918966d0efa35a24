"""``damperfit compare``: runs side by side, and whether what differs is more than chance."""

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
from damperfit.cli.github import append_summary, summary_file

if TYPE_CHECKING:
    from pathlib import Path

    from damperfit.comparison import RunComparison
    from damperfit.queries.compared import Compared

__all__ = ["compare"]


@command(api.compare, shown=("github_summary", "json", "quiet", "debug", "version"))
def compare(how: Shown, runs: list[Path], **given: Any) -> int:
    """Show what differs between runs, and whether it is more than chance.

    A folder of folders stands for all in it; two such are paired by name.

    Example: damperfit compare before after
    """
    summary = summary_file() if how.github_summary else None
    done = api.compare(*runs, **given)
    if given["save"] is not None and not how.quiet:
        say(f"damperfit: {given['save']} written: give it as A or B of a later comparison")
    found, out = done.compared, given["out"]
    if len(runs) == 1 and given["save"] is not None and not found.points:
        return 0
    _tell(found, is_debug=how.debug)
    if how.json:
        print_json(done.document())
    else:
        _show(found, done.tolerance, is_quiet=how.quiet)
    if summary is not None:
        append_summary(summary, done.markdown, instead="The comparison is too long for a summary.")
    if out is not None and not how.quiet:
        say(f"damperfit: {out}/comparison.html written, with Markdown, JSON and tables")
    return 1 if found.remarks else 0 if done.is_met else 4


def _tell(found: Compared, *, is_debug: bool) -> None:
    for remark in (*found.remarks, *found.alone):
        say(f"damperfit: {remark}")
    for one in found.comparisons if is_debug else ():
        for trace in one.traces:
            say_lines(trace)


def _show(found: Compared, source: str | None, *, is_quiet: bool) -> None:
    for one in found.comparisons:
        _show_pair(one, is_quiet=is_quiet)
    if found.points:
        from damperfit.reporting.compared import tolerance_outcome, tolerance_sheet

        print_lines([f"tolerance {source}: {tolerance_outcome(found.points)}", ""])
        if not is_quiet:
            print_table(tolerance_sheet(found.points, is_short=True))


def _show_pair(comparison: RunComparison, *, is_quiet: bool) -> None:
    from damperfit.reporting.compared import comparison_sheets

    lines = [f"A: {comparison.first.shown_as}", f"B: {comparison.second.shown_as}"]
    if comparison.repeats:
        names = ", ".join(run.shown_as for run in comparison.repeats)
        lines.append(f"yardstick: the scatter of A and its repeats {names}")
    lines += [*(f"differs besides: {one}" for one in comparison.differing), *comparison.sentences]
    lines += [f"note: {one}" for one in comparison.to_know]
    columns = screen_columns()
    print_lines([part for line in lines for part in wrap(line, columns, subsequent_indent="  ")])
    print_lines([""])
    if is_quiet:
        return
    for title, sheet in comparison_sheets(comparison, is_short=True):
        print_lines([title, ""])
        print_table(sheet)
        print_lines([""])
