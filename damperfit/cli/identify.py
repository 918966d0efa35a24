"""``damperfit identify``: logs to parameters, MSE and reports."""

from __future__ import annotations

from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated, Any

import typer

from damperfit.cli.console import (
    one_line,
    print_json,
    print_lines,
    print_table,
    say,
    say_failures,
    screen_columns,
    spark_levels,
)
from damperfit.cli.github import append_summary, summary_file
from damperfit.cli.option_values import (
    configured,
    covaried,
    declared_setting,
    names_of,
    quantity_names,
    quantity_values,
    refuse_what_cannot_act,
    rig_entries,
    starts_of,
)
from damperfit.cli.options import (
    ConfigOption,
    CovariateOption,
    DebugOption,
    FiguresOption,
    GithubSummaryOption,
    HoldOutOption,
    JobsOption,
    JsonOption,
    LogsArgument,
    ModelOption,
    ProcedureOption,
    QuietOption,
    RigOption,
    RigProfileOption,
    RivalsOption,
    SettingOption,
    SkewOption,
    StartOption,
    StrictOption,
    TestsOption,
    TruncatedOption,
    UnitsOption,
    VersionOption,
)
from damperfit.cli.report import check_kind, write_report
from damperfit.errors import ConfigurationError
from damperfit.problem import Option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.laws import Tried
    from damperfit.run.ending import Ending
    from damperfit.run.result import RunResult

__all__ = ["identify"]

_TOO_LONG = "The MSE report is too long for a summary; it is in report.md."
_AUTO = "auto"
_ALL_FAILED = 3


def identify(
    logs: LogsArgument,
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,NAME",
            help="Parameters to fit; in the paper's model r_m1 r_m2 r_m3 k_e f_f f_0.  [default: "
            "those of the procedure]",
        ),
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Hold a parameter at a value; may be given several times."
        ),
    ] = None,
    model: ModelOption = None,
    rivals: RivalsOption = False,
    procedure: ProcedureOption = None,
    share: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,NAME", help="Parameters shared by all settings in a joint fit."),
    ] = None,
    hold_out: HoldOutOption = None,
    hold_out_cycles: Annotated[
        float | None,
        typer.Option(
            metavar="N", help="Hold out the last N cycles of each log; below 1: that share of them."
        ),
    ] = None,
    covariate: CovariateOption = None,
    bulk_modulus: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="K_e: free, or appendix1, from one gas content.  [default: free]"
        ),
    ] = None,
    starts: Annotated[
        int | None, typer.Option(metavar="N", help="Fit each setting from N starts.  [default: 1]")
    ] = None,
    start: StartOption = None,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,NAME", help="Profile the misfit along a parameter, into profiles.csv."
        ),
    ] = None,
    max_mse: Annotated[
        float | None, typer.Option(metavar="PCT", help="End with code 4 above this MSE.")
    ] = None,
    check: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,NAME",
            help="End with code 4 unless these checks pass; purdy2000 is a list of them.",
        ),
    ] = None,
    setting: SettingOption = None,
    tests: TestsOption = None,
    strict: StrictOption = False,
    skew: SkewOption = None,
    rig_profile: RigProfileOption = None,
    rig: RigOption = None,
    allow_truncated: TruncatedOption = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the results.  [default: results]")
    ] = None,
    report: Annotated[
        bool, typer.Option("--report", help="Also write report.html, as damperfit report does.")
    ] = False,
    figures: FiguresOption = None,
    units: UnitsOption = None,
    github_summary: GithubSummaryOption = False,
    jobs: JobsOption = None,
    config: ConfigOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
    version: VersionOption = False,
) -> int:
    """Read logs, fit every setting, write tables and the MSE report.

    Example: damperfit identify sample_runs/*.csv --out results
    """
    from damperfit.cli.interrupt import stop_on_signal
    from damperfit.cli.progress import progress
    from damperfit.run.dampers import folder_name
    from damperfit.run.pipeline import run_each
    from damperfit.run.unwritten import UnwrittenError
    from damperfit.run.watching import Watch

    check_kind("--figures", figures)
    if max_mse == 0.0:
        raise ConfigurationError(
            "expected more than 0, as every fit leaves some misfit; for no gate leave "
            "the option out (output.max_mse_percent = 0)",
            where=Option("max_mse", "0"),
        )
    summary = summary_file() if github_summary else None
    start_file, start_values = starts_of(start)
    configuration = configured(
        config,
        ("--free", "identification.free", quantity_names(free)),
        ("--fix", "identification.fix", quantity_values(fix or [], option="--fix") or None),
        ("--model", "damper.model", None if model == _AUTO else model),
        (
            "--covariate",
            "damper.reference_temperature",
            covaried(covariate, model=model, config=config),
        ),
        ("--procedure", "identification.procedure", procedure),
        ("--share", "identification.share", quantity_names(share)),
        ("--bulk-modulus", "identification.bulk_modulus", bulk_modulus),
        ("--starts", "identification.starts", starts),
        ("--start", "identification.start", start_file),
        (
            "--start",
            "identification.start_values",
            None if model == _AUTO else start_values or None,
        ),
        ("--profile", "identification.profile", quantity_names(profile)),
        ("--hold-out", "identification.hold_out", hold_out or None),
        ("--hold-out-cycles", "identification.hold_out_cycles", hold_out_cycles),
        ("--strict", "rig.strict", strict or None),
        ("--tests", "test.table", str(tests) if tests is not None else None),
        *rig_entries(rig),
        ("--skew", "rig.skew", skew),
        ("--rig-profile", "rig.profile", rig_profile),
        ("--allow-truncated", "rig.allow_truncated", allow_truncated or None),
        ("--max-mse", "output.max_mse_percent", max_mse),
        ("--check", "output.checks", names_of(check) if check else None),
        ("--units", "output.units", _known(units)),
        ("--out", "output.folder", str(out) if out is not None else None),
        is_law_open=model == _AUTO,
    )
    refuse_what_cannot_act(configuration, share, is_law_open=model == _AUTO, rivals=rivals)
    if model == _AUTO:
        asked = configuration
        configuration = _with_law(
            configuration, logs, setting, start_values, jobs=jobs, rivals=rivals, is_quiet=quiet
        )
        if not quiet:
            _tell_other_procedure(asked, configuration)
    declared = declared_setting(setting, configuration)
    lost: UnwrittenError | None = None
    found: list[tuple[str, RunResult]] = []
    with stop_on_signal() as cancelled, progress(is_wanted=not quiet) as bar:
        watch = Watch(on_start=bar.start, on_fit=bar.advance, cancelled=cancelled)
        try:
            for one in run_each(configuration, logs, jobs=jobs, setting=declared, watch=watch):
                found.append(one)  # noqa: PERF402 - what is done is kept where the next one fails
        except UnwrittenError as error:
            lost = error
            found.append((error.owner, error.result))
    for owner, result in found:
        is_written = lost is None or result is not lost.result
        folder = configuration.output.folder
        folder = folder / folder_name(owner) if owner else folder
        say_failures(result.facts.failures, is_debug=debug)
        _tell_people(result, configuration, folder, is_quiet=quiet, is_written=is_written)
        if result.campaign.fits and (report or figures) and is_written:
            write_report(folder, folder, page=report, figures=figures)
        if summary is not None:
            from damperfit.report.markdown import markdown_report

            append_summary(summary, markdown_report(result.tables, result.facts), instead=_TOO_LONG)
        if not json and result.campaign.fits:
            _show(result, configuration, owner=owner)
    if json:
        print_json(_document(found))
    if lost is not None:
        raise lost
    return _worst([result.ending for _, result in found])


def _known(units: str | None) -> str | None:
    """Return the list of units once it is known that each is one."""
    from damperfit.units.shown_units import parse_units

    if units is not None:
        parse_units(units)
    return units


def _document(found: Sequence[tuple[str, RunResult]]) -> dict[str, Any]:
    """Return the results as one document; of several dampers one inside the other, by name."""
    if len(found) == 1:
        return found[0][1].document()
    return {"dampers": {owner: result.document() for owner, result in found}}


def _worst(endings: Sequence[Ending]) -> int:
    """Return the exit code of all: that of one, where all ended alike, else the gravest."""
    codes = {ending.value for ending in endings}
    if len(codes) == 1:
        return int(codes.pop())
    # Where one damper failed altogether others did not: that is a failure in part.
    codes = {1 if code == _ALL_FAILED else code for code in codes}
    return next((code for code in (130, 1, 4) if code in codes), 0)


def _show(result: RunResult, configuration: Configuration, *, owner: str) -> None:
    from damperfit.report.forces import force_sheets
    from damperfit.report.tables import check_lines, held_out_sheet, parameter_sheet
    from damperfit.report.units import parameters_in_units, rows_in_units, sheet_in_units

    if owner:
        print_lines([f"damper {owner}", ""])
    tables, units = result.tables, configuration.output.units
    forces = rows_in_units(tables.adjustment.to_pylist(), units)
    for sheet in force_sheets(forces):
        print_table(sheet_in_units(sheet, units))
        print_lines([""])
    rows, quantities = parameters_in_units(tables.parameters.to_pylist(), tables.quantities, units)
    print_table(parameter_sheet(rows, quantities, columns=screen_columns(), levels=spark_levels()))
    if result.facts.held_out:
        print_lines([""])
        print_table(held_out_sheet(result.facts.held_out, columns=screen_columns()))
    told = result.record.get("procedure") or [configuration.damper_sentence]  # as it was fitted
    damper = wrap(told[0], screen_columns())
    lines = map(one_line, check_lines(result.facts.checks))
    checks = (part for line in lines for part in wrap(line, screen_columns()))
    print_lines(["", *damper, "", *checks, *([""] if owner else [])])


def _tell_people(
    result: RunResult,
    configuration: Configuration,
    folder: Path,
    *,
    is_quiet: bool,
    is_written: bool,
) -> None:
    from damperfit.report.facts import short_listing
    from damperfit.run.remarks import corrections

    for gate in result.facts.gates:
        say(f"damperfit: {gate}")
    if is_quiet:
        return
    physics = " ".join(result.facts.law_choice.get("sentences", ()))
    if physics:
        say(f"damperfit: {physics}")
    for line in (*configuration.notes, *result.facts.taken, *corrections(result.campaign)):
        say(f"note: {line}")
    for warning in short_listing(result.facts.warnings):
        say(f"warning: {warning}")
    for sentence in short_listing(result.facts.withheld):
        say(f"warning: grade withheld: {sentence}")
    for sentence in result.facts.undetermined:
        say(f"note: {sentence}")
    if not is_written:
        return
    profiles = ", the profiles in profiles.csv" if configuration.profile else ""
    say(f"damperfit: {_summary(result, folder)}{profiles}")


def _summary(result: RunResult, folder: Path) -> str:
    n_fits, n_all = len(result.campaign.fits), len(result.facts.failures)
    n_failed = sum(not failure.is_left_out for failure in result.facts.failures)
    done = f"{n_fits} setting{'' if n_fits == 1 else 's'} fitted"
    failed = f", {n_failed} failed" if n_failed else ""
    failed += f", {n_all - n_failed} left out" if n_all > n_failed else ""
    if result.facts.is_interrupted and not n_fits:
        return "interrupted before a setting was finished; nothing was written"
    if result.keeps_earlier:
        return f"{done}{failed}; nothing was written: the earlier results in {folder} stay"
    interrupted = "interrupted; " if result.facts.is_interrupted else ""
    return f"{interrupted}{done}{failed}; results in {folder}"


def _with_law(
    configuration: Configuration,
    logs: list[str],
    setting: str | None,
    start_values: dict[str, str],
    *,
    jobs: int | None,
    rivals: bool,
    is_quiet: bool,
) -> Configuration:
    """Let the logs choose the law, and say which it is."""
    from damperfit.run.auto_model import choose_law, with_chosen_law
    from damperfit.run.given_starts import start_of_laws

    def tried(law: Tried) -> None:
        if not is_quiet:
            say(f"damperfit: tried {law.title}")

    choice = choose_law(
        configuration,
        logs,
        jobs=jobs,
        setting=declared_setting(setting, configuration),
        start=start_of_laws(configuration, start_values),
        on_law=lambda law: tried(law.tried),
        on_rival=tried if rivals else None,
    )
    if not is_quiet:
        say(f"damperfit: the logs support {choice.supported}.")
        for one in choice.alike:
            say(f"note: these logs cannot tell apart: {one[0].lower()}{one[1:]}")
    return with_chosen_law(configuration, choice)


def _tell_other_procedure(asked: Configuration, chosen: Configuration) -> None:
    """Say so where the law cannot be fitted by the procedure that somebody named."""
    named, taken = asked.identification.procedure, chosen.identification.procedure
    if "identification.procedure" in asked.declared and named != taken:
        say(
            f"note: procedure {named} fits the paper's model alone; the law that the logs support "
            f"is fitted by {taken}"
        )
