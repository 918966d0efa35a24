"""The commands: each calls its function and prints what comes back."""

from __future__ import annotations

import json
import logging
import os
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import partial
from glob import glob
from itertools import chain, count
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

import typer

from damperfit import __version__, api
from damperfit.after_fit import functions
from damperfit.arguments import assignments
from damperfit.cli.command import COMMON, Shown, command
from damperfit.cli.console import (
    append_summary,
    looking_on,
    one_line,
    print_blocks,
    print_json,
    print_lines,
    print_renderable,
    record,
    say,
    say_failures,
    screen_columns,
    show_trace,
    spark_levels,
    stop_on_signal,
    summary_file,
    wrapped,
)
from damperfit.errors import ConfigurationError, DamperfitError, SimulationError
from damperfit.problem import Option, Problem, counted

if TYPE_CHECKING:
    from damperfit.configuration.options import Configuration
    from damperfit.run.auto_model import LawChoice
    from damperfit.run.identify import Identified

_ALL_FAILED = 3
_VERDICTS = {"good": 32, "warnings": 33, "curves": 36, "refused": 31}  # ANSI, of `inspect`
_EVERY = 10  # structures that are tried between two lines that say so


def _tell(
    options: Shown,
    *actions: str,
    notes: Iterable[object] = (),
    warnings: Iterable[object] = (),
) -> None:
    """Report actions, notes and warnings, unless quiet; a problem shows its own severity."""
    for before, lines in (("damperfit", actions), ("note", notes), ("warning", warnings)):
        for line in () if options.quiet else lines:
            say(f"{getattr(line, 'severity', before)}: {line}")


def _show(
    options: Shown,
    document: Callable[[], Any],
    blocks: Iterable[Any],
    colours: Mapping[str, int] | None = None,
) -> None:
    """Print the JSON document, or texts, lines and tables for people."""
    if options.json:
        print_json(document())
    else:
        print_blocks(blocks, colours)


def _warn(place: object, problems: Sequence[Problem]) -> int:
    """Report problems of a results folder; return their exit code."""
    for problem in problems:
        say(f"damperfit: {place}: {problem}")
    return _code_of(problems)


def _code_of(problems: Iterable[Problem]) -> int:
    """Return the exit code of problems: 1 where one is more than a note."""
    return int(any(problem.severity != "note" for problem in problems))


def _counting(options: Shown) -> Callable[[str], None]:
    """Return a function that records each structure tried, and reports every tenth count."""
    numbers = count(1)

    def note(title: str) -> None:
        record(logging.DEBUG, f"tried {title}")
        if (n := next(numbers)) % _EVERY == 0:
            _tell(options, f"{n} structures tried")

    return note


# Fits


@command(
    api.identify,
    shown=("github_summary", *COMMON),
    example="identify sample_runs/*.csv --out results",
)
def identify(options: Shown, **given: Any) -> int:
    """Read logs, fit every setting, write tables and the MSE report."""
    summary = summary_file() if options.github_summary else None

    def tell_choice(choice: LawChoice, requested: Configuration, delivered: Configuration) -> None:
        notes = [f"not determined by these logs: {s[0].lower()}{s[1:]}" for s in choice.alike]
        procedure = requested.identification.procedure
        fitted_by = delivered.identification.procedure
        if "identification.procedure" in requested.declared and procedure != fitted_by:
            only = f"procedure {procedure} fits the paper's model alone"
            notes.append(f"{only}; the model that the logs support is fitted by {fitted_by}")
        _tell(options, f"the logs support {choice.supported}.", notes=notes)

    is_quiet = options.quiet or options.no_progress
    watch = looking_on(is_quiet=is_quiet, on_law=_counting(options), on_choice=tell_choice)
    dampers = api.identify_each(**given, watch=watch)
    for damper in dampers:
        say_failures(damper.failures, is_debug=options.debug)
        _tell_of_run(damper, options)
        if summary is not None:
            instead = "The MSE report is too long for a summary; it is in report.md."
            append_summary(summary, damper.run.report_text, instead=instead)
        if not options.json and damper.run.settings:
            print_blocks(_blocks_of_run(damper))
    if options.json:
        documents = {damper.owner: damper.run.document() for damper in dampers}
        print_json({"dampers": documents} if len(dampers) > 1 else dampers[0].run.document())
    for damper in dampers:
        if damper.error is not None:
            raise damper.error
    return _worst({damper.run.exit_code for damper in dampers})


def _worst(codes: set[int]) -> int:
    """Return the exit code of all: the common one, else the most serious."""
    if len(codes) == 1:
        return int(codes.pop())
    # One damper failed altogether and others did not: a partial failure.
    codes = {1 if code == _ALL_FAILED else code for code in codes}
    return next((code for code in (130, 1, 4) if code in codes), 0)


def _tell_of_run(damper: Identified, options: Shown) -> None:
    from damperfit.problem import listing, short_listing
    from damperfit.reporting.records import problems_in, sentences_in
    from damperfit.reporting.report import withheld

    record, configuration = damper.run.record, damper.configuration
    for gate in record["gates_missed"]:
        say(f"damperfit: {gate}")
    if options.quiet:
        return
    corrected = (sentences_in(record, key) for key in ("tables_of_tests", "corrections"))
    grades = (f"grade withheld: {sentence}" for sentence in short_listing(withheld(damper.run)))
    warned = damper.run.warned
    notes = listing(problem for problem in warned if problem.severity == "note")
    warnings = listing(problem for problem in warned if problem.severity != "note")
    every_note = chain(configuration.notes, *corrected, notes)
    _tell(options, notes=every_note, warnings=(*warnings, *grades))
    groups: dict[tuple[str, str], list[Problem]] = {}
    for problem in problems_in(record, "undetermined"):
        groups.setdefault((problem.code, problem.values["quantity"]), []).append(problem)
    for first, *others in groups.values():
        count = f" (and {len(others)} similar at other settings: report.md)" if others else ""
        say(f"note: {first}{count}")
    if damper.error is not None and not damper.is_written:
        return
    n_fits, n_all = len(damper.run.settings), len(damper.failures)
    n_failed = sum(not failure.is_left_out for failure in damper.failures)
    done = f"{counted(n_fits, 'setting')} fitted"
    done += f", {n_failed} failed" if n_failed else ""
    done += f", {n_all - n_failed} left out" if n_all > n_failed else ""
    if damper.is_interrupted and not n_fits:
        done = "interrupted before a setting was finished; nothing was written"
    elif damper.keeps_earlier:
        done += f"; nothing was written: the earlier results in {damper.folder} stay"
    else:
        seconds = f" in {record['timings']['total_s']:.1f} s"
        done = (
            f"{'interrupted; ' * damper.is_interrupted}{done}{seconds}; "
            f"{'results' if n_fits else 'why'} in {damper.folder}"
        )
    say(f"damperfit: {done}{', the profiles in profiles.csv' if configuration.profile else ''}")


def _blocks_of_run(damper: Identified) -> list[Any]:
    from damperfit.reporting.records import checks_in, entries_in, law_in
    from damperfit.reporting.sheet import rows_in_units, sheet_in_units
    from damperfit.reporting.tables import (
        check_lines,
        force_sheets,
        held_out_sheet,
        law_sentences,
        parameter_sheet,
    )

    run, configuration = damper.run, damper.configuration
    units = configuration.output.units
    forces = force_sheets(rows_in_units(run.rows("adjustment"), units))
    rows = run.rows("parameters")
    held_out, law = entries_in(run.record, "held_out"), law_in(run.record)
    as_fitted = run.record.get("procedure") or [configuration.damper_sentence()]
    return [
        f"damper {damper.owner}" * bool(damper.folders),
        *(sheet_in_units(sheet, units) for sheet in forces),
        parameter_sheet(rows, run.quantities, levels=spark_levels(), units=units),
        *([held_out_sheet(held_out, is_narrow=True)] if held_out else []),
        as_fitted[0],
        " ".join(law_sentences(law)),
        wrapped(*map(one_line, check_lines(checks_in(run.record)))),
        [""] * bool(damper.folders),
    ]


@command(api.inspect, example="inspect runs/*.csv")
def inspect(options: Shown, **given: Any) -> int:
    """Show what is in the logs and what is wrong with them; fit nothing."""
    from damperfit.reporting.inspection import finding_lines

    answer = api.inspect(**given)
    batch, facts = answer.batch, answer.facts
    say_failures(batch.failures, is_debug=options.debug)
    _tell(options, notes=batch.notes, warnings=(*batch.skipped_files, *batch.remarks))
    columns = min(screen_columns(), 80)  # longer lines are hard to read
    lines = finding_lines(facts, has_notes=not options.quiet, columns=columns)
    _show(options, batch.document, [*answer.all_sheets(), list(map(one_line, lines))], _VERDICTS)
    return int(batch.ending.value)


@command(api.models, example="models runs/*.csv --config my.toml --hold-out '*_check.csv'")
def models(options: Shown, **given: Any) -> int:
    """Fit one model structure after the other to the logs and say which one they support."""
    from damperfit.identification.sharing import of_settings

    choice = api.models(**given, on_law=_counting(options))
    _tell(options, notes=(*choice.assumed, *choice.remarks))
    say_failures(choice.failures, is_debug=options.debug)
    candidates, chosen, rivals = choice.sheets()
    problem = f"The chosen model cannot be simulated at {of_settings(choice.lost)}."
    undecided = wrapped(*choice.undecided)
    _show(options, choice.document, [
        candidates,
        wrapped(*(f"{law.candidate.title}: {law.reason}" for law in choice.search.laws)),
        choice.sentence,
        chosen,
        ["What these logs leave open:", *undecided] if undecided else "",
        rivals,
        problem if choice.lost else "",
    ])  # fmt: skip
    return int(bool(choice.failures or choice.lost))


@command(api.fleet, example="fleet runs --out fleet --collect")
def fleet(options: Shown, **given: Any) -> int:
    """Fit many dampers, one part each; finished ones are not fitted again."""
    fault = None
    watch = looking_on(is_quiet=options.quiet or options.no_progress, of_fleet=True)
    try:
        result = api.fleet(**given, watch=watch)
    except DamperfitError as error:
        if not hasattr(error, "done"):
            raise
        fault, result = error, error.done  # parts are done, and could not be collected
    for line in result.remarks:
        say(f"damperfit: {line}")
    _tell(options, *result.written)
    if fault is not None:
        raise fault
    _show(options, result.document, [result.sentence.splitlines()])
    return result.exit_code


# Questions about results


@command(api.simulate, example="simulate --setting 10 --amplitude 32mm --frequency 1.5Hz")
def simulate(options: Shown, **given: Any) -> int:
    """Print forces, energy and pressures of one setting."""
    answer = api.simulate(**given)
    notes = (*answer.configured_notes, *answer.notes)
    _tell(options, answer.damper, answer.choice.source, notes=notes, warnings=answer.warnings)
    cycle = answer.last_cycle(screen_columns(), spark_levels())
    is_shown = not options.quiet or given["out"] is None
    blocks = [answer.sentence, *answer.sheets(), ["last cycle", *cycle]] if is_shown else []
    _show(options, answer.document, blocks)
    return 0


@command(api.sweep, example="sweep --setting 10 --vary r_m1=0.8,1,1.2")
def sweep(options: Shown, **given: Any) -> int:
    """Scale one parameter by factors and show what it does to the force."""
    out = given["out"] or Path("sweep")
    answer = api.sweep(**{**given, "out": out})
    _tell(options, answer.damper, answer.source, notes=answer.notes, warnings=answer.warnings)
    _show(options, answer.document, chain(*zip(answer.sheets(), answer.sentences, strict=True)))
    _tell(options, f"sweep.csv and {counted(len(answer.plots), 'figure')} written to {out}")
    return 0


@command(api.settings, example="settings --force 900N --velocity 0.2m/s")
def settings(options: Shown, **given: Any) -> int:
    """Show force by setting and what a click changes; find the setting for a force."""
    answer: Any = api.settings(**{**given, "results": given["results"] or []})
    code = _warn(answer.run.shown_as, answer.remarks) if answer.remarks else 0  # curves: no run
    for trace in getattr(answer, "traces", ()):
        show_trace(trace, is_debug=options.debug)
    if hasattr(answer, "run") or not options.quiet:
        for note in answer.notes:
            say(f"note: {note}")
    answers = [line for line in getattr(answer, "answers", (answer.sentence,)) if line]
    everything = [wrapped(*answers), getattr(answer, "heading", ""), *answer.sheets()]
    _show(options, answer.document, [answers] if answers and options.quiet else everything)
    return code


@command(api.compare, shown=("github_summary", *COMMON), example="compare before after")
def compare(options: Shown, runs: list[str], **given: Any) -> int:
    """Show what differs between runs, and whether it is more than chance.

    A folder of folders stands for all in it; two such are paired by name.
    """
    from damperfit.reporting.compared import comparison_sheets, tolerance_outcome, tolerance_sheet

    summary = summary_file() if options.github_summary else None
    answer = api.compare(*runs, **given)
    if given["save"] is not None:
        _tell(options, f"{given['save']} written: give it as A or B of a later comparison")
        if len(runs) == 1 and not answer.points:
            return 0
    for problem in (*answer.remarks, *answer.alone):
        say(f"damperfit: {problem}")
    for trace in (trace for pair in answer.comparisons for trace in pair.traces):
        show_trace(trace, is_debug=options.debug)
    if options.json:
        print_json(answer.document())
    else:
        for pair in answer.comparisons:
            lines = [f"A: {pair.first.place}", f"B: {pair.second.place}"]
            if pair.repeats:
                names = ", ".join(str(run.place) for run in pair.repeats)
                lines.append(f"yardstick: the scatter of A and its repeats {names}")
            lines += [*(f"differs: {difference}" for difference in pair.differing), *pair.sentences]
            lines += [f"note: {note}" for note in pair.to_know]
            sheets: Any = [] if options.quiet else comparison_sheets(pair, is_short=True)
            print_blocks([wrapped(*lines, indent="  "), *chain(*sheets)])
            print_lines([""])
        if answer.points:
            outcome = f"tolerance {answer.tolerance}: {tolerance_outcome(answer.points)}"
            sheet = tolerance_sheet(answer.points, is_short=True)
            print_blocks([outcome, "" if options.quiet else sheet])
    if summary is not None:
        instead = "The comparison is too long for a summary."
        append_summary(summary, answer.markdown, instead=instead)
    if given["out"] is not None:
        _tell(options, f"{given['out']}/comparison.html written, with Markdown, JSON and tables")
    return _code_of(answer.remarks) or (0 if answer.is_met else 4)


def _answer(function: Any, options: Shown, **given: Any) -> int:
    """Print the sentence, the tables and the notes of an answer."""
    answer = function(**given)
    tables = [] if options.quiet and answer.sentence else answer.sheets()
    _show(options, answer.document, [answer.sentence, *tables])
    for note in () if options.json else answer.remarks:
        say(f"note: {note}")
    return 0


advise, valves, ride = (
    command(function, example=example)(partial(_answer, function))
    for function, example in (
        (functions.advise, "advise results --for k_e --max-stroke 40mm"),
        (functions.valves, "valves results --cd 0.7"),
        (functions.ride, "ride results --car car.toml"),
    )
)


@command(functions.watch, example="watch runs --out results --reference before")
def watch(options: Shown, **given: Any) -> int:
    """Fit each log as soon as it is complete, and answer in one line; Ctrl-C ends it."""
    stop = Event()
    arrivals = functions.watch(**given, stop=stop)
    _tell(options, f"watching {given['folder']}; Ctrl-C ends it")
    with stop_on_signal("the results will be written", stop):
        for arrival in arrivals:
            line = json.dumps(arrival.document(), ensure_ascii=False) if options.json else ""
            print_lines([line or arrival.sentence])
    return 0


# Files


@command(functions.passport, example="passport results --out passports")
def passport(options: Shown, **given: Any) -> int:
    """Write the passport of a damper: one A4 page, and a JSON that compare takes as a baseline."""
    files = functions.passport(**given)
    if options.json:
        print_json({"files": [str(path) for path in files]})
    else:
        _tell(options, f"{files[0]} and {files[1]} written")
    return 0


@command(api.report, example="report results --figures svg")
def report(options: Shown, **given: Any) -> int:
    """Write report.html, one page that opens anywhere, from a results folder.

    Units are those of the run unless --units says otherwise.
    Damper and rig are those of the run; a --config is only checked.
    """
    from damperfit.tables.files import json_values

    files = api.report(**given)
    code = _warn(given["results"], files.remarks)
    if options.json:
        print_json({"files": list(map(str, files)), "remarks": json_values(files.remarks)})
    else:
        figures = f" and {len(files) - 1} figures" if len(files) > 1 else ""
        _tell(options, f"{files[0]} written{figures}")
    return code


@command(api.export, shown=("list", *COMMON), example="export results --to csv")
def export(options: Shown, **given: Any) -> int:
    """Hand an identified damper over to a simulator or a spreadsheet."""
    from damperfit.exporting.targets import find_target
    from damperfit.tables.files import json_values
    from damperfit.units.shown_units import SI, parse_units

    if options.list:
        _show_targets(options)
        return 0
    files = api.export(**given)
    target, exported = find_target(given["to"]), files.made
    assert exported is not None
    code = _warn(given["results"], files.remarks)
    if options.json:
        document: dict[str, object] = {
            "target": target.name,
            "units": target.units,
            "sign": target.sign,
            "files": list(map(str, files)),
            "remarks": json_values(files.remarks),
            "notes": json_values(files.notes),
        }
        document |= {"lost_in_a_table": exported.lost} if exported.lost else {}
        document["determined"] = [
            {"setting": table.setting.cell, "speed_m_per_s": json_values(table.determined)}
            for table in exported.tables
        ]
        if given["check"]:
            document["check"] = [{**asdict(c), "setting": c.setting.cell} for c in files.checked]
        print_json(document)
        return code
    units = SI if given["units"] is None else parse_units(given["units"])
    count = f" and {len(files) - 1} more" if len(files) > 1 else ""
    unit_names = target.units if units.is_si else f"{units.of('m/s')}, {units.of('N')}"
    notes: list[object] = [exported.lost] if exported.lost else []
    if given["extend"] is not None:
        tested = max(table.tested for table in exported.tables)
        notes.append(f"beyond {tested:.4g} m/s the tables are untested")
    notes += [*files.notes, exported.determined]
    _tell(options, f"{files[0]} written{count}; {unit_names}; {target.sign}", notes=notes)
    print_blocks([[f"check, {check}" for check in files.checked]])
    return code


def _show_targets(options: Shown) -> None:
    from damperfit.exporting.targets import TARGETS

    rows, lines = [], []
    for target in TARGETS.values():
        file = target.file.format(stem="damper", setting="N")
        facts = {"file": file, "units": target.units, "sign": target.sign}
        rows.append({"target": target.name, "title": target.title, **facts, "place": target.place})
        lines += wrapped(f"{target.name}: {target.title}", indent="  ")
        for label, text in (*facts.items(), ("goes", f"to {target.place}")):
            lines += wrapped(f"  {label:<7}{text}", indent=" " * 9)
    _show(options, lambda: {"targets": rows}, [lines])


@command(api.samples, example="samples my_runs --settings 1-5")
def samples(options: Shown, **given: Any) -> int:
    """Write synthetic rig logs with known parameters."""
    files = api.samples(**given, watch=looking_on(is_quiet=options.quiet or options.no_progress))
    written = [str(path) for path in files]
    _tell(options, str(files.notes[0]))
    document = {"logs": written[:-2], "files": written}
    _show(options, lambda: document, [[] if options.quiet else written])
    return 0


# The first configuration

_PAPERS = "purdy"  # the model that is taken where none is named


@command(
    api.init,
    shown=("quiet", "debug", "version"),
    example="init runs/*.csv --model monotube --set rod_diameter=12mm",
)
def init(options: Shown, logs: list[str] | None, **given: Any) -> int:
    """Write a commented configuration for a damper of your own, and inspect its logs with it.

    On a terminal it asks for what is not given.
    """
    out = Path(given["out"] or "my_damper.toml")
    path = None if str(out) == "-" else out  # which is stdout
    keys = assignments(given["set"] or [], Option("set"), "rod_diameter=12mm")
    arguments = {**given, "out": path, "set": keys}
    is_asking = _is_terminal() and not options.quiet
    if is_asking and not (path is not None and path.exists() and not given["overwrite"]):
        arguments["model"] = given["model"] or _asked_model()
        arguments["set"] = _asked_keys(arguments["model"], arguments["set"])
    draft = api.init(logs, **arguments)
    if path is None:
        print_lines(draft.text.splitlines())
        return 0
    for before, sentences in (("note", draft.why), ("warning", draft.open)):
        for sentence in () if options.quiet else sentences:
            say(f"{before}: {sentence}")
    if not options.quiet:
        say(f"damperfit: {out} written; measure the keys that begin with #, and remove the #")
    code, config = 0, shlex.quote(str(out))
    if logs:
        print_lines([f"$ damperfit inspect {_as_typed(logs)} --config {config}"])
        code = inspect(logs, config=out, quiet=options.quiet)
    if code == 0 and not options.quiet:
        step = "settle what is open, then damperfit inspect" if draft.open else "damperfit identify"
        say(f"next: {step} {_as_typed(logs or ['LOGS'])} --config {config}")
    return code


def _is_terminal() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()


def _asked_model() -> str:
    """Ask which damper it is, until the answer is a model."""
    from damperfit.configuration.drawings import DRAWINGS
    from damperfit.damper.model import MODELS
    from damperfit.queries.first_configuration import check_damper

    say("Which damper is it? See also: damperfit help models")
    for name in DRAWINGS:
        say(f"  {name:<13} {MODELS[name].title}")
    while True:
        model = _asked("model", _PAPERS) or _PAPERS
        try:
            check_damper(model, {})
        except ConfigurationError as error:
            say(f"  {error.problem.message()}")
        else:
            return model


def _asked_keys(model: str, given: dict[str, str]) -> dict[str, str]:
    """Ask for missing keys until they make a damper; Enter leaves a key undeclared."""
    from damperfit.configuration.drawings import DRAWINGS, MEASURED
    from damperfit.queries.first_configuration import check_damper, damper_keys, fault_of

    defaults = {key: text for key, text in damper_keys(model).items() if key not in given}
    lengths = (
        "Now its lengths and pressures, as in 12mm or 8bara. Enter keeps the value in brackets."
    )
    for line in (*[lengths] * bool(defaults), *DRAWINGS.get(model, "").splitlines()):
        say(line)
    answers = dict(given)
    while True:
        for key, text in defaults.items():
            question = f"{key} ({MEASURED[key]})" if key in MEASURED else key
            while (typed := _asked(question, answers.get(key, text))) and (
                fault := fault_of(model, key, typed)
            ):
                say(f"  {fault}")
            if typed:
                answers[key] = typed
        try:
            check_damper(model, answers)
        except ConfigurationError as error:
            if not defaults:
                raise
            where = error.problem.where
            key = f"{where.key}: " if isinstance(where, Option) and where.key else ""
            say(f"  {key}{error.problem.message()}; once more:")
        else:
            return answers


def _asked(question: str, default: str) -> str:
    # input() would write its prompt to stdout where that is a file, as for `--out -`.
    sys.stderr.write(f"{question} [{default}]: ")
    sys.stderr.flush()
    line = sys.stdin.readline()
    if not line:
        raise typer.Abort
    return line.strip()


def _as_typed(logs: list[str]) -> str:
    """Return logs as a shell takes them; several as a pattern, where it matches only them."""
    if len(logs) > 1:
        start = os.path.commonprefix(logs)  # noqa: RUF071 - of a pattern, not of a path
        pattern = f"{start}*{Path(logs[0]).suffix}"
        if set(glob(pattern)) == set(logs):
            return shlex.quote(pattern)
    return " ".join(map(shlex.quote, logs))


# The program itself


@command(name="config", example="config > my_damper.toml")
def config(options: Shown, config: str | None = None, *, schema: bool = False) -> int:
    """Print the complete configuration in force, as TOML."""
    from damperfit.configuration import loading
    from damperfit.configuration.options import configuration_schema
    from damperfit.tables.files import json_values

    if schema:
        print_json(configuration_schema())
        return 0
    configuration = loading.load_configuration(config)
    lines = loading.configuration_toml(configuration).splitlines()
    _show(options, lambda: json_values(configuration.document), [lines])
    return 0


@command(name="help", takes_context=True, example="help trust")
def show_help(options: Shown, context: typer.Context, topic: str | None = None) -> int:
    """Show a page of the manual, or list the pages."""
    from rich.markdown import Markdown

    from damperfit.cli.pages import filled
    from damperfit.manual import TOPICS, read_page

    commands = {} if context.parent is None else getattr(context.parent.command, "commands", {})
    if topic is None:
        titles = {name: read_page(name).title for name in TOPICS}
        lines = [f"{name:{max(map(len, titles))}}  {title}" for name, title in titles.items()]
        hint = "damperfit help TOPIC shows one of them, or what a command takes."
        _show(options, lambda: {"topics": titles}, [[*lines, "", hint]])
    elif topic in commands and topic not in TOPICS:
        text = commands[topic].get_help(typer.Context(commands[topic], context.parent, topic))
        _show(options, lambda: {"command": topic, "text": text}, [text.splitlines()])
    else:
        page = read_page(topic, commands)
        page = page._replace(source=filled(page.source))
        if options.json:
            print_json({"topic": page.topic, "title": page.title, "text": page.text})
        else:
            print_renderable(Markdown(page.text, hyperlinks=False))
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


@command(name="doctor", shown=("json", "debug", "version"), example="doctor")
def doctor(options: Shown) -> int:
    """Show what works on this machine: version, core, extras, a one-second fit."""
    import platform
    from importlib import metadata  # slow to load, and every command registers this one

    checks: dict[str, dict[str, Any]] = {}
    for name, check in (("core", _core), ("fit", _fit)):
        try:
            checks[name] = {"works": True, "said": check()}
        except Exception as error:  # noqa: BLE001 - whatever it is, it is what the user wants to know
            advice = "to mend it: pip install --force-reinstall damperfit"
            checks[name] = {"works": False, "said": f"{type(error).__name__}: {error}; {advice}"}
    python = f"{platform.python_version()}, {platform.system()} {platform.machine()}"
    facts = {"damperfit": __version__, "python": python, "executable": sys.executable}
    lines = list(facts.items())
    lines += [
        (n, f"{'works' if check['works'] else 'FAILS'}: {check['said']}")
        for n, check in checks.items()
    ]
    extras = {}
    for extra, name, purpose in _EXTRAS:
        extras[extra], state = "", f"not there: pip install 'damperfit[{extra}]'"
        with suppress(metadata.PackageNotFoundError):
            extras[extra] = metadata.version(name)
            state = f"{name} {extras[extra]}"
        lines.append((extra, f"{purpose}: {state}"))
    document = {**facts, "checks": checks, "extras": extras}
    _show(options, lambda: document, [[f"{name:<10} {text}" for name, text in lines]])
    return 0 if all(check["works"] for check in checks.values()) else 1


def _core() -> str:
    from damperfit.damper import _core as core

    return str(core.__file__)


def _fit() -> str:
    """Fit a synthetic log of the reference set and compare with its true parameter."""
    from tempfile import TemporaryDirectory

    from damperfit.damper.purdy.parameters import reference_parameters

    begun = time.perf_counter()
    with TemporaryDirectory() as folder:
        log, *_ = api.samples(
            folder, settings="10", cycles=5, force_noise="0N", displacement_noise="0m"
        )
        truth = reference_parameters(10)
        fixed = {name: getattr(truth, name) for name in ("r_m3", "f_f")}
        fitted = api.identify([log], procedure="plain", fix=fixed).setting(10).values
    error = abs(fitted["r_m1"] / truth.r_m1 - 1.0)
    if error > 1e-3:
        text = f"R_m1 of a synthetic log is {100.0 * error:.2g} % off"
        raise SimulationError(text, code="wrong-fit")
    seconds = time.perf_counter() - begun
    return f"R_m1 of a synthetic log within {100.0 * error:.1g} %, {seconds:.1f} s"
