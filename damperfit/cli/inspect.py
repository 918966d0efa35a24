"""``damperfit inspect``: what is in the logs; fits nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.cli.console import (
    one_line,
    print_json,
    print_lines,
    print_table,
    say,
    say_failures,
    screen_columns,
)
from damperfit.cli.option_values import configured, declared_setting, rig_entries
from damperfit.cli.options import (
    ConfigOption,
    DebugOption,
    JobsOption,
    JsonOption,
    LogsArgument,
    QuietOption,
    RigOption,
    RigProfileOption,
    SettingOption,
    SkewOption,
    StrictOption,
    TestsOption,
    TruncatedOption,
    VersionOption,
)

if TYPE_CHECKING:
    from damperfit.run.logs import LogBatch

__all__ = ["inspect"]

_WIDEST = 80  # columns of sentences: longer lines are hard to read


def inspect(
    logs: LogsArgument,
    setting: SettingOption = None,
    tests: TestsOption = None,
    strict: StrictOption = False,
    skew: SkewOption = None,
    rig_profile: RigProfileOption = None,
    rig: RigOption = None,
    allow_truncated: TruncatedOption = False,
    jobs: JobsOption = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Show what is in the logs and what is wrong with them; fit nothing.

    Example: damperfit inspect runs/*.csv
    """
    from damperfit.run.ending import log_documents, reading_ending
    from damperfit.run.log_paths import expand
    from damperfit.run.logs import Purpose, read_batch
    from damperfit.run.remarks import skipped_files
    from damperfit.workers import available_cores

    configuration = configured(
        config,
        ("--tests", "test.table", str(tests) if tests is not None else None),
        *rig_entries(rig),
        ("--strict", "rig.strict", strict or None),
        ("--skew", "rig.skew", skew),
        ("--rig-profile", "rig.profile", rig_profile),
        ("--allow-truncated", "rig.allow_truncated", allow_truncated or None),
        is_law_open=True,  # no model is asked for; the file may be one for --model auto
    )
    paths = expand(logs)
    workers = jobs or available_cores()
    batch = read_batch(
        paths,
        configuration,
        jobs=workers,
        setting=declared_setting(setting, configuration),
        purpose=Purpose.INSPECT,
    )
    say_failures(batch.failures, is_debug=debug)
    if not quiet:
        for note in batch.notes:
            say(f"note: {note}")
        for warning in (*skipped_files(batch), *batch.remarks):
            say(f"warning: {warning}")
    if json:
        print_json(log_documents(batch))
    else:
        _show(batch, has_notes=not quiet)
    return int(reading_ending(batch).value)


def _show(batch: LogBatch, *, has_notes: bool) -> None:
    from damperfit.report.forces import curve_sheet
    from damperfit.report.inspection import (
        VERDICT_COLOURS,
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
