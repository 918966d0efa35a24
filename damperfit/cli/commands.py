"""The commands: each calls its function and prints what comes back."""

from __future__ import annotations

import itertools
import logging
import math
import platform
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from damperfit import __version__, api
from damperfit.cli.command import Shown, command
from damperfit.cli.console import (
    append_summary,
    one_line,
    print_json,
    print_lines,
    print_renderable,
    print_table,
    record,
    say,
    say_failures,
    say_lines,
    screen_columns,
    spark_levels,
    summary_file,
    wrapped,
)
from damperfit.cli.watching import looking_on
from damperfit.errors import ConfigurationError, DamperfitError, SimulationError, did_you_mean

if TYPE_CHECKING:
    from damperfit.answers import FleetDone
    from damperfit.comparison import RunComparison
    from damperfit.configuration.options import Configuration
    from damperfit.run.auto_model import LawChoice
    from damperfit.run.identify import Identified

_MANY = 20  # failures of a fleet that are listed one by one; the parts hold them all
_ALL_FAILED = 3
_EVERY = 10  # structures that are tried between two lines that say so
_NUMBERS = re.compile(r"settings? [\d, -]+|[-+]?\d[\d.e+-]*")


def _tell(how: Shown, *, notes: Iterable[object] = (), warnings: Iterable[object] = ()) -> None:
    """Say what people should know, unless they asked for quiet."""
    if not how.quiet:
        for note in notes:
            say(f"note: {note}")
        for warning in warnings:
            say(f"warning: {warning}")


def _done(how: Shown, *lines: str) -> None:
    """Say what was done, unless they asked for quiet."""
    for line in () if how.quiet else lines:
        say(f"damperfit: {line}")


def _counting(how: Shown) -> Callable[[str], None]:
    """Return what notes each structure that is tried, and says now and then how many."""
    count = itertools.count(1)

    def note(title: str) -> None:
        record(logging.DEBUG, f"tried {title}")
        if (n := next(count)) % _EVERY == 0:
            _done(how, f"{n} structures tried")

    return note


def _tables(*sheets: Any) -> None:
    """Print tables one below the other; those without rows are left out."""
    for k, sheet in enumerate(one for one in sheets if one.rows):
        if k:
            print_lines([""])
        print_table(sheet)


def _plural(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


# identify, inspect, models


@command(api.identify, shown=("github_summary", "json", "quiet", "debug", "version"))
def identify(how: Shown, **given: Any) -> int:
    """Read logs, fit every setting, write tables and the MSE report.

    Example: damperfit identify sample_runs/*.csv --out results
    """
    summary = summary_file() if how.github_summary else None

    def tell_choice(choice: LawChoice, asked: Configuration, made: Configuration) -> None:
        _done(how, f"the logs support {choice.supported}.")
        alike = (f"not determined by these logs: {one[0].lower()}{one[1:]}" for one in choice.alike)
        named, taken = asked.identification.procedure, made.identification.procedure
        _tell(how, notes=alike)
        if "identification.procedure" in asked.declared and named != taken:
            only = f"procedure {named} fits the paper's model alone"
            _tell(how, notes=[f"{only}; the law that the logs support is fitted by {taken}"])

    watch = looking_on(
        is_quiet=how.quiet or how.no_progress,
        on_law=_counting(how),
        on_choice=tell_choice,
    )
    found = api.identify_each(**given, watch=watch)
    for one in found:
        say_failures(one.failures, is_debug=how.debug)
        _tell_of_run(one, how)
        if summary is not None:
            instead = "The MSE report is too long for a summary; it is in report.md."
            append_summary(summary, one.run.report_text, instead=instead)
        if not how.json and one.run.settings:
            _show_run(one)
    if how.json:
        documents = {one.owner: one.run.document() for one in found}
        print_json(found[0].run.document() if len(found) == 1 else {"dampers": documents})
    for one in found:
        if one.error is not None:
            raise one.error
    return _worst({one.run.exit_code for one in found})


def _worst(codes: set[int]) -> int:
    """Return the exit code of all: that of one, where all ended alike, else the gravest."""
    if len(codes) == 1:
        return int(codes.pop())
    # Where one damper failed altogether others did not: that is a failure in part.
    codes = {1 if code == _ALL_FAILED else code for code in codes}
    return next((code for code in (130, 1, 4) if code in codes), 0)


def _show_run(one: Identified) -> None:
    from damperfit.reporting.forces import force_sheets
    from damperfit.reporting.laws import law_sentences
    from damperfit.reporting.records import checks_in, law_in, predictions_in
    from damperfit.reporting.sheet import parameters_in_units, rows_in_units, sheet_in_units
    from damperfit.reporting.tables import check_lines, held_out_sheet, parameter_sheet

    run, configuration = one.run, one.configuration
    if one.beside:
        print_lines([f"damper {one.owner}", ""])
    tables, units = run.tables, configuration.output.units
    forces = force_sheets(rows_in_units(tables["adjustment"].to_pylist(), units))
    rows, quantities = parameters_in_units(tables["parameters"].to_pylist(), run.quantities, units)
    sheets = [sheet_in_units(sheet, units) for sheet in forces]
    sheets.append(parameter_sheet(rows, quantities, levels=spark_levels()))
    if held_out := predictions_in(run.record):
        sheets.append(held_out_sheet(held_out, is_narrow=True))
    _tables(*sheets)
    told = run.record.get("procedure") or [configuration.damper_sentence]  # as it was fitted
    checks = wrapped(*map(one_line, check_lines(checks_in(run.record))))
    print_lines(["", *wrapped(told[0]), ""])
    if law := law_sentences(law_in(run.record), with_undecided=False):
        print_lines([*wrapped(" ".join(law)), ""])
    print_lines([*checks, *([""] if one.beside else [])], of_checks=True)


def _tell_of_run(one: Identified, how: Shown) -> None:
    from damperfit.problem import listing, short_listing
    from damperfit.reporting.records import sentences_in
    from damperfit.reporting.report import withheld

    record, configuration = one.run.record, one.configuration
    for gate in record["gates_missed"]:
        say(f"damperfit: {gate}")
    if how.quiet:
        return
    corrected = (sentences_in(record, about) for about in ("tables_of_tests", "corrections"))
    grades = (f"grade withheld: {sentence}" for sentence in short_listing(withheld(one.run)))
    warnings = (*listing(one.run.warned), *grades)
    _tell(how, notes=chain(configuration.notes, *corrected), warnings=warnings)
    _tell(how, notes=_alike(sentences_in(record, "undetermined")))
    if one.error is not None and not one.is_written:
        return
    n_fits, n_all = len(one.run.settings), len(one.failures)
    n_failed = sum(not failure.is_left_out for failure in one.failures)
    done = f"{_plural(n_fits, 'setting')} fitted"
    done += f", {n_failed} failed" if n_failed else ""
    done += f", {n_all - n_failed} left out" if n_all > n_failed else ""
    seconds = f" in {record['timings']['total_s']:.1f} s"
    if one.is_interrupted and not n_fits:
        done = "interrupted before a setting was finished; nothing was written"
    elif one.keeps_earlier:
        done += f"; nothing was written: the earlier results in {one.folder} stay"
    else:
        done = f"{'interrupted; ' * one.is_interrupted}{done}{seconds}; results in {one.folder}"
    say(f"damperfit: {done}{', the profiles in profiles.csv' if configuration.profile else ''}")


def _alike(sentences: Iterable[str]) -> Iterator[str]:
    """Yield sentences on a quantity; of those that differ in their numbers alone the first."""
    groups: dict[tuple[str, str], list[str]] = {}
    for sentence in sentences:
        quantity, _, rest = sentence.partition(" at ")  # r_m1 and r_m2 are two
        groups.setdefault((quantity, _NUMBERS.sub("", rest)), []).append(sentence)
    for first, *others in groups.values():
        more = f" (and {len(others)} alike at other settings: report.md)" if others else ""
        yield f"{first}{more}"


@command(api.inspect)
def inspect(how: Shown, **given: Any) -> int:
    """Show what is in the logs and what is wrong with them; fit nothing.

    Example: damperfit inspect runs/*.csv
    """
    batch = api.inspect(**given).batch
    say_failures(batch.failures, is_debug=how.debug)
    _tell(how, notes=batch.notes, warnings=(*batch.skipped_files, *batch.remarks))
    facts = [log.facts for log in batch.logs]
    if how.json:
        print_json(batch.document())
    elif facts:
        from damperfit.reporting import inspection as shown

        print_table(shown.inspection_sheet(facts), shown.VERDICT_COLOURS)
        for sheet in (shown.stretch_sheet(facts), shown.curve_sheet(facts)):
            if sheet.rows:
                print_lines([""])
                print_table(sheet)
        columns = min(screen_columns(), 80)  # longer lines are hard to read
        lines = shown.finding_lines(facts, has_notes=not how.quiet, columns=columns)
        print_lines(["", *map(one_line, lines)])
    return int(batch.ending.value)


@command(api.models)
def models(how: Shown, **given: Any) -> int:
    """Fit one damper law after the other to the logs and say which one they support.

    Example: damperfit models runs/*.csv --config damper.toml --hold-out '*_check.csv'
    """
    choice = api.models(**given, on_law=_counting(how))
    _tell(how, notes=(*choice.assumed, *choice.remarks))
    say_failures(choice.failures, is_debug=how.debug)
    code = int(bool(choice.failures or choice.lost))
    if how.json:
        print_json(choice.document())
        return code
    tried, chosen, rivals = choice.sheets()
    print_table(tried)
    reasons = (f"{law.tried.title}: {law.reason}" for law in choice.search.laws)
    print_lines(["", *wrapped(*reasons), "", *wrapped(choice.sentence), ""])
    print_table(chosen)
    if choice.undecided:
        print_lines(["", "What these logs leave open:", *wrapped(*choice.undecided)])
    if rivals.rows:
        print_lines([""])
        print_table(rivals)
    if choice.lost:
        from damperfit.identification.sharing import of_settings

        print_lines([f"The chosen law cannot be simulated at {of_settings(choice.lost)}."])
    return code


# simulate, sweep, settings


@command(api.simulate)
def simulate(how: Shown, **given: Any) -> int:
    """Print forces, energy and pressures of one setting.

    Example: damperfit simulate --setting 10 --amplitude 32mm --frequency 1.5Hz
    """
    done = api.simulate(**given)
    test = done.test
    _done(how, done.damper, test.choice.source)
    _tell(how, notes=(*done.configured_notes, *done.notes), warnings=done.warnings)
    if how.json:
        print_json(done.document())
    elif not how.quiet or given["out"] is None:
        from damperfit.reporting.simulated import cycle_sparklines

        print_lines([done.title, ""])
        _tables(*done.sheets())
        cycle = cycle_sparklines(
            test.response, test.frequency, columns=screen_columns(), levels=spark_levels()
        )
        print_lines(["", "last cycle", *cycle])
    return 0


@command(api.sweep)
def sweep(how: Shown, **given: Any) -> int:
    """Scale one parameter by factors and show what it does to the force.

    Example: damperfit sweep --setting 10 --vary r_m1=0.8,1,1.2
    """
    out = given["out"] or Path("sweep")
    done = api.sweep(**{**given, "out": out})
    _done(how, done.damper, done.source)
    _tell(how, notes=done.notes, warnings=done.warnings)
    if how.json:
        facts = {"damper": done.damper, "source": done.source}
        print_json(facts | {"rows": done.records, "sentences": list(done.sentences)})
    else:
        for sheet, sentence in zip(done.sheets(), done.sentences, strict=True):
            print_table(sheet)
            print_lines([*wrapped(sentence), ""])
    _done(how, f"sweep.csv and {_plural(len(done.plots), 'figure')} written to {out}")
    return 0


@command(api.settings)
def settings(how: Shown, **given: Any) -> int:
    """Show force by setting and what a click changes; find the setting for a force.

    Example: damperfit settings --force 900N --velocity 0.2m/s
    """
    from damperfit.queries.settings import SettingForces

    done = api.settings(**{**given, "results": given["results"] or []})
    if isinstance(done, SettingForces):
        for remark in done.remarks:
            say(f"damperfit: {done.run.shown_as}: {remark}")
        for trace in done.traces if how.debug else ():
            say_lines(trace)
        for note in done.notes:
            say(f"note: {note}")
    if how.json:
        print_json(done.document())
        return int(bool(done.remarks))
    answers = [done.sentence] if done.sentence else []
    heading = []
    if isinstance(done, SettingForces):
        answers, heading = list(done.answers), [done.heading, ""]
    if answers:
        print_lines(answers if how.quiet else [*wrapped(*answers), ""])
    if not (answers and how.quiet):
        if heading:
            print_lines(heading)
        else:
            _tell(how, notes=done.notes)
        _tables(*done.sheets())
    return int(bool(done.remarks))


# compare


@command(api.compare, shown=("github_summary", "json", "quiet", "debug", "version"))
def compare(how: Shown, runs: list[Path], **given: Any) -> int:
    """Show what differs between runs, and whether it is more than chance.

    A folder of folders stands for all in it; two such are paired by name.

    Example: damperfit compare before after
    """
    summary = summary_file() if how.github_summary else None
    done = api.compare(*runs, **given)
    if given["save"] is not None:
        _done(how, f"{given['save']} written: give it as A or B of a later comparison")
    out = given["out"]
    if len(runs) == 1 and given["save"] is not None and not done.points:
        return 0
    for remark in (*done.remarks, *done.alone):
        say(f"damperfit: {remark}")
    for trace in chain(*(one.traces for one in done.comparisons)) if how.debug else ():
        say_lines(trace)
    if how.json:
        print_json(done.document())
    else:
        from damperfit.reporting.compared import tolerance_outcome, tolerance_sheet

        for one in done.comparisons:
            _show_pair(one, how)
        if done.points:
            outcome = f"tolerance {done.tolerance}: {tolerance_outcome(done.points)}"
            print_lines([outcome, ""], of_checks=True)
            if not how.quiet:
                print_table(tolerance_sheet(done.points, is_short=True))
    if summary is not None:
        append_summary(summary, done.markdown, instead="The comparison is too long for a summary.")
    if out is not None:
        _done(how, f"{out}/comparison.html written, with Markdown, JSON and tables")
    return 1 if done.remarks else 0 if done.is_met else 4


def _show_pair(comparison: RunComparison, how: Shown) -> None:
    from damperfit.reporting.compared import comparison_sheets

    lines = [f"A: {comparison.first.place}", f"B: {comparison.second.place}"]
    if comparison.repeats:
        names = ", ".join(str(run.place) for run in comparison.repeats)
        lines.append(f"yardstick: the scatter of A and its repeats {names}")
    lines += [*(f"differs: {one}" for one in comparison.differing), *comparison.sentences]
    lines += [f"note: {one}" for one in comparison.to_know]
    print_lines([*wrapped(*lines, indent="  "), ""])
    for title, sheet in () if how.quiet else comparison_sheets(comparison, is_short=True):
        print_lines([title, ""])
        print_table(sheet)
        print_lines([""])


# report, export, samples


@command(api.report)
def report(how: Shown, **given: Any) -> int:
    """Write report.html, one page that opens anywhere, from a results folder.

    Units are those of the run unless --units says otherwise.
    Damper and rig are those of the run; a --config is only checked.

    Example: damperfit report results --figures svg
    """
    files = api.report(**given)
    for remark in files.remarks:
        say(f"damperfit: {given['results']}: {remark}")
    if how.json:
        print_json({"files": [str(path) for path in files], "remarks": list(files.remarks)})
    else:
        more = f" and {len(files) - 1} figures" if len(files) > 1 else ""
        _done(how, f"{files[0]} written{more}")
    return 1 if files.remarks else 0


@command(api.export, shown=("list", "json", "quiet", "debug", "version"))
def export(how: Shown, **given: Any) -> int:
    """Hand an identified damper over to a simulator or a spreadsheet.

    Example: damperfit export results --to csv
    """
    from damperfit.exporting import find_target
    from damperfit.units.shown_units import SI, parse_units

    if how.list:
        _show_targets(is_json=how.json)
        return 0
    files = api.export(**given)
    target, made = find_target(given["to"]), files.made
    for remark in files.remarks:
        say(f"damperfit: {given['results']}: {remark}")
    code = 1 if files.remarks else 0
    if made is None:
        return code
    if how.json:
        document: dict[str, object] = {
            "target": target.name,
            "units": target.units,
            "sign": target.sign,
            "files": [str(path) for path in files],
            "remarks": list(files.remarks),
            "notes": list(files.notes),
        }
        document |= {"lost_in_a_table": made.lost} if made.lost else {}
        tops = [(one.setting.cell, one.determined) for one in made.tables]
        document["determined"] = [
            {"setting": setting, "speed_m_per_s": None if math.isnan(top) else top}
            for setting, top in tops
        ]
        rows = [{**asdict(one), "setting": one.setting.cell} for one in files.checked]
        print_json(document | ({"check": rows} if given["check"] else {}))
        return code
    shown = SI if given["units"] is None else parse_units(given["units"])
    more = f" and {len(files) - 1} more" if len(files) > 1 else ""
    used = target.units if shown.is_si else f"{shown.of('m/s')}, {shown.of('N')}"
    _done(how, f"{files[0]} written{more}; {used}; {target.sign}")
    notes = [made.lost] if made.lost else []
    if given["extend"] is not None:
        tested = max(one.tested for one in made.tables)
        notes.append(f"beyond {tested:.4g} m/s the tables are untested")
    _tell(how, notes=(*notes, *files.notes, made.determined))
    if files.checked:
        print_lines([f"check, {one}" for one in files.checked])
    return code


def _show_targets(*, is_json: bool) -> None:
    from damperfit.exporting import TARGETS

    rows = [
        {
            "target": one.name,
            "title": one.title,
            "file": one.file.format(stem="damper", setting="N"),
            "units": one.units,
            "sign": one.sign,
            "place": one.place,
        }
        for one in TARGETS.values()
    ]
    if is_json:
        print_json({"targets": rows})
        return
    for row in rows:
        print_lines(wrapped(f"{row['target']}: {row['title']}", indent="  "))
        goes = {**row, "goes": f"to {row['place']}"}
        for word in ("file", "units", "sign", "goes"):
            print_lines(wrapped(f"  {word:<7}{goes[word]}", indent=" " * 9))


@command(api.samples)
def samples(how: Shown, **given: Any) -> int:
    """Write synthetic rig logs with known parameters.

    Example: damperfit samples my_runs --settings 1-5
    """
    files = api.samples(**given, watch=looking_on(is_quiet=how.quiet or how.no_progress))
    written = [str(path) for path in files]
    _done(how, files.notes[0])
    if how.json:
        print_json({"logs": written[:-2], "files": written})
    elif not how.quiet:
        print_lines(written)
    return 0


# fleet


@command(api.fleet)
def fleet(how: Shown, **given: Any) -> int:
    """Fit many dampers, one part each; finished ones are not fitted again.

    Example: damperfit fleet runs --out fleet --collect
    """
    fault = None
    watch = looking_on(is_quiet=how.quiet or how.no_progress, of_fleet=True)
    try:
        found = api.fleet(**given, watch=watch)
    except DamperfitError as error:
        if not hasattr(error, "done"):
            raise
        fault, found = error, error.done  # parts are done, and could not be collected
    _tell_of_fleet(found, how)
    if found.n_rows is not None:
        table = found.folder / "_fleet" / "fleet.parquet"
        _done(how, f"{found.n_rows} rows of the fleet in {table} and .csv")
        if found.page is not None:
            _done(how, f"{found.page} written, with tables of dampers and outliers")
    if fault is not None:
        raise fault
    if how.json:
        print_json(found.document())
    else:
        print_lines(_fleet_lines(found, has_logs=bool(given["logs"])))
    return found.code


def _fleet_lines(found: FleetDone, *, has_logs: bool) -> list[str]:
    """How many dampers ended in which way, and those that are out of tolerance."""
    counts, lines = found.counts, []
    words = {
        "fitted": "fitted now",
        "known": "done before",
        "failed": "without any fit",
        "later": "not done, tried again next time",
    }
    if has_logs:
        asked = (key for key in words if counts[key] or key == "fitted")
        parts = ", ".join(f"{counts[key]} {words[key]}" for key in asked)
        n_logs, n_settings = (
            sum(getattr(one, n) for one in found.done) for n in ("n_logs", "n_settings")
        )
        dampers = _plural(found.n_tasks, "damper")
        lines = [f"{dampers}: {parts}; {n_logs} logs, {n_settings} settings with a fit"]
    if found.held is None:
        return lines
    lines.append(f"tolerance {found.held.source}: {found.held.sentence}")
    for point in found.held.worst[:_MANY]:
        setting = f", setting {point.setting}" if str(point.setting) else ""
        speed = f", {point.speed:g} m/s {point.stroke}" if point.stroke else ""
        lines.append(f"{point.run or 'unknown'}{setting}{speed}: {point.words}")
    more = len(found.held.worst) - _MANY
    if more > 0:
        lines.append(f"and {_plural(more, 'more damper')}; --report lists them")
    return lines


def _tell_of_fleet(found: FleetDone, how: Shown) -> None:
    done, n_tasks, out = found.done, found.n_tasks, found.folder
    lines = [f"{one.owner or 'logs'}: {line}" for one in done for line in one.failures]
    for line in lines[:_MANY]:
        say(f"damperfit: {line}")
    if len(lines) > _MANY:
        say(f"damperfit: and {len(lines) - _MANY} more failures; the parts in {out} hold them all")
    for one in done:
        for gate in one.gates:
            say(f"damperfit: {one.owner or 'logs'}: {gate}")
    if n_before := sum(one.n_failures for one in done) - len(lines):
        verb, them = ("counts", "it") if n_before == 1 else ("count", "them")
        count = _plural(n_before, "failure")
        _done(how, f"{count} of an earlier run {verb} too; the parts hold {them}")
    if found.is_stopped:
        left = f"{n_tasks - len(done)} of {n_tasks} dampers left"
        say(f"damperfit: interrupted; {left}, the same command goes on with them")
    elif n_tasks:
        _done(how, f"parts in {out}")


# config, help, doctor


def _config(config: Path | None = None, *, schema: bool = False) -> None:
    """Take what the command takes."""


@command(_config, name="config")
def config(how: Shown, config: Path | None, *, schema: bool) -> int:
    """Print the complete configuration in force, as TOML.

    Example: damperfit config > my_damper.toml
    """
    if schema:
        from damperfit.configuration.json_schema import configuration_schema

        print_json(configuration_schema())
        return 0
    from damperfit.configuration import loading
    from damperfit.tables.files import json_values

    found = loading.load_configuration(config)
    if how.json:
        print_json(json_values(found.document))
    else:
        print_lines(loading.configuration_toml(found).splitlines())
    return 0


def _help(topic: str | None = None) -> None:
    """Take what the command takes."""


@command(_help, name="help", takes_context=True)
def show_help(how: Shown, context: typer.Context, topic: str | None) -> int:
    """Show a page of the manual, or list the pages.

    Example: damperfit help trust
    """
    from damperfit.manual import TOPICS, read_page

    commands = {} if context.parent is None else getattr(context.parent.command, "commands", {})
    if topic is None:
        pages = [read_page(one) for one in TOPICS]
        wide = max(map(len, TOPICS))
        lines = [f"{page.topic:{wide}}  {page.title}" for page in pages]
        last = "damperfit help TOPIC shows one of them, or what a command takes."
        record: Any = {"topics": {page.topic: page.title for page in pages}}
        print_json(record) if how.json else print_lines([*lines, "", last])
    elif topic.strip().lower() in TOPICS:
        from rich.markdown import Markdown

        from damperfit.cli.pages import filled

        page = read_page(topic)
        page = replace(page, source=filled(page.source))
        if how.json:
            print_json({"topic": page.topic, "title": page.title, "text": page.text})
        else:
            print_renderable(Markdown(page.text, hyperlinks=False))
    elif topic in commands:
        text = commands[topic].get_help(typer.Context(commands[topic], context.parent, topic))
        record = {"command": topic, "text": text}
        print_json(record) if how.json else print_lines(text.splitlines())
    else:
        hint = did_you_mean(topic.strip().lower(), (*TOPICS, *commands))
        raise ConfigurationError(
            f"help {topic}: there is no such topic.{hint} damperfit help lists them",
            code="unknown-topic",
        )
    return 0


# Extra, the distribution that it brings, what it is for.
_EXTRAS = (
    ("tdms", "npTDMS", "TDMS logs"),
    ("mdf", "asammdf", "MDF logs"),
    ("mat73", "h5py", "MATLAB 7.3 logs"),
    ("excel", "python-calamine", "Excel logs"),
    ("cluster", "distributed", "fleet --scheduler"),
    ("fmu", "ziglang", "FMU libraries of other platforms"),
)


@command(None, name="doctor", shown=("json", "debug", "version"))
def doctor(how: Shown) -> int:
    """Show what works on this machine: version, core, extras, a one-second fit.

    Example: damperfit doctor
    """
    from importlib import metadata  # slow to load, and every command registers this one

    def version(distribution: str) -> str:
        try:
            return metadata.version(distribution)
        except metadata.PackageNotFoundError:
            return ""

    python = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    found = {"damperfit": __version__, "python": python, "executable": sys.executable}
    checks = {name: _tried(check) for name, check in (("core", _core), ("fit", _fit))}
    extras = {extra: version(name) for extra, name, _ in _EXTRAS}
    if how.json:
        results = {name: {"works": ok, "said": text} for name, (ok, text) in checks.items()}
        print_json({**found, "checks": results, "extras": extras})
    else:
        lines = list(found.items())
        lines += [
            (name, f"{'works: ' if ok else 'FAILS: '}{text}") for name, (ok, text) in checks.items()
        ]
        for extra, name, purpose in _EXTRAS:
            missing = f"not there: pip install 'damperfit[{extra}]'"
            there = f"{name} {extras[extra]}" if extras[extra] else missing
            lines.append((extra, f"{purpose}: {there}"))
        print_lines([f"{name:<10} {text}" for name, text in lines])
    return 0 if all(ok for ok, _ in checks.values()) else 1


def _tried(check: Callable[[], str]) -> tuple[bool, str]:
    try:
        return True, check()
    except Exception as error:  # noqa: BLE001 - whatever it is, it is what the user wants to know
        advice = "pip install --force-reinstall damperfit"
        return False, f"{type(error).__name__}: {error}; to mend it: {advice}"


def _core() -> str:
    from damperfit.damper import _core as core

    return str(core.__file__)


def _fit() -> str:
    """Fit a synthetic log of the reference set and compare with what it was made from."""
    from tempfile import TemporaryDirectory

    from damperfit.damper.purdy.reference import reference_parameters

    begun = time.perf_counter()
    with TemporaryDirectory() as folder:
        log, *_ = api.samples(
            folder, settings="10", cycles=5, force_noise="0N", displacement_noise="0m"
        )
        truth = reference_parameters(10)
        held = {name: getattr(truth, name) for name in ("r_m3", "f_f")}
        found = api.identify([log], procedure="plain", fix=held).setting(10).values
    off = abs(found["r_m1"] / truth.r_m1 - 1.0)
    if off > 1e-3:
        raise SimulationError(f"R_m1 of a synthetic log is {100.0 * off:.2g} % off")
    taken = time.perf_counter() - begun
    return f"R_m1 of a synthetic log within {100.0 * off:.1g} %, {taken:.1f} s"
