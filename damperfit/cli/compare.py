"""``damperfit compare``: runs side by side, and whether what differs is more than chance."""

from __future__ import annotations

from json import dumps
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damperfit.cli.console import (
    print_json,
    print_lines,
    print_table,
    say,
    say_lines,
    screen_columns,
)
from damperfit.cli.github import append_summary, summary_file
from damperfit.cli.option_values import check_places, configured, rig_entries
from damperfit.cli.options import (
    AmplitudeOption,
    ConfigOption,
    DebugOption,
    FrequencyOption,
    GithubSummaryOption,
    JobsOption,
    JsonOption,
    QuietOption,
    RigOption,
    RigProfileOption,
    ToleranceOption,
    UnitsOption,
    VersionOption,
)
from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from damperfit.comparison import ComparisonOptions, RunComparison
    from damperfit.configuration.options import Configuration
    from damperfit.queries.comparisons import Compared
    from damperfit.store import FileSet

__all__ = ["compare"]


def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="A B...",
            help="Results folders, or folders of several; A is the reference. With --measured "
            "also raw logs: a folder, a quoted pattern or @list.txt of them is one run.",
        ),
    ],
    repeats: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RESULTS", help="Repeat run of A; the scatter of the repeats is the yardstick."
        ),
    ] = None,
    tolerance: ToleranceOption = None,
    measured: Annotated[
        bool,
        typer.Option(
            "--measured",
            help="Compare measured curves only; takes folders of raw logs, logs and curve files.",
        ),
    ] = False,
    velocity: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEED", help="Speeds to compare at.  [default: the named test speeds]"
        ),
    ] = None,
    amplitude: AmplitudeOption = None,
    frequency: FrequencyOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write page, Markdown, JSON and tables.")
    ] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Keep A as a baseline.")
    ] = None,
    junit: Annotated[
        Path | None,
        typer.Option(metavar="FILE.xml", help="Write the points of --tolerance as JUnit XML."),
    ] = None,
    github_summary: GithubSummaryOption = False,
    units: UnitsOption = None,
    rig_profile: RigProfileOption = None,
    rig: RigOption = None,
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
    from damperfit.queries.comparisons import compare_all, comparison_options, parse_bands
    from damperfit.workers import available_cores

    check_places(out, *(path.parent for path in (save, junit) if path is not None))
    reading = _reading(config, rig, rig_profile, is_measured=measured)
    bands = parse_bands(tolerance)
    if junit is not None and bands is None:
        raise ConfigurationError(
            "holds the points of --tolerance, which was not given", where=Option("junit")
        )
    summary = summary_file() if github_summary else None
    options = comparison_options(
        velocities=velocity or (),
        amplitude=amplitude,
        frequency=frequency,
        is_measured=measured,
        jobs=jobs or available_cores(),
        units=units,
    )
    if save is not None:
        _save(runs[0], save, options, config=config, reading=reading, is_quiet=quiet)
        if len(runs) == 1 and bands is None:
            return 0
    found = compare_all(
        runs, options, repeats=repeats or (), tolerance=bands, config=config, reading=reading
    )
    _tell(found, is_debug=debug)
    if json:
        print_json(_document(found, tolerance))
    else:
        _show(found, tolerance, is_quiet=quiet)
    source = tolerance or ""
    _write(found, source, out=out, junit=junit, summary=summary)
    if out is not None and not quiet:
        say(f"damperfit: {out}/comparison.html written, with Markdown, JSON and tables")
    is_missed = any(not point.is_met for point in found.points)
    return 1 if found.remarks else 4 if is_missed else 0


def _reading(
    config: Path | None,
    rig: list[str] | None,
    rig_profile: str | None,
    *,
    is_measured: bool,
) -> Configuration | None:
    """Return how raw logs are read; None where none may be given."""
    for option, given in (("--rig", rig[0] if rig else None), ("--rig-profile", rig_profile)):
        if given is not None and not is_measured:
            raise ConfigurationError(
                f"{option} {given} has no effect: no log is read without --measured; leave it out"
            )
    profile = ("--rig-profile", "rig.profile", rig_profile)
    if not is_measured:
        return None
    return configured(config, *rig_entries(rig), profile, is_law_open=True)


def _save(
    place: Path,
    path: Path,
    options: ComparisonOptions,
    *,
    config: Path | None,
    reading: Configuration | None,
    is_quiet: bool,
) -> None:
    from damperfit.queries.baseline import baseline_text
    from damperfit.queries.comparisons import one_run
    from damperfit.store import write_text

    run = one_run(place, options, config=config, reading=reading)
    write_text(path, baseline_text(run))
    if not is_quiet:
        say(f"damperfit: {path} written: give it as A or B of a later comparison")


def _write(
    found: Compared,
    source: str,
    *,
    out: Path | None,
    junit: Path | None,
    summary: Path | None,
) -> None:
    """Write what was asked for as files."""
    from damperfit.report.compared import comparison_markdown, junit_report
    from damperfit.report.page import comparison_page
    from damperfit.store import file_set

    found_rows = (found.comparisons, found.points)
    if out is not None:
        page = comparison_page(*found_rows, source=source, alone=found.alone)
        markdown = comparison_markdown(*found_rows, source=source, alone=found.alone)
        text = dumps(_document(found, source), indent=2, ensure_ascii=False, allow_nan=False)
        with file_set(out) as files:
            for name, one in (("html", page), ("md", markdown), ("json", text + "\n")):
                path = files.path(f"comparison.{name}")
                path.write_bytes(one.encode("utf-8", "backslashreplace"))
            _write_tables(found, files)
    if junit is not None:
        with file_set(junit.parent) as files:
            files.path(junit.name).write_bytes(junit_report(found.points, source=source))
    if summary is not None:
        markdown = comparison_markdown(*found_rows, source=source, alone=found.alone)
        append_summary(summary, markdown, instead="The comparison is too long for a summary.")


def _write_tables(found: Compared, files: FileSet) -> None:
    from damperfit.report.compared import (
        comparison_rows,
        comparison_table,
        tolerance_rows,
        tolerance_table,
    )
    from damperfit.tables import write_table

    rows = [row for one in found.comparisons for row in comparison_rows(one)]
    tables = {"differences": comparison_table(rows)}
    if found.points:
        tables["tolerance"] = tolerance_table(tolerance_rows(found.points))
    for name, table in tables.items():
        for suffix in (".csv", ".parquet"):
            write_table(files.path(name + suffix), table, suffix=suffix)


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
        from damperfit.report.compared import tolerance_outcome, tolerance_sheet

        print_lines([f"tolerance {source}: {tolerance_outcome(found.points)}", ""])
        if not is_quiet:
            print_table(tolerance_sheet(found.points, is_short=True))


def _show_pair(comparison: RunComparison, *, is_quiet: bool) -> None:
    from damperfit.report.compared import comparison_sheets

    lines = [f"A: {comparison.first.place}", f"B: {comparison.second.place}"]
    if comparison.repeats:
        names = ", ".join(run.place for run in comparison.repeats)
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


def _document(found: Compared, tolerance: str | None) -> dict[str, Any]:
    from damperfit.report.compared import comparison_record, tolerance_rows

    return {
        "comparisons": [comparison_record(one) for one in found.comparisons],
        "tolerance": tolerance or None,
        "points": tolerance_rows(found.points),
        "alone": list(found.alone),
        "remarks": list(found.remarks),
    }
