"""``damperfit inspect``: what is in the logs; fits nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from damperfit.cli.console import print_json, print_lines, print_renderable, say
from damperfit.cli.options import (
    ConfigOption,
    DebugOption,
    JobsOption,
    JsonOption,
    LogsArgument,
    QuietOption,
    SettingOption,
    SkewOption,
    VersionOption,
    overlay,
)

if TYPE_CHECKING:
    from damperfit.intake import Intake

__all__ = ["inspect"]


def inspect(
    logs: LogsArgument,
    setting: SettingOption = None,
    skew: SkewOption = None,
    jobs: JobsOption = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Tell what is in the logs; fit nothing.

    Example: damperfit inspect runs/*.csv
    """
    from damperfit.account import log_documents, reading_ending
    from damperfit.config import load_settings
    from damperfit.intake import available_cores, expand, take_in

    settings = load_settings(config, overlay=overlay(("rig", "skew", skew)))
    paths = expand(logs)
    intake = take_in(paths, settings, jobs=jobs or available_cores(), setting=setting)
    for failure in intake.failures:
        say(f"damperfit: {failure.line}")
    if not quiet:
        for path in intake.skipped:
            say(f"warning: {path}: a parameter table of damperfit, not a log; skipped")
    if json:
        print_json(log_documents(intake))
    else:
        _show(intake)
    return int(reading_ending(intake).value)


def _show(intake: Intake) -> None:
    from damperfit.cli.console import one_line
    from damperfit.report import log_sheet, terminal_table

    if intake.traces:
        print_renderable(terminal_table(log_sheet([log.facts for log in intake.logs])))
    notes = [
        one_line(f"{log.log}: {note}") for log in intake.logs for note in log.facts.get("notes", ())
    ]
    if notes:
        print_lines(["", *notes])
