"""``damperfit identify``: logs to parameters, MSE and reports."""

from __future__ import annotations

from itertools import chain
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from damperfit import api
from damperfit.cli.command import Shown, command, looking_on
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

if TYPE_CHECKING:
    from collections.abc import Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.run.auto_model import LawChoice
    from damperfit.run.identify import Identified

__all__ = ["identify"]

_TOO_LONG = "The MSE report is too long for a summary; it is in report.md."
_ALL_FAILED = 3


@command(api.identify, shown=("github_summary", "json", "quiet", "debug", "version"))
def identify(how: Shown, **given: Any) -> int:
    """Read logs, fit every setting, write tables and the MSE report.

    Example: damperfit identify sample_runs/*.csv --out results
    """
    summary = summary_file() if how.github_summary else None

    def tell(line: str) -> None:
        if not how.quiet:
            say(line)

    def tell_choice(choice: LawChoice, asked: Configuration, made: Configuration) -> None:
        tell(f"damperfit: the logs support {choice.supported}.")
        for one in choice.alike:
            tell(f"note: these logs cannot tell apart: {one[0].lower()}{one[1:]}")
        if not how.quiet:
            _tell_other_procedure(asked, made)

    watch = looking_on(
        is_quiet=how.quiet,
        on_law=lambda title: tell(f"damperfit: tried {title}"),
        on_choice=tell_choice,
    )
    found = api.identify_each(**given, watch=watch)
    for one in found:
        say_failures(one.failures, is_debug=how.debug)
        _tell_people(one, is_quiet=how.quiet)
        if summary is not None:
            append_summary(summary, one.run.report_text, instead=_TOO_LONG)
        if not how.json and one.run.settings:
            _show(one)
    if how.json:
        print_json(_document(found))
    for one in found:
        if one.error is not None:
            raise one.error
    return _worst({one.run.exit_code for one in found})


def _document(found: Sequence[Identified]) -> dict[str, Any]:
    """Return the results as one document; of several dampers one inside the other, by name."""
    if len(found) == 1:
        return found[0].run.document()
    return {"dampers": {one.owner: one.run.document() for one in found}}


def _worst(codes: set[int]) -> int:
    """Return the exit code of all: that of one, where all ended alike, else the gravest."""
    if len(codes) == 1:
        return int(codes.pop())
    # Where one damper failed altogether others did not: that is a failure in part.
    codes = {1 if code == _ALL_FAILED else code for code in codes}
    return next((code for code in (130, 1, 4) if code in codes), 0)


def _show(one: Identified) -> None:
    from damperfit.reporting.forces import force_sheets
    from damperfit.reporting.records import checks_in, predictions_in
    from damperfit.reporting.sheet import parameters_in_units, rows_in_units, sheet_in_units
    from damperfit.reporting.tables import check_lines, held_out_sheet, parameter_sheet

    result, configuration = one.run, one.configuration
    if one.beside:
        print_lines([f"damper {one.owner}", ""])
    tables, units = result.tables, configuration.output.units
    forces = rows_in_units(tables["adjustment"].to_pylist(), units)
    for sheet in force_sheets(forces):
        print_table(sheet_in_units(sheet, units))
        print_lines([""])
    rows, quantities = parameters_in_units(
        tables["parameters"].to_pylist(), result.quantities, units
    )
    print_table(parameter_sheet(rows, quantities, levels=spark_levels()))
    if held_out := predictions_in(result.record):
        print_lines([""])
        print_table(held_out_sheet(held_out, is_narrow=True))
    told = result.record.get("procedure") or [configuration.damper_sentence]  # as it was fitted
    damper = wrap(told[0], screen_columns())
    lines = map(one_line, check_lines(checks_in(result.record)))
    checks = (part for line in lines for part in wrap(line, screen_columns()))
    print_lines(["", *damper, "", *checks, *([""] if one.beside else [])])


def _tell_people(one: Identified, *, is_quiet: bool) -> None:
    from damperfit.problem import listing, short_listing
    from damperfit.reporting.records import law_in, sentences_in
    from damperfit.reporting.report import withheld

    record, configuration = one.run.record, one.configuration
    for gate in record["gates_missed"]:
        say(f"damperfit: {gate}")
    if is_quiet:
        return
    physics = " ".join(law_in(record).get("sentences", ()))
    if physics:
        say(f"damperfit: {physics}")
    told = (sentences_in(record, about) for about in ("tables_of_tests", "corrections"))
    for line in chain(configuration.notes, *told):
        say(f"note: {line}")
    for warning in listing(one.run.warned):
        say(f"warning: {warning}")
    for sentence in short_listing(withheld(one.run)):
        say(f"warning: grade withheld: {sentence}")
    for sentence in sentences_in(record, "undetermined"):
        say(f"note: {sentence}")
    if one.error is not None and not one.is_written:
        return
    profiles = ", the profiles in profiles.csv" if configuration.profile else ""
    say(f"damperfit: {_summary(one)}{profiles}")


def _summary(one: Identified) -> str:
    n_fits, n_all = len(one.run.settings), len(one.failures)
    n_failed = sum(not failure.is_left_out for failure in one.failures)
    done = f"{n_fits} setting{'' if n_fits == 1 else 's'} fitted"
    failed = f", {n_failed} failed" if n_failed else ""
    failed += f", {n_all - n_failed} left out" if n_all > n_failed else ""
    if one.is_interrupted and not n_fits:
        return "interrupted before a setting was finished; nothing was written"
    if one.keeps_earlier:
        return f"{done}{failed}; nothing was written: the earlier results in {one.folder} stay"
    interrupted = "interrupted; " if one.is_interrupted else ""
    return f"{interrupted}{done}{failed}; results in {one.folder}"


def _tell_other_procedure(asked: Configuration, chosen: Configuration) -> None:
    """Say so where the law cannot be fitted by the procedure that somebody named."""
    named, taken = asked.identification.procedure, chosen.identification.procedure
    if "identification.procedure" in asked.declared and named != taken:
        say(
            f"note: procedure {named} fits the paper's model alone; the law that the logs support "
            f"is fitted by {taken}"
        )
