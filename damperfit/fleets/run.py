"""A whole run of `fleet`: logs -> tasks, one damper each -> parts on the disk.

A key says whether the part of a task exists. A log that kills its worker costs only that log.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict, deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import Enum
from functools import partial
from itertools import chain
from pathlib import Path, PurePath
from typing import Any, NamedTuple

import pyarrow as pa

from damperfit import __version__
from damperfit.configuration.options import Configuration
from damperfit.damper.temperature_law import WithTemperature
from damperfit.errors import ConfigurationError, failure_of
from damperfit.fleets.parts import (
    SYMBOL,
    forget_earlier,
    part_path,
    read_facts_of,
    renew_facts,
    tidy,
    touch,
    write_part,
)
from damperfit.fleets.sources import (
    AT_ONCE,
    FleetLog,
    UnreachableError,
    brought_here,
    find_sources,
    head_of,
    recognised,
)
from damperfit.io.files import sha256_of
from damperfit.io.tests_table import is_tests_table, read_tests
from damperfit.problem import Failure, Option, Problem
from damperfit.queries.compared import compared_record
from damperfit.recording import natural_order
from damperfit.reporting.records import problems_in
from damperfit.results import Run
from damperfit.run.identify import identified
from damperfit.run.logs import Labels
from damperfit.tables.columns import adjusters_in, table_schema
from damperfit.tables.files import part_table
from damperfit.tested.identity import Identity, identity_in
from damperfit.tested.setting import ADJUSTER
from damperfit.workers import Cluster, Died, Processes, executor

TABLE_OF_TESTS = "tests.csv"
_UNREADABLE = "unreadable"
_ENTRY = re.compile(r"\s*[#;%/*!]*\s*([^:=\t;,]{1,40}?)\s*[:=\t;,]\s*(.+?)[\s;,]*$")
_REFERENCE = "reference_temperature_degC"


# The damper of a log


class DamperTask(NamedTuple):
    """The logs of one damper, for a worker; everything in it can be pickled."""

    owner: str  # serial number, else the damper's name, else the folder of its logs
    logs: tuple[FleetLog, ...]  # in order
    tables: tuple[FleetLog, ...] = ()  # tables of tests that stand beside them
    # Place of each log that has killed a worker, with a sentence on it; it is left out.
    dead: tuple[tuple[str, str], ...] = ()

    @property
    def files(self) -> tuple[FleetLog, ...]:
        """Logs and tables of tests."""
        return (*self.logs, *self.tables)


def share_of(text: str) -> Callable[[DamperTask], bool]:
    """Return a test for tasks of share I of N, by ``I/N`` as in a job array.

    Which share a task is of does not depend on the other tasks.
    """
    match = re.fullmatch(r"\s*(\d+)\s*/\s*(\d+)\s*", text)
    number, of = map(int, match.groups()) if match else (0, 0)
    if not 1 <= number <= of:
        raise ConfigurationError(
            "expected I/N with I from 1 to N, such as 3/100 for the third of 100",
            where=Option("part", text),
            code="bad-part",
        )

    def takes(task: DamperTask) -> bool:
        digest = hashlib.sha256(task.owner.encode("utf-8", "surrogatepass")).digest()
        return int.from_bytes(digest[:8], "big") % of == number - 1

    return takes


def tasks_by_damper(
    sources: Sequence[FleetLog], configuration: Configuration
) -> tuple[DamperTask, ...]:
    """Group logs by damper: as the table of tests says, else the log's preamble, else its folder.

    Where logs of one name and setting were taken on several dates, each date is a test of its own;
    the date in a name is no part of it. A ConfigurationError: a table of tests is wrong, or there
    is no log.
    """
    adjusters, table = configuration.reading.adjusters, configuration.test.table
    files = [source for source in sources if source.file.lower() == TABLE_OF_TESTS]
    # Identity and setting of a log, by its folder and name.
    rows: dict[tuple[str, str], tuple[Identity, str]] = {}
    with brought_here(files) as (paths, _):
        tables = {(file.where, file.folder): file for file in files if is_tests_table(paths[file])}
        logs = [source for source in sources if source not in set(tables.values())]
        if not logs:
            raise ConfigurationError(
                "no logs among the files given: they are all tables of tests", code="no-log"
            )
        # A table that was given is the only one, as in `identify`.
        listed = [(file.where, paths[file]) for file in tables.values()]
        for folder, path in listed if table is None else [("", table)]:
            for name, row in read_tests(path, adjusters).rows.items():
                if row.identity.owner:
                    rows.setdefault((folder, name), (row.identity, str(row.places)))

    def whose(log: FleetLog) -> tuple[Identity, str]:
        keys = ((log.where, log.file), ("", log.file), ("", log.name))
        if row := next((rows[key] for key in keys if key in rows), None):
            return row
        if log.earlier is not None:
            return Identity(serial=log.earlier.owner, date=log.earlier.date), ""
        return _in_preamble(head_of(log))

    owners: dict[str, dict[str, list[FleetLog]]] = defaultdict(lambda: defaultdict(list))
    tests_on: dict[tuple[str, str], set[tuple[str, str]]] = defaultdict(set)
    # In a store each new log costs the time of an answer.
    with executor(AT_ONCE if any(log.is_remote for log in logs) else 1) as pool:
        for log, (identity, setting) in zip(logs, pool.map(whose, logs), strict=True):
            owner = identity.owner or configuration.test.identity.owner or _in_unicode(log.folder)
            owners[owner][day := identity.date[:10]].append(log)
            tests_on[owner, day].add((_undated(log.file, day, has_setting=bool(setting)), setting))
    tasks = []
    for owner in sorted(owners, key=natural_order):
        names = [tests_on[owner, day] for day in owners[owner]]
        tests = list(map(tuple, owners[owner].values()))
        if sum(map(len, names)) == len(set().union(*names)):
            everything = set(chain.from_iterable(tests))
            tests = [tuple(log for log in logs if log in everything)]
        for test in tests:
            keys = dict.fromkeys((log.where, log.folder) for log in test)
            of_test = tuple(tables[key] for key in keys if key in tables)
            tasks.append(DamperTask(owner, test, of_test))
    return tuple(tasks)


def _in_unicode(name: str) -> str:
    """Return a name with bytes that are no UTF-8 as escapes, for tables."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def _undated(name: str, day: str, *, has_setting: bool) -> str:
    """Return a file's name without the date of its test, YYYY-MM-DD, and the time behind that.

    Two numbers apart, as in 12-08, are a time only where the log says its setting elsewhere.
    """
    if not (numbers := re.fullmatch(r"(\d\d(\d\d))-(\d\d)-(\d\d)", day)):
        return name
    year, short, month, number = numbers.groups()
    gap = "[-_.]?"
    dates = (
        f"{year}{gap}{month}{gap}{number}|{number}{gap}{month}{gap}{year}|{short}{month}{number}"
    )
    apart = "[-_]?" if has_setting else ""
    time = rf"[-_T ]?\d\d({apart}\d\d|[-_]?\d\d[-_]?\d\d)(?!\d)"
    return re.sub(rf"({dates})({time})?", "", name)


def _in_preamble(head: bytes) -> tuple[Identity, str]:
    """Return identity and setting, by the lines before the numbers of a text log."""
    text = head.decode("utf-8", "replace")
    entries = (_ENTRY.match(line) for line in text.splitlines()[:60] if "\0" not in text)
    stated = {entry[1]: entry[2] for entry in entries if entry}
    return identity_in(stated), stated.get(ADJUSTER, "")


def content_key(entries: Iterable[tuple[PurePath, str]], configuration: Configuration) -> str:
    """Return the key of a task's result, of its logs and tables with their hashes.

    It depends on the files' bytes and names, on which are in one folder (a table of tests holds for
    those), the configuration and the version of damperfit; not on the folders' names.
    """
    folders: dict[PurePath, list[tuple[str, str]]] = defaultdict(list)
    for path, digest in entries:
        folders[path.parent].append((path.name, digest))
    table = configuration.test.table
    facts = {
        "version": __version__,
        # The output folder does not change results.
        "configuration": {k: v for k, v in configuration.document.items() if k != "output"},
        "checks": list(configuration.output.checks),
        "max_mse_percent": configuration.output.max_mse_percent,
        "table": None if table is None else hash_of(table),
        "folders": sorted(sorted(files) for files in folders.values()),
    }
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def hash_of(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal; "unreadable" where it cannot be opened."""
    try:
        return sha256_of(path)
    except OSError:
        return _UNREADABLE


# The work of a worker: from the logs of one damper to the rows of its part.


class State(Enum):
    """How a task ended."""

    FITTED = "fitted"
    FAILED = "failed"  # no setting could be fitted; a part says why
    KNOWN = "known"  # a part of an earlier run was there
    LATER = "later"  # nothing was written; the next run tries again


class Done(NamedTuple):
    """Outcome of one task."""

    owner: str
    state: State
    n_logs: int
    n_settings: int = 0  # with a fit
    n_gates: int = 0
    failures: tuple[Problem, ...] = ()
    gates: tuple[Problem, ...] = ()  # that were missed


def _later(task: DamperTask, reason: Problem) -> Done:
    return Done(task.owner, State.LATER, len(task.logs), failures=(reason,))


def _part_of(
    task: DamperTask,
    configuration: Configuration,
    folder: Path,
    hashes: Iterable[tuple[PurePath, str]],
) -> tuple[Path, str, Done | None]:
    """Return path and key of the part of a task, and the task's outcome if the part exists."""
    key = content_key(hashes, configuration)
    path = part_path(folder, task.owner, key)
    if not path.exists() or not (facts := read_facts_of(path)):
        return path, key, None
    touch(path)
    counts = (len(task.logs), facts.get("settings", 0), facts.get("gates", 0))
    errors = part_table(path)[0]["error"].to_pylist() if facts.get("failures") else []
    failures = tuple(Problem("earlier", error) for error in errors if error)
    return path, key, Done(task.owner, State.KNOWN, *counts, failures=failures)


def _known_already(configuration: Configuration, folder: Path, task: DamperTask) -> Done | None:
    """Return the outcome of a task whose part exists; nothing is fetched for that."""
    # Where there can be no part nothing is hashed: the worker does it.
    is_new = not part_path(folder, task.owner, "").parent.is_dir()
    if is_new or any(file.is_remote and file.earlier is None for file in task.files):
        return None
    entries = [
        (file.fetched_to, file.earlier.sha256)
        if file.earlier
        else (Path(file.place), hash_of(Path(file.place)))
        for file in task.files
    ]
    return _part_of(task, configuration, folder, entries)[2]


def _try_log(configuration: Configuration, task: DamperTask) -> None:
    """Work on one log alone and write nothing, to see whether it kills its worker."""
    # Anything else that is wrong with it is a failure of the whole task.
    with brought_here(task.files) as (paths, _), suppress(Exception):
        logs = [str(paths[log]) for log in task.logs]
        deque(identified(configuration, logs, jobs=1), maxlen=0)


def _do(configuration: Configuration, folder: Path, task: DamperTask) -> Done:
    """Fit one damper and write its part, unless the part is there."""
    try:
        with brought_here(task.files) as (paths, stamps):
            return _fitted(configuration, folder, task, paths, stamps)
    except UnreachableError as error:
        return _later(task, error.problem)


def _fitted(
    configuration: Configuration,
    folder: Path,
    task: DamperTask,
    paths: Mapping[FleetLog, Path],
    stamps: Mapping[FleetLog, str],
) -> Done:
    """Fit one damper and write its part; errors of its logs become rows of it."""
    hashes = {file: hash_of(path) for file, path in paths.items()}
    entries = ((paths[file], digest) for file, digest in hashes.items())
    path, key, before = _part_of(task, configuration, folder, entries)
    objects = {}
    for file, stamp in stamps.items():
        if stamp:
            identity, _ = _in_preamble(head_of(FleetLog(str(paths[file]), "")))
            objects[file.place] = (stamp, hashes[file], identity.owner, identity.date)
    if before:
        if objects:  # changed in date, not in bytes: with the new stamp it is not fetched again
            renew_facts(path, seen=objects)
        return before
    dead = dict(task.dead)
    failures: list[tuple[str, Failure]] = []
    if dead:
        labels = Labels([paths[log] for log in task.logs], configuration)
        for log in (log for log in task.logs if log.place in dead):
            problem = Problem("worker-died", dead[log.place])
            setting = labels.unread(paths[log], configuration)
            failures.append((task.owner, Failure(problem, "WorkerDied", log.file, "", setting)))
    rows: list[dict[str, Any]] = []
    gates: list[Problem] = []
    records: list[dict[str, Any]] = []
    try:
        living = [str(paths[log]) for log in task.logs if log.place not in dead]
        for result in identified(configuration, living, jobs=1) if living else ():
            owner = result.owner or task.owner
            rows += _part_rows(result.run, owner)
            gates += problems_in(result.run.record, "gates")
            records.append(compared_record(result.run.record))
            failures += [(owner, failure) for failure in result.failures]
    except (MemoryError, OSError):
        raise  # of the machine, not of the logs: tried again another time
    except Exception as error:  # noqa: BLE001 - the other dampers of the fleet go on
        failures.append((task.owner, failure_of(error, "the work on the logs of one damper")))
    # In messages a log has its name in the fleet, not that of its copy.
    names = {
        spelled: _in_unicode(log.name)
        for log in task.logs
        for spelled in (str(paths[log]), _in_unicode(str(paths[log])))
    }
    failed = [_failed_row(owner, failure, names) for owner, failure in failures]
    facts = {
        "key": key,
        "version": __version__,
        "logs": sorted({hashes[log] for log in task.logs} - {_UNREADABLE}),
        "places": sorted(log.place for log in task.logs),
        **({"seen": objects} if objects else {}),
        "settings": len(rows),
        "failures": len(failed),
        "gates": len(gates),
    }
    table = pa.Table.from_pylist([*rows, *failed], _schema(configuration))
    # Rows of several dampers are no one run.
    write_part(path, table, facts, records[0] if len(records) == 1 and rows else None)
    return Done(
        *(task.owner, State.FITTED if rows else State.FAILED),
        *(len(task.logs), len(rows), len(gates)),
        failures=tuple(
            Problem(failure.code, row["error"])
            for row, (_, failure) in zip(failed, failures, strict=True)
        ),
        gates=tuple(gates),
    )


def _failed_row(owner: str, failure: Failure, names: Mapping[str, str]) -> dict[str, str]:
    problem = failure.problem
    sentence = replace(problem, subject=names.get(problem.subject, problem.subject)).sentence()
    row = {"log": failure.log, "error_kind": failure.kind, "error": sentence, "damper": owner}
    if failure.setting is not None:
        row["setting"] = str(failure.setting)
    return {name: _in_unicode(text) for name, text in row.items()}


def _force_columns(stroke: str, speed: float) -> tuple[str, str]:
    """The columns of a force and of its standard error."""
    column = f"force_{stroke}_{1000.0 * speed:g}_mm_per_s"
    return f"{column}_N", f"{column}_se_N"


def _part_rows(run: Run, damper: str) -> Iterator[dict[str, Any]]:
    """Yield one row a setting: parameters, damper, date, forces at named speeds."""
    forces: dict[str, dict[str, float]] = defaultdict(dict)
    for row in run.table("adjustment").to_pylist():
        force, error = _force_columns(row["stroke"], row["speed_m_per_s"])
        forces[str(row["setting"])] |= {force: row["force_N"], error: row["force_se_N"]}
    shared = {
        "damper": damper,
        "date": run.record["test"].get("date"),
        _REFERENCE: run.record["configuration"]["damper"]["reference_temperature"],
    }
    for row in run.table("parameters").to_pylist():
        places = {name: str(row[name]) for name in adjusters_in(list(row), run.quantities)}
        setting = str(row["setting"])
        yield row | places | forces[setting] | shared | {"setting": setting}


def _schema(configuration: Configuration) -> pa.Schema:
    """Return the columns of a part: the same for every damper of one configuration."""
    # Only metadata of columns is collected: with it goes the symbol of a quantity.
    names, damper = configuration.reading.adjusters, configuration.damper
    symbols = {quantity.name: {SYMBOL: quantity.symbol.encode()} for quantity in damper.quantities}
    parameters = [
        field.with_metadata((field.metadata or {}) | symbols.get(field.name, {}))
        for field in table_schema("parameters", {}, settings=(), quantities=damper.quantities)
        if field.name != ADJUSTER
    ]
    columns = [
        _force_columns(stroke, speed)
        for stroke in ("rebound", "bump")
        for speed in configuration.output.speeds
    ]
    numbers = [pair[k] for k in (0, 1) for pair in columns]
    if isinstance(damper, WithTemperature):  # where its resistances and forces hold
        numbers.insert(0, _REFERENCE)
    # A setting is text: labels of some dampers are numbers, of others words.
    first = ["damper", "date", "setting", *(() if names == (ADJUSTER,) else names)]
    return pa.schema(
        [
            *(pa.field(name, pa.string()) for name in first),
            *parameters,
            *(pa.field(name, pa.float64()) for name in numbers),
            *(pa.field(name, pa.string()) for name in ("log", "error_kind", "error")),
        ]
    )


# The whole fleet


def planned(
    configuration: Configuration,
    logs: Sequence[str],
    folder: Path,
    takes: Callable[[DamperTask], bool] = lambda _: True,
) -> tuple[DamperTask, ...]:
    """Return the tasks of a fleet that `takes` accepts; files in its own folder are no logs."""
    results = folder.resolve()
    sources = [
        log for log in find_sources(logs) if log.is_remote or results not in Path(log.place).parents
    ]
    if not sources:
        raise ConfigurationError(
            f"{', '.join(logs)}: no log there but in {folder} itself", code="no-log"
        )
    tasks = tasks_by_damper(recognised(sources, folder), configuration)
    return tuple(filter(takes, tasks))


def run_fleet(
    configuration: Configuration,
    tasks: Sequence[DamperTask],
    folder: Path,
    engine: Processes | Cluster,
    *,
    cancelled: Callable[[], bool] = lambda: False,
) -> Iterator[Done]:
    """Do the tasks of a fleet whose parts do not exist, in any order, and yield each when done.

    A task whose worker dies goes to another one. If that dies too, each of its logs is tried alone:
    those that kill their worker are left out with a row that says so, the others are fitted. No
    task begins once `cancelled` returns True.
    """
    do, try_log = partial(_do, configuration, folder), partial(_try_log, configuration)

    def attempt(tasks: Iterable[DamperTask]) -> Generator[Done, None, list[DamperTask]]:
        """Yield the outcome of tasks, and return those that ended their worker."""
        died = []
        for task, result in engine.each(do, tasks, cancelled=cancelled):
            if isinstance(result, Died):
                died.append(task)
            elif isinstance(result, Exception):  # of the disk, or a bug
                yield _later(task, failure_of(result, "the work on one damper").problem)
            else:
                yield result
        return died

    tidy(folder)
    waiting: list[DamperTask] = []
    for task in tasks:
        if cancelled():
            return
        # So that no worker starts where there is nothing to do.
        try:
            before = _known_already(configuration, folder, task)
        except (OSError, ValueError) as error:
            before = _later(task, failure_of(error, "looking for its part").problem)
        if before:
            yield before
        else:
            waiting.append(task)
    for _ in range(2):
        waiting = yield from attempt(waiting)
    for task in waiting:
        if cancelled():
            break
        alone = [task._replace(logs=(log,)) for log in task.logs]
        for _ in range(2):
            outcomes = engine.each(try_log, alone, cancelled=cancelled)
            alone = [task for task, result in outcomes if isinstance(result, Died)]
        # Where none does it alone something else ended the workers, as too little memory does.
        reason = (
            "reading or fitting this log killed its worker process twice; it is left out: check "
            "the log and the machine's memory"
        )
        logs = sorted(task.logs[0] for task in alone)
        dead = tuple((log.place, f"{log.file}: {reason}") for log in logs)
        for failed in (yield from attempt([task._replace(dead=dead)])):
            text = "its workers die, though no single log is the cause; nothing was written"
            yield _later(failed, Problem("worker-died", text))
    forget_earlier(folder)
