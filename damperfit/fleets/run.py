"""A whole run of `fleet`: logs -> tasks, one damper each -> parts on the disk.

A key says whether the part of a task is there already. What ends a worker costs itself alone.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections import defaultdict, deque
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from damperfit import __version__
from damperfit.damper.warmed import Warmed
from damperfit.errors import ConfigurationError, mishap_of
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
from damperfit.io import TestsTable, is_tests_table, read_tests
from damperfit.io.files import sha256_of
from damperfit.problem import Failure, Option, Problem
from damperfit.queries.compared_runs import compared_record
from damperfit.recording import natural_order
from damperfit.run.logs import Labels
from damperfit.tested.identity import identity_in
from damperfit.tested.setting import ADJUSTER
from damperfit.workers import Died, executor

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence

    from damperfit.configuration.options import Configuration
    from damperfit.results import Run
    from damperfit.run.identify import Identified
    from damperfit.workers import Executor

TABLE_OF_TESTS = "tests.csv"
_UNREADABLE = "unreadable"
_ENTRY = re.compile(r"\s*[#;%/*!]*\s*([^:=\t;,]{1,40}?)\s*[:=\t;,]\s*(.+?)[\s;,]*$")
# What changes where results stand, or who is informed, and not the results.
_NOT_OF_RESULTS = {"output"}


@dataclass(frozen=True, slots=True)
class DamperTask:
    """The logs of one damper.

    Attributes
    ----------
    owner : str
        Serial number, else the damper's name, else the folder of its logs.
    logs : tuple of FleetLog
        Its logs, in order.
    tables : tuple of FleetLog
        Tables of tests that stand beside them.
    """

    owner: str
    logs: tuple[FleetLog, ...]
    tables: tuple[FleetLog, ...] = ()


@dataclass(frozen=True, slots=True)
class Share:
    """Part I of N of a fleet, as a job array does it.

    Attributes
    ----------
    number, of : int
        1 <= number <= of.
    """

    number: int
    of: int

    def takes(self, task: DamperTask) -> bool:
        """Whether a task is of this share; every task is of one, whatever other tasks there are."""
        digest = hashlib.sha256(task.owner.encode("utf-8", "surrogatepass")).digest()
        return int.from_bytes(digest[:8], "big") % self.of == self.number - 1


def share_of(text: str) -> Share:
    """Return the share that ``I/N`` says.

    Raises
    ------
    ConfigurationError
        It says none.

    Examples
    --------
    >>> share_of("3/100")
    Share(number=3, of=100)
    """
    found = re.fullmatch(r"\s*(\d+)\s*/\s*(\d+)\s*", text)
    number, of = (int(part) for part in found.groups()) if found else (0, 0)
    if not 1 <= number <= of:
        raise ConfigurationError(
            "expected I/N with I from 1 to N, such as 3/100 for the third of 100",
            where=Option("part", text),
        )
    return Share(number, of)


def tasks_by_damper(
    sources: Sequence[FleetLog], configuration: Configuration
) -> tuple[DamperTask, ...]:
    """Part logs by damper: the table of tests, else the log's preamble, else its folder says whose.

    Parameters
    ----------
    sources : sequence of FleetLog
        The logs, with tables of tests among them.
    configuration : Configuration
        Adjusters and table of tests.

    Raises
    ------
    ConfigurationError
        A table of tests is wrong, or there is no log.
    """
    named = [one for one in sources if one.file.lower() == TABLE_OF_TESTS]
    with brought_here(named) as (here, _):
        tables = [one for one in named if is_tests_table(here[one])]
        logs = [one for one in sources if one not in set(tables)]
        if not logs:
            raise ConfigurationError("no logs among the files given: they are all tables of tests")
        rows = _rows({one: here[one] for one in tables}, configuration)
    owners: dict[str, list[FleetLog]] = defaultdict(list)
    # In a store each log that is not known costs the time of an answer.
    with executor(AT_ONCE if any(one.is_remote for one in logs) else 1) as pool:
        for log, owner in zip(logs, pool.map(lambda one: _owner(one, rows), logs), strict=True):
            known = owner or configuration.test.identity.owner
            owners[known or _in_unicode(log.folder)].append(log)
    beside = {(_where(one), one.folder): one for one in tables}
    return tuple(
        DamperTask(owner, tuple(mine), tuple(dict.fromkeys(_beside(mine, beside))))
        for owner, mine in sorted(owners.items(), key=lambda entry: natural_order(entry[0]))
    )


def _where(source: FleetLog) -> str:
    place = source.place if source.is_remote else source.place.replace("\\", "/")
    return place.rsplit("/", 1)[0] if "/" in place else ""


def _beside(
    logs: Iterable[FleetLog], tables: Mapping[tuple[str, str], FleetLog]
) -> Iterable[FleetLog]:
    for log in logs:
        if table := tables.get((_where(log), log.folder)):
            yield table


def _rows(
    tables: Mapping[FleetLog, Path], configuration: Configuration
) -> dict[tuple[str, str], str]:
    """Return whose a log is, by its folder and name, as far as tables of tests say it."""
    adjusters = configuration.reading.adjusters
    found: dict[tuple[str, str], str] = {}
    given = configuration.test.table
    if given is not None:  # then it alone speaks, as in `identify`
        return {("", name): owner for name, owner in _owners(read_tests(given, adjusters))}
    for source, path in tables.items():
        for name, owner in _owners(read_tests(path, adjusters)):
            found.setdefault((_where(source), name), owner)
    return found


def _owners(table: TestsTable) -> Iterable[tuple[str, str]]:
    return ((name, row.identity.owner) for name, row in table.rows.items() if row.identity.owner)


def _owner(log: FleetLog, rows: Mapping[tuple[str, str], str]) -> str:
    folder = _where(log)
    owner = rows.get((folder, log.file)) or rows.get(("", log.file)) or rows.get(("", log.name))
    if not owner:
        owner = _owner_in_preamble(head_of(log)) if log.seen is None else log.seen.owner
    return owner


def _in_unicode(name: str) -> str:
    """Return a name with bytes that are no UTF-8 as escapes: no table takes them as they are."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def _owner_in_preamble(head: bytes) -> str:
    """Return whose a log of text says it is, in the lines before its numbers."""
    text = head.decode("utf-8", "replace")
    if "\0" in text:
        return ""
    entries = (_ENTRY.match(line) for line in text.splitlines()[:60])
    return identity_in({one[1]: one[2] for one in entries if one}).owner


def content_key(entries: Iterable[tuple[PurePath, str]], configuration: Configuration) -> str:
    """Return the key of what a task's result depends on.

    It depends on the files' bytes and names, on which stand in one folder (a table of tests speaks
    for those), the configuration and the version of damperfit; not on the folders' names.

    Parameters
    ----------
    entries : iterable of (pathlib.PurePath, str)
        Logs and tables of tests, each with its hash from `hash_of`.
    configuration : Configuration
        What is done with them.
    """
    folders: dict[PurePath, list[tuple[str, str]]] = defaultdict(list)
    for path, digest in entries:
        folders[path.parent].append((path.name, digest))
    document = {k: v for k, v in configuration.document.items() if k not in _NOT_OF_RESULTS}
    table = configuration.test.table
    facts = {
        "version": __version__,
        "configuration": document,
        "checks": list(configuration.output.checks),
        "max_mse_percent": configuration.output.max_mse_percent,
        "table": None if table is None else hash_of(table),
        "folders": sorted(sorted(entries) for entries in folders.values()),
    }
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def hash_of(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal; "unreadable" where it cannot be opened."""
    try:
        # Whoever opens a pipe waits for somebody to write.
        return sha256_of(path) if path.is_file() else _UNREADABLE
    except OSError:
        return _UNREADABLE


# What a worker does: the logs of one damper to the rows of its part, written where they belong.

_REFERENCE = "reference_temperature_degC"


class State(Enum):
    """How a task ended."""

    FITTED = "fitted"
    FAILED = "failed"  # no setting could be fitted; a part says why
    KNOWN = "known"  # a part of an earlier run was there
    LATER = "later"  # nothing was written; the next run tries again


@dataclass(frozen=True, slots=True)
class Done:
    """What became of one task.

    Attributes
    ----------
    owner : str
        Whose logs.
    state : State
        How it ended.
    n_logs : int
        Logs of the task.
    n_settings : int
        Settings with a fit.
    failures : tuple of str
        One sentence each; of a part that was there they are not said again.
    gates : tuple of str
        Gates that were missed, likewise.
    n_failures, n_gates : int
        How many, said or not.
    """

    owner: str
    state: State
    n_logs: int
    n_settings: int = 0
    failures: tuple[str, ...] = ()
    gates: tuple[str, ...] = ()
    n_failures: int = 0
    n_gates: int = 0

    @classmethod
    def later(cls, task: DamperTask, said: str) -> Done:
        """Return a task that was not done, with the reason."""
        return cls(task.owner, State.LATER, len(task.logs), failures=(said,), n_failures=1)


@dataclass(frozen=True, slots=True)
class Job:
    """A task as it goes to a worker; everything in it can be pickled.

    Attributes
    ----------
    task : DamperTask
        The logs.
    configuration : Configuration
        What is done with them.
    folder : pathlib.Path
        Of the fleet.
    dead : tuple of (str, str)
        Place of each log that has ended a worker, and the sentence that says so; it is left out.
    """

    task: DamperTask
    configuration: Configuration
    folder: Path
    dead: tuple[tuple[str, str], ...] = ()


def _do(job: Job) -> Done:
    """Fit one damper and write its part, unless the part is there.

    Whatever is wrong with the logs becomes rows of the part.
    """
    task = job.task
    try:
        with brought_here((*task.logs, *task.tables)) as (here, stamps):
            return _done(job, here, stamps)
    except UnreachableError as error:
        return Done.later(task, str(error))


def _known_already(job: Job) -> Done | None:
    """Return what the part of a task says, where it is there; nothing is fetched for that."""
    task = job.task
    # Nothing is hashed, once here and once by the worker, where there can be no part.
    if not part_path(job.folder, task.owner, "").parent.is_dir():
        return None
    entries: list[tuple[PurePath, str]] = []
    for one in (*task.logs, *task.tables):
        if not one.is_remote:
            entries.append((Path(one.place), hash_of(Path(one.place))))
        elif one.seen is not None:
            entries.append((one.fetched_to, one.seen.sha256))
        else:
            return None
    return _known(task, part_path(job.folder, task.owner, content_key(entries, job.configuration)))


def _known(task: DamperTask, path: Path) -> Done | None:
    if not path.exists() or not (facts := read_facts_of(path)):
        return None
    touch(path)
    n_settings, n_failures, n_gates = (
        facts.get(name, 0) for name in ("settings", "failures", "gates")
    )
    return Done(
        *(task.owner, State.KNOWN, len(task.logs), n_settings),
        n_failures=n_failures,
        n_gates=n_gates,
    )


def _done(job: Job, here: Mapping[FleetLog, Path], stamps: Mapping[FleetLog, str]) -> Done:
    task, configuration = job.task, job.configuration
    hashes = {one: hash_of(path) for one, path in here.items()}
    key = content_key(((here[one], digest) for one, digest in hashes.items()), configuration)
    path = part_path(job.folder, task.owner, key)
    seen = {
        one.place: (stamp, hashes[one], _owner_in_preamble(head_of(FleetLog(str(here[one]), ""))))
        for one, stamp in stamps.items()
        if stamp
    }
    if before := _known(task, path):
        if seen:  # another time of change, the same bytes: not to be fetched each time from now on
            renew_facts(path, seen=seen)
        return before
    names = {
        spelled: _in_unicode(one.name)
        for one in task.logs
        for spelled in (str(here[one]), _in_unicode(str(here[one])))
    }
    dead = dict(job.dead)
    rows: list[dict[str, Any]] = []
    gates: list[str] = []
    records: list[dict[str, Any]] = []
    failed = list(_dead_rows(job, here))
    living = [str(here[one]) for one in task.logs if one.place not in dead]
    try:
        for found in _results(configuration, living):
            owner = found.owner or task.owner
            rows += list(_part_rows(found.run, owner))
            gates += found.run.record["gates_missed"]
            records.append(compared_record(found.run.record))
            failed += [
                _failure(one, names, log=one.log, damper=owner, setting=one.setting)
                for one in found.failures
            ]
    except (MemoryError, OSError):
        raise  # of the machine, not of the logs: tried again another time
    except Exception as error:  # noqa: BLE001 - the other dampers of the fleet go on
        failed.append(_failure(mishap_of(error, "the work on the logs of one damper"), names))
    facts = {
        "key": key,
        "version": __version__,
        "logs": sorted({hashes[one] for one in task.logs} - {_UNREADABLE}),
        "places": sorted(one.place for one in task.logs),
        **({"seen": seen} if seen else {}),
        "settings": len(rows),
        "failures": len(failed),
        "gates": len(gates),
    }
    table = pa.Table.from_pylist(
        [{"damper": task.owner, **row} for row in (*rows, *failed)], _schema(configuration)
    )
    # Rows of several dampers are no one run.
    write_part(path, table, facts, records[0] if len(records) == 1 and rows else None)
    return Done(
        task.owner,
        State.FITTED if rows else State.FAILED,
        len(task.logs),
        len(rows),
        tuple(one["error"] for one in failed),
        tuple(gates),
        len(failed),
        len(gates),
    )


def _dead_rows(job: Job, here: Mapping[FleetLog, Path]) -> Iterator[dict[str, Any]]:
    """Yield the rows of logs that have ended a worker, with the setting as far as it is known."""
    said = dict(job.dead)
    dead = [one for one in job.task.logs if one.place in said]
    if not dead:
        return
    labels = Labels([here[one] for one in job.task.logs], job.configuration)
    for one in dead:
        setting = labels.unread(here[one], job.configuration)
        died = Failure(Problem("worker-died", said[one.place]), "WorkerDied")
        yield _failure(died, {}, log=one.file, setting=setting)


def _failure(
    failure: Failure,
    names: Mapping[str, str],
    *,
    log: str = "",
    damper: str | None = None,
    setting: object = None,
) -> dict[str, Any]:
    """Return the row of a failure, its log called as in the fleet, wherever it was read."""
    problem = failure.problem
    sentence = replace(problem, subject=names.get(problem.subject, problem.subject)).sentence()
    row = {"log": log, "error_kind": failure.kind, "error": sentence, "damper": damper}
    row["setting"] = None if setting is None else str(setting)
    return {name: _in_unicode(text) for name, text in row.items() if text is not None}


def _results(configuration: Configuration, logs: Sequence[str]) -> Iterator[Identified]:
    from damperfit.run.identify import identified

    return identified(configuration, logs, jobs=1) if logs else iter(())


def _try_log(job: Job) -> Done:
    """Do the work on one log alone and write nothing: it tells whether the log ends its worker."""
    task = job.task
    with (
        brought_here((*task.logs, *task.tables)) as (here, _),
        suppress(Exception),  # the whole task says what is wrong with it
    ):
        deque(_results(job.configuration, [str(here[one]) for one in task.logs]), maxlen=0)
    return Done(task.owner, State.LATER, len(task.logs))


def _part_rows(result: Run, damper: str) -> Iterator[dict[str, Any]]:
    """Yield one row a setting: parameters, whose it is, forces at named speeds."""
    from damperfit.tables.columns import adjusters_in

    known = result.record["test"]
    forces: dict[str, dict[str, float]] = {}
    for row in result.tables["adjustment"].to_pylist():
        name = _force_column(row["stroke"], row["speed_m_per_s"])
        forces.setdefault(str(row["setting"]), {})[name] = row["force_N"]
    for row in result.tables["parameters"].to_pylist():
        names = adjusters_in(list(row), result.quantities)
        places = {name: str(row[name]) for name in names}
        setting = str(row["setting"])
        yield {
            **row,
            **places,
            **forces.get(setting, {}),
            "setting": setting,
            "damper": damper,
            "date": known.get("date"),
            _REFERENCE: result.record["configuration"]["damper"]["reference_temperature"],
        }


def _force_column(stroke: str, speed: float) -> str:
    return f"force_{stroke}_{1000.0 * speed:g}_mm_per_s_N"


def _schema(configuration: Configuration) -> pa.Schema:
    """Return the columns of a part: the same for every damper of one configuration.

    A setting is text here, as labels of some dampers are numbers and of others words.
    """
    from damperfit.tables.columns import table_schema

    names = configuration.reading.adjusters
    own = table_schema("parameters", {}, settings=(), quantities=configuration.damper.quantities)
    symbols = {one.name: one.symbol for one in configuration.damper.quantities}
    quantities = [_with_symbol(one, symbols) for one in own if one.name != ADJUSTER]
    places = [] if names == (ADJUSTER,) else [pa.field(name, pa.string()) for name in names]
    forces = [
        pa.field(_force_column(stroke, speed), pa.float64())
        for stroke in ("rebound", "bump")
        for speed in configuration.output.speeds
    ]
    texts = [pa.field(name, pa.string()) for name in ("log", "error_kind", "error")]
    first = [pa.field(name, pa.string()) for name in ("damper", "date", "setting")]
    # Of a damper that follows the temperature: where its resistances and forces hold.
    is_warmed = isinstance(configuration.damper, Warmed)
    warmth = [pa.field(_REFERENCE, pa.float64())] if is_warmed else []
    return pa.schema([*first, *places, *quantities, *warmth, *forces, *texts])


def _with_symbol(field: pa.Field, symbols: Mapping[str, str]) -> pa.Field:
    """Return a column that tells its symbol: of all metadata a column's own is collected."""
    if field.name not in symbols:
        return field
    return field.with_metadata({**(field.metadata or {}), SYMBOL: symbols[field.name].encode()})


_DIED = (
    "{}: reading or fitting this log killed its worker process twice; it is left out: check the "
    "log and the machine's memory"
)


def planned(
    configuration: Configuration, logs: Sequence[str], folder: Path, share: Share | None = None
) -> tuple[DamperTask, ...]:
    """Return the tasks of a fleet: one damper each, of the share that is asked for.

    Parameters
    ----------
    configuration : Configuration
        Adjusters, table of tests.
    logs : sequence of str
        Folders, files, patterns, addresses in object stores.
    folder : pathlib.Path
        Of the fleet; what stands in it is no log.
    share : Share, optional
        Part I of N.

    Raises
    ------
    ConfigurationError
        There is no log, or a table of tests is wrong.
    """
    own = folder.resolve()
    sources = tuple(
        one for one in find_sources(logs) if one.is_remote or own not in Path(one.place).parents
    )
    if not sources:
        raise ConfigurationError(f"{', '.join(logs)}: no log there but in {folder} itself")
    tasks = tasks_by_damper(recognised(sources, folder), configuration)
    return tuple(task for task in tasks if share is None or share.takes(task))


@dataclass(frozen=True, slots=True, eq=False)
class _Fleet:
    engine: Executor
    configuration: Configuration
    folder: Path
    cancelled: Callable[[], bool]

    def job(self, task: DamperTask) -> Job:
        return Job(task, self.configuration, self.folder)

    def tried(self, jobs: Iterable[Job]) -> Generator[Done, None, list[Job]]:
        """Yield what became of jobs, and return those that ended their worker."""
        died = []
        for job, found in self.engine.each(_do, jobs, cancelled=self.cancelled):
            if isinstance(found, Died):
                died.append(job)
            elif isinstance(found, Exception):  # of the disk, or a bug
                yield Done.later(job.task, mishap_of(found, "the work on one damper").message)
            else:
                yield found
        return died

    def rescued(self, job: Job) -> Iterator[Done]:
        """Yield a job whose worker dies, done without the logs that end it."""
        died = yield from self.tried([self.without_what_kills(job)])
        for one in died:
            yield Done.later(
                one.task, "its workers die, though no single log is the cause; nothing was written"
            )

    def without_what_kills(self, job: Job) -> Job:
        """Return a job that leaves out the logs that end a worker by themselves."""
        alone = [replace(job, task=replace(job.task, logs=(log,))) for log in job.task.logs]
        for _ in range(2):
            found = self.engine.each(_try_log, alone, cancelled=self.cancelled)
            alone = [one for one, result in found if isinstance(result, Died)]
        # Where none does it alone something else ended the workers, as too little memory does.
        logs = [one.task.logs[0] for one in alone]
        return replace(job, dead=tuple((log.place, _DIED.format(log.file)) for log in sorted(logs)))


def run_fleet(
    configuration: Configuration,
    tasks: Sequence[DamperTask],
    folder: Path,
    engine: Executor,
    *,
    cancelled: Callable[[], bool] = lambda: False,
) -> Iterator[Done]:
    """Do the tasks of a fleet whose parts are not there, in any order, and yield each when done.

    A task whose worker dies is given to another one. Where that dies too, each of its logs is tried
    alone, those that end their worker are left out with a row that says so, and the others are
    fitted.

    Parameters
    ----------
    configuration : Configuration
        What is done with the logs.
    tasks : sequence of DamperTask
        From `planned`.
    folder : pathlib.Path
        Where the parts go.
    engine : Engine
        Who does the work.
    cancelled : callable
        Once it says True nothing more is begun.
    """
    tidy(folder)
    fleet = _Fleet(engine, configuration, folder, cancelled)
    waiting: list[Job] = []
    for task in tasks:
        if cancelled():
            return
        # Asked here, so that no worker is started where there is nothing to do.
        try:
            before = _known_already(fleet.job(task))
        except (OSError, ValueError) as error:
            yield Done.later(task, mishap_of(error, "looking for its part").message)
            continue
        if before:
            yield before
        else:
            waiting.append(fleet.job(task))
    for _ in range(2):
        waiting = yield from fleet.tried(waiting)
    for job in waiting:
        if not cancelled():
            yield from fleet.rescued(job)
    forget_earlier(folder)
