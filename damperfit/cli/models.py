"""``damperfit models``: which law of a damper, and of its rig, the logs tell."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING, Annotated

import typer

from damperfit.cli.console import (
    print_json,
    print_lines,
    print_table,
    say,
    say_failures,
    screen_columns,
)
from damperfit.cli.option_values import configured, declared_setting, rig_entries, starts_of
from damperfit.cli.options import (
    ConfigOption,
    DebugOption,
    HoldOutOption,
    JobsOption,
    JsonOption,
    LogsArgument,
    QuietOption,
    RigOption,
    RigProfileOption,
    RivalsOption,
    SettingOption,
    StartOption,
    VersionOption,
)
from damperfit.errors import ConfigurationError, did_you_mean
from damperfit.problem import Option

if TYPE_CHECKING:
    from damperfit.run.auto_model import LawChoice

__all__ = ["models"]


def models(
    logs: LogsArgument,
    hold_out: HoldOutOption = None,
    layout: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Layout of the damper, if known: twin_tube, monotube, through_flow.",
        ),
    ] = None,
    rivals: RivalsOption = False,
    start: StartOption = None,
    setting: SettingOption = None,
    rig_profile: RigProfileOption = None,
    rig: RigOption = None,
    jobs: JobsOption = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Fit one damper law after the other to the logs and say which one they support.

    Example: damperfit models runs/*.csv --config damper.toml --hold-out '*_check.csv'
    """
    from damperfit.laws.other_layouts import LAYOUTS
    from damperfit.run.auto_model import choose_law
    from damperfit.run.given_starts import start_of_laws

    if layout is not None and layout not in LAYOUTS:
        raise ConfigurationError(
            f"no layout {layout!r}; there are {', '.join(LAYOUTS)}.{did_you_mean(layout, LAYOUTS)}",
            where=Option("layout"),
        )
    start_file, start_values = starts_of(start)
    configuration = configured(
        config,
        *rig_entries(rig),
        ("--rig-profile", "rig.profile", rig_profile),
        ("--hold-out", "identification.hold_out", hold_out or None),
        ("--start", "identification.start", start_file),
        is_law_open=True,
    )
    if not quiet:
        for note in configuration.notes:
            say(f"note: {note}")
    choice = choose_law(
        configuration,
        logs,
        layout=layout,
        jobs=jobs,
        setting=declared_setting(setting, configuration),
        start=start_of_laws(configuration, start_values),
        on_law=lambda law: None if quiet else say(f"damperfit: tried {law.tried.title}"),
        on_rival=(lambda one: None if quiet else say(f"damperfit: tried {one.title}"))
        if rivals
        else None,
    )
    if not quiet:
        for remark in choice.remarks:
            say(f"note: {remark}")
    say_failures(choice.failures, is_debug=debug)
    if json:
        print_json(choice.document())
    else:
        _show(choice)
    return int(bool(choice.failures or choice.lost))


def _show(choice: LawChoice) -> None:
    from damperfit.report.laws import chosen_sheet, rival_sheet, tried_laws_sheet

    width, document = screen_columns(), choice.document()
    print_table(tried_laws_sheet(document, is_narrow=True))
    reasons = [f"{law.tried.title}: {law.reason}" for law in choice.search.laws]
    print_lines(["", *(line for one in reasons for line in wrap(one, width))])
    said = " ".join((f"The logs support {choice.supported}.", *choice.sentences))
    print_lines(["", *wrap(said, width), ""])
    print_table(chosen_sheet(choice.fits))
    if choice.undecided:
        print_lines(["", "What these logs leave open:"])
        print_lines([line for one in choice.undecided for line in wrap(one, width)])
    if choice.rivals:
        print_lines([""])
        print_table(rival_sheet(document))
    if choice.lost:
        from damperfit.identification.sharing import of_settings

        print_lines([f"The chosen law cannot be simulated at {of_settings(choice.lost)}."])
